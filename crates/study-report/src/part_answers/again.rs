//! What is said of groups and repeated sessions.

use super::ci;
use crate::apa;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::{Interval, Number as _, Stat};

/// By how much more one group changes than another, from the first session to the last.
pub(super) fn changes(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.again.groups_sessions.as_ref()?;
    let told: Vec<String> = (found.changes.iter())
        .filter_map(|(pair, contrast)| {
            let (name, estimate) = contrast.estimate();
            let [first, second] = pair.names();
            let p = apa::p_beside(contrast.p_holm.number()?, part.alpha);
            Some(format!(
                "{first} and {second}, {name} {}{}, p {p}",
                apa::plain(estimate?),
                ci(contrast.ci95.ends(), apa::plain)
            ))
        })
        .collect();
    (!told.is_empty()).then(|| {
        format!(
            "Change from the first session to the last, of the first group compared with that of the second (t tests, Holm's \
             correction): {}.",
            told.join("; ")
        )
    })
}

/// How alike the sessions are.
pub(super) fn retest(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.again.retest.as_ref()?;
    let icc = |value: &Stat, ci95: &Interval| {
        let ci = ci(ci95.ends(), apa::two);
        Some(format!("{}{ci}", apa::two(value.number()?)))
    };
    Some(format!(
        "Test–retest reliability over {} participants: ICC(A,1) = {} (agreement), ICC(C,1) = {} \
         (consistency).",
        found.n.number()?,
        icc(&found.icc_agreement, &found.icc_agreement_ci95)?,
        icc(&found.icc_consistency, &found.icc_consistency_ci95)?
    ))
}
