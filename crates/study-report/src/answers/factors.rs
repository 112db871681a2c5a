//! Do the factors matter, and does the effect of one depend on another?

use super::Answer;
use crate::{apa, sentences};
use study_analysis::analyze::results::{ContrastName, LevelsName, Number as _};
use study_analysis::analyze::{Analysis, PreregisteredRule, Question};
use study_plan::protocol::Crossing;

/// Differences that are listed.
const MAX_LISTED: usize = 12;

/// An answer for each effect that is tested.
pub(super) fn factors(a: &Analysis) -> Vec<Answer> {
    let Some(crossing) = &a.crossing else {
        return Vec::new();
    };
    let answer = |effect: &Vec<usize>| {
        let question = Question::Effect(crossing.effect_name(effect));
        let (mut answer, finding) = Answer::to(a, &question)?;
        match effect[..] {
            [factor] => {
                answer.main.extend(means(a, crossing, factor));
                // Without a test of differences there is none of equivalence, for the same reason.
                let told = equivalent(a, crossing, factor).filter(|_| finding.reason().is_none());
                answer.main.extend(told);
            }
            [first, second] if finding.is_yes() => {
                answer
                    .main
                    .extend(simple_effects(a, crossing, first, second));
                answer
                    .more
                    .extend(simple_effects(a, crossing, second, first));
            }
            _ => {}
        }
        Some(answer)
    };
    crossing.effects.iter().filter_map(answer).collect()
}

/// The means of the levels of a factor.
fn means(a: &Analysis, crossing: &Crossing, factor: usize) -> Option<String> {
    let tests = a.results.evidence.factorial.as_ref()?;
    let name = crossing.name(factor);
    let means: Vec<String> = (crossing.levels(factor).iter())
        .filter_map(|level| {
            let at = LevelsName(vec![(name.to_owned(), level.clone())]);
            let found = tests.means.get(&at)?;
            let ci = sentences::ci(found.ci95.as_ref(), apa::two);
            Some(format!("{level} {}{ci}", apa::two(found.mean.number()?)))
        })
        .collect();
    (!means.is_empty()).then(|| format!("Means over participants: {}.", means.join("; ")))
}

/// Which levels of a factor differ by less than the margin that was stated in advance.
fn equivalent(a: &Analysis, crossing: &Crossing, factor: usize) -> Option<String> {
    let tests = a.results.evidence.factorial.as_ref()?;
    let margin = a.equivalence_margin?;
    let levels = crossing.levels(factor);
    let (mut shown, mut not_shown) = (Vec::new(), Vec::new());
    for (i, first) in levels.iter().enumerate() {
        for second in &levels[i + 1..] {
            let name = ContrastName {
                factor: crossing.name(factor).to_owned(),
                levels: [first.clone(), second.clone()],
                at: LevelsName::default(),
            };
            let found = tests.contrasts.get(&name)?.equivalence.as_ref()?;
            let p = apa::p_beside(found.p_tost_holm.number()?, a.alpha);
            let ci = apa::interval(found.ci90.ends()?, apa::two);
            let told = format!("{first} and {second} (90 % CI {ci}, p {p})");
            match found.equivalent.is_set() {
                true => shown.push(told),
                false => not_shown.push(told),
            }
        }
    }
    let later = match a.changed(PreregisteredRule::Margin) {
        true => " (changed after the study began)",
        false => "",
    };
    let begin = format!("Equivalence within ± {margin} points{later}");
    let end = "two one-sided t tests, Holm's correction over the pairs of levels";
    let told = match (shown.is_empty(), not_shown.is_empty()) {
        (true, true) => return None,
        (true, false) => format!("{begin} is not shown for {}", listed(not_shown)),
        (false, true) => format!("{begin} is shown for {}", listed(shown)),
        (false, false) => format!(
            "{begin} is shown for {}, not for {}",
            listed(shown),
            listed(not_shown)
        ),
    };
    Some(format!("{told}; {end}."))
}

/// As many as are listed.
fn listed(mut told: Vec<String>) -> String {
    let more = match told.len().saturating_sub(MAX_LISTED) {
        0 => String::new(),
        n => format!("; and {n} more in the table"),
    };
    told.truncate(MAX_LISTED);
    told.join("; ") + &more
}

/// The differences between the levels of a factor at each level of another.
fn simple_effects(
    a: &Analysis,
    crossing: &Crossing,
    factor: usize,
    other: usize,
) -> Option<String> {
    let tests = a.results.evidence.factorial.as_ref()?;
    let levels = crossing.levels(factor);
    let mut told = Vec::new();
    for at in crossing.levels(other) {
        for (i, first) in levels.iter().enumerate() {
            for second in &levels[i + 1..] {
                let name = ContrastName {
                    factor: crossing.name(factor).to_owned(),
                    levels: [first.clone(), second.clone()],
                    at: LevelsName(vec![(crossing.name(other).to_owned(), at.clone())]),
                };
                let found = tests.contrasts.get(&name)?;
                let size = apa::two(found.difference.number()?);
                let ci = sentences::ci(&found.difference_ci95, apa::two);
                let p = found.p_holm.number();
                let p = p.map_or_else(String::new, |p| {
                    format!(", p {}", apa::p_beside(p, a.alpha))
                });
                told.push(format!("at {at}, {first} − {second} = {size}{ci}{p}"));
            }
        }
    }
    (!told.is_empty()).then(|| {
        format!(
            "Simple effects of {} (t tests over participants, Holm's correction): {}.",
            crossing.name(factor),
            listed(told)
        )
    })
}
