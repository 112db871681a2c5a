//! Linear mixed models: `lmm_model`, `lmm_vaf`, `lmm_vaf_slope`,
//! `lmm_vaf_crossed`, `slope_variance`, `lmm_crossed`, `lmm_variance`. All over the tested
//! realizations, including subjects who did not rate all of them.
//!
//! Of the models with VAF only `lmm_vaf_crossed` generalizes to other realizations:
//! it has a random effect of the realization besides VAF.

mod records;

pub use records::{
    Coefficients, Likelihood, LmmCrossed, LmmModel, LmmVaf, LmmVafCrossed, LmmVafSlope,
    LmmVariance, MarginalMean, Mixed, SlopeVariance,
};

use super::cells::Cells;
use super::record::{Interval, Number as _, RealizationName, Stat, Why};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_stats::describe::{mean, sum_of_squares};
use study_stats::distribution::chi2_upper;
use study_stats::lmm::{
    CellSummary, ContrastT, Criterion, FixedEffects, LmmData, LmmError, LmmFit, RandomEffects, fit,
    kenward_roger, slope_variance as variance_of_slopes,
};
use thiserror::Error;

/// The data of the models.
struct Data {
    /// All tested realizations.
    all: Result<LmmData, LmmError>,
    /// The tested realizations with a VAF, with the covariate VAF.
    vaf: Result<LmmData, LmmError>,
    /// The same without the covariate.
    vaf_null: Result<LmmData, LmmError>,
    /// Whether any realization has a VAF.
    has_vaf: bool,
    /// Whether a cell with a VAF has two ratings.
    repeats: bool,
    /// The number of cells with a VAF.
    cells: usize,
    /// Whether all tested realizations have a VAF: then `all` is `vaf_null`.
    all_have_vaf: bool,
    /// The slope on VAF with fixed effects of the subjects.
    within_subjects: Option<f64>,
    /// Mean VAF over realizations, or over rows if each row has its own; 0 without VAF.
    center: f64,
    /// Whether VAF differs between the rows of a realization.
    by_row: bool,
}

/// Why a model with VAF is not fitted.
#[derive(Debug, Clone, Copy, Error)]
enum NotFitted {
    #[error("no test realization has a VAF")]
    NoVaf,
    #[error("VAF differs between the ratings of one realization")]
    VafByRow,
    #[error("VAF does not vary, or overflows")]
    ConstantVaf,
    #[error("fewer than three realizations with a VAF")]
    FewRealizations,
    #[error("no subject rated two realizations with different VAF")]
    NoSlope,
    #[error(transparent)]
    Estimation(#[from] LmmError),
}

/// All mixed models: those that only describe, and those on which findings rest.
pub(super) struct Fitted {
    pub(super) mixed: Mixed,
    pub(super) crossed: LmmVafCrossed,
    pub(super) variance: LmmVariance,
}

/// Only `lmm_vaf_crossed`.
pub(super) fn only_crossed(cells: &Cells<'_>) -> LmmVafCrossed {
    let data = Data::of(cells);
    let null = crossed_without_vaf(&data);
    vaf_crossed(cells, &data, crossed_with_vaf(&data).as_ref(), &null)
}

pub(super) fn mixed(cells: &Cells<'_>) -> Fitted {
    let data = Data::of(cells);
    let fitted = crossed_with_vaf(&data);
    let null = crossed_without_vaf(&data);
    let of_crossed = vaf_crossed(cells, &data, fitted.as_ref(), &null);
    let mixed = Mixed {
        model: model(cells, &data).unwrap_or_else(|e| LmmModel::undefined(e.to_string())),
        vaf: vaf(cells, &data),
        vaf_slope: vaf_slope(cells, &data)
            .unwrap_or_else(|e| LmmVafSlope::undefined(data.reason(e).to_string())),
        slope_variance: slope_variance(&data, fitted.as_ref()),
        crossed: crossed(cells, &data, &null)
            .unwrap_or_else(|e| LmmCrossed::undefined(e.to_string())),
    };
    Fitted {
        mixed,
        variance: variance(&data, &null, share_of_vaf(&of_crossed)),
        crossed: of_crossed,
    }
}

impl Data {
    fn of(cells: &Cells<'_>) -> Self {
        let models = cells.tested();
        let own: Vec<_> = (cells.cells.iter())
            .filter(|c| models.binary_search(&c.model).is_ok())
            .collect();
        let of_rows = |subject, realization, x, rows: &[f64]| -> Option<CellSummary> {
            Some(CellSummary {
                subject,
                realization,
                x,
                n: rows.len(),
                mean: mean(rows)?,
                within: sum_of_squares(rows)?,
            })
        };
        let all: Vec<CellSummary> = own.iter().filter_map(|c| c.summary()).collect();
        let vafs: Vec<f64> = models.iter().filter_map(|&m| cells.vaf[m]).collect();
        let by_row = vafs.is_empty();
        let mut with_vaf: Vec<CellSummary> = Vec::new();
        if by_row {
            for c in &own {
                let mut rows: Vec<(f64, f64)> = cells.order[c.rows.clone()]
                    .iter()
                    .filter_map(|&i| cells.ratings.vaf[i].zip(cells.centered[i]))
                    .collect();
                rows.small_sort_by(|a, b| a.0.total_cmp(&b.0));
                for same in rows.chunk_by(|a, b| a.0 == b.0) {
                    let ratings: Vec<f64> = same.iter().map(|r| r.1).collect();
                    with_vaf.extend(of_rows(c.subject, c.model, same[0].0, &ratings));
                }
            }
        } else {
            with_vaf.extend(
                all.iter()
                    .filter_map(|c| cells.vaf[c.realization].map(|x| CellSummary { x, ..*c })),
            );
        }
        let center = if with_vaf.is_empty() {
            0.0
        } else if by_row {
            let n: f64 = with_vaf.iter().map(|c| c.n as f64).sum();
            with_vaf.iter().map(|c| c.x * c.n as f64).sum::<f64>() / n
        } else {
            let mut rated: Vec<usize> = with_vaf.iter().map(|c| c.realization).collect();
            rated.sort_unstable();
            rated.dedup();
            let rated: Vec<f64> = rated.iter().filter_map(|&m| cells.vaf[m]).collect();
            mean(&rated).unwrap_or(0.0)
        };
        let vaf_null = LmmData::new(&with_vaf, FixedEffects::Intercept);
        // If every realization has a VAF, the ratings are the same.
        let all_have_vaf = all.len() == with_vaf.len() && !by_row;
        let all = if all_have_vaf {
            vaf_null.clone()
        } else {
            LmmData::new(&all, FixedEffects::Intercept)
        };
        Self {
            vaf: (vaf_null.clone())
                .and_then(|t| t.with_fixed_effects(FixedEffects::Covariate { center })),
            vaf_null,
            all,
            has_vaf: !with_vaf.is_empty(),
            repeats: with_vaf.iter().any(|c| c.n > 1),
            cells: with_vaf.len(),
            all_have_vaf,
            within_subjects: within_subjects(&with_vaf),
            center,
            by_row: by_row && !with_vaf.is_empty(),
        }
    }
}

/// Borrows a table or copies its error.
fn given(table: &Result<LmmData, LmmError>) -> Result<&LmmData, LmmError> {
    table.as_ref().map_err(|e| *e)
}

impl Data {
    /// Why a model with VAF is not fitted, given the error of its table or fit.
    fn reason(&self, error: LmmError) -> NotFitted {
        match error {
            _ if !self.has_vaf => NotFitted::NoVaf,
            LmmError::ConstantCovariate => NotFitted::ConstantVaf,
            LmmError::FewRealizations => NotFitted::FewRealizations,
            LmmError::NoSlope => NotFitted::NoSlope,
            other => other.into(),
        }
    }
}

const NO_DF: &str = "the likelihood is too flat for degrees of freedom";

/// −2 log likelihood ratio, at least 0.
fn ratio(null: &LmmFit<'_>, full: &LmmFit<'_>) -> f64 {
    (null.deviance - full.deviance).max(0.0)
}

fn likelihood(null: &LmmFit<'_>, full: &LmmFit<'_>, df: f64) -> Likelihood {
    let chi2 = ratio(null, full);
    Likelihood {
        ml_deviance: Stat::of(full.deviance),
        ml_aic: Stat::of(full.aic()),
        ml_bic: Stat::of(full.bic()),
        lrt_chi2: Stat::of(chi2),
        lrt_p: Stat::or(chi2_upper(chi2, df), NO_DF),
    }
}

fn model(cells: &Cells<'_>, data: &Data) -> Result<LmmModel, LmmError> {
    let null = given(&data.all)?;
    let table = &null.with_fixed_effects(FixedEffects::Realizations)?;
    let width = table.realizations().len();
    if width < 2 {
        return Err(LmmError::OneRealization);
    }
    let random = RandomEffects::default();
    let reml = fit(table, random, Criterion::Reml)?;
    let ml = fit(table, random, Criterion::Ml)?;
    let null = fit(null, random, Criterion::Ml)?;
    let v = reml.variances;
    let df = width as f64 - 1.0;
    let by_satterthwaite = reml.f_test();
    let by_kenward_roger = kenward_roger(&reml);
    let few = "the adjustment is undefined for so few ratings";
    Ok(LmmModel {
        reml_deviance: Stat::of(reml.deviance),
        var_subject: Stat::of(v.intercept),
        sigma2: Stat::of(v.error),
        icc_subject: Stat::of(v.intercept / (v.intercept + v.error)),
        likelihood: likelihood(&null, &ml, df),
        lrt_df: Stat::of(df),
        null_ml_deviance: Stat::of(null.deviance),
        satterthwaite_f: Stat::or(by_satterthwaite.map(|f| f.f), NO_DF),
        satterthwaite_df2: Stat::or(by_satterthwaite.and_then(|f| f.df2), NO_DF),
        satterthwaite_p: Stat::or(by_satterthwaite.and_then(|f| f.p), NO_DF),
        kenward_roger_f: Stat::or(by_kenward_roger.map(|f| f.f), few),
        kenward_roger_df2: Stat::or(by_kenward_roger.and_then(|f| f.df2), few),
        kenward_roger_p: Stat::or(by_kenward_roger.and_then(|f| f.p), few),
        emm: marginal_means(cells, &reml, table.realizations()),
    })
}

fn marginal_means(
    cells: &Cells<'_>,
    fit: &LmmFit<'_>,
    realizations: &[usize],
) -> BTreeMap<RealizationName, MarginalMean> {
    let width = realizations.len();
    let contrasts: Vec<Vec<f64>> = (0..width)
        .map(|j| (0..width).map(|i| f64::from(u8::from(i == j))).collect())
        .collect();
    let all = realizations.iter().zip(fit.t_tests(&contrasts));
    all.map(|(&m, t)| {
        let shift = |e: f64| e + cells.offset;
        let mean = MarginalMean {
            estimate: Stat::of(shift(t.estimate)),
            se: Stat::of(t.se),
            ci95: Interval::or(t.ci95.map(|(l, h)| (shift(l), shift(h))), NO_DF),
        };
        (cells.model_name(m).into(), mean)
    })
    .collect()
}

/// The intercept at a VAF, and the slope with its test.
fn coefficients(fit: &LmmFit<'_>, at: f64, offset: f64) -> (Coefficients, ContrastT) {
    let tests = fit.t_tests(&[vec![1.0, at], vec![0.0, 1.0]]);
    let (intercept, slope) = (tests[0], tests[1]);
    let coefficients = Coefficients {
        reml_deviance: Stat::of(fit.deviance),
        sigma2: Stat::of(fit.variances.error),
        intercept: Stat::of(intercept.estimate + offset),
        intercept_se: Stat::of(intercept.se),
        slope: Stat::of(slope.estimate),
        slope_se: Stat::of(slope.se),
        slope_t: Stat::or(slope.t, NO_DF),
        slope_satterthwaite_df: Stat::or(slope.df, NO_DF),
        slope_satterthwaite_p: Stat::or(slope.p, NO_DF),
        slope_ci95: Interval::or(slope.ci95, NO_DF),
    };
    (coefficients, slope)
}

fn vaf(cells: &Cells<'_>, data: &Data) -> LmmVaf {
    let found = fitted_vaf(cells, data);
    let within = Stat::or(data.within_subjects, "no subject has two values of VAF");
    LmmVaf {
        statsmodels_slope: within,
        ..found.unwrap_or_else(|error| LmmVaf::undefined(data.reason(error).to_string()))
    }
}

fn fitted_vaf(cells: &Cells<'_>, data: &Data) -> Result<LmmVaf, LmmError> {
    let table = given(&data.vaf)?;
    let random = RandomEffects::default();
    let reml = fit(table, random, Criterion::Reml)?;
    let ml = fit(table, random, Criterion::Ml)?;
    let null = fit(given(&data.vaf_null)?, random, Criterion::Ml)?;
    let (coefficients, slope) = coefficients(&reml, -data.center, cells.offset);
    let v = reml.variances;
    let explained = slope.estimate.powi(2) * table.covariate_variance();
    let total = explained + v.intercept + v.error;
    Ok(LmmVaf {
        coefficients,
        var_subject: Stat::of(v.intercept),
        likelihood: likelihood(&null, &ml, 1.0),
        r2_marginal: Stat::of(explained / total),
        r2_conditional: Stat::of((explained + v.intercept) / total),
        ..LmmVaf::undefined("")
    })
}

/// The slope with fixed effects of the subjects, Σn(x − x̄ₛ)(y − ȳₛ)/Σn(x − x̄ₛ)²: the
/// limit of the mixed model's slope for a large subject variance.
fn within_subjects(cells: &[CellSummary]) -> Option<f64> {
    let (mut xx, mut xy, mut scale) = (0.0, 0.0, 0.0f64);
    for own in cells.chunk_by(|a, b| a.subject == b.subject) {
        let n: f64 = own.iter().map(|c| c.n as f64).sum();
        let about =
            |f: fn(&CellSummary) -> f64| own.iter().map(|c| c.n as f64 * f(c)).sum::<f64>() / n;
        let (mx, my) = (about(|c| c.x), about(|c| c.mean));
        for c in own {
            xx += c.n as f64 * (c.x - mx).powi(2);
            xy += c.n as f64 * (c.x - mx) * (c.mean - my);
            scale = scale.max(c.x.abs());
        }
    }
    (xx > 1e-24 * scale * scale)
        .then(|| xy / xx)
        .filter(|b| b.is_finite())
}

fn vaf_slope(cells: &Cells<'_>, data: &Data) -> Result<LmmVafSlope, LmmError> {
    let table = given(&data.vaf)?;
    let random = RandomEffects {
        slope: true,
        ..RandomEffects::default()
    };
    let reml = fit(table, random, Criterion::Reml)?;
    let v = reml.variances;
    Ok(LmmVafSlope {
        coefficients: coefficients(&reml, 0.0, cells.offset).0,
        vaf_centre: Stat::of(data.center),
        var_intercept: Stat::of(v.intercept),
        var_slope: Stat::of(v.slope),
        cov: Stat::of(v.covariance),
        singular: Stat::flag(reml.singular),
    })
}

/// rating ~ VAF + (1 | subject) + (1 | realization) [+ (1 | cell)], by REML.
fn crossed_with_vaf(data: &Data) -> Result<LmmFit<'_>, NotFitted> {
    if data.by_row {
        return Err(NotFitted::VafByRow);
    }
    let fitted = given(&data.vaf)
        .and_then(|table| fit(table, RandomEffects::crossed(table), Criterion::Reml));
    fitted.map_err(|error| data.reason(error))
}

/// The same without VAF, over the same ratings.
fn crossed_without_vaf(data: &Data) -> Result<LmmFit<'_>, LmmError> {
    let table = given(&data.vaf_null)?;
    fit(table, RandomEffects::crossed(table), Criterion::Reml)
}

fn vaf_crossed(
    cells: &Cells<'_>,
    data: &Data,
    fitted: Result<&LmmFit<'_>, &NotFitted>,
    null: &Result<LmmFit<'_>, LmmError>,
) -> LmmVafCrossed {
    let reml = match fitted {
        Ok(reml) => reml,
        Err(why) => {
            let why = Why::from(why.to_string());
            return LmmVafCrossed {
                var_subject_model: data.repeats.then(|| Stat::missing(why.clone())),
                ..LmmVafCrossed::undefined(why)
            };
        }
    };
    let v = reml.variances;
    LmmVafCrossed {
        coefficients: coefficients(reml, -data.center, cells.offset).0,
        var_subject: Stat::of(v.intercept),
        var_model: Stat::of(v.realization),
        var_subject_model: data.repeats.then(|| Stat::of(v.cell)),
        // The share of VAF is relative to the same model without it: other terms would
        // attribute the interaction to VAF.
        var_model_without_vaf: match null {
            Ok(null) => Stat::of(null.variances.realization),
            Err(error) => Stat::missing(error.to_string()),
        },
        singular: Stat::flag(reml.singular),
    }
}

/// Most cells for which the variance of the slopes is estimated: its matrices grow with
/// them.
const MAX_CELLS: usize = 1000;

/// The variance of the participants' slopes on VAF, beside the model without it.
fn slope_variance(data: &Data, without: Result<&LmmFit<'_>, &NotFitted>) -> SlopeVariance {
    let found = match without {
        Err(why) => Err(why.to_string()),
        Ok(_) if data.cells > MAX_CELLS => Err(format!("more than {MAX_CELLS} cells")),
        Ok(without) => variance_of_slopes(without).map_err(|error| data.reason(error).to_string()),
    };
    match found {
        Err(why) => SlopeVariance::undefined(why),
        Ok(found) => SlopeVariance {
            variance: Stat::of(found.variance),
            sd: Stat::of(found.variance.sqrt()),
            chi2: Stat::of(found.chi2),
            p: Stat::or(found.p, NO_DF),
            slope: Stat::of(found.slope.estimate),
            slope_se: Stat::of(found.slope.se),
            slope_ci95: Interval::or(found.slope.ci95, NO_DF),
        },
    }
}

/// A model of all ratings, unless it is `null`: then it is not fitted again.
fn of_all<'a>(
    data: &'a Data,
    random: RandomEffects,
    null: &Result<LmmFit<'a>, LmmError>,
) -> Result<LmmFit<'a>, LmmError> {
    let table = given(&data.all)?;
    if data.all_have_vaf && random == RandomEffects::crossed(table) {
        return null.clone();
    }
    fit(table, random, Criterion::Reml)
}

fn crossed<'a>(
    cells: &Cells<'_>,
    data: &'a Data,
    null: &Result<LmmFit<'a>, LmmError>,
) -> Result<LmmCrossed, LmmError> {
    let random = RandomEffects {
        realization: true,
        ..RandomEffects::default()
    };
    let reml = of_all(data, random, null)?;
    let mean = reml.t_test(&[1.0]);
    Ok(LmmCrossed {
        reml_deviance: Stat::of(reml.deviance),
        intercept: Stat::of(mean.estimate + cells.offset),
        intercept_se: Stat::of(mean.se),
        var_subject: Stat::of(reml.variances.intercept),
        var_model: Stat::of(reml.variances.realization),
        sigma2: Stat::of(reml.variances.error),
    })
}

/// Variance components: ~ 1 + (1|subject) + (1|model) + (1|subject:model).
fn variance<'a>(
    data: &'a Data,
    null: &Result<LmmFit<'a>, LmmError>,
    model_share_of_vaf: Stat,
) -> LmmVariance {
    let random = RandomEffects {
        realization: true,
        cell: true,
        ..RandomEffects::default()
    };
    let v = match of_all(data, random, null).map(|fit| fit.variances) {
        Ok(v) => v,
        Err(error) => {
            return LmmVariance {
                model_share_of_vaf,
                ..LmmVariance::undefined(error.to_string())
            };
        }
    };
    let total: f64 = [v.intercept, v.realization, v.cell, v.error].iter().sum();
    LmmVariance {
        var_subject: Stat::of(v.intercept),
        share_subject: Stat::of(v.intercept / total),
        var_model: Stat::of(v.realization),
        share_model: Stat::of(v.realization / total),
        var_subject_model: Stat::of(v.cell),
        share_subject_model: Stat::of(v.cell / total),
        var_error: Stat::of(v.error),
        share_error: Stat::of(v.error / total),
        model_share_of_vaf,
    }
}

/// The share of the variance between realizations that VAF explains in the crossed
/// model, with the same random terms and ratings. Negative if VAF explains less than
/// an unrelated covariate is expected to.
fn share_of_vaf(crossed: &LmmVafCrossed) -> Stat {
    let (with, without) = (&crossed.var_model, &crossed.var_model_without_vaf);
    let why = with.reason().or_else(|| without.reason());
    let why = why.unwrap_or("there is no variance between realizations to explain");
    let share = (with.number().zip(without.number()))
        .filter(|(_, without)| *without > 0.0)
        .map(|(with, without)| 1.0 - with / without);
    Stat::or(share, why.to_owned())
}
