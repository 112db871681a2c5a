//! The wording of findings about parts that are no ratings.

use super::{USUAL, Wording, Words};
use crate::{apa, sentences};
use study_analysis::analyze::Pair;
use study_analysis::analyze::psychophysics::{PartAnalysis, PartFinding, PartQuestion};
use study_analysis::analyze::results::Number as _;
use study_base::text::counted;

/// What most questions about parts share.
const PART: Wording = Wording {
    shown: "{result} ({corrected}, {people})",
    answer: "{verdict}: {shown}.",
    paper: "{said}, {shown}.",
    ..USUAL
};

/// A finding in words.
pub(crate) fn of_part<'a>(part: &'a PartAnalysis, f: &'a PartFinding) -> Words<'a, PartQuestion> {
    Words {
        f,
        texts: texts(&f.question),
        own: Box::new(|key| value(part, f, key)),
    }
}

/// A question and the test that decides it, for a preregistration.
pub(crate) fn declared_of_part(part: &PartAnalysis, f: &PartFinding) -> Option<String> {
    of_part(part, f).fill(match (&f.test, &f.question) {
        (Some(_), PartQuestion::RankedFirst) => {
            "Part `{part}`: {ask} Decided by: {corrected}; level {level}. Where two never had another order, the sign test over participants takes its place."
        }
        (Some(_), _) => "Part `{part}`: {ask} Decided by: {corrected}; level {level}.",
        (None, _) => "Part `{part}`: {ask} No test: {why}.",
    })
}

/// The texts of a question.
fn texts(question: &PartQuestion) -> Wording {
    match question {
        PartQuestion::Preferred => Wording {
            ask: "Is a realization preferred to another?",
            yes: "Preferences differed between realizations",
            not_shown: "No difference of preference between realizations was shown",
            shown: "{clearest} ({corrected}, {people})",
            paper: "{said}: {shown}.",
            ..PART
        },
        PartQuestion::PreferenceVaf => Wording {
            ask: "Does VAF predict which is preferred?",
            yes: "Preference was correlated with VAF",
            not_shown: "No correlation of preference with VAF was shown",
            shown: "r = {r}, {result} ({corrected}, {realizations})",
            ..PART
        },
        PartQuestion::IntervalOrder => Wording {
            ask: "Does the order of the intervals matter?",
            yes: "The order of the intervals mattered",
            not_shown: "No effect of the order of the intervals was shown",
            shown: "{size} for what is presented first, {result} ({corrected})",
            ..PART
        },
        PartQuestion::ToldApart(_) => Wording {
            ask: "{of}: are standard and comparison told apart?",
            yes: "{of}: standard and comparison were told apart",
            not_shown: "{of}: it was not shown that standard and comparison are told apart",
            shown: "mean d′ {size}, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Thresholds => Wording {
            ask: "Do thresholds differ between the conditions?",
            yes: "Thresholds differed between conditions",
            not_shown: "No difference of thresholds between conditions was shown",
            ..PART
        },
        PartQuestion::Magnitudes => Wording {
            ask: "Do the estimates differ between realizations?",
            yes: "Estimates differed between realizations",
            not_shown: "No difference of estimates between realizations was shown",
            ..PART
        },
        PartQuestion::MagnitudeVaf => Wording {
            ask: "Does VAF predict the estimates?",
            yes: "Estimates (logarithms) were correlated with VAF",
            not_shown: "No correlation of estimates (logarithms) with VAF was shown",
            shown: "r = {r}, {result} ({corrected}, {realizations})",
            ..PART
        },
        PartQuestion::Identified => Wording {
            ask: "Is the right label given more often than by guessing?",
            yes: "The right label was given more often than by guessing",
            not_shown: "It was not shown that the right label is given more often than by guessing",
            shown: "{size} of the answers were correct, {guesses} by guessing, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Structure => Wording {
            ask: "Is there a structure that a map shows better than chance?",
            yes: "A map of the realizations had less stress than by chance",
            not_shown: "It was not shown that a map of the realizations has less stress than by chance",
            shown: "stress {size} in {tested}, {chance} by chance, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Dimensions => Wording {
            ask: "Does it take more than one dimension?",
            yes: "Two dimensions predicted the ratings of a participant better than one",
            not_shown: "It was not shown that two dimensions predict the ratings of a participant better than one",
            shown: "difference of the correlations {size}, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::MapFollows(_) => Wording {
            ask: "Does the map follow {of}?",
            yes: "The map followed {of}",
            not_shown: "It was not shown that the map follows {of}",
            shown: "Procrustes correlation {size}, {result} ({corrected}, {realizations})",
            ..PART
        },
        PartQuestion::RankedAlike => Wording {
            ask: "Do participants rank the realizations alike?",
            yes: "Participants ranked the realizations alike",
            not_shown: "It was not shown that participants rank the realizations alike",
            shown: "Kendall's W = {size}, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::RankedFirst => Wording {
            ask: "Is one realization ranked above each other one?",
            yes: "{first} was ranked above each other realization",
            not_shown: "It was not shown that one realization is ranked above each other one",
            shown: "{first} over {second} by {margin}, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Adjusted => Wording {
            ask: "Do settings differ from the standard?",
            yes: "Settings differed from the standard",
            not_shown: "It was not shown that settings differ from the standard",
            shown: "difference {size}, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Starts => Wording {
            ask: "Do settings depend on the side from which they start?",
            yes: "Settings depended on the side from which they started",
            not_shown: "It was not shown that settings depend on the side from which they start",
            shown: "from below less from above {size}, {result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Groups => Wording {
            ask: "Do the groups differ?",
            yes: "The groups differed",
            not_shown: "No difference between the groups was shown",
            shown: "{estimate}{result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::GroupsConditions => Wording {
            ask: "Does what distinguishes the conditions depend on the group?",
            yes: "The differences between the conditions depended on the group",
            not_shown: "No interaction of group and condition was shown",
            shown: "{estimate}{result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::Sessions => Wording {
            ask: "Do the sessions differ?",
            yes: "The sessions differed",
            not_shown: "No difference between the sessions was shown",
            shown: "{estimate}{result} ({corrected}, {people})",
            ..PART
        },
        PartQuestion::GroupsSessions => Wording {
            ask: "Do the changes from session to session depend on the group?",
            yes: "The changes from session to session depended on the group",
            not_shown: "No interaction of group and session was shown",
            shown: "{estimate}{result} ({corrected}, {people})",
            ..PART
        },
    }
}

/// A value in the texts of parts.
fn value(part: &PartAnalysis, f: &PartFinding, key: &str) -> Option<String> {
    Some(match key {
        "part" => part.part.to_string(),
        "of" => match &f.question {
            PartQuestion::ToldApart(condition) => condition.clone(),
            PartQuestion::MapFollows(properties) => of_properties(properties),
            _ => return None,
        },
        "tested" => {
            let found = part.results.over.similarity.as_ref();
            let dimensions = found.and_then(|own| own.structure.dimensions.number());
            let n = dimensions.map_or(2, |d| d as usize);
            counted(n, "dimension", "dimensions")
        }
        "chance" => {
            let found = part.results.over.similarity.as_ref();
            let chance = found.and_then(|own| own.structure.by_chance.number());
            chance.map_or_else(String::new, apa::two)
        }
        "guesses" => {
            let found = part.results.over.identification.as_ref();
            found
                .and_then(|own| own.by_guessing.number())
                .map_or_else(String::new, apa::two)
        }
        "margin" => {
            let found = part.results.over.ranking.as_ref();
            let bound = found.and_then(|own| own.best.ci95.lo.number());
            match (&f.estimate, bound) {
                (None, Some(bound)) => format!(
                    "at least {} (95 %) on the logarithm of the worth, in every ranking",
                    apa::two(bound)
                ),
                (estimate, _) => {
                    let size = estimate.as_ref().map(|e| sentences::estimate(e, apa::two));
                    let size = size.unwrap_or_default();
                    format!("{size} on the logarithm of the worth")
                }
            }
        }
        "clearest" => match clearest(part) {
            Some(pair) => format!(
                "{} over {} by {}, {}",
                pair.first,
                pair.second,
                sentences::estimate(&pair.difference, apa::two),
                // The statistic of the pair has the sign of the difference that is printed.
                match pair.test.as_ref().or(f.test.as_ref()) {
                    Some(test) => sentences::tested(test, f.participants),
                    None => String::new(),
                }
            ),
            None => sentences::result(f).unwrap_or_default(),
        },
        "estimate" => f.estimate.as_ref().map_or_else(String::new, |e| {
            format!("{} {}, ", e.name, sentences::estimate(e, apa::two))
        }),
        _ => return None,
    })
}

/// Properties of the realizations, as a noun.
fn of_properties(name: &str) -> String {
    match name {
        "level" => "the level".to_owned(),
        "covariates" => "the covariates".to_owned(),
        other => other.to_owned(),
    }
}

/// The pair with the smallest p, the higher one first.
fn clearest(part: &PartAnalysis) -> Option<Pair> {
    let p = |pair: &&Pair| pair.test.as_ref().map_or(f64::INFINITY, |t| t.p);
    let pair = part.pairs.iter().min_by(|a, b| p(a).total_cmp(&p(b)))?;
    Some(upwards(pair))
}

/// A pair seen from the one with the higher value. Ratios stay as they are.
pub(crate) fn upwards(pair: &Pair) -> Pair {
    match pair.difference.value < 0.0 {
        true => pair.seen_from(&pair.second),
        false => pair.clone(),
    }
}
