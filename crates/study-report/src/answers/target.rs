//! Whether the realizations feel like the target: the best mean, its share of realistic
//! ratings, references and hidden duplicates.

use super::Answer;
use crate::{apa, sentences, wording};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, Better, PreregisteredRule, Question};
use study_base::text::capital;
use study_session::outcome::Role;

/// Realizations whose shares are listed.
const MAX_SHARES: usize = 12;

/// The best-rated realization, and how it compares with the target.
pub(super) fn target(a: &Analysis) -> Option<Answer> {
    let ranked = a.ranked();
    let (mean, best) = *ranked.first()?;
    let equals = ranked.iter().filter(|r| (r.0 - mean).abs() < 1e-10).count();
    let what = sentences::mean(a);
    let most = a.better.most();
    let subject = match (ranked.len(), equals) {
        (1, _) => format!("The only realization is {best}"),
        (_, 1) => format!("The best-rated realization is {best}"),
        _ => format!(
            "{} realizations share the {most} {what}; one of them is {best}",
            capital(&apa::count(equals))
        ),
    };
    let scale = a.scale.map_or_else(String::new, |(from, to)| {
        format!(" on a scale from {from} to {to}")
    });
    let ci = if a.design.is_complete() {
        a.described(best).map(|d| &d.subject_mean.ci95)
    } else {
        a.adjusted(best).map(|m| &m.ci95)
    };
    let ci = sentences::ci(ci, apa::two);
    let realistic = realistic(a, best).map_or_else(String::new, |r| format!("; {r}"));
    let question = if sentences::is_about_realism(a) {
        "Do the realizations feel like the target?".to_owned()
    } else {
        match &a.construct {
            Some(construct) => format!("Which realization is rated {most} in {construct}?"),
            None => format!("Which realization is rated {most}?"),
        }
    };
    let lower = match a.better {
        Better::Higher => "",
        Better::Lower => ", of which lower ratings are better",
    };
    let short = format!(
        "{subject}, {what} {}{ci}{scale}{lower}{realistic}.",
        apa::two(mean)
    );
    let mut answer = Answer::new(&question, short);
    answer.main = against_references(a);
    answer.more.extend(shares(a, &ranked));
    let roles = [
        Role::HiddenReference,
        Role::Physical,
        Role::LowAnchor,
        Role::MidAnchor,
    ];
    for role in roles {
        for m in a.realizations.iter().filter(|m| m.role == role) {
            if let Some(mean) = a.described(&m.id).map(|d| &d.mean).number() {
                let (mean, name) = (apa::two(mean), wording::role(role));
                (answer.more).push(format!("Mean rating of the {name} {}: {mean}.", m.id));
            }
        }
    }
    Some(answer)
}

/// The share of realistic ratings of a realization with its interval: `60 %, 95 % CI [41 %,
/// 77 %]`.
pub(super) fn share(a: &Analysis, name: &str) -> Option<String> {
    let found = a.realistic(name)?;
    let share = apa::percent(found.share.number()?);
    Some(format!(
        "{share}{}",
        sentences::ci(&found.ci95, apa::percent)
    ))
}

fn realistic(a: &Analysis, best: &str) -> Option<String> {
    let changed = a.changed(PreregisteredRule::RealisticFrom);
    let found = (a.realistic(best)).and_then(|found| Some((found, found.share.number()?)));
    match a.realistic_from.zip(found) {
        Some((from, (found, part))) => {
            let later = if changed {
                ", a threshold changed after the study began"
            } else {
                ""
            };
            let ci = sentences::ci(&found.ci95, apa::percent);
            let part = apa::percent(part);
            Some(format!(
                "{part} of its ratings are {from} or higher{later}{ci}"
            ))
        }
        None if changed => Some(
            "the threshold for “realistic” was changed after the study began: see Deviations"
                .to_owned(),
        ),
        None if sentences::is_about_realism(a) => {
            Some("no threshold for “realistic” was set in advance".to_owned())
        }
        None => None,
    }
}

fn shares(a: &Analysis, ranked: &[(f64, &str)]) -> Option<String> {
    let from = a.realistic_from?;
    let all = ranked.iter().take(MAX_SHARES);
    let all: Vec<String> = all
        .filter_map(|(_, id)| Some(format!("{id} {}", share(a, id)?)))
        .collect();
    (all.len() > 1).then(|| format!("Share of ratings of {from} or higher: {}.", all.join("; ")))
}

/// The best realization against each reference and anchor.
fn against_references(a: &Analysis) -> Vec<String> {
    let mut found = Vec::new();
    for f in &a.findings {
        let Question::Reference(reference) = &f.question else {
            continue;
        };
        let role = a
            .realizations
            .iter()
            .find(|m| m.id == *reference)
            .map(|m| m.role);
        let (Some(best), Some(role)) = (f.names.first(), role) else {
            continue;
        };
        let equivalence = match role {
            Role::LowAnchor | Role::MidAnchor => None,
            _ => equivalence(a, best, reference),
        };
        let equivalence = equivalence.map_or_else(String::new, |e| format!(" {e}"));
        let difference = wording::of_ratings(a, f).answer().unwrap_or_default();
        found.push(format!("{difference}{equivalence}"));
    }
    found
}

fn equivalence(a: &Analysis, best: &str, reference: &str) -> Option<String> {
    let contrast = a.against(reference, best)?;
    let f = a.finding(&Question::Equivalence(reference.to_owned()));
    let Some(f) = f.filter(|f| f.test.is_some()) else {
        return sentences::no_equivalence(a, contrast);
    };
    wording::of_ratings(a, f).answer()
}

/// Whether hidden duplicates are rated like their originals.
pub(super) fn repeats(a: &Analysis) -> Option<Answer> {
    let all = (a.findings.iter()).filter(|f| matches!(f.question, Question::Repeat(_)));
    let mut all = all.map(|f| wording::of_ratings(a, f));
    let first = all.next()?;
    let mut answer = Answer::new(&first.ask(), first.answer()?);
    answer.main.extend(all.filter_map(|words| words.answer()));
    Some(answer)
}
