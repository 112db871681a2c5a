//! Which ratings are better.

use std::cmp::Ordering;

/// The better end of the scale.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Better {
    /// Higher ratings are better.
    #[default]
    Higher,
    /// Lower ratings are better.
    Lower,
}

impl Better {
    /// The word in `--direction` and `--json`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Higher => "higher",
            Self::Lower => "lower",
        }
    }

    /// Of the best mean: `highest` or `lowest`.
    pub fn most(self) -> &'static str {
        match self {
            Self::Higher => "highest",
            Self::Lower => "lowest",
        }
    }

    /// Orders numbers with the best first.
    pub fn best_first(self, x: f64, y: f64) -> Ordering {
        match self {
            Self::Higher => y.total_cmp(&x),
            Self::Lower => x.total_cmp(&y),
        }
    }
}
