//! Does the forgetting factor matter: `covariate/*`, over realizations.
//!
//! λ itself is a poor scale: from .9991 to .9999 the memory grows ninefold. It
//! enters as log₁₀ of the memory, in mm where the realizations say it
//! (`memory_mm`), else in samples, 1/(1 − λ). Only test realizations with a VAF,
//! so that each covariate stands beside the VAF of the same ones.

use super::Rules;
use super::cells::Cells;
use super::values::{Group, Values};
use std::collections::BTreeSet;
use study_stats::correlation::pearson;
use study_stats::describe::{is_constant, mean};
use study_stats::distribution::t_two_sided;
use study_stats::regression::{line, parabola};

/// A realization: what it is, its VAF, its mean.
struct Point {
    model: usize,
    vaf: f64,
    mean: f64,
}

pub(super) fn memory(cells: &Cells<'_>, _: &Rules, values: &mut Values) {
    let models = &cells.ratings.models;
    let names: BTreeSet<&str> = (models.iter())
        .flat_map(|m| m.covariates.keys().map(String::as_str))
        .collect();
    if names.is_empty() {
        return;
    }
    let means = cells.subject_means();
    let points: Vec<Point> = (cells.test_models().into_iter())
        .filter_map(|model| {
            let (vaf, mean) = (cells.vaf[model]?, mean(&means[model])?);
            Some(Point { model, vaf, mean })
        })
        .collect();
    let of = |name: &str| -> Option<Vec<f64>> {
        let covariate = |p: &Point| models[p.model].covariates.get(name).copied();
        points.iter().map(covariate).collect()
    };
    for name in &names {
        let x = of(name);
        let mut g = values.group(format!("covariate/{name}"), reason(x.as_deref()));
        straight(&mut g, x.as_deref(), &points);
    }
    let in_mm = of("memory_mm").filter(|x| x.iter().all(|v| *v > 0.0));
    let samples = of("lambda").filter(|x| x.iter().all(|v| (0.0..1.0).contains(v)));
    let of_mm = in_mm.is_some();
    let Some(x) = in_mm.or_else(|| samples.map(|x| x.iter().map(|l| 1.0 / (1.0 - l)).collect()))
    else {
        return;
    };
    let x: Vec<f64> = x.iter().map(|v: &f64| v.log10()).collect();
    let mut g = values.group("covariate/log10_memory", reason(Some(&x)));
    g.put("in_mm", f64::from(u8::from(of_mm)));
    straight(&mut g, Some(&x), &points);
    let y: Vec<f64> = points.iter().map(|p| p.mean).collect();
    let bent = parabola(&x, &y);
    let why = "fewer than four realizations, or fewer than three memories, or equal means";
    let mut g = values.group("covariate/log10_memory/quadratic", why);
    g.maybe("square", bent.map(|b| b.square));
    g.maybe("se", bent.map(|b| b.se));
    g.maybe("df", bent.map(|b| b.df));
    g.maybe("r2", bent.map(|b| b.r2));
    g.maybe("turn", bent.and_then(|b| b.turn));
    let why = match bent {
        Some(_) => "the means lie on the parabola",
        None => why,
    };
    g.put_or("t", bent.and_then(|b| b.t), why);
    g.put_or("p", bent.and_then(|b| b.p), why);
    g.put_or("F", bent.and_then(|b| b.f), why);
    g.put_or("p_F", bent.and_then(|b| b.p_f), why);
}

/// Why a covariate explains nothing.
fn reason(x: Option<&[f64]>) -> &'static str {
    match x {
        None => "not every test realization with a VAF has it",
        Some(x) if x.len() < 3 => "fewer than three realizations with a VAF",
        Some(x) if is_constant(x) => "all realizations have the same",
        Some(_) => "all realizations have the same mean rating",
    }
}

fn straight(g: &mut Group<'_>, x: Option<&[f64]>, points: &[Point]) {
    let y: Vec<f64> = points.iter().map(|p| p.mean).collect();
    let vaf: Vec<f64> = points.iter().map(|p| p.vaf).collect();
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
    let level = "the means lie on a line";
    match found {
        Some(_) => {
            g.put_or("t", t, level);
            g.put_or("p", t.and_then(|t| t_two_sided(t, df)), level);
        }
        None => g.none(&["t", "p"]),
    }
    let beside = x.and_then(|x| pearson(x, &vaf).filter(|_| x.len() > 2));
    match (found, beside) {
        (Some(_), None) => g.put_or("r_with_vaf", None, "all realizations have the same VAF"),
        (_, r) => g.maybe("r_with_vaf", r),
    }
}
