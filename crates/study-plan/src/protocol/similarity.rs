//! Similarity: how different two realizations are.

use super::{IntervalOrder, Order, Pairs};
use serde::Serialize;
use study_base::text::ModelId;

/// What the trials of a part compare: every realization with every other one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Similarity {
    /// The realizations, or levels of a family.
    pub models: Vec<ModelId>,
    /// How the order of the pairs is made; never from a file.
    pub order: Order,
    /// Trials of each pair.
    pub repetitions: u32,
    /// Whether each realization is also compared with itself.
    pub identical: bool,
    /// Number of practice trials, with pairs that are drawn.
    pub practice: u32,
}

impl Similarity {
    /// The pairs of two different realizations.
    pub fn different(&self) -> Vec<[ModelId; 2]> {
        let from = |i: usize| self.models[i + 1..].iter().map(move |b| (i, b));
        let all = (0..self.models.len()).flat_map(from);
        all.map(|(i, b)| [self.models[i].clone(), b.clone()])
            .collect()
    }

    /// All pairs with their order: which of the two comes first is balanced over repetitions and rows.
    pub fn pairs(&self) -> Pairs {
        let with_itself = self.models.iter().map(|m| [m.clone(), m.clone()]);
        let identical = with_itself.filter(|_| self.identical);
        Pairs {
            pairs: self.different().into_iter().chain(identical).collect(),
            order: self.order.clone(),
            repetitions: self.repetitions,
            tie: false,
            interval_order: IntervalOrder::Balanced,
            neighbors: false,
        }
    }
}
