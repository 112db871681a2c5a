//! Proportional-odds models with a normal random intercept for each subject.
//!
//! logit P(Y ≤ j | b) = θⱼ − xβ − b, b ~ N(0, σ²). In the terms of [`super::clm`]
//! one subject contributes ln ∫ e^f(b) db/√(2π) with
//!
//! ```text
//! f(b) = Σ (nₖaₖ − mₖs(aₖ)) − b²/(2σ²) − ln σ,   aₖ = θⱼ − xβ − b
//! ```
//!
//! which is concave in b. The integral is computed in two ways: by Laplace's method,
//! f(b̂) − ½ ln H with H = −f″(b̂), the default of most software, and by adaptive
//! Gauss–Hermite quadrature (Pinheiro & Bates 1995), which is numerically exact. Both are
//! maximized over (θ, β, ln σ) by Newton's method with second derivatives of the
//! marginal likelihood, so that the standard errors are those of the observed
//! information (R's `ordinal`, Christensen 2019, fits the same model by quasi-Newton).
//!
//! At the boundary σ = 0 the marginal likelihood is that of the fixed-effects model, and
//! its derivative in σ² is ½ Σᵢ (f₁² + f₂), with f₁ and f₂ the derivatives in b at 0. If
//! it is not positive and no σ > 0 has a higher likelihood, the estimate is 0.

mod crossed;
pub(crate) mod hermite;
mod laplace;
mod mode;
mod quadrature;
#[cfg(test)]
mod tests;

use super::clm::counts::CategoryCounts;
use super::clm::newton::{Evaluation, Maximum, maximize};
use super::clm::{ClmError, ClmFit, clm, fit_of, logistic};
pub use crossed::{CrossedClmm, CrossedParameters, clmm_crossed};
use std::sync::LazyLock;

/// Number of nodes of the reported quadrature.
pub const NODES: usize = 60;

/// Number of nodes of the first steps.
const FEW_NODES: usize = 12;

static RULE: LazyLock<Vec<hermite::Node>> = LazyLock::new(|| hermite::rule(NODES));
static FEW: LazyLock<Vec<hermite::Node>> = LazyLock::new(|| hermite::rule(FEW_NODES));

/// A larger standard deviation, in logits, is reported as infinite: one standard
/// deviation changes the odds by e¹⁰⁰.
const INFINITE_SD: f64 = 100.0;

/// A smaller σ is reported as 0: it changes a probability by less than 10⁻⁴.
const SMALLEST_SD: f64 = 1e-4;

/// Estimates of a proportional-odds model with a random intercept.
#[derive(Debug, Clone, PartialEq)]
pub struct ClmmFit {
    /// Thresholds and coefficients; on the boundary those of [`clm`].
    pub fit: ClmFit,
    /// Standard deviation σ between subjects, in logits; 0 on the boundary.
    pub sd: f64,
    /// Whether the likelihood is largest at σ = 0.
    pub boundary: bool,
}

/// The estimates by Laplace's method and by adaptive quadrature.
#[derive(Debug, Clone, PartialEq)]
pub struct ClmmFits {
    /// By Laplace's method.
    pub laplace: Result<ClmmFit, ClmError>,
    /// By adaptive Gauss–Hermite quadrature with [`NODES`] nodes.
    pub quadrature: Result<ClmmFit, ClmError>,
}

/// Fits the model by Laplace's method and by adaptive quadrature. Each result is an error
/// if its estimates do not exist or were not found.
pub fn clmm(table: &CategoryCounts) -> ClmmFits {
    let undefined = |error| ClmmFits {
        laplace: Err(error),
        quadrature: Err(error),
    };
    let fixed = match clm(table) {
        Ok(_) if table.subjects() < 2 => return undefined(ClmError::OneSubject),
        Ok(fixed) => fixed,
        Err(error) => return undefined(error),
    };
    let mut modes = vec![0.0; table.subjects()];
    let mut by_laplace = |at: &[f64]| laplace::evaluate(table, at, &mut modes);
    let starts: Vec<Vec<f64>> = [0.3, 1.0, 3.0]
        .iter()
        .map(|&sd| marginal_to_conditional(&fixed, sd))
        .collect();
    let start = best(&starts, &mut by_laplace);
    let slope = slope_at_zero(table, &fixed);
    let found = start.and_then(|at| maximize(at, &mut by_laplace));
    let laplace = estimates(table, &fixed, slope, found.as_ref());
    // Start at Laplace's maximum; if that fails, start again from the initial values.
    let near = match (found, &laplace) {
        (Some(found), Ok(mixed)) if !mixed.boundary => integrate(table, found.at, &mut modes),
        _ => None,
    };
    let near = estimates(table, &fixed, slope, near.as_ref());
    let quadrature = near.or_else(|_| {
        let few = &mut |at: &[f64]| quadrature::evaluate(table, at, &FEW, &mut modes);
        let start = best(&starts, few);
        let found = start.and_then(|at| integrate(table, at, &mut modes));
        estimates(table, &fixed, slope, found.as_ref())
    });
    ClmmFits {
        laplace,
        quadrature,
    }
}

/// The maximum of the integral: first with few nodes, because the cost of a step is
/// proportional to their number.
fn integrate(table: &CategoryCounts, start: Vec<f64>, modes: &mut [f64]) -> Option<Maximum> {
    let near = maximize(start.clone(), |at| {
        quadrature::evaluate(table, at, &FEW, modes)
    });
    maximize(near.map_or(start, |near| near.at), |at| {
        quadrature::evaluate(table, at, &RULE, modes)
    })
}

/// Starting values with this standard deviation. Effects given the subject are larger
/// than marginal ones by about √(1 + 0.346σ²) (Zeger, Liang & Albert 1988).
fn marginal_to_conditional(fixed: &ClmFit, sd: f64) -> Vec<f64> {
    let factor = (1.0 + 0.346 * sd * sd).sqrt();
    let fixed = fixed.thresholds.iter().chain(&fixed.beta);
    fixed.map(|v| v * factor).chain([sd.ln()]).collect()
}

/// The starting values with the highest likelihood.
fn best(
    starts: &[Vec<f64>],
    at: &mut impl FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Vec<f64>> {
    starts
        .iter()
        .filter_map(|s| at(s).map(|p| (p.value, s)))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, s)| s.clone())
}

/// What does not depend on the random intercepts at (θ, β, ln σ): 1/σ², the likelihood's
/// term of the thresholds, and aₖ of every place. `None` if these are not admissible.
fn common_part(table: &CategoryCounts, at: &[f64]) -> Option<(f64, Evaluation, Vec<f64>)> {
    let precision = (-2.0 * at[at.len() - 1]).exp();
    if !(precision.is_finite() && precision > 0.0) {
        return None;
    }
    Some((precision, table.spacing(at, at.len())?, table.linear(at)))
}

/// The derivative of the marginal log-likelihood in σ² at σ = 0.
fn slope_at_zero(table: &CategoryCounts, fixed: &ClmFit) -> f64 {
    let at: Vec<f64> = fixed
        .thresholds
        .iter()
        .chain(&fixed.beta)
        .copied()
        .collect();
    let a = table.linear(&at);
    let by_subject = table.by_subject().map(|terms| {
        let (mut first, mut second) = (0.0, 0.0);
        for term in terms {
            let f = logistic(a[term.place]);
            first -= term.n - term.m * f;
            second -= term.m * f * (1.0 - f);
        }
        0.5 * (first * first + second)
    });
    by_subject.sum()
}

/// The estimates from the maximum found, if any; `slope` is that at σ = 0.
fn estimates(
    table: &CategoryCounts,
    fixed: &ClmFit,
    slope: f64,
    found: Option<&Maximum>,
) -> Result<ClmmFit, ClmError> {
    let sd = |found: &Maximum| found.at[table.parameters()].exp();
    let zero = ClmmFit {
        fit: fixed.clone(),
        sd: 0.0,
        boundary: true,
    };
    match found {
        Some(m) if sd(m) > INFINITE_SD => Err(ClmError::SubjectsSeparated),
        Some(m) if sd(m) > SMALLEST_SD && (slope > 0.0 || m.value > fixed.loglik) => Ok(ClmmFit {
            fit: fit_of(table, &m.at, m.value, &m.information)?,
            sd: sd(m),
            boundary: false,
        }),
        _ if slope <= 0.0 => Ok(zero),
        Some(m) if sd(m) <= SMALLEST_SD => Ok(zero),
        _ => Err(ClmError::NoMaximum),
    }
}
