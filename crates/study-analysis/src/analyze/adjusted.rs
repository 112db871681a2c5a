//! Adjusted means (`adjusted/*`, `within_cells/*`): what a mean participant would rate, by the model
//! cell mean ~ realization + subject. Beside it the mixed model with random subjects (`lmm_cells/*`).
//!
//! Verdicts rest on them where cells are missing: realizations are compared within
//! participants, so that it does not matter who rated which of them. A mixed model would also compare
//! participants with each other, which shows their severity where groups rated different
//! realizations. In designs without a missing cell they are the means over participants.

use super::cells::{Cell, Cells};
use super::design::Design;
use super::record::{Interval, RealizationName, Stat, Why, statistics};
use std::collections::BTreeMap;
use study_stats::describe::mean;
use study_stats::lmm::{
    AdjustedMeans, CellSummary, ContrastT, FixedEffects, LmmData, LmmError, adjusted_means,
};
use study_stats::within::{Clustered, Within, WithinError};

/// Most realizations that are compared pair by pair.
pub(super) const MAX_COMPARED: usize = 60;

/// The means on which verdicts rest, less [`Cells::offset`].
#[derive(Debug)]
pub(super) struct Adjusted {
    pub(super) design: Design,
    /// Indices of the realizations.
    pub(super) models: Vec<usize>,
    /// Their means, or why there are none.
    pub(super) means: Result<Vec<f64>, WithinError>,
    /// The comparison within participants.
    pub(super) within: Result<Within, WithinError>,
    /// The same with standard errors clustered by participant, on which verdicts rest where more than one in ten participants
    /// would be left out. `None` elsewhere, and where there are too many realizations or participants.
    pub(super) clustered: Option<Clustered>,
    /// The mixed model, for the standard errors of means.
    pub(super) fit: Result<AdjustedMeans, LmmError>,
}

/// Differences of realizations whose variances differ by this factor at most are taken as equally precise.
const MOST_UNLIKE: f64 = 1.2;

impl Adjusted {
    /// Whether the design makes the means of all realizations with a covariate about equally precise.
    pub(super) fn is_balanced(&self, covariate: &[Option<f64>]) -> bool {
        match &self.within {
            Ok(within) => within.precision_ratio(|at| covariate[at].is_some()) <= MOST_UNLIKE,
            Err(_) => self.design.is_complete(),
        }
    }

    pub(super) fn of(cells: &Cells<'_>) -> Self {
        let models = cells.tested();
        let design = Design::of(cells);
        let own: Vec<CellSummary> = (cells.cells.iter())
            .filter(|c| models.binary_search(&c.model).is_ok())
            .filter_map(Cell::summary)
            .collect();
        let fit = fitted(&own, &models);
        let within = Within::of(&own).and_then(|found| match found.realizations == models {
            true => Ok(found),
            false => Err(WithinError::Overflow),
        });
        let clustered = (within.is_ok() && !design.uses_complete())
            .then(|| Clustered::of(&own).ok())
            .flatten();
        let by_model = cells.subject_means();
        let raw = || (models.iter()).map(|&m| mean(&by_model[m]).ok_or(WithinError::NoData));
        let means = match &within {
            // To the last bit.
            _ if design.is_complete() => raw().collect(),
            Err(WithinError::OneRealization) => raw().collect(),
            Err(error) => Err(*error),
            // Nothing makes them comparable: as they are.
            Ok(found) if !found.is_connected() => raw().collect(),
            Ok(found) => Ok(found.means.clone()),
        };
        Self {
            design,
            models,
            means,
            within,
            clustered,
            fit,
        }
    }
}

fn fitted(own: &[CellSummary], models: &[usize]) -> Result<AdjustedMeans, LmmError> {
    let table = LmmData::new(own, FixedEffects::Intercept)?;
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

    /// Cell mean ~ realization + subject of the test realizations by least squares, with both as fixed factors: realizations are compared within participants only (the intrablock analysis of Yates 1936), so that it does not matter whether severe participants rated other realizations than lenient ones. Each cell counts once. If no cell is missing, F is that of `rmanova`.
    pub struct WithinCells {
        /// sets of realizations that participants link, directly or by way of others; differences between sets cannot be told
        sets: Stat,
        /// variance of a cell mean about the model
        var_error: Stat,
        /// realizations less sets
        df1: Stat,
        /// of the differences between realizations of a set
        f: Stat as "F",
        /// cells less participants less `df1`
        df2: Stat,
        /// of `F`
        p: Stat,
    }

    /// The differences of `within_cells`, where more than one in ten participants did not rate every realization, without the assumption that errors have one variance and do not depend on each other within a participant. Their covariance is clustered by participant (CR2, Bell & McCaffrey 2002; Pustejovsky & Tipton 2018); F is the sum of squares of the differences, uncorrelated and of one variance if cells are, over its expectation by that covariance; Box's (1954) ε corrects its degrees of freedom. If no cell were missing it would be the F of `rmanova` with `p_gg` and `p_hf`. Not given for more than 100 realizations or 1000 participants, where `within_cells` decides.
    pub struct WithinClustered {
        /// differences that one participant alone determines, which does not show how much participants vary; they are left out
        left_out: Stat,
        /// of the differences between realizations of a set
        f: Stat as "F",
        /// ε̂ of the clustered covariance, as Greenhouse and Geisser estimate it
        eps_gg: Stat,
        /// Huynh and Feldt's, at most 1, with Satterthwaite's degrees of freedom for each difference in place of participants less one
        eps_hf: Stat,
        /// differences
        df1: Stat,
        /// Satterthwaite's degrees of freedom of the denominator
        df2: Stat,
        /// of `F` with `eps_gg`
        p_gg: Stat,
        /// of `F` with `eps_hf`
        p_hf: Stat,
    }

    /// What a mean participant would rate, by the model `within_cells`; if no cell is missing, or if nothing links the realizations, `desc/M/subject_mean/mean`. Standard error and interval, about the mean, are those of the marginal mean in `lmm_cells`, for other participants.
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
        /// the comparison within participants
        within: WithinCells as "within_cells",
        /// the same, clustered by participant
        clustered: Option<WithinClustered> as "within_clustered",
        /// the mixed model of cell means
        model: CellModel as "lmm_cells",
        /// the mean of each test realization
        means: BTreeMap<RealizationName, AdjustedMean> as "adjusted",
    }
}

impl WithinClustered {
    /// ε and p by which differences are decided: as in complete tables those of Greenhouse and Geisser, where there are not more participants
    /// than realizations those of Huynh and Feldt.
    pub(super) fn deciding(&self, design: Design) -> (&Stat, &Stat) {
        match design.corrects_by_greenhouse_geisser() {
            true => (&self.eps_gg, &self.p_gg),
            false => (&self.eps_hf, &self.p_hf),
        }
    }
}

pub(super) fn adjusted(cells: &Cells<'_>, found: &Adjusted) -> AdjustedCells {
    let of_fit = |error: &LmmError| Why::from(error.to_string());
    let no_fit = (found.fit.as_ref().err()).map_or_else(Why::default, of_fit);
    let of_means = |error: &WithinError| Why::from(error.to_string());
    let no_mean = (found.means.as_ref().err()).map_or_else(Why::default, of_means);
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
        // About the mean above.
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
        within: within_cells(&found.within),
        clustered: found.clustered.as_ref().map(within_clustered),
        model,
    }
}

fn within_cells(found: &Result<Within, WithinError>) -> WithinCells {
    let found = match found {
        Ok(found) => found,
        Err(why) => return WithinCells::undefined(why.to_string()),
    };
    let why = "the ratings leave no variance of error";
    let or = |x: Option<f64>| Stat::or(x, why);
    let effect = found.effect;
    WithinCells {
        sets: Stat::count(found.sets.iter().max().map_or(0, |last| last + 1)),
        var_error: or(found.error.map(|(variance, _)| variance)),
        df1: or(effect.map(|f| f.df1)),
        f: or(effect.map(|f| f.f)),
        df2: or(effect.and_then(|f| f.df2)),
        p: or(effect.and_then(|f| f.p)),
    }
}

fn within_clustered(found: &Clustered) -> WithinClustered {
    let Some(test) = found.differences() else {
        return WithinClustered::undefined(
            "the ratings leave no variance of error, or one participant alone links any two realizations",
        );
    };
    WithinClustered {
        left_out: Stat::count(test.left_out),
        f: Stat::of(test.f),
        eps_gg: Stat::of(test.epsilon_gg),
        eps_hf: Stat::of(test.epsilon_hf),
        df1: Stat::of(test.df1),
        df2: Stat::of(test.df2),
        p_gg: Stat::or(test.p_gg, "F overflows"),
        p_hf: Stat::or(test.p_hf, "F overflows"),
    }
}
