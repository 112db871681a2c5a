//! Pairs of realizations: the two best-rated, and all that differ.

use super::Answer;
use crate::{apa, sentences};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, MAX_PAIRED, Question, Test};
use study_base::text::counted;

/// Pairs that are listed.
const MAX_LISTED: usize = 10;

/// Whether the best-rated realization differs from the second best.
pub(super) fn best_two(a: &Analysis) -> Option<Answer> {
    let f = a.finding(&Question::Best)?;
    let ranked = a.ranked();
    let mean = |name: &str| {
        let found = ranked.iter().find(|r| r.1 == name);
        found.map_or_else(String::new, |r| apa::two(r.0))
    };
    let (most, what) = (a.better.most(), sentences::mean(a));
    let both = match &f.names[..] {
        [first, second] => format!(
            "{first} ({what} {}) and {second} ({what} {})",
            mean(first),
            mean(second)
        ),
        _ => String::new(),
    };
    let question = "Does the best-rated realization differ from the second best?";
    let mut answer = Answer::of(question, f, |verdict| {
        let Some(test) = &f.test else {
            let (all, mean) = (apa::listing(&f.names), mean(&f.names[0]));
            return format!("{verdict}: {all} share the {most} {what}, {mean}.");
        };
        let alone = match a.design.realizations {
            2 => "",
            _ => ", these two only, not corrected",
        };
        format!(
            "{verdict}: {both}, {} ({}{alone}).",
            sentences::tested(test, f.participants),
            sentences::corrected(test)
        )
    });
    if let Some(why) = f.reason() {
        answer.short = format!("Cannot be determined: {both}; {why}.");
    }
    if let (Some(e), [first, second], true) = (f.estimate, &f.names[..], f.test.is_some()) {
        let dz = f.effect.map_or_else(String::new, |dz| {
            format!(" (Cohen's dz = {})", apa::two(dz.value))
        });
        answer.main.push(format!(
            "{first} minus {second}: {}{dz}.",
            sentences::estimate(&e, apa::two)
        ));
    }
    Some(answer)
}

/// Which pairs differ.
pub(super) fn which(a: &Analysis) -> Option<Answer> {
    let f = a.finding(&Question::Pairs)?;
    let different = a.different_pairs();
    let all = match a.design.realizations {
        k if k <= MAX_PAIRED => counted(a.pairs.len(), "pair", "pairs"),
        _ => format!(
            "{} with the {} {}",
            counted(a.pairs.len(), "pair", "pairs"),
            a.better.most(),
            sentences::mean(a)
        ),
    };
    let mut answer = Answer::of("Which pairs of realizations differ?", f, |verdict| {
        let test = f.test.as_ref();
        let how = test.map_or_else(String::new, sentences::corrected);
        let p = test.map_or_else(String::new, sentences::p);
        match different.len() {
            0 => format!("{verdict} for any of {all}, smallest {p} ({how})."),
            n => format!("{verdict}: {n} of {all} ({how})."),
        }
    });
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
