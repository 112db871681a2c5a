//! Pairs of realizations: the two best-rated, and all that differ.

use super::{Answer, posterior};
use crate::{apa, sentences};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, MAX_PAIRED, Question, Test};

/// Pairs that are listed.
const MAX_LISTED: usize = 10;

/// Whether the best-rated realization differs from the second best.
pub(super) fn best_two(a: &Analysis) -> Option<Answer> {
    let (mut answer, f) = Answer::to(a, &Question::Best)?;
    if let (Some(e), [first, second], true) = (f.estimate, &f.names[..], f.test.is_some()) {
        let dz = f.effect.map_or_else(String::new, |dz| {
            format!(" (Cohen's dz = {})", apa::two(dz.value))
        });
        answer.main.push(format!(
            "{first} minus {second}: {}{dz}.",
            sentences::estimate(&e, apa::two)
        ));
    }
    answer.main.extend(posterior::best(a));
    answer.main.extend(posterior::missing(a));
    Some(answer)
}

/// Which pairs differ.
pub(super) fn which(a: &Analysis) -> Option<Answer> {
    let (mut answer, _) = Answer::to(a, &Question::Pairs)?;
    let different = a.different_pairs();
    let listed = different.iter().take(MAX_LISTED);
    answer
        .main
        .extend(listed.map(|p| format!("{}.", sentences::different_pair(p))));
    if different.len() > MAX_LISTED {
        let more = different.len() - MAX_LISTED;
        answer
            .main
            .push(format!("{more} more are in the table of pairs."));
    }
    answer.main.extend(equivalent(a));
    if let Some(dz) = a.results.sensitivity.difference.number() {
        answer.more.push(format!(
            "A single difference of {} standard deviations (of the differences) is found with a power \
             of 80 % in this design; of a pair among several it has to be larger.",
            apa::two(dz)
        ));
    }
    if a.design.realizations > MAX_PAIRED && !a.pairs.is_empty() {
        answer.more.push(format!(
            "Above {MAX_PAIRED} realizations only the one with the {} {} is compared with each \
             other one; the correction counts all pairs.",
            a.better.most(),
            sentences::mean(a)
        ));
    }
    Some(answer)
}

/// The pairs that are equivalent within the preregistered margin.
fn equivalent(a: &Analysis) -> Option<String> {
    let test = a.pairs.iter().find_map(|p| p.equivalence.as_ref())?;
    let margin = a.equivalence_margin?;
    let pairs: Vec<String> = (a.pairs.iter())
        .filter(|p| p.equivalence.as_ref().is_some_and(Test::is_significant))
        .map(|p| format!("{} and {}", p.first, p.second))
        .take(MAX_LISTED)
        .collect();
    let which = match &pairs[..] {
        [] => "no pair".to_owned(),
        pairs => pairs.join("; "),
    };
    Some(format!(
        "Equivalence within {margin} points is shown for {which} ({}).",
        sentences::corrected(test)
    ))
}
