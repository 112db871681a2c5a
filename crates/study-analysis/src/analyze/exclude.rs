//! Applies the preregistered exclusion rules, `[[analysis.exclude]]`, to ratings and to the
//! trials of parts.
//!
//! Every rule judges the same rows: those that count before any rule is applied.
//! The order of the rules therefore decides only which rule is reported for a row
//! that several exclude: the first. `study_plan::protocol::rules` has the rules themselves.

use std::collections::BTreeSet;
use study_plan::protocol::rules::{Answers, Force, Given, Realization, Trial, Trials};
use study_plan::protocol::{Exclusion, Role};
use study_session::outcome::Verdict;
use study_session::outcome::ratings::Ratings;

/// The effect of a rule.
#[derive(Debug, Clone, PartialEq)]
pub struct Applied {
    /// The rule.
    pub rule: Exclusion,
    /// Rows that it excluded.
    pub rows: usize,
    /// Participants with such a row.
    pub participants: usize,
    /// Why it could judge no rows, or not all.
    pub problem: Option<&'static str>,
}

/// Applies the rules to trials. Returns the index of the first rule that excludes each, and
/// the effect of each rule.
pub(super) fn apply(
    rules: &[Exclusion],
    trials: &Trials<'_>,
) -> (Vec<Option<usize>>, Vec<Applied>) {
    let judged: Vec<_> = rules.iter().map(|rule| rule.judge(trials)).collect();
    let excluded_by: Vec<Option<usize>> = (0..trials.trials.len())
        .map(|i| (judged.iter()).position(|rule| rule.as_ref().is_ok_and(|j| j.excluded[i])))
        .collect();
    let applied = (rules.iter().zip(&judged).enumerate())
        .map(|(k, (rule, judged))| {
            let gone = (excluded_by.iter().zip(&trials.trials)).filter(|(by, _)| **by == Some(k));
            let participants: BTreeSet<usize> =
                gone.clone().map(|(_, trial)| trial.participant).collect();
            Applied {
                rule: *rule,
                rows: gone.count(),
                participants: participants.len(),
                problem: judged.as_ref().map_or_else(|why| Some(*why), |j| j.problem),
            }
        })
        .collect();
    (excluded_by, applied)
}

/// What the rules see of rows of ratings. `primary`: they answer the primary question.
pub(super) fn trials(
    ratings: &Ratings,
    rows: impl IntoIterator<Item = usize>,
    primary: bool,
) -> Trials<'static> {
    let mut realizations: Vec<Realization> = (ratings.models.iter())
        .map(|model| Realization {
            hidden_reference: model.role == Role::HiddenReference,
            duplicate_of: None,
        })
        .collect();
    for (duplicate, original) in pairs(ratings) {
        realizations[duplicate].duplicate_of = Some(original);
    }
    let trial = |i: usize| Trial {
        participant: ratings.subject[i] as usize,
        realization: ratings.model[i].map(|m| m as usize),
        answer: ratings.rating[i].map(Given::Number),
        strokes: ratings.strokes[i],
        force: ratings.felt(i).map(|felt| force(felt.verdict)),
    };
    Trials {
        answers: match primary {
            true => Answers::Points,
            false => Answers::Secondary,
        },
        of_a_part: false,
        participants: ratings.subjects.len(),
        realizations,
        trials: rows.into_iter().map(trial).collect(),
    }
}

/// What a verdict says of the force.
pub(super) fn force(verdict: Verdict) -> Force {
    match verdict {
        Verdict::Ok => Force::Right,
        Verdict::Flag | Verdict::Fault => Force::Wrong,
        Verdict::Unverified | Verdict::TooLittle => Force::Unverified,
    }
}

/// Indices of each hidden duplicate and its original.
pub(super) fn pairs(ratings: &Ratings) -> Vec<(usize, usize)> {
    let models = &ratings.models;
    (models.iter().enumerate())
        .filter_map(|(d, model)| {
            let original = model.duplicate_of.as_ref()?;
            let o = models.binary_search_by(|m| m.id.cmp(original)).ok()?;
            Some((d, o))
        })
        .collect()
}
