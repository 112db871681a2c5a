//! Whether subjects differ in their slope on the covariate.

use super::fit::{Criterion, LmmFit, fit};
use super::satterthwaite::ContrastT;
use super::{LmmError, RandomEffects};
use crate::distribution::chi2_upper;

/// The variance of the subjects' slopes, with its test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlopeVariance {
    /// Variance of the slopes, per squared unit of the covariate.
    pub variance: f64,
    /// The mean slope in the model with this variance: the effect for other subjects and
    /// other realizations.
    pub slope: ContrastT,
    /// Difference of the restricted deviances without and with the variance.
    pub chi2: f64,
    /// p of `chi2`: of an equal mixture of χ²(1) and χ²(2), because a variance cannot be
    /// negative (Stram & Lee 1994).
    pub p: Option<f64>,
}

/// Estimates and tests the variance in y ~ x + (1 + x | subject) + (1 | realization)
/// [+ (1 | cell) if a cell has two ratings], by REML. Without the random realizations, and
/// the cells, differences between realizations that x does not explain would be taken
/// for differences between slopes. `without` is the same model without the slopes, fitted
/// by REML.
///
/// # Errors
/// If the table has no covariate that varies within subjects, or the model has no fit.
pub fn slope_variance(without: &LmmFit<'_>) -> Result<SlopeVariance, LmmError> {
    let table = without.table;
    if table.columns() != 2 {
        return Err(LmmError::ConstantCovariate);
    }
    let random = RandomEffects {
        slope: true,
        ..RandomEffects::crossed(table)
    };
    let with = fit(table, random, Criterion::Reml)?;
    let chi2 = (without.deviance - with.deviance).max(0.0);
    let p = chi2_upper(chi2, 1.0).zip(chi2_upper(chi2, 2.0));
    Ok(SlopeVariance {
        variance: with.variances.slope,
        slope: with.t_test(&[0.0, 1.0]),
        chi2,
        p: p.map(|(one, two)| 0.5 * (one + two)),
    })
}
