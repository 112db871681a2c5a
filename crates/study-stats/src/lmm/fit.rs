//! Fitting a model: the minimum of the profiled criterion, on the scale of the data.
//!
//! With d_Z the log-determinant of the random part, the criterion is
//! ML: d_Z + N(1 + log 2πr²/N); REML: d_Z + log|A| + (N − p)(1 + log 2πr²/(N − p))
//! (Bates et al. 2015, eqs 34 and 41).

use super::data::{FixedEffects, LmmData};
use super::optimize::minimize;
use super::profile::{Profile, Ratios, profile};
use super::start::Coordinates;
use super::{LmmError, RandomEffects};
use std::f64::consts::PI;

/// The likelihood that is maximized.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// The likelihood: for likelihood-ratio tests of fixed effects.
    Ml,
    /// The restricted likelihood: for variances and standard errors.
    Reml,
}

/// Variance components, in squared units of the rating; 0 if not in the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VarianceComponents {
    /// Variance of the subject intercept.
    pub intercept: f64,
    /// Variance of the subject slope, per squared unit of the covariate.
    pub slope: f64,
    /// Covariance of subject intercept and slope, per unit of the covariate.
    pub covariance: f64,
    /// Variance of the realization intercept.
    pub realization: f64,
    /// Variance of the cell intercept.
    pub cell: f64,
    /// Variance of the error.
    pub error: f64,
}

/// A fitted model.
#[derive(Debug, Clone)]
pub struct LmmFit<'a> {
    pub(super) table: &'a LmmData,
    pub(super) criterion: Criterion,
    pub(super) coordinates: Coordinates,
    pub(super) at: Vec<f64>,
    /// Coordinates off the boundary.
    pub(super) free: Vec<usize>,
    pub(super) profile: Profile,
    /// σ², standardized.
    pub(super) sigma2: f64,
    /// −2 log (restricted) likelihood.
    pub deviance: f64,
    /// Number of fixed effects, variances, covariances and σ².
    pub parameters: usize,
    /// The variance components.
    pub variances: VarianceComponents,
    /// Whether a variance is 0 or a correlation ±1.
    pub singular: bool,
}

/// Residual degrees of freedom of the criterion.
pub(super) fn weight(table: &LmmData, criterion: Criterion) -> f64 {
    match criterion {
        Criterion::Ml => table.n,
        Criterion::Reml => table.n - table.columns() as f64,
    }
}

fn deviance(p: &Profile, criterion: Criterion, weight: f64) -> Option<f64> {
    if p.rss <= 0.0 {
        return None;
    }
    let log_det = match criterion {
        Criterion::Ml => p.log_det_z,
        Criterion::Reml => p.log_det_z + p.log_det_x,
    };
    Some(log_det + weight * (1.0 + (2.0 * PI * p.rss / weight).ln()))
}

/// A smaller share of the variance of the ratings is not an error variance but rounding.
const NO_ERROR: f64 = 1e-13;

/// Whether the effects can be separated.
fn identified(table: &LmmData, random: RandomEffects) -> Result<(), LmmError> {
    let covariate = matches!(table.fixed, FixedEffects::Covariate { .. });
    if random.realization && table.realizations.len() < 2 {
        return Err(LmmError::OneRealization);
    }
    if random.realization && covariate && table.realizations.len() < 3 {
        return Err(LmmError::FewRealizations);
    }
    if random.slope && !table.x_within {
        return Err(LmmError::NoSlope);
    }
    if random.cell && !table.repeats() {
        return Err(LmmError::NoRepetition);
    }
    // The residual with every random effect taken as a fixed one: for large γ the
    // penalized residual is that + c/γ, and two values of γ eliminate c.
    let rss = |all: f64| {
        let ratios = Ratios {
            intercept: all,
            slope: if random.slope { all } else { 0.0 },
            realization: if random.realization { all } else { 0.0 },
            ..Ratios::default()
        };
        profile(table, random, &ratios).map(|p| p.rss)
    };
    let least = if random.cell {
        Some(table.within)
    } else {
        rss(1e7).zip(rss(1e8)).map(|(a, b)| (10.0 * b - a) / 9.0)
    };
    match least {
        Some(rss) if rss > NO_ERROR * table.n && weight(table, Criterion::Reml) >= 1.0 => Ok(()),
        _ => Err(LmmError::NoError),
    }
}

/// Fits a model.
///
/// # Errors
/// If the effects cannot be separated, no error variance is left, or the search does not
/// converge.
pub fn fit(
    table: &LmmData,
    random: RandomEffects,
    criterion: Criterion,
) -> Result<LmmFit<'_>, LmmError> {
    identified(table, random)?;
    let coordinates = Coordinates::of(table, random);
    let weight = weight(table, criterion);
    let value = |at: &[f64]| {
        let p = profile(table, random, &coordinates.ratios(at))?;
        deviance(&p, criterion, weight)
    };
    let bounded = coordinates.bounded();
    let starts = coordinates.starts(&value);
    let mut ends = starts
        .iter()
        .filter_map(|start| minimize(&value, start, &bounded));
    let found = if bounded.len() == 1 {
        // The criterion can have two local minima.
        ends.min_by(|a, b| a.value.total_cmp(&b.value))
    } else {
        ends.next()
    }
    .ok_or(LmmError::NotConverged)?;
    let ratios = coordinates.ratios(&found.at);
    let profile = profile(table, random, &ratios).ok_or(LmmError::NotConverged)?;
    let sigma2 = profile.rss / weight;
    let mut scale = 2.0 * weight * table.y_scale.ln();
    if let (Criterion::Reml, FixedEffects::Covariate { .. }) = (criterion, table.fixed) {
        scale += 2.0 * table.x_scale.ln();
    }
    let error = sigma2 * table.y_scale.powi(2);
    let variances = VarianceComponents {
        intercept: ratios.intercept * error,
        slope: ratios.slope * error / table.x_scale.powi(2),
        covariance: ratios.covariance * error / table.x_scale,
        realization: ratios.realization * error,
        cell: ratios.cell * error,
        error,
    };
    Ok(LmmFit {
        deviance: found.value + scale,
        parameters: table.columns() + found.at.len() + 1,
        singular: found.free.len() < found.at.len() || random.slope && found.at[0].abs() < 1e-4,
        table,
        criterion,
        coordinates,
        at: found.at,
        free: found.free,
        profile,
        sigma2,
        variances,
    })
}

impl LmmFit<'_> {
    /// Akaike's criterion −2 log L + 2k, k the number of parameters.
    pub fn aic(&self) -> f64 {
        self.deviance + 2.0 * self.parameters as f64
    }

    /// Schwarz's criterion −2 log L + k log N.
    pub fn bic(&self) -> f64 {
        self.deviance + self.parameters as f64 * self.table.n.ln()
    }

    /// The scale and offset that transform each fixed effect to the units of the data.
    pub(super) fn units(&self) -> Vec<(f64, f64)> {
        let t = self.table;
        match t.fixed {
            FixedEffects::Intercept => vec![(t.y_scale, t.y_center)],
            FixedEffects::Covariate { .. } => {
                vec![(t.y_scale, t.y_center), (t.y_scale / t.x_scale, 0.0)]
            }
            FixedEffects::Realizations => vec![(t.y_scale, t.y_center); t.realizations.len()],
        }
    }

    /// The contrast Σ lᵢβᵢ of the fixed effects: of the means of
    /// [`FixedEffects::Realizations`], of the intercept, or of intercept and slope.
    pub fn estimate(&self, l: &[f64]) -> f64 {
        self.units()
            .iter()
            .zip(l)
            .zip(self.profile.beta.iter())
            .map(|(((unit, shift), l), b)| l * (unit * b + shift))
            .sum()
    }
}
