//! `unverified-force`

use super::{Declaration, Force, Judgement, Trials};

pub(super) const RULE: Declaration = Declaration::new(
    "unverified-force",
    "Excludes trials in which the force was not shown to be that of the table (`rendering` is not `ok`).",
    &[],
);

pub(super) fn words() -> String {
    "trials in which the force was not shown to be that of the realization's table".to_owned()
}

pub(super) fn judge(trials: &Trials<'_>) -> Result<Judgement, &'static str> {
    Ok(trials.by_force(|force| force != Force::Right))
}
