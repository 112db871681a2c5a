//! Adjusted means (`adjusted/*`, `lmm_cells/*`): the marginal means of the mixed model
//! cell mean ~ realization + (1 | subject).
//!
//! Verdicts rest on them where cells are missing: they compare realizations as if the
//! same participants had rated all of them. In designs without a missing cell they are
//! the means over participants.

use super::cells::{Cell, Cells};
use super::design::Design;
use super::record::{Interval, RealizationName, Stat, Why, statistics};
use std::collections::BTreeMap;
use study_stats::describe::mean;
use study_stats::lmm::{AdjustedMeans, ContrastT, FixedEffects, LmmData, LmmError, adjusted_means};

/// Most realizations that are compared pair by pair.
pub(super) const MAX_COMPARED: usize = 60;

/// The means on which verdicts rest, less [`Cells::offset`].
#[derive(Debug)]
pub(super) struct Adjusted {
    pub(super) design: Design,
    /// Indices of the realizations.
    pub(super) models: Vec<usize>,
    /// Their means, or why there are none.
    pub(super) means: Result<Vec<f64>, LmmError>,
    /// The fitted model.
    pub(super) fit: Result<AdjustedMeans, LmmError>,
}

impl Adjusted {
    pub(super) fn of(cells: &Cells<'_>) -> Self {
        let models = cells.tested();
        let design = Design::of(cells);
        let fit = fitted(cells, &models);
        let by_model = cells.subject_means();
        let raw = || (models.iter()).map(|&m| mean(&by_model[m]).ok_or(LmmError::NoData));
        let means = match &fit {
            // To the last bit, also where the model has no fit.
            _ if design.is_complete() => raw().collect(),
            Err(LmmError::ConstantRatings | LmmError::OneRealization) => raw().collect(),
            Err(error) => Err(*error),
            Ok(fit) => Ok(fit.means.iter().map(|t| t.estimate).collect()),
        };
        Self {
            design,
            models,
            means,
            fit,
        }
    }
}

fn fitted(cells: &Cells<'_>, models: &[usize]) -> Result<AdjustedMeans, LmmError> {
    let own = (cells.cells.iter())
        .filter(|c| models.binary_search(&c.model).is_ok())
        .filter_map(Cell::summary);
    let table = LmmData::new(&own.collect::<Vec<_>>(), FixedEffects::Intercept)?;
    let found = adjusted_means(&table)?;
    if found.realizations == models {
        Ok(found)
    } else {
        Err(LmmError::NoData)
    }
}

statistics! {
    /// Cell mean ~ realization + (1|subject) of the test realizations, by restricted maximum likelihood, F with Satterthwaite's degrees of freedom, means and differences with Kenward and Roger's. Each cell counts once, because its ratings are not independent. If no cell is missing, F is that of `rmanova`.
    pub struct CellModel {
        /// variance of the subjects
        var_subject: Stat,
        /// variance of the error
        var_error: Stat,
        /// 0 if participants do not link all realizations, so that some differences compare different participants only
        connected: Stat,
        /// realizations less one
        df1: Stat,
        /// of the differences between realizations
        f: Stat as "F",
        /// Satterthwaite's
        df2: Stat,
        /// of `F`
        p: Stat,
    }

    /// The marginal mean of a realization in the model of cells; if no cell is missing, `desc/M/subject_mean/mean`.
    pub struct AdjustedMean {
        /// the mean
        mean: Stat,
        /// its standard error
        se: Stat,
        /// its interval
        ci95: Interval,
    }

    /// The means on which verdicts rest.
    pub struct AdjustedCells {
        /// the model of cell means
        model: CellModel as "lmm_cells",
        /// the mean of each test realization
        means: BTreeMap<RealizationName, AdjustedMean> as "adjusted",
    }
}

pub(super) fn adjusted(cells: &Cells<'_>, found: &Adjusted) -> AdjustedCells {
    let why = |error: &LmmError| Why::from(error.to_string());
    let no_fit = found.fit.as_ref().err().map_or_else(Why::default, why);
    let no_mean = found.means.as_ref().err().map_or_else(Why::default, why);
    let fit = found.fit.as_ref().ok();
    let flat = match fit {
        Some(_) => "the likelihood is too flat for degrees of freedom".into(),
        None => no_fit.clone(),
    };
    let of_fit = |x: Option<f64>| Stat::or(x, no_fit.clone());
    let f = fit.and_then(|f| f.effect);
    let model = CellModel {
        var_subject: of_fit(fit.map(|f| f.variances.intercept)),
        var_error: of_fit(fit.map(|f| f.variances.error)),
        connected: of_fit(fit.map(|f| f64::from(u8::from(f.connected)))),
        df1: of_fit(f.map(|f| f.df1)),
        f: of_fit(f.map(|f| f.f)),
        df2: Stat::or(f.and_then(|f| f.df2), flat.clone()),
        p: Stat::or(f.and_then(|f| f.p), flat.clone()),
    };
    let means = found.models.iter().enumerate().map(|(i, &m)| {
        let mean = found.means.as_ref().ok().map(|means| means[i]);
        let t = fit.map(|f| &f.means[i]);
        // About the mean above, from which the model's differs by rounding.
        let about = |(t, mean): (&ContrastT, f64)| {
            let shift = mean - t.estimate + cells.offset;
            t.ci95.map(|(low, high)| (low + shift, high + shift))
        };
        let own = AdjustedMean {
            mean: Stat::or(mean.map(|x| x + cells.offset), no_mean.clone()),
            se: of_fit(t.map(|t| t.se)),
            ci95: Interval::or(t.zip(mean).and_then(about), flat.clone()),
        };
        (cells.model_name(m).into(), own)
    });
    AdjustedCells {
        means: means.collect(),
        model,
    }
}
