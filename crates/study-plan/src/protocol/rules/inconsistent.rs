//! `inconsistent`

use super::trials::mean_of_set;
use super::{Declaration, Judgement, Trial, Trials};
use crate::protocol::Protocol;
use crate::protocol::keys::{Kind, keys};
use std::collections::BTreeMap;
use study_stats::describe::rounded;

pub(super) const RULE: Declaration = Declaration::new(
    "inconsistent",
    "Excludes participants who rate a realization and its hidden duplicate too differently.",
    keys! {
        /// The largest mean distance between the two, in points of the primary scale.
        "difference": Kind::ANY_NUMBER, "1.5", required;
    },
)
.needs(has_duplicate, "no realization has a `duplicate_of`");

fn has_duplicate(protocol: &Protocol) -> bool {
    (protocol.models.iter()).any(|model| model.duplicate_of.is_some())
}

pub(super) fn words(difference: f64) -> String {
    format!(
        "participants whose mean ratings of a realization and its hidden duplicate differ by more \
         than {difference} on average"
    )
}

pub(super) fn judge(trials: &Trials<'_>, difference: f64) -> Result<Judgement, &'static str> {
    trials.need_points()?;
    let pairs = trials.duplicates();
    if pairs.is_empty() {
        return Err(match trials.of_a_part {
            true => "the part has no hidden duplicate",
            false => "the design has no hidden duplicate",
        });
    }
    let most = rounded(difference);
    trials.of_participants(|own| distance(own, &pairs).is_some_and(|distance| distance > most))
}

impl Trials<'_> {
    /// Each hidden duplicate with its original.
    fn duplicates(&self) -> Vec<(usize, usize)> {
        (self.realizations.iter().enumerate())
            .filter_map(|(duplicate, r)| Some((duplicate, r.duplicate_of?)))
            .collect()
    }

    /// The mean distance between realizations and their hidden duplicates, of each
    /// participant who rated such a pair.
    pub fn repeat_distances(&self) -> Vec<Option<f64>> {
        let pairs = self.duplicates();
        (self.by_participant())
            .map(|own| distance(&own, &pairs))
            .collect()
    }
}

/// The mean distance of one participant between the mean ratings of each pair. Distances
/// that differ by rounding errors only are equal.
fn distance(own: &[&Trial<'_>], pairs: &[(usize, usize)]) -> Option<f64> {
    let mut cells: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for trial in own {
        if let (Some(realization), Some(number)) = (trial.realization, trial.number()) {
            cells.entry(realization).or_default().push(number);
        }
    }
    let mean = |realization| mean_of_set(cells.get(realization)?.iter().copied());
    let distances = (pairs.iter())
        .filter_map(|(duplicate, original)| Some((mean(duplicate)? - mean(original)?).abs()));
    mean_of_set(distances).map(rounded)
}
