//! Proportional-odds models: cumulative-link models with the logit link.
//!
//! logit P(Y ≤ j) = θⱼ − xβ for the categories j = 1 … J − 1, with increasing θ
//! (McCullagh 1980; Agresti, *Analysis of Ordinal Categorical Data*, 2nd ed.,
//! 2010, ch. 3). [`super::clmm`] adds a random intercept for each subject.
//!
//! With F the logistic function, aⱼ = θⱼ − xβ and s(a) = ln(1 + eᵃ),
//!
//! ```text
//! F(A) − F(B) = (e^A − e^B) / ((1 + e^A)(1 + e^B))
//! ln P(Y = j) = [j < J] (aⱼ − s(aⱼ)) − [j > 1] s(aⱼ₋₁) + [1 < j < J] κ(θⱼ − θⱼ₋₁)
//! κ(δ) = ln(1 − e^−δ)
//! ```
//!
//! so that no digits cancel where two thresholds are close or extreme. The
//! log-likelihood of counts n is Σ nₖaₖ − mₖs(aₖ) + Σ Nⱼκⱼ over the pairs k of a
//! predictor and a threshold, m = nⱼ + nⱼ₊₁: one logistic regression for each
//! threshold, and a term that keeps the thresholds apart. It is concave, and its
//! derivatives are sums over k. [`CategoryCounts`] holds the counts.

pub(crate) mod counts;
pub(crate) mod newton;
mod parallel;
#[cfg(test)]
pub(crate) mod tests;

use crate::matrix::{Cholesky, SymmetricMatrix};
pub use counts::{CategoryCount, CategoryCounts, Predictor};
use newton::{Evaluation, maximize};
pub use parallel::{ProportionalOdds, proportional_odds};

/// Why an ordinal model has no estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ClmError {
    /// All ratings fall in one category.
    #[error("all ratings are equal")]
    OneCategory,
    /// The predictor does not vary.
    #[error("there are no two different predictors")]
    OnePredictor,
    /// A mixed model needs two subjects.
    #[error("one subject has no variance between subjects")]
    OneSubject,
    /// Slope and realizations cannot be separated.
    #[error("fewer than three realizations with a covariate")]
    FewRealizations,
    /// The likelihood has no maximum: an estimate is infinite.
    #[error(
        "complete separation: the ratings of some realizations do not overlap with others, so an estimate is infinite"
    )]
    Separated,
    /// The standard deviation between subjects is infinite.
    #[error("the subjects' ratings do not overlap: their standard deviation is infinite")]
    SubjectsSeparated,
    /// The search found no maximum, or one with a singular information matrix.
    #[error("the likelihood has no maximum that could be found")]
    NoMaximum,
}

/// Estimates of a proportional-odds model, in logits.
#[derive(Debug, Clone, PartialEq)]
pub struct ClmFit {
    /// Thresholds θ, increasing; one less than there are categories.
    pub thresholds: Vec<f64>,
    /// Coefficients β, by column of the design.
    pub beta: Vec<f64>,
    /// Standard errors of β, from the observed information.
    pub se: Vec<f64>,
    /// Log-likelihood at the maximum.
    pub loglik: f64,
}

/// Maximum-likelihood estimates; all ratings are treated as independent.
///
/// # Errors
/// If the estimates do not exist (decided from the counts) or were not found.
pub fn clm(table: &CategoryCounts) -> Result<ClmFit, ClmError> {
    table.estimable()?;
    let found = maximize(start(table), |at| evaluate(table, at)).ok_or(ClmError::NoMaximum)?;
    fit_of(table, &found.at, found.value, &found.information)
}

/// The estimates at a maximum. Parameters after β are not reported.
pub(super) fn fit_of(
    table: &CategoryCounts,
    at: &[f64],
    loglik: f64,
    information: &SymmetricMatrix,
) -> Result<ClmFit, ClmError> {
    let t = table.thresholds();
    let end = table.parameters();
    let factor = Cholesky::definite(information).ok_or(ClmError::NoMaximum)?;
    let variances = factor.inverse_diagonal();
    let se: Vec<f64> = variances[t..end].iter().map(|v| v.sqrt()).collect();
    if se.iter().chain(at).all(|v| v.is_finite()) {
        Ok(ClmFit {
            thresholds: at[..t].to_vec(),
            beta: at[t..end].to_vec(),
            se,
            loglik,
        })
    } else {
        Err(ClmError::NoMaximum)
    }
}

/// Starting values: thresholds at the logits of the cumulative shares, β = 0.
fn start(table: &CategoryCounts) -> Vec<f64> {
    let mut at = table.marginal_logits();
    at.resize(table.parameters(), 0.0);
    at
}

/// Value, gradient and Hessian at (θ, β); `None` if the thresholds do not increase.
pub(super) fn evaluate(table: &CategoryCounts, at: &[f64]) -> Option<Evaluation> {
    let mut point = table.spacing(at, table.parameters())?;
    let a = table.linear(at);
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for (k, &(n, m)) in a.iter().zip(table.pooled()) {
        let f = logistic(*k);
        point.value += n * k - m * softplus(*k);
        first.push(n - m * f);
        second.push(-m * f * (1.0 - f));
    }
    table.add_gradient(&first, &mut point.gradient);
    table.add_hessian(&second, &mut point.hessian);
    point.value.is_finite().then_some(point)
}

/// F(a) = 1/(1 + e^−a).
pub(super) fn logistic(a: f64) -> f64 {
    1.0 / (1.0 + (-a).exp())
}

/// s(a) = ln(1 + eᵃ).
pub(super) fn softplus(a: f64) -> f64 {
    a.max(0.0) + (-a.abs()).exp().ln_1p()
}
