//! The method of constant stimuli.

use super::{Ladder, ProcedureError, filled};
use serde::{Deserialize, Serialize};
use study_base::rng::Stream;

/// Each level equally often, in a random order that the answers do not change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constant {
    /// Levels of the ladder.
    pub levels: Vec<f64>,
    /// Trials of each level.
    pub repetitions: u32,
}

impl Constant {
    /// Number of trials.
    pub fn trials(&self) -> u32 {
        let levels = u32::try_from(self.levels.len()).unwrap_or(u32::MAX);
        levels.saturating_mul(self.repetitions)
    }
}

/// A track of constant stimuli.
#[derive(Debug, Clone)]
pub(super) struct Progress {
    order: Vec<f64>,
    answered: usize,
}

impl Progress {
    /// One shuffled pass through the levels for each repetition.
    pub(super) fn new(
        rule: &Constant,
        ladder: &Ladder,
        stream: &mut Stream,
    ) -> Result<Self, ProcedureError> {
        filled("levels", &rule.levels)?;
        for level in &rule.levels {
            ladder.step(*level)?;
        }
        let mut order = Vec::new();
        for _ in 0..rule.repetitions {
            let mut pass = rule.levels.clone();
            stream.shuffle(&mut pass);
            order.extend(pass);
        }
        Ok(Self { order, answered: 0 })
    }

    pub(super) fn next(&self) -> Option<f64> {
        self.order.get(self.answered).copied()
    }

    pub(super) fn answer(&mut self) {
        self.answered += 1;
    }

    pub(super) fn answered(&self) -> u32 {
        u32::try_from(self.answered).unwrap_or(u32::MAX)
    }
}
