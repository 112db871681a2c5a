//! Pairs of realizations: which are compared, and which of two comes first.

use super::Order;
use super::keys::words;
use serde::Serialize;
use study_base::text::ModelId;

/// Which realizations are compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pairs {
    /// The pairs, no two alike.
    pub pairs: Vec<[ModelId; 2]>,
    /// How the order is made; never from a file.
    pub order: Order,
    /// Trials of each pair.
    pub repetitions: u32,
    /// Whether "no difference" is an answer.
    pub tie: bool,
    /// Which of a pair comes first.
    pub interval_order: IntervalOrder,
    /// Whether the pairs are the neighbors in a list, also in that of a group with some of the
    /// realizations. Since [`OrderVersion::Unguessable`](super::OrderVersion); before, such a
    /// group has those neighbors in the whole list that it has both.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub neighbors: bool,
}

impl Pairs {
    /// Leaves the pairs of some of the realizations.
    pub(super) fn keep(&mut self, models: &[ModelId]) {
        if self.neighbors {
            let first = self.pairs.first().map(|[first, _]| first.clone());
            let others = self.pairs.iter().map(|[_, second]| second.clone());
            let own: Vec<ModelId> = (first.into_iter().chain(others))
                .filter(|m| models.contains(m))
                .collect();
            self.pairs = neighbors(&own);
        } else {
            let pairs = &mut self.pairs;
            pairs.retain(|pair| pair.iter().all(|m| models.contains(m)));
        }
    }
}

/// Each realization of a list with each later one.
pub(super) fn every(models: &[ModelId]) -> Vec<[ModelId; 2]> {
    let from = |i: usize| models[i + 1..].iter().map(move |b| (i, b));
    let all = (0..models.len()).flat_map(from);
    all.map(|(i, b)| [models[i].clone(), b.clone()]).collect()
}

/// Each realization of a list with the next one.
pub(super) fn neighbors(models: &[ModelId]) -> Vec<[ModelId; 2]> {
    let two = |two: &[ModelId]| [two[0].clone(), two[1].clone()];
    models.windows(2).map(two).collect()
}

words! {
    /// Which realization of a pair comes first.
    IntervalOrder {
        /// Each in turn over the repetitions; the first time by row, so that two rows have both orders.
        Balanced = "balanced",
        /// Drawn for each trial.
        Random = "random",
    }
}
