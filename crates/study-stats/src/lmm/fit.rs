//! A fit: the minimum of the profiled criterion, on the scale of the data.
//!
//! ML: d = log|Z part| + N(1 + log 2πr²/N); REML: d = log|Z part| + log|A| +
//! (N − p)(1 + log 2πr²/(N − p)) (Bates et al. 2015, eqs 34 and 41).

use super::data::{FixedEffects, LmmData};
use super::optimize::minimize;
use super::profile::{Profile, Ratios, profile};
use super::start::Coordinates;
use super::{LmmError, RandomEffects};
use std::f64::consts::PI;

/// What is maximised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// Likelihood, for tests of fixed effects by likelihood ratio.
    Ml,
    /// Restricted likelihood, for variances and standard errors.
    Reml,
}

/// Variances, in squared units of the rating.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VarianceComponents {
    /// Subject intercept.
    pub intercept: f64,
    /// Subject slope, per squared unit of the covariate.
    pub slope: f64,
    /// Of intercept and slope.
    pub covariance: f64,
    /// Realization intercept.
    pub realization: f64,
    /// Cell intercept.
    pub cell: f64,
    /// Error.
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
    /// σ², standardised.
    pub(super) sigma2: f64,
    /// −2 log (restricted) likelihood.
    pub deviance: f64,
    /// Fixed effects, variances and σ².
    pub parameters: usize,
    /// In squared units of the rating.
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

/// Share of the variance of the ratings below which there is no error left.
const NO_ERROR: f64 = 1e-13;

/// What the table must have for these effects to be told apart.
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
    if random.cell && table.n <= table.cells as f64 {
        return Err(LmmError::NoRepetition);
    }
    // The residual with every random effect taken as a fixed one: the penalised
    // residual is that + c/γ for large γ, and two γ take c out.
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

/// Fits a model to a table.
///
/// # Errors
/// Where the effects cannot be told apart, or nothing is left for the error.
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
        // The criterion can have two minima.
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
    /// −2 log L + 2k.
    pub fn aic(&self) -> f64 {
        self.deviance + 2.0 * self.parameters as f64
    }

    /// −2 log L + k log N.
    pub fn bic(&self) -> f64 {
        self.deviance + self.parameters as f64 * self.table.n.ln()
    }

    /// What a unit of each fixed effect is in data units, and what is added.
    pub(super) fn units(&self) -> Vec<(f64, f64)> {
        let t = self.table;
        match t.fixed {
            FixedEffects::Intercept => vec![(t.y_scale, t.y_centre)],
            FixedEffects::Covariate { .. } => {
                vec![(t.y_scale, t.y_centre), (t.y_scale / t.x_scale, 0.0)]
            }
            FixedEffects::Realizations => vec![(t.y_scale, t.y_centre); t.realizations.len()],
        }
    }

    /// Σ lᵢβᵢ of the fixed effects: the means of [`FixedEffects::Realizations`], or the mean
    /// at the centre and the slope.
    pub fn estimate(&self, l: &[f64]) -> f64 {
        self.units()
            .iter()
            .zip(l)
            .zip(self.profile.beta.iter())
            .map(|(((unit, shift), l), b)| l * (unit * b + shift))
            .sum()
    }
}
