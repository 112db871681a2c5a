//! Gaussian mixed models, by profiled maximum likelihood (ML or REML).
//!
//! y = Xβ + Zb + ε, ε ~ N(0, σ²), b ~ N(0, σ²Γ). The random effects are a subject
//! intercept (optionally with a correlated slope of the covariate), a realization
//! intercept, and an intercept of each subject × realization cell. Trials of one cell
//! differ only by noise, so that n, mean and sum of squares of each cell are sufficient;
//! subjects with the same pattern of cells share their algebra ([`LmmData`]). Subjects
//! and cells are eliminated by the Woodbury identity, realizations, which are few, by a
//! dense Cholesky factor. A variance on the boundary is exactly 0.
//!
//! Usage: [`LmmData::new`], then [`fit`], then the tests of [`LmmFit`] or
//! [`kenward_roger`]; or [`adjusted_means`]. [`balanced_slope`] is the closed form of the
//! crossed model on complete, balanced data.
//!
//! `docs/statistics-mixed.md` derives the formulas. Sources: Bates, Mächler,
//! Bolker & Walker (2015) for the profiled criterion; Satterthwaite (1946) and
//! Kuznetsova, Brockhoff & Christensen (2017) for the degrees of freedom;
//! Kenward & Roger (1997) for the adjusted F.
//!
//! Not supported: effects of single observations (order, carry-over), other random
//! slopes, weights.

mod adjusted;
mod balanced;
mod data;
mod differences;
mod fit;
mod kenward_roger;
mod optimize;
mod profile;
mod satterthwaite;
mod slope_variance;
mod start;
#[cfg(test)]
mod tests;

pub use adjusted::{AdjustedMeans, adjusted_means};
pub use balanced::{BalancedSlope, balanced_slope};
pub use data::{CellSummary, FixedEffects, LmmData};
pub use fit::{Criterion, LmmFit, VarianceComponents, fit};
pub use kenward_roger::{kenward_roger, kenward_roger_t};
pub use satterthwaite::{ContrastF, ContrastT};
pub use slope_variance::{SlopeVariance, slope_variance};

/// The random effects of a model; every model has a subject intercept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RandomEffects {
    /// A slope of the covariate for each subject, correlated with the intercept.
    pub slope: bool,
    /// An intercept for each realization.
    pub realization: bool,
    /// An intercept for each subject × realization cell.
    pub cell: bool,
}

impl RandomEffects {
    /// Intercepts of realizations and, if a cell has two ratings, of cells.
    pub fn crossed(table: &LmmData) -> Self {
        Self {
            slope: false,
            realization: true,
            cell: table.repeats(),
        }
    }
}

/// Why there is no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LmmError {
    /// The table has no ratings, or they overflow.
    #[error("there are no ratings, or they overflow")]
    NoData,
    /// There is only one subject.
    #[error("fewer than two subjects")]
    OneSubject,
    /// There is only one realization.
    #[error("fewer than two realizations")]
    OneRealization,
    /// The slope and the realization effects cannot be separated.
    #[error("fewer than three realizations with a covariate")]
    FewRealizations,
    /// The covariate does not vary, or overflows.
    #[error("the covariate does not vary, or overflows")]
    ConstantCovariate,
    /// All ratings are equal.
    #[error("all ratings are equal")]
    ConstantRatings,
    /// No subject has two values of the covariate.
    #[error("no subject has two values of the covariate")]
    NoSlope,
    /// No cell has two ratings.
    #[error("no cell has two ratings")]
    NoRepetition,
    /// Fixed and random effects together explain every rating.
    #[error("the effects explain every rating: there is no variance of error")]
    NoError,
    /// The work would exceed the bounds of [`LmmData`].
    #[error("too many realizations, or too many different patterns of cells")]
    TooLarge,
    /// The search did not converge.
    #[error("the likelihood has no minimum that the search could find")]
    NotConverged,
}
