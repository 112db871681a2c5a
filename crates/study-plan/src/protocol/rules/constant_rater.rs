//! `constant-rater`

use super::{Declaration, Judgement, Trials};

pub(super) const RULE: Declaration = Declaration::new(
    "constant-rater",
    "Excludes participants with two or more primary ratings that are all equal.",
    &[],
);

pub(super) fn words() -> String {
    "participants whose ratings never change".to_owned()
}

pub(super) fn judge(trials: &Trials<'_>) -> Result<Judgement, &'static str> {
    trials.of_participants(|own| {
        let answers: Vec<_> = own.iter().filter_map(|trial| trial.answer).collect();
        answers.len() > 1 && answers.iter().all(|answer| *answer == answers[0])
    })
}
