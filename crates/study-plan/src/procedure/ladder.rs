//! The levels that a track may present.

use super::{ProcedureError, filled};
use serde::{Deserialize, Serialize};

/// A rising list of levels. Every one is certified before a session; a level that it
/// does not have is never presented.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Ladder {
    levels: Vec<f64>,
}

impl Ladder {
    /// At least one finite level; each is above the one before.
    pub fn new(levels: Vec<f64>) -> Result<Self, ProcedureError> {
        filled("the ladder", &levels)?;
        for level in &levels {
            if !level.is_finite() {
                return Err(ProcedureError::Range {
                    what: "a level of the ladder".to_owned(),
                    value: *level,
                    range: "finite",
                });
            }
        }
        if let Some(pair) = levels.windows(2).find(|pair| pair[1] <= pair[0]) {
            return Err(ProcedureError::NotRising {
                before: pair[0],
                after: pair[1],
            });
        }
        Ok(Self { levels })
    }

    /// All levels, rising.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// The level of a step.
    ///
    /// # Panics
    /// If there is no such step.
    pub fn level(&self, step: usize) -> f64 {
        self.levels[step]
    }

    /// The lowest level.
    pub fn first(&self) -> f64 {
        self.levels[0]
    }

    /// The highest level.
    pub fn last(&self) -> f64 {
        self.levels[self.levels.len() - 1]
    }

    /// The step whose level is nearest; of two that are equally near, the lower one.
    ///
    /// ```
    /// # use study_plan::procedure::{Ladder, ProcedureError};
    /// let ladder = Ladder::new(vec![0.0, 1.0, 2.0, 4.0])?;
    /// assert_eq!(ladder.nearest(3.2), 3);
    /// # Ok::<(), ProcedureError>(())
    /// ```
    pub fn nearest(&self, level: f64) -> usize {
        let above = self.levels.partition_point(|l| *l < level);
        if above == 0 {
            return 0;
        }
        if above == self.levels.len() {
            return above - 1;
        }
        let (low, high) = (self.levels[above - 1], self.levels[above]);
        if high - level < level - low {
            above
        } else {
            above - 1
        }
    }

    /// The step with exactly this level.
    pub(super) fn step(&self, level: f64) -> Result<usize, ProcedureError> {
        let step = self.nearest(level);
        if self.levels[step] == level {
            return Ok(step);
        }
        Err(ProcedureError::NotOnLadder {
            level,
            first: self.first(),
            last: self.last(),
        })
    }
}

impl TryFrom<Vec<f64>> for Ladder {
    type Error = ProcedureError;

    fn try_from(levels: Vec<f64>) -> Result<Self, ProcedureError> {
        Self::new(levels)
    }
}

impl From<Ladder> for Vec<f64> {
    fn from(ladder: Ladder) -> Self {
        ladder.levels
    }
}
