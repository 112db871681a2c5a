//! The log-likelihood of the observations of a row, and its derivatives in the linear predictor.

use super::Family;
use crate::clm::{logistic, softplus};

/// What the observations of a row sum to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    /// Observations; trials of the binomial family.
    pub(super) n: f64,
    /// Sum of the observations; successes of the binomial family.
    pub(super) y: f64,
}

/// A log-likelihood without what does not depend on the predictor.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Term {
    pub(super) value: f64,
    /// First derivative.
    pub(super) score: f64,
    /// Second derivative times −1.
    pub(super) weight: f64,
    /// Derivative of the weight.
    pub(super) slope: f64,
}

impl Family {
    /// At the linear predictor η; `shape` is of the gamma family.
    pub(super) fn term(self, sums: Sums, eta: f64, shape: f64) -> Term {
        let Sums { n, y } = sums;
        match self {
            Self::Poisson => {
                let mean = n * eta.exp();
                Term {
                    value: y * eta - mean,
                    score: y - mean,
                    weight: mean,
                    slope: mean,
                }
            }
            Self::Binomial => {
                let share = logistic(eta);
                let weight = n * share * (1.0 - share);
                Term {
                    value: y * eta - n * softplus(eta),
                    score: y - n * share,
                    weight,
                    slope: weight * (1.0 - 2.0 * share),
                }
            }
            Self::Gamma => {
                let ratio = y * (-eta).exp();
                let weight = shape * ratio;
                Term {
                    value: shape * (-ratio - n * eta),
                    score: shape * (ratio - n),
                    weight,
                    slope: -weight,
                }
            }
        }
    }
}
