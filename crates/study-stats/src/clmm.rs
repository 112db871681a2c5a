//! Proportional odds with a normal intercept for each subject.
//!
//! logit P(Y ≤ j | b) = θⱼ − xβ − b, b ~ N(0, σ²). In the terms of [`super::clm`]
//! one subject adds ln ∫ e^f(b) db/√(2π) with
//!
//! ```text
//! f(b) = Σ (nₖaₖ − mₖs(aₖ)) − b²/(2σ²) − ln σ,   aₖ = θⱼ − xβ − b
//! ```
//!
//! which is concave in b. Two integrals: `laplace`, f(b̂) − ½ ln H with H =
//! −f″(b̂), which is what most software prints; and `quadrature`, adaptive
//! Gauss–Hermite (Pinheiro & Bates 1995), which is the integral itself. Both are
//! maximised over (θ, β, ln σ) by Newton's method with second derivatives of the
//! marginal likelihood, so that the standard errors are those of the observed
//! information (Christensen 2019, `ordinal`, has the same model by quasi-Newton).
//!
//! σ = 0 is a boundary: there the marginal likelihood is the fixed model's, and
//! its slope in σ² is ½ Σᵢ (f₁² + f₂), f₁ and f₂ the derivatives in b at 0. If it
//! falls there and no σ above does better, the standard deviation is 0.

mod hermite;
mod laplace;
mod mode;
mod quadrature;
#[cfg(test)]
mod tests;

use super::clm::counts::CategoryCounts;
use super::clm::newton::{Evaluation, Maximum, maximise};
use super::clm::{ClmError, ClmFit, clm, fit_of, logistic};
use std::sync::LazyLock;

/// Nodes of the quadrature that is reported.
pub const NODES: usize = 60;

/// Nodes on the way there.
const FEW_NODES: usize = 12;

static RULE: LazyLock<Vec<hermite::Node>> = LazyLock::new(|| hermite::rule(NODES));
static FEW: LazyLock<Vec<hermite::Node>> = LazyLock::new(|| hermite::rule(FEW_NODES));

/// From here up a standard deviation, in logits, is called infinite: between
/// two standard deviations the odds differ by e¹⁰⁰.
const INFINITE_SD: f64 = 100.0;

/// Below it σ is 0: it moves a probability by less than 10⁻⁴.
const SMALLEST_SD: f64 = 1e-4;

/// Estimates of a mixed model.
#[derive(Debug, Clone, PartialEq)]
pub struct ClmmFit {
    /// Of the fixed part. On the boundary those of the model without subjects.
    pub fit: ClmFit,
    /// σ, logits; 0 on the boundary.
    pub sd: f64,
    /// Whether the likelihood is greatest at σ = 0.
    pub boundary: bool,
}

/// The estimates by Laplace's method, and by adaptive quadrature.
#[derive(Debug, Clone, PartialEq)]
pub struct ClmmFits {
    /// By Laplace's method.
    pub laplace: Result<ClmmFit, ClmError>,
    /// With [`NODES`] nodes.
    pub quadrature: Result<ClmmFit, ClmError>,
}

/// Fits the mixed model both ways.
pub fn clmm(table: &CategoryCounts) -> ClmmFits {
    let fixed = match clm(table) {
        Ok(_) if table.subjects() < 2 => Err(ClmError::OneSubject),
        other => other,
    };
    let fixed = match fixed {
        Ok(fixed) => fixed,
        Err(cause) => {
            return ClmmFits {
                laplace: Err(cause),
                quadrature: Err(cause),
            };
        }
    };
    let mut modes = vec![0.0; table.subjects()];
    let mut by_laplace = |at: &[f64]| laplace::point(table, at, &mut modes);
    let starts: Vec<Vec<f64>> = [0.3, 1.0, 3.0]
        .iter()
        .map(|&sd| marginal_to_conditional(&fixed, sd))
        .collect();
    let start = best(&starts, &mut by_laplace);
    let slope = slope_at_zero(table, &fixed);
    let found = start.and_then(|at| maximise(at, &mut by_laplace));
    let laplace = judge(table, &fixed, slope, found.as_ref());
    // Laplace's maximum is near; where it is not, the integral is searched anew.
    let near = match (found, &laplace) {
        (Some(found), Ok(mixed)) if !mixed.boundary => integrate(table, found.at, &mut modes),
        _ => None,
    };
    let near = judge(table, &fixed, slope, near.as_ref());
    let quadrature = near.or_else(|_| {
        let few = &mut |at: &[f64]| quadrature::point(table, at, &FEW, &mut modes);
        let start = best(&starts, few);
        let found = start.and_then(|at| integrate(table, at, &mut modes));
        judge(table, &fixed, slope, found.as_ref())
    });
    ClmmFits {
        laplace,
        quadrature,
    }
}

/// The maximum of the integral: with few nodes first, since each step costs as
/// many passes as there are nodes.
fn integrate(table: &CategoryCounts, start: Vec<f64>, modes: &mut [f64]) -> Option<Maximum> {
    let near = maximise(start.clone(), |at| {
        quadrature::point(table, at, &FEW, modes)
    });
    maximise(near.map_or(start, |near| near.at), |at| {
        quadrature::point(table, at, &RULE, modes)
    })
}

/// Effects given a subject are larger than marginal ones by about √(1 + 0.346σ²)
/// (Zeger, Liang & Albert 1988).
fn marginal_to_conditional(fixed: &ClmFit, sd: f64) -> Vec<f64> {
    let factor = (1.0 + 0.346 * sd * sd).sqrt();
    let fixed = fixed.thresholds.iter().chain(&fixed.beta);
    fixed.map(|v| v * factor).chain([sd.ln()]).collect()
}

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

/// The slope of the marginal log-likelihood in σ² at the fixed model.
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

fn judge(
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
