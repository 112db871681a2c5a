//! Gaussian mixed models, by profiled maximum likelihood (ML or REML).
//!
//! y = Xβ + Zb + ε, ε ~ N(0, σ²), b ~ N(0, σ²Γ). The random effects are a subject
//! intercept (with a correlated slope of the covariate, if asked for), a
//! realization intercept, and an intercept of each subject × realization cell.
//! Trials of one cell differ only by noise, so n, mean and sum of squares of
//! each cell are all that the models need; subjects with the same pattern of
//! cells share their algebra ([`LmmData`]). Subjects and cells are eliminated by
//! the Woodbury identity, realizations, which are few, by a dense Cholesky
//! factor. A variance on the boundary is 0 exactly.
//!
//! `docs/statistics-mixed.md` derives the formulas. Sources: Bates, Mächler,
//! Bolker & Walker (2015) for the profiled criterion; Satterthwaite (1946) and
//! Kuznetsova, Brockhoff & Christensen (2017) for the degrees of freedom;
//! Kenward & Roger (1997) for the adjusted F.
//!
//! Not here: observations with effects of their own (order, carry-over), random
//! slopes of anything else, weights.

mod data;
mod differences;
mod fit;
mod kenward_roger;
mod optimize;
mod profile;
mod satterthwaite;
mod start;
#[cfg(test)]
mod tests;

pub use data::{CellSummary, FixedEffects, LmmData};
pub use fit::{Criterion, LmmFit, VarianceComponents, fit};
pub use kenward_roger::kenward_roger;
pub use satterthwaite::{ContrastF, ContrastT};

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

/// Why there is no fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LmmError {
    /// The table has no ratings, or they overflow.
    #[error("there are no ratings, or they overflow")]
    NoData,
    /// One subject.
    #[error("fewer than two subjects")]
    OneSubject,
    /// One realization.
    #[error("fewer than two realizations")]
    OneRealization,
    /// The slope and the realization effects cannot be told apart.
    #[error("fewer than three realizations with a VAF")]
    FewRealizations,
    /// The covariate does not vary, or overflows.
    #[error("VAF does not vary, or overflows")]
    ConstantCovariate,
    /// All ratings are equal.
    #[error("all ratings are equal")]
    ConstantRatings,
    /// No subject has two values of the covariate.
    #[error("no subject rated two realizations with different VAF")]
    NoSlope,
    /// No cell has two ratings.
    #[error("no cell has two ratings")]
    NoRepetition,
    /// Fixed and random effects together explain every rating.
    #[error("the effects explain every rating: there is no variance of error")]
    NoError,
    /// Larger than the engine is bounded to.
    #[error("too many realizations, or too many different patterns of cells")]
    TooLarge,
    /// The search did not end at a minimum.
    #[error("the likelihood has no minimum that the search could find")]
    NotConverged,
}
