//! `hidden-reference-below`

use super::trials::mean_of_set;
use super::{Declaration, Judgement, Trial, Trials};
use crate::protocol::keys::{Kind, keys};
use crate::protocol::{Protocol, Role};
use study_stats::describe::rounded;

pub(super) const RULE: Declaration = Declaration::new(
    "hidden-reference-below",
    "Excludes participants whose mean primary rating of the hidden references is too low.",
    keys! {
        /// The least mean rating.
        "rating": Kind::ANY_NUMBER, "5", required;
    },
)
.needs(
    has_reference,
    "no realization has the role \"hidden-reference\"",
);

fn has_reference(protocol: &Protocol) -> bool {
    (protocol.models.iter()).any(|model| model.role == Role::HiddenReference)
}

pub(super) fn words(rating: f64) -> String {
    format!("participants whose mean rating of the hidden references is below {rating}")
}

pub(super) fn judge(trials: &Trials<'_>, rating: f64) -> Result<Judgement, &'static str> {
    trials.need_points()?;
    if !trials.realizations.iter().any(|r| r.hidden_reference) {
        return Err(match trials.of_a_part {
            true => "the part has no hidden reference",
            false => "the design has no hidden reference",
        });
    }
    let of_reference = |trial: &&&Trial<'_>| {
        (trial.realization).is_some_and(|r| trials.realizations[r].hidden_reference)
    };
    // Means that differ by rounding errors only are equal.
    let least = rounded(rating);
    trials.of_participants(|own| {
        let numbers = own.iter().filter(of_reference).filter_map(|t| t.number());
        mean_of_set(numbers).is_some_and(|mean| rounded(mean) < least)
    })
}
