//! Generalized linear mixed models: counts (Poisson, logarithmic link), shares (binomial, logit
//! link) and positive numbers (gamma, logarithmic link) with normal random intercepts.
//!
//! With g the link, g(E y) = Xβ + Σ θ_f u_f over the factors f, such as subjects, realizations and
//! their cells, crossed or nested, in any number; u are independent and standard normal, one for each
//! level, and θ_f is the standard deviation of a factor. The likelihood is
//!
//! ```text
//! L = ∫ exp f(u) du / (2π)^(q/2),   f = Σ ln p(y | u) − ½ uᵀu.
//! ```
//!
//! [`Integral::Laplace`] is f(û) − ½ ln |H| with H = −f″(û), the criterion of R's `glmer` with
//! `nAGQ = 1` (Bates, Mächler, Bolker & Walker 2015); [`Integral::Adaptive`], for one factor, is
//! adaptive Gauss–Hermite quadrature (Pinheiro & Bates 1995), which is numerically exact. Both are
//! maximized over β, θ and, of the gamma family, the logarithm of the shape, by Newton's method with
//! a gradient in closed form. Standard errors are those of the observed information of all
//! parameters, as of `glmer`. The likelihood is even and smooth in θ: a θ of 0 needs no special case.
//!
//! **Gamma.** The shape 1/φ is estimated by maximum likelihood with the others. `glmer` does
//! otherwise: it finds the modes with φ = 1, plugs φ = deviance/n into the density, and does not divide
//! uᵀu by φ. That is no approximation of the likelihood, and its standard deviations are too small (of a
//! true 0.5 it finds 0.31 where the likelihood is largest at 0.47). Here both integrals agree with the
//! likelihood as R integrates it; `tests/glmm.rs` has the comparison.
//!
//! `docs/statistics-mixed.md` derives the gradient.

mod adaptive;
mod data;
mod family;
mod laplace;
mod search;
mod sparse;
#[cfg(test)]
mod tests;

use super::distribution::chi2_upper;
use super::matrix::{Cholesky, Matrix, dot};
pub use data::{GlmmData, Observation};

/// The distribution of an observation, and its link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Counts 0, 1, 2 …; the logarithm of the mean is linear.
    Poisson,
    /// Successes in some trials; the logit of the probability is linear.
    Binomial,
    /// Numbers above 0 whose standard deviation is proportional to the mean; the logarithm of the
    /// mean is linear.
    Gamma,
}

/// How the random intercepts are integrated out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integral {
    /// Laplace's approximation, with any factors.
    Laplace,
    /// Adaptive Gauss–Hermite quadrature with 25 nodes, with one factor.
    Adaptive,
}

/// Why a generalized mixed model has no estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum GlmmError {
    /// There are no observations, or they differ in their numbers of columns or factors.
    #[error("there are no observations")]
    NoData,
    /// An observation is outside of what the family allows.
    #[error("an observation is no number of this kind")]
    NotOfFamily,
    /// A factor has one level only.
    #[error("fewer than two levels of a random factor")]
    OneLevel,
    /// A column is a combination of others.
    #[error("the fixed effects cannot be separated")]
    Collinear,
    /// An estimate is infinite.
    #[error("an estimate is infinite: somewhere all counts are 0, or all trials have one answer")]
    Separated,
    /// A standard deviation is infinite.
    #[error("the levels of a random factor do not overlap: their standard deviation is infinite")]
    InfiniteSd,
    /// The observations do not vary around what the effects predict.
    #[error("the effects explain every observation")]
    NoError,
    /// Quadrature is of one factor.
    #[error("quadrature is defined with one random factor")]
    SeveralFactors,
    /// The work would exceed the bounds of [`GlmmData`].
    #[error("too many levels of random factors")]
    TooLarge,
    /// The search did not converge: nothing can be said.
    #[error("the likelihood has no maximum that the search could find")]
    NotConverged,
}

/// Estimates of a generalized mixed model.
#[derive(Debug, Clone, PartialEq)]
pub struct GlmmFit {
    /// Fixed effects, on the scale of the link.
    pub beta: Vec<f64>,
    /// Their standard errors.
    pub se: Vec<f64>,
    /// Standard deviation of each factor, on the scale of the link; 0 on the boundary.
    pub sd: Vec<f64>,
    /// Variance over squared mean φ, of the gamma family.
    pub dispersion: Option<f64>,
    /// Log-likelihood with all constants.
    pub loglik: f64,
    /// Number of fixed effects, standard deviations and φ.
    pub parameters: usize,
    /// Covariance of the fixed effects.
    covariance: Matrix,
}

impl GlmmFit {
    /// The contrast Σ lᵢβᵢ and its standard error; `None` unless there is a weight for each effect.
    pub fn contrast(&self, l: &[f64]) -> Option<(f64, f64)> {
        if l.len() != self.beta.len() {
            return None;
        }
        let variance = dot(&self.covariance.times(l), l);
        Some((dot(&self.beta, l), variance.max(0.0).sqrt()))
    }

    /// Akaike's criterion −2 log L + 2k, k the number of parameters.
    pub fn aic(&self) -> f64 {
        2.0 * self.parameters as f64 - 2.0 * self.loglik
    }
}

/// The likelihood-ratio test of some fixed effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RatioTest {
    /// Twice the difference of the log-likelihoods.
    pub chi2: f64,
    /// Number of effects.
    pub df: usize,
    /// P(χ²(df) ≥ chi2), which is too small for few subjects.
    pub p: Option<f64>,
}

/// A larger standard deviation is reported as infinite: one standard deviation changes odds and
/// means by e²⁵.
const INFINITE_SD: f64 = 25.0;

/// A smaller one is reported as 0.
const SMALLEST_SD: f64 = 1e-4;

/// A fixed effect with a larger standard error is infinite; its column is scaled to a maximum of 1.
const INFINITE_SE: f64 = 1000.0;

/// Fits the model.
///
/// # Errors
/// If the estimates do not exist or were not found.
pub fn glmm(data: &GlmmData, integral: Integral) -> Result<GlmmFit, GlmmError> {
    if integral == Integral::Adaptive && data.factors() != 1 {
        return Err(GlmmError::SeveralFactors);
    }
    let p = data.columns();
    let (beta, shape) = data.start()?;
    // Effects given the levels are larger than marginal ones (Zeger, Liang & Albert 1988).
    let from = |sd: f64| -> Vec<f64> {
        let grown = match data.family {
            Family::Binomial => (1.0 + 0.346 * sd * sd * data.factors() as f64).sqrt(),
            Family::Poisson | Family::Gamma => 1.0,
        };
        let beta = beta.iter().map(|b| b * grown);
        let sds = vec![sd; data.factors()];
        beta.chain(sds).chain(shape).collect()
    };
    let found = [0.5, 1.5, 0.1].map(from).into_iter().find_map(|start| {
        let mut laplace = laplace::Laplace::new(data);
        let near = search::maximum(start, |at| laplace.gradient(at))?;
        match integral {
            Integral::Laplace => Some(near),
            Integral::Adaptive => {
                let mut adaptive = adaptive::Adaptive::new(data);
                search::maximum(near.at, |at| adaptive.gradient(at))
            }
        }
    });
    let found = found.ok_or(GlmmError::NotConverged)?;
    let sd: Vec<f64> = found.at[p..p + data.factors()]
        .iter()
        .map(|sd| {
            if sd.abs() < SMALLEST_SD {
                0.0
            } else {
                sd.abs()
            }
        })
        .collect();
    if sd.iter().any(|sd| *sd > INFINITE_SD) {
        return Err(GlmmError::InfiniteSd);
    }
    let all = Cholesky::definite(&found.information)
        .ok_or(GlmmError::NotConverged)?
        .inverse();
    if (0..p).any(|i| all[(i, i)].sqrt() > INFINITE_SE) {
        return Err(GlmmError::Separated);
    }
    let scale = data.scale();
    let covariance = Matrix::from_fn(p, p, |i, j| all[(i, j)] / (scale[i] * scale[j]));
    Ok(GlmmFit {
        beta: found.at.iter().zip(scale).map(|(b, s)| b / s).collect(),
        se: (0..p).map(|i| covariance[(i, i)].sqrt()).collect(),
        sd,
        dispersion: shape.map(|_| (-found.at[found.at.len() - 1]).exp()),
        loglik: found.value,
        parameters: found.at.len(),
        covariance,
    })
}

/// Tests the fixed effects of these columns against the model without them; `full` is the model
/// with them, by the same integral.
///
/// # Errors
/// If the model without them has no estimate.
pub fn ratio_test(
    data: &GlmmData,
    full: &GlmmFit,
    columns: &[usize],
    integral: Integral,
) -> Result<RatioTest, GlmmError> {
    let reduced = glmm(&data.without(columns)?, integral)?;
    let chi2 = (2.0 * (full.loglik - reduced.loglik)).max(0.0);
    let df = full.parameters - reduced.parameters;
    Ok(RatioTest {
        chi2,
        df,
        p: chi2_upper(chi2, df as f64),
    })
}
