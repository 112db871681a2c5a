//! Adjusted means: marginal means of the mixed model cell mean ~ realization +
//! (1 | subject), by restricted maximum likelihood (`adjusted/*`, `lmm_cells/*`).
//!
//! The model is fitted to cell means, so that repetitions of a cell do not count as
//! independent. Where every participant rated every realization, the adjusted means
//! equal the means over participants, and F that of the analysis of variance. Where
//! cells are missing, they compare realizations as if the same participants had rated
//! all of them.

use super::cells::Cells;
use super::design::Design;
use super::identifiers::group_id;
use super::values::Values;
use study_stats::describe::mean;
use study_stats::lmm::{
    CellSummary, ContrastF, ContrastT, Criterion, FixedEffects, LmmData, LmmError, RandomEffects,
    VarianceComponents, fit,
};

/// Most realizations that are compared pair by pair.
pub(super) const MAX_COMPARED: usize = 60;

/// The means on which verdicts rest, less [`Cells::offset`].
#[derive(Debug)]
pub(super) struct Adjusted {
    pub(super) design: Design,
    /// Indices of the realizations.
    pub(super) models: Vec<usize>,
    /// Their adjusted means, or why there are none.
    pub(super) means: Result<Vec<f64>, LmmError>,
    fit: Result<CellFit, LmmError>,
}

#[derive(Debug)]
struct CellFit {
    means: Vec<ContrastT>,
    f: Option<ContrastF>,
    variances: VarianceComponents,
    /// First minus second, by position; only where the mixed model decides.
    pairs: Vec<(usize, usize, ContrastT)>,
}

impl Adjusted {
    pub(super) fn of(cells: &Cells<'_>) -> Self {
        let models = cells.tested();
        let design = Design::of(cells);
        let fit = fitted(cells, design, &models);
        let by_model = cells.subject_means();
        let raw = || (models.iter()).map(|&m| mean(&by_model[m]).ok_or(LmmError::NoData));
        let means = match &fit {
            // Equal to the last bit, also where the model has no fit.
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

    /// The differences of the pairs of realizations by the mixed model: first minus
    /// second, by position in [`Self::models`].
    pub(super) fn pairs(&self) -> Result<&[(usize, usize, ContrastT)], LmmError> {
        self.fit.as_ref().map(|f| &f.pairs[..]).map_err(|e| *e)
    }
}

fn fitted(cells: &Cells<'_>, design: Design, models: &[usize]) -> Result<CellFit, LmmError> {
    let own = (cells.cells.iter())
        .filter(|c| models.binary_search(&c.model).is_ok() && c.mean.is_finite())
        .map(|c| CellSummary {
            subject: c.subject,
            realization: c.model,
            x: 0.0,
            n: 1,
            mean: c.mean,
            within: 0.0,
        });
    let table = LmmData::new(&own.collect::<Vec<_>>(), FixedEffects::Realizations)?;
    let k = table.realizations().len();
    if k < 2 {
        return Err(LmmError::OneRealization);
    }
    let reml = fit(&table, RandomEffects::default(), Criterion::Reml)?;
    let unit = |i: usize| {
        let mut l = vec![0.0; k];
        l[i] = 1.0;
        l
    };
    let mut places = Vec::new();
    if !design.uses_complete() && k <= MAX_COMPARED {
        places.extend((0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b))));
    }
    let differences: Vec<Vec<f64>> = (places.iter())
        .map(|&(a, b)| {
            let mut l = unit(a);
            l[b] = -1.0;
            l
        })
        .collect();
    let means: Vec<Vec<f64>> = (0..k).map(unit).collect();
    Ok(CellFit {
        means: reml.t_tests(&means),
        f: reml.f_test(),
        variances: reml.variances,
        pairs: (places.into_iter().zip(reml.t_tests(&differences)))
            .map(|((a, b), t)| (a, b, t))
            .collect(),
    })
}

pub(super) fn adjusted(cells: &Cells<'_>, found: &Adjusted, values: &mut Values) {
    let why = |error: &LmmError| error.to_string();
    let no_fit = found.fit.as_ref().err().map_or_else(String::new, why);
    let fit = found.fit.as_ref().ok();
    let mut g = values.group("lmm_cells", no_fit.clone());
    g.maybe("var_subject", fit.map(|f| f.variances.intercept));
    g.maybe("var_error", fit.map(|f| f.variances.error));
    let f = fit.and_then(|f| f.f);
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
        let id = group_id("adjusted", &[cells.model_name(m)]);
        let mut g = values.group(id, no_mean.clone());
        g.maybe("mean", mean.map(|x| x + cells.offset));
        g.put_or("se", t.map(|t| t.se), &no_fit);
        let ends = t.and_then(|t| t.ci95).zip(t.zip(mean));
        // About the mean that is printed: in complete designs it has no rounding error.
        let shift = |(t, mean): (&ContrastT, f64)| mean - t.estimate + cells.offset;
        let ends = ends.map(|((low, high), at)| (low + shift(at), high + shift(at)));
        let mut g = values.group(group_id("adjusted", &[cells.model_name(m)]), flat);
        g.interval("ci95", ends);
    }
}
