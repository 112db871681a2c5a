//! Adjusted means (`adjusted/*`, `lmm_cells/*`): the marginal means of the mixed model
//! cell mean ~ realization + (1 | subject).
//!
//! Verdicts rest on them where cells are missing: they compare realizations as if the
//! same participants had rated all of them. In designs without a missing cell they are
//! the means over participants.

use super::cells::{Cell, Cells};
use super::design::Design;
use super::identifiers::group_id;
use super::values::Values;
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

pub(super) fn adjusted(cells: &Cells<'_>, found: &Adjusted, values: &mut Values) {
    let why = |error: &LmmError| error.to_string();
    let no_fit = found.fit.as_ref().err().map_or_else(String::new, why);
    let fit = found.fit.as_ref().ok();
    let mut g = values.group("lmm_cells", no_fit.clone());
    g.maybe("var_subject", fit.map(|f| f.variances.intercept));
    g.maybe("var_error", fit.map(|f| f.variances.error));
    g.maybe("connected", fit.map(|f| f64::from(u8::from(f.connected))));
    let f = fit.and_then(|f| f.effect);
    g.maybe("df1", f.map(|f| f.df1));
    g.maybe("F", f.map(|f| f.f));
    let flat = "the likelihood is too flat for degrees of freedom";
    let flat = if fit.is_some() { flat } else { &no_fit };
    g.put_or("df2", f.and_then(|f| f.df2), flat);
    g.put_or("p", f.and_then(|f| f.p), flat);
    let no_mean = found.means.as_ref().err().map_or_else(String::new, why);
    for (i, &m) in found.models.iter().enumerate() {
        let mean = found.means.as_ref().ok().map(|means| means[i]);
        let t = fit.map(|f| &f.means[i]);
        let mut g = values.group(group_id("adjusted", &[cells.model_name(m)]), flat);
        g.put_or("mean", mean.map(|x| x + cells.offset), &no_mean);
        g.put_or("se", t.map(|t| t.se), &no_fit);
        // About the mean above, from which the model's differs by rounding.
        let about = |(t, mean): (&ContrastT, f64)| {
            let shift = mean - t.estimate + cells.offset;
            t.ci95.map(|(low, high)| (low + shift, high + shift))
        };
        g.interval("ci95", t.zip(mean).and_then(about));
    }
}
