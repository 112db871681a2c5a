//! Covariates of the realizations, above all the forgetting factor: `covariate/*`.
//!
//! λ itself is a poor scale: from .9991 to .9999 the memory grows ninefold. It
//! enters as log₁₀ of the memory, in mm where all realizations give it
//! (`memory_mm`), else in samples, 1/(1 − λ). Only tested realizations with a VAF,
//! so that each covariate can be compared with VAF; all of them where none has one.

use super::cells::Cells;
use super::record::{CovariateName, Stat, statistics};
use std::collections::{BTreeMap, BTreeSet};
use study_session::outcome::ratings::Ratings;
use study_stats::correlation::pearson;
use study_stats::describe::{is_constant, mean};
use study_stats::distribution::t_two_sided;
use study_stats::regression::{line, parabola};

statistics! {
    /// The regression of the means of the test realizations with a VAF on a covariate.
    pub struct Line {
        /// realizations
        n_models: Stat,
        /// correlation of covariate and means
        r: Stat,
        /// change of the mean per unit of the covariate
        slope: Stat,
        /// its standard error
        se: Stat,
        /// `n_models` − 2
        df: Stat,
        /// `slope`/`se`
        t: Stat,
        /// two-sided
        p: Stat,
        /// correlation of covariate and VAF
        r_with_vaf: Stat,
    }

    /// The quadratic term (x − x̄)² added to the line.
    pub struct Quadratic {
        /// its coefficient
        square: Stat,
        /// its standard error
        se: Stat,
        /// n − 3
        df: Stat,
        /// share of the variance of the means that line and quadratic term explain
        r2: Stat,
        /// vertex of the parabola
        turn: Stat,
        /// `square`/`se`
        t: Stat,
        /// two-sided
        p: Stat,
        /// of line and quadratic term together
        f: Stat as "F",
        /// of `F`
        p_f: Stat as "p_F",
    }

    /// The regression on log₁₀ of the memory.
    pub struct LogMemory {
        /// 1 if the memory is in mm, 0 if in samples, 1/(1 − λ)
        in_mm: Stat,
        /// the line
        line: Line as "",
        /// with five realizations the degrees of freedom are 3 for the line and 2 for the parabola: read them together with p
        quadratic: Quadratic,
    }

    /// Covariates of the realizations.
    pub struct Covariates {
        /// of the protocol and, where there is telemetry, `least_energy_j`: the mean over the playbacks of the smallest energy that the hand had put in; below 0 the device was active
        by_name: BTreeMap<CovariateName, Line> as "",
        /// the forgetting factor as log₁₀ of the memory: of `memory_mm` (a covariate, or the model file's) if all realizations have it, otherwise of 1/(1 − λ) samples
        log10_memory: Option<LogMemory>,
    }
}

/// Index, VAF and mean rating of a realization.
struct Point {
    model: usize,
    vaf: Option<f64>,
    mean: f64,
}

/// The names of all covariates, sorted.
pub(super) fn covariates(ratings: &Ratings) -> Vec<String> {
    let names = ratings.models.iter().flat_map(|m| m.covariates.keys());
    let names: BTreeSet<&String> = names.collect();
    names.into_iter().cloned().collect()
}

pub(super) fn memory(cells: &Cells<'_>) -> Covariates {
    let models = &cells.ratings.models;
    let names = covariates(cells.ratings);
    if names.is_empty() {
        return Covariates::undefined("no realization has a covariate");
    }
    let means = cells.subject_means();
    let tested = cells.tested();
    let any_vaf = tested.iter().any(|&m| cells.vaf[m].is_some());
    let points: Vec<Point> = (tested.into_iter())
        .filter(|&m| cells.vaf[m].is_some() || !any_vaf)
        .filter_map(|model| {
            let (vaf, mean) = (cells.vaf[model], mean(&means[model])?);
            Some(Point { model, vaf, mean })
        })
        .collect();
    let of = |name: &str| -> Option<Vec<f64>> {
        let covariate = |p: &Point| models[p.model].covariates.get(name).copied();
        points.iter().map(covariate).collect()
    };
    let by_name = names.iter().map(|name| {
        let x = of(name);
        (name.as_str().into(), linear(x.as_deref(), &points, any_vaf))
    });
    Covariates {
        by_name: by_name.collect(),
        log10_memory: log_memory(of("memory_mm"), of("lambda"), &points, any_vaf),
    }
}

/// The regression on log₁₀ of the memory in mm or, where a realization has none, in samples.
fn log_memory(
    in_mm: Option<Vec<f64>>,
    lambda: Option<Vec<f64>>,
    points: &[Point],
    any_vaf: bool,
) -> Option<LogMemory> {
    let in_mm = in_mm.filter(|x| x.iter().all(|v| *v > 0.0));
    let lambda = lambda.filter(|x| x.iter().all(|v| (0.0..1.0).contains(v)));
    let of_mm = in_mm.is_some();
    let in_samples = || Some(lambda?.iter().map(|l| 1.0 / (1.0 - l)).collect());
    let x: Vec<f64> = in_mm.or_else(in_samples)?;
    let x: Vec<f64> = x.iter().map(|v: &f64| v.log10()).collect();
    let y: Vec<f64> = points.iter().map(|p| p.mean).collect();
    Some(LogMemory {
        in_mm: Stat::flag(of_mm),
        line: linear(Some(&x), points, any_vaf),
        quadratic: quadratic(&x, &y),
    })
}

fn quadratic(x: &[f64], y: &[f64]) -> Quadratic {
    let why = "fewer than four realizations, or fewer than three memories, or equal means";
    let Some(curve) = parabola(x, y) else {
        return Quadratic::undefined(why);
    };
    let exact = "the means lie on the parabola";
    Quadratic {
        square: Stat::of(curve.square),
        se: Stat::of(curve.se),
        df: Stat::of(curve.df),
        r2: Stat::of(curve.r2),
        turn: Stat::or(curve.turn, why),
        t: Stat::or(curve.t, exact),
        p: Stat::or(curve.p, exact),
        f: Stat::or(curve.f, exact),
        p_f: Stat::or(curve.p_f, exact),
    }
}

/// Why the regression on a covariate is undefined.
fn reason(x: Option<&[f64]>, any_vaf: bool) -> &'static str {
    match x {
        None if any_vaf => "not every test realization with a VAF has it",
        None => "not every test realization has it",
        Some(x) if x.len() < 3 && any_vaf => "fewer than three realizations with a VAF",
        Some(x) if x.len() < 3 => "fewer than three realizations",
        Some(x) if is_constant(x) => "all realizations have the same value",
        Some(_) => "all realizations have the same mean rating",
    }
}

fn linear(x: Option<&[f64]>, points: &[Point], any_vaf: bool) -> Line {
    let why = reason(x, any_vaf);
    let y: Vec<f64> = points.iter().map(|p| p.mean).collect();
    let vaf: Option<Vec<f64>> = points.iter().map(|p| p.vaf).collect();
    let with_vaf = x.zip(vaf.as_deref());
    let with_vaf = with_vaf.and_then(|(x, vaf)| pearson(x, vaf).filter(|_| x.len() > 2));
    let n_models = Stat::count(points.len());
    let Some(found) = x.and_then(|x| line(x, &y)) else {
        return Line {
            n_models,
            r_with_vaf: Stat::or(with_vaf, why),
            ..Line::undefined(why)
        };
    };
    let df = points.len() as f64 - 2.0;
    let varies = found.slope_se > 1e-12 * found.slope.abs();
    let t = varies.then(|| found.slope / found.slope_se);
    let exact = "the means lie on a line";
    let no_vaf = match vaf {
        None => "no realization has a VAF",
        Some(_) => "all realizations have the same VAF",
    };
    Line {
        n_models,
        r: Stat::of(found.r),
        slope: Stat::of(found.slope),
        se: Stat::of(found.slope_se),
        df: Stat::of(df),
        t: Stat::or(t, exact),
        p: Stat::or(t.and_then(|t| t_two_sided(t, df)), exact),
        r_with_vaf: Stat::or(with_vaf, no_vaf),
    }
}
