//! Linear mixed models: `lmm_model`, `lmm_vaf`, `lmm_vaf_slope`,
//! `lmm_vaf_crossed`, `slope_variance`, `lmm_crossed`, `lmm_variance`. All over the tested
//! realizations, including subjects who did not rate all of them.
//!
//! Of the models with VAF only `lmm_vaf_crossed` generalizes to other realizations:
//! it has a random effect of the realization besides VAF.

use super::cells::Cells;
use super::identifiers::group_id;
use super::values::{Group, Values};
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
    centre: f64,
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

/// Only `lmm_vaf_crossed`.
pub(super) fn only_crossed(cells: &Cells<'_>, values: &mut Values) {
    let data = Data::of(cells);
    let null = crossed_without_vaf(&data);
    vaf_crossed(
        cells,
        &data,
        crossed_with_vaf(&data).as_ref(),
        &null,
        values,
    );
}

pub(super) fn mixed(cells: &Cells<'_>, values: &mut Values) {
    let data = Data::of(cells);
    model(cells, &data, values);
    vaf(cells, &data, values);
    vaf_slope(cells, &data, values);
    let fitted = crossed_with_vaf(&data);
    let null = crossed_without_vaf(&data);
    vaf_crossed(cells, &data, fitted.as_ref(), &null, values);
    slope_variance(&data, fitted.as_ref(), values);
    crossed(cells, &data, &null, values);
    variance(&data, &null, values);
    share_of_vaf(values);
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
                    .filter_map(|&i| cells.ratings.vaf[i].zip(cells.centred[i]))
                    .collect();
                rows.sort_by(|a, b| a.0.total_cmp(&b.0));
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
        let centre = if with_vaf.is_empty() {
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
                .and_then(|t| t.with_fixed_effects(FixedEffects::Covariate { centre })),
            vaf_null,
            all,
            has_vaf: !with_vaf.is_empty(),
            repeats: with_vaf.iter().any(|c| c.n > 1),
            cells: with_vaf.len(),
            all_have_vaf,
            within_subjects: within_subjects(&with_vaf),
            centre,
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

fn likelihood(g: &mut Group<'_>, null: &LmmFit<'_>, full: &LmmFit<'_>, df: f64) {
    let chi2 = ratio(null, full);
    g.put("ml_deviance", full.deviance);
    g.put("ml_aic", full.aic());
    g.put("ml_bic", full.bic());
    g.put("lrt_chi2", chi2);
    g.maybe("lrt_p", chi2_upper(chi2, df));
}

fn model(cells: &Cells<'_>, data: &Data, values: &mut Values) {
    let found = (|| {
        let null = given(&data.all)?;
        let table = &null.with_fixed_effects(FixedEffects::Realizations)?;
        if table.realizations().len() < 2 {
            return Err(LmmError::OneRealization);
        }
        let random = RandomEffects::default();
        let reml = fit(table, random, Criterion::Reml)?;
        let ml = fit(table, random, Criterion::Ml)?;
        let null = fit(null, random, Criterion::Ml)?;
        let mut g = values.group("lmm_model", NO_DF);
        g.put("reml_deviance", reml.deviance);
        let v = reml.variances;
        g.put("var_subject", v.intercept);
        g.put("sigma2", v.error);
        g.put("icc_subject", v.intercept / (v.intercept + v.error));
        let df = table.realizations().len() as f64 - 1.0;
        likelihood(&mut g, &null, &ml, df);
        g.put("lrt_df", df);
        g.put("null_ml_deviance", null.deviance);
        let f = reml.f_test();
        g.maybe("satterthwaite_F", f.map(|f| f.f));
        g.maybe("satterthwaite_df2", f.and_then(|f| f.df2));
        g.maybe("satterthwaite_p", f.and_then(|f| f.p));
        let f = kenward_roger(&reml);
        let why = "the adjustment is undefined for so few ratings";
        g.put_or("kenward_roger_F", f.map(|f| f.f), why);
        g.put_or("kenward_roger_df2", f.and_then(|f| f.df2), why);
        g.put_or("kenward_roger_p", f.and_then(|f| f.p), why);
        let width = table.realizations().len();
        let contrasts: Vec<Vec<f64>> = (0..width)
            .map(|j| (0..width).map(|i| f64::from(u8::from(i == j))).collect())
            .collect();
        let means = reml.t_tests(&contrasts);
        for (&m, t) in table.realizations().iter().zip(means) {
            let mut g = values.group(group_id("lmm_model/emm", &[cells.model_name(m)]), NO_DF);
            g.put("estimate", t.estimate + cells.offset);
            g.put("se", t.se);
            let shift = |e: f64| e + cells.offset;
            g.interval("ci95", t.ci95.map(|(l, h)| (shift(l), shift(h))));
        }
        Ok(())
    })();
    if let Err(error) = found {
        let names = [
            "reml_deviance",
            "var_subject",
            "sigma2",
            "icc_subject",
            "ml_deviance",
            "ml_aic",
            "ml_bic",
            "lrt_chi2",
            "lrt_df",
            "lrt_p",
            "null_ml_deviance",
            "satterthwaite_F",
            "satterthwaite_df2",
            "satterthwaite_p",
            "kenward_roger_F",
            "kenward_roger_df2",
            "kenward_roger_p",
        ];
        values.group("lmm_model", error.to_string()).none(&names);
    }
}

const COVARIATE: [&str; 11] = [
    "reml_deviance",
    "sigma2",
    "intercept",
    "intercept_se",
    "slope",
    "slope_se",
    "slope_t",
    "slope_satterthwaite_df",
    "slope_satterthwaite_p",
    "slope_ci95_lo",
    "slope_ci95_hi",
];

/// Adds the intercept at a VAF and the slope with its test.
fn coefficients(g: &mut Group<'_>, fit: &LmmFit<'_>, at: f64, offset: f64) -> ContrastT {
    let tests = fit.t_tests(&[vec![1.0, at], vec![0.0, 1.0]]);
    let (intercept, slope) = (tests[0], tests[1]);
    g.put("reml_deviance", fit.deviance);
    g.put("sigma2", fit.variances.error);
    g.put("intercept", intercept.estimate + offset);
    g.put("intercept_se", intercept.se);
    g.put("slope", slope.estimate);
    g.put("slope_se", slope.se);
    g.maybe("slope_t", slope.t);
    g.maybe("slope_satterthwaite_df", slope.df);
    g.maybe("slope_satterthwaite_p", slope.p);
    g.interval("slope_ci95", slope.ci95);
    slope
}

fn vaf(cells: &Cells<'_>, data: &Data, values: &mut Values) {
    let found = (|| {
        let table = given(&data.vaf)?;
        let random = RandomEffects::default();
        let reml = fit(table, random, Criterion::Reml)?;
        let ml = fit(table, random, Criterion::Ml)?;
        let null = fit(given(&data.vaf_null)?, random, Criterion::Ml)?;
        let mut g = values.group("lmm_vaf", NO_DF);
        let slope = coefficients(&mut g, &reml, -data.centre, cells.offset);
        let v = reml.variances;
        g.put("var_subject", v.intercept);
        likelihood(&mut g, &null, &ml, 1.0);
        let explained = slope.estimate.powi(2) * table.covariate_variance();
        let total = explained + v.intercept + v.error;
        g.put("r2_marginal", explained / total);
        g.put("r2_conditional", (explained + v.intercept) / total);
        Ok(())
    })();
    let mut g = values.group("lmm_vaf", "no subject has two values of VAF");
    g.maybe("statsmodels_slope", data.within_subjects);
    if let Err(error) = found {
        let mut g = values.group("lmm_vaf", data.reason(error).to_string());
        g.none(&COVARIATE);
        g.none(&[
            "var_subject",
            "ml_deviance",
            "ml_aic",
            "ml_bic",
            "lrt_chi2",
            "lrt_p",
            "r2_marginal",
            "r2_conditional",
        ]);
    }
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

fn vaf_slope(cells: &Cells<'_>, data: &Data, values: &mut Values) {
    let found = (|| {
        let table = given(&data.vaf)?;
        let random = RandomEffects {
            slope: true,
            ..RandomEffects::default()
        };
        let reml = fit(table, random, Criterion::Reml)?;
        let mut g = values.group("lmm_vaf_slope", NO_DF);
        coefficients(&mut g, &reml, 0.0, cells.offset);
        let v = reml.variances;
        g.put("vaf_centre", data.centre);
        g.put("var_intercept", v.intercept);
        g.put("var_slope", v.slope);
        g.put("cov", v.covariance);
        g.put("singular", f64::from(u8::from(reml.singular)));
        Ok(())
    })();
    if let Err(error) = found {
        let mut g = values.group("lmm_vaf_slope", data.reason(error).to_string());
        g.none(&COVARIATE);
        g.none(&[
            "vaf_centre",
            "var_intercept",
            "var_slope",
            "cov",
            "singular",
        ]);
    }
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
    values: &mut Values,
) {
    let cell = data.repeats;
    let found = fitted.map(|reml| {
        let mut g = values.group("lmm_vaf_crossed", NO_DF);
        coefficients(&mut g, reml, -data.centre, cells.offset);
        let v = reml.variances;
        g.put("var_subject", v.intercept);
        g.put("var_model", v.realization);
        g.put("singular", f64::from(u8::from(reml.singular)));
        if cell {
            g.put("var_subject_model", v.cell);
        }
        // The share of VAF is relative to the same model without it: other terms would
        // attribute the interaction to VAF.
        match null {
            Ok(null) => g.put("var_model_without_vaf", null.variances.realization),
            Err(error) => g.put_or("var_model_without_vaf", None, &error.to_string()),
        }
    });
    if let Err(why) = found {
        let mut g = values.group("lmm_vaf_crossed", why.to_string());
        g.none(&COVARIATE);
        g.none(&[
            "var_subject",
            "var_model",
            "var_model_without_vaf",
            "singular",
        ]);
        if cell {
            g.none(&["var_subject_model"]);
        }
    }
}

/// Most cells for which the variance of the slopes is estimated: its matrices grow with
/// them.
const MAX_CELLS: usize = 1000;

/// The variance of the participants' slopes on VAF, beside the model without it.
fn slope_variance(data: &Data, without: Result<&LmmFit<'_>, &NotFitted>, values: &mut Values) {
    let found = match without {
        Err(why) => Err(why.to_string()),
        Ok(_) if data.cells > MAX_CELLS => Err(format!("more than {MAX_CELLS} cells")),
        Ok(without) => variance_of_slopes(without).map_err(|error| data.reason(error).to_string()),
    };
    let why = found.as_ref().err().cloned();
    let found = found.ok();
    let mut g = values.group("slope_variance", why.unwrap_or_else(|| NO_DF.to_owned()));
    g.maybe("variance", found.map(|f| f.variance));
    g.maybe("sd", found.map(|f| f.variance.sqrt()));
    g.maybe("chi2", found.map(|f| f.chi2));
    g.maybe("p", found.and_then(|f| f.p));
    g.maybe("slope", found.map(|f| f.slope.estimate));
    g.maybe("slope_se", found.map(|f| f.slope.se));
    g.interval("slope_ci95", found.and_then(|f| f.slope.ci95));
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
    values: &mut Values,
) {
    let found = (|| {
        let random = RandomEffects {
            realization: true,
            ..RandomEffects::default()
        };
        let reml = of_all(data, random, null)?;
        let mean = reml.t_test(&[1.0]);
        let mut g = values.group("lmm_crossed", NO_DF);
        g.put("reml_deviance", reml.deviance);
        g.put("intercept", mean.estimate + cells.offset);
        g.put("intercept_se", mean.se);
        g.put("var_subject", reml.variances.intercept);
        g.put("var_model", reml.variances.realization);
        g.put("sigma2", reml.variances.error);
        Ok::<(), LmmError>(())
    })();
    if let Err(error) = found {
        values.group("lmm_crossed", error.to_string()).none(&[
            "reml_deviance",
            "intercept",
            "intercept_se",
            "var_subject",
            "var_model",
            "sigma2",
        ]);
    }
}

/// Variance components: ~ 1 + (1|subject) + (1|model) + (1|subject:model).
fn variance<'a>(data: &'a Data, null: &Result<LmmFit<'a>, LmmError>, values: &mut Values) {
    let random = RandomEffects {
        realization: true,
        cell: true,
        ..RandomEffects::default()
    };
    let names = ["subject", "model", "subject_model", "error"];
    match of_all(data, random, null).map(|fit| fit.variances) {
        Ok(v) => {
            let parts = [v.intercept, v.realization, v.cell, v.error];
            let total: f64 = parts.iter().sum();
            let mut g = values.group("lmm_variance", "it overflows");
            for (name, part) in names.iter().zip(parts) {
                g.put(&format!("var_{name}"), part);
                g.put(&format!("share_{name}"), part / total);
            }
        }
        Err(error) => {
            let mut g = values.group("lmm_variance", error.to_string());
            for name in names {
                g.none(&[&format!("var_{name}"), &format!("share_{name}")]);
            }
        }
    }
}

/// The share of the variance between realizations that VAF explains in the crossed
/// model, with the same random terms and ratings. Negative if VAF explains less than
/// an unrelated covariate is expected to.
fn share_of_vaf(values: &mut Values) {
    let why = ["var_model", "var_model_without_vaf"]
        .iter()
        .find_map(|v| values.reason(&format!("lmm_vaf_crossed/{v}")))
        .unwrap_or("there is no variance between realizations to explain")
        .to_owned();
    let number = |v: &str| values.number(&format!("lmm_vaf_crossed/{v}"));
    let share = number("var_model")
        .zip(number("var_model_without_vaf"))
        .filter(|(_, without)| *without > 0.0)
        .map(|(with, without)| 1.0 - with / without);
    values
        .group("lmm_variance", why.clone())
        .maybe("model_share_of_vaf", share);
    values
        .group("corr/share", why)
        .maybe("var_model_crossed", share);
}
