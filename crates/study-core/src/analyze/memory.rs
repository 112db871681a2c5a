//! Covariates of the realizations, above all the forgetting factor: `covariate/*`.
//!
//! λ itself is a poor scale: from .9991 to .9999 the memory grows ninefold. It
//! enters as log₁₀ of the memory, in mm where all realizations give it
//! (`memory_mm`), else in samples, 1/(1 − λ). Only tested realizations with a VAF,
//! so that each covariate can be compared with VAF; all of them where none has one.

use super::cells::Cells;
use super::identifiers::group_id;
use super::values::{Group, Values};
use crate::outcome::ratings::Ratings;
use std::collections::BTreeSet;
use study_stats::correlation::pearson;
use study_stats::describe::{is_constant, mean};
use study_stats::distribution::t_two_sided;
use study_stats::regression::{line, parabola};

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

pub(super) fn memory(cells: &Cells<'_>, values: &mut Values) {
    let models = &cells.ratings.models;
    let names = covariates(cells.ratings);
    if names.is_empty() {
        return;
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
    for name in &names {
        let x = of(name);
        let mut g = values.group(
            group_id("covariate", &[name]),
            reason(x.as_deref(), any_vaf),
        );
        linear(&mut g, x.as_deref(), &points);
    }
    let in_mm = of("memory_mm").filter(|x| x.iter().all(|v| *v > 0.0));
    let samples = of("lambda").filter(|x| x.iter().all(|v| (0.0..1.0).contains(v)));
    let of_mm = in_mm.is_some();
    let Some(x) = in_mm.or_else(|| samples.map(|x| x.iter().map(|l| 1.0 / (1.0 - l)).collect()))
    else {
        return;
    };
    let x: Vec<f64> = x.iter().map(|v: &f64| v.log10()).collect();
    let mut g = values.group("covariate/log10_memory", reason(Some(&x), any_vaf));
    g.put("in_mm", f64::from(u8::from(of_mm)));
    linear(&mut g, Some(&x), &points);
    let y: Vec<f64> = points.iter().map(|p| p.mean).collect();
    let curve = parabola(&x, &y);
    let why = "fewer than four realizations, or fewer than three memories, or equal means";
    let mut g = values.group("covariate/log10_memory/quadratic", why);
    g.maybe("square", curve.map(|b| b.square));
    g.maybe("se", curve.map(|b| b.se));
    g.maybe("df", curve.map(|b| b.df));
    g.maybe("r2", curve.map(|b| b.r2));
    g.maybe("turn", curve.and_then(|b| b.turn));
    let why = match curve {
        Some(_) => "the means lie on the parabola",
        None => why,
    };
    g.put_or("t", curve.and_then(|b| b.t), why);
    g.put_or("p", curve.and_then(|b| b.p), why);
    g.put_or("F", curve.and_then(|b| b.f), why);
    g.put_or("p_F", curve.and_then(|b| b.p_f), why);
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

fn linear(g: &mut Group<'_>, x: Option<&[f64]>, points: &[Point]) {
    let y: Vec<f64> = points.iter().map(|p| p.mean).collect();
    let vaf: Option<Vec<f64>> = points.iter().map(|p| p.vaf).collect();
    let found = x.and_then(|x| line(x, &y));
    let df = points.len() as f64 - 2.0;
    let t = found
        .filter(|l| l.slope_se > 1e-12 * l.slope.abs())
        .map(|l| l.slope / l.slope_se);
    g.put("n_models", points.len() as f64);
    g.maybe("r", found.map(|l| l.r));
    g.maybe("slope", found.map(|l| l.slope));
    g.maybe("se", found.map(|l| l.slope_se));
    g.maybe("df", found.map(|_| df));
    let exact = "the means lie on a line";
    match found {
        Some(_) => {
            g.put_or("t", t, exact);
            g.put_or("p", t.and_then(|t| t_two_sided(t, df)), exact);
        }
        None => g.none(&["t", "p"]),
    }
    let with_vaf = x.zip(vaf.as_deref());
    let with_vaf = with_vaf.and_then(|(x, vaf)| pearson(x, vaf).filter(|_| x.len() > 2));
    match (found, with_vaf) {
        (Some(_), None) if vaf.is_none() => {
            g.put_or("r_with_vaf", None, "no realization has a VAF");
        }
        (Some(_), None) => g.put_or("r_with_vaf", None, "all realizations have the same VAF"),
        (_, r) => g.maybe("r_with_vaf", r),
    }
}
