//! `desc/*`, `desc_all/*`, `design/*`, `univariate/*`, `regression/*`.

use super::cells::{Cells, CompleteTable, within};
use super::identifiers::group_id;
use super::values::Values;
use study_stats::describe::{counts, lag1_autocorrelation, mean, quantile, sd, sorted};
use study_stats::distribution::t_quantile;
use study_stats::regression::line;

/// Largest number of bins of a histogram.
const MAX_BINS: f64 = 101.0;

pub(super) const ONE: &str = "fewer than two ratings";
const ONE_SUBJECT: &str = "fewer than two subjects";
pub(super) const NO_REPETITION: &str = "no cell has two ratings";

pub(super) fn describe(cells: &Cells<'_>, values: &mut Values) {
    let table = cells.table(&cells.tested());
    let bins = whole_scale(cells);
    design(cells, &table, values);
    all(cells, bins, values);
    by_model(cells, bins, values);
    cousineau_morey(cells, &table, values);
    alone(cells, values);
}

/// Smallest and largest rating, if all are whole and the range is not too wide.
fn whole_scale(cells: &Cells<'_>) -> Option<(f64, f64)> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for &v in cells.ratings.rating.iter().flatten() {
        if v.fract() != 0.0 {
            return None;
        }
        (low, high) = (low.min(v), high.max(v));
    }
    (low <= high && high - low < MAX_BINS).then_some((low, high))
}

/// The ratings in ascending order; a counting sort if they are whole.
fn ascending(x: &[f64], bins: Option<(f64, f64)>) -> Vec<f64> {
    let Some((low, high)) = bins else {
        return sorted(x);
    };
    let mut all = Vec::with_capacity(x.len());
    let mut value = low;
    for n in counts(x, low, high) {
        all.resize(all.len() + n as usize, value);
        value += 1.0;
    }
    all
}

fn rated(cells: &Cells<'_>) -> Vec<f64> {
    cells.ratings.rating.iter().copied().flatten().collect()
}

fn design(cells: &Cells<'_>, table: &CompleteTable, values: &mut Values) {
    let r = cells.ratings;
    let rated = rated(cells).len();
    let (s, m) = (r.subjects.len(), r.models.len());
    let per_cell = cells.cells.first().map_or(0, |c| c.rows.len());
    let balanced = m > 0
        && rated == r.len()
        && cells.cells.len() == s * m
        && cells.cells.iter().all(|c| c.rows.len() == per_cell);
    let mut g = values.group("design", "");
    g.put("n_ratings", rated as f64);
    g.put("n_missing_ratings", (r.len() - rated) as f64);
    g.put("n_subjects", s as f64);
    g.put("n_models", m as f64);
    g.put("n_cells", cells.cells.len() as f64);
    g.put("n_subjects_complete", table.subjects.len() as f64);
    g.put("balanced", f64::from(u8::from(balanced)));
}

fn all(cells: &Cells<'_>, bins: Option<(f64, f64)>, values: &mut Values) {
    let rated = rated(cells);
    let mut g = values.group("desc_all", "no ratings");
    g.maybe("mean", mean(&rated));
    g.put_or("sd", sd(&rated), ONE);
    let (ss, df) = within(&cells.cells);
    let within_sd = (df > 0).then(|| (ss / df as f64).sqrt());
    g.put("within_cell_df", df as f64);
    g.put_or("within_cell_sd", within_sd, NO_REPETITION);
    let coefficient = within_sd.map(|s| 1.96 * std::f64::consts::SQRT_2 * s);
    g.put_or("repeatability_coefficient", coefficient, NO_REPETITION);
    if let Some((low, high)) = bins {
        g.put("hist_from", low);
        g.list("hist", counts(&rated, low, high));
    }
}

fn by_model(cells: &Cells<'_>, bins: Option<(f64, f64)>, values: &mut Values) {
    let r = cells.ratings;
    let mut by_model: Vec<Vec<f64>> = vec![Vec::new(); r.models.len()];
    for &i in &cells.order {
        if let (Some(m), Some(rating)) = (r.model[i], r.rating[i]) {
            by_model[m as usize].push(rating);
        }
    }
    let subject_means = cells.subject_means();
    for (m, x) in by_model.iter().enumerate() {
        let id = group_id("desc", &[cells.model_name(m)]);
        let s = ascending(x, bins);
        let mut g = values.group(id.clone(), "no ratings");
        g.put("n", x.len() as f64);
        g.maybe("mean", mean(x));
        g.put_or("sd", sd(x), ONE);
        g.maybe("median", quantile(&s, 0.5));
        g.maybe("q1", quantile(&s, 0.25));
        g.maybe("q3", quantile(&s, 0.75));
        g.maybe("min", s.first().copied());
        g.maybe("max", s.last().copied());
        if let Some((low, high)) = bins {
            g.list("hist", counts(x, low, high));
        }
        let x: &[f64] = &subject_means[m];
        let mut g = values.group(format!("{id}/subject_mean"), ONE_SUBJECT);
        let center = mean(x);
        let spread = sd(x);
        let sem = spread.map(|s| s / (x.len() as f64).sqrt());
        let half = sem.and_then(|s| Some(s * t_quantile(0.975, x.len() as f64 - 1.0)?));
        let center = center.map(|c| c + cells.offset);
        g.put("n", x.len() as f64);
        g.put_or("mean", center, "no ratings");
        g.maybe("sd", spread);
        g.maybe("sem", sem);
        let ends = center.zip(half).map(|(c, h)| (c - h, c + h));
        g.interval("ci95", ends);
    }
}

/// Within-subject intervals: ratings less the subject's mean (Cousineau 2005), SEM
/// times √(M/(M − 1)) (Morey 2008).
fn cousineau_morey(cells: &Cells<'_>, table: &CompleteTable, values: &mut Values) {
    let (s, m) = (table.rows.len(), table.models.len());
    let why = if m < 2 {
        "fewer than two realizations"
    } else {
        "fewer than two complete subjects"
    };
    let normal: Vec<Vec<f64>> = table
        .rows
        .iter()
        .map(|row| {
            // Of no realizations there is no row.
            let center = mean(row).unwrap_or(0.0);
            row.iter().map(|v| v - center).collect()
        })
        .collect();
    let t = t_quantile(0.975, s as f64 - 1.0).filter(|_| m >= 2);
    for (j, &model) in table.models.iter().enumerate() {
        let column: Vec<f64> = normal.iter().map(|r| r[j]).collect();
        let correction = (m as f64 / (m as f64 - 1.0)).sqrt();
        let sem = sd(&column)
            .filter(|_| m >= 2)
            .map(|v| v / (s as f64).sqrt() * correction);
        let id = group_id("desc", &[cells.model_name(model)]);
        let mut g = values.group(format!("{id}/cousineau_morey"), why);
        g.maybe("sem", sem);
        g.maybe("ci95_half", sem.zip(t).map(|(a, b)| a * b));
    }
}

/// A table of one subject: univariate data, or a regression on VAF.
fn alone(cells: &Cells<'_>, values: &mut Values) {
    let r = cells.ratings;
    if r.subjects.len() != 1 {
        return;
    }
    let x = rated(cells);
    if r.models.len() <= 1 {
        let mut g = values.group("univariate", "all numbers are equal");
        g.put("n", x.len() as f64);
        g.maybe("mean", mean(&x));
        g.put_or("sd", sd(&x), ONE);
        g.maybe("lag1_autocorrelation", lag1_autocorrelation(&x));
    }
    let once = cells.cells.iter().all(|c| c.rows.len() == 1) || r.model.iter().all(Option::is_none);
    let rows = (0..r.len()).filter(|&i| r.rating[i].is_some());
    let vaf: Option<Vec<f64>> = rows.map(|i| r.vaf[i]).collect();
    let Some(l) = vaf
        .filter(|v| once && v.len() >= 3)
        .and_then(|vaf| line(&vaf, &x))
    else {
        return;
    };
    let mut g = values.group("regression", "the line fits without a residual");
    g.put("intercept", l.intercept);
    g.put("slope", l.slope);
    g.put("intercept_se", l.intercept_se);
    g.put("slope_se", l.slope_se);
    g.put("residual_sd", l.residual_sd);
    g.put("r2", l.r2);
    g.maybe("F", l.f);
    g.put("pearson_r", l.r);
}
