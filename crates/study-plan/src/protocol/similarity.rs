//! Similarity: how different two realizations are.

use super::{IntervalOrder, Order, Pairs};
use serde::Serialize;
use std::collections::BTreeSet;
use study_base::text::ModelId;

/// What the trials of a part compare.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Similarity {
    /// The realizations, or levels of a family.
    pub models: Vec<ModelId>,
    /// The pairs of two different ones that are rated, no two alike: all of them, or some that connect all realizations.
    pub different: Vec<[ModelId; 2]>,
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
    /// Leaves the pairs of some of the realizations.
    pub(super) fn keep(&mut self, stays: impl Fn(&ModelId) -> bool) {
        self.models.retain(&stays);
        self.different.retain(|pair| pair.iter().all(&stays));
    }

    /// Number of pairs of two different realizations that could be rated.
    pub fn possible(&self) -> usize {
        let n = self.models.len();
        n * n.saturating_sub(1) / 2
    }

    /// All pairs with their order: which of the two comes first is balanced over repetitions and rows.
    pub fn pairs(&self) -> Pairs {
        let with_itself = self.models.iter().map(|m| [m.clone(), m.clone()]);
        let identical = with_itself.filter(|_| self.identical);
        Pairs {
            pairs: self.different.iter().cloned().chain(identical).collect(),
            order: self.order.clone(),
            repetitions: self.repetitions,
            tie: false,
            interval_order: IntervalOrder::Balanced,
            neighbors: false,
        }
    }
}

/// Two realizations that pairs do not connect, not by way of others either. `None` if all are connected.
pub fn unconnected<'m>(models: &'m [ModelId], pairs: &[[ModelId; 2]]) -> Option<[&'m ModelId; 2]> {
    let first = models.first()?;
    let mut reached = BTreeSet::from([first]);
    loop {
        let before = reached.len();
        for pair in pairs {
            if pair.iter().any(|m| reached.contains(m)) {
                reached.extend(pair);
            }
        }
        if reached.len() == before {
            break;
        }
    }
    let other = models.iter().find(|m| !reached.contains(m))?;
    Some([first, other])
}
