//! The ratings of each participant, by pair and order.

use super::SimilarityRow;
use std::collections::{BTreeMap, BTreeSet};
use study_stats::describe::mean;
use study_stats::similarity::Dissimilarities;

/// The ratings of a participant, by the places of the two realizations.
#[derive(Debug, Default)]
pub(super) struct Own {
    /// By the one that was felt first.
    ordered: BTreeMap<(usize, usize), Vec<f64>>,
    pub(super) identical: BTreeMap<usize, Vec<f64>>,
}

impl Own {
    /// The ratings of a pair in an order.
    pub(super) fn of(&self, first: usize, second: usize) -> &[f64] {
        self.ordered
            .get(&(first, second))
            .map_or(&[], Vec::as_slice)
    }

    /// All ratings of pairs of different realizations.
    pub(super) fn different(&self) -> Vec<f64> {
        self.ordered.values().flatten().copied().collect()
    }

    /// The mean dissimilarity of a pair: that of both orders, if both were rated.
    pub(super) fn pair(&self, a: usize, b: usize) -> Option<f64> {
        match (mean(self.of(a, b)), mean(self.of(b, a))) {
            (Some(one), Some(other)) => Some(0.5 * (one + other)),
            (one, other) => one.or(other),
        }
    }

    pub(super) fn dissimilarities(&self, realizations: usize) -> Dissimilarities {
        Dissimilarities::from_fn(realizations, |a, b| self.pair(a, b))
    }

    /// The mean of the pairs of different realizations.
    pub(super) fn mean(&self) -> Option<f64> {
        let pairs: BTreeSet<(usize, usize)> = (self.ordered.keys())
            .map(|&(a, b)| (a.min(b), a.max(b)))
            .collect();
        let pairs: Vec<f64> = pairs
            .into_iter()
            .filter_map(|(a, b)| self.pair(a, b))
            .collect();
        mean(&pairs)
    }
}

/// The ratings of each participant.
pub(super) fn people<'a>(rows: &'a [SimilarityRow], names: &[&str]) -> BTreeMap<&'a str, Own> {
    let mut people: BTreeMap<&str, Own> = BTreeMap::new();
    let place = |name: &String| names.binary_search(&name.as_str()).ok();
    for row in rows {
        let (Some(first), Some(second)) = (place(&row.first), place(&row.second)) else {
            continue;
        };
        let own = people.entry(&row.participant).or_default();
        let ratings = match first == second {
            true => own.identical.entry(first).or_default(),
            false => own.ordered.entry((first, second)).or_default(),
        };
        ratings.push(row.rating);
    }
    people
}
