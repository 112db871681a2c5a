//! Do the sites agree?

use super::{Estimate, Facts, Finding, Question, Test, TestKind};
use study_base::text::counted;

/// Level, pattern and effect of VAF by site; nothing in a study of one site.
pub(super) fn sites(facts: &Facts<'_>) -> Vec<Finding> {
    if facts.cells.ratings.sites.is_empty() {
        return Vec::new();
    }
    [
        Some(Question::SiteRealizations),
        has_vaf(facts).then_some(Question::SiteVaf),
        Some(Question::SiteLevel),
    ]
    .into_iter()
    .flatten()
    .map(|question| of(facts, question))
    .collect()
}

fn has_vaf(facts: &Facts<'_>) -> bool {
    let cells = facts.cells;
    cells.tested().into_iter().any(|m| cells.vaf[m].is_some())
}

fn of(facts: &Facts<'_>, question: Question) -> Finding {
    // p, the correction of both degrees of freedom, and the name of the difference.
    let (group, kind, p, epsilon, name) = match question {
        Question::SiteRealizations => (
            "site_realizations",
            TestKind::BetweenWithin,
            "p_gg",
            Some("eps_gg"),
            None,
        ),
        Question::SiteVaf => (
            "site_vaf",
            TestKind::BetweenSites,
            "p",
            None,
            Some("difference of slopes"),
        ),
        _ => (
            "site_level",
            TestKind::BetweenSites,
            "p",
            None,
            Some("difference"),
        ),
    };
    let get = |what: &str| facts.number(&format!("{group}/{what}"));
    let design = facts.design;
    let Some(value) = get(p) else {
        let why = facts.values.reason(&format!("{group}/{p}"));
        return Finding::undefined(question, why.unwrap_or("there is no test"), design);
    };
    let epsilon = match epsilon {
        Some(id) => get(id).unwrap_or(1.0),
        None => 1.0,
    };
    let df = ["df1", "df2"].map(|id| get(id).map(|df| df * epsilon));
    let test = Test::single(kind, value, facts.rules.alpha).with("F", get("F"), &df);
    let mut found = Finding::decided(question, test, design);
    found.participants = design.complete;
    found.effect = get("pes").and_then(|e| Estimate::of("partial eta squared", e));
    found.estimate = name.zip(get("difference")).map(|(name, value)| Estimate {
        name,
        value,
        ci95: (facts.values).interval(&format!("{group}/difference_ci95")),
    });
    if design.complete < design.participants {
        found.caveat(
            "complete-only",
            format!(
                "{} of {} rated every realization; the others are left out of the comparison of sites",
                design.complete,
                counted(design.participants, "participant", "participants")
            ),
        );
    }
    found
}
