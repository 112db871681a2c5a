//! `strokes-below`

use super::{Declaration, Judgement, Trials};
use crate::protocol::keys::{Kind, keys};

pub(super) const RULE: Declaration = Declaration::new(
    "strokes-below",
    "Excludes trials with too few full strokes. Trials whose strokes were not counted stay.",
    keys! {
        /// The least number of strokes.
        "strokes": Kind::ANY_NUMBER, "2", required;
    },
);

pub(super) fn words(strokes: f64) -> String {
    format!("trials with fewer than {strokes} full strokes")
}

#[expect(clippy::unnecessary_wraps, reason = "the signature of all rules")]
pub(super) fn judge(trials: &Trials<'_>, strokes: f64) -> Result<Judgement, &'static str> {
    let few = |counted: u32| f64::from(counted) < strokes;
    Ok(trials.one_by_one(
        |trial| trial.strokes.map(few),
        "the strokes of some trials are unknown; these trials stay",
    ))
}
