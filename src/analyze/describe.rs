//! `desc/*`, `desc_all/*`, `design/*`, `subject/*`, `univariate/*`,
//! `regression/*`, `realistic/*`, `duplicate/*`.

use super::Rules;
use super::cells::{Cells, Table};
use super::values::Values;
use crate::outcome::ratings::NO_MODEL;
use crate::stats::correlation::pearson;
use crate::stats::describe::{
    counts, lag1_autocorrelation, mean, quantile, sd, sorted, sum_of_squares, tidy,
};
use crate::stats::distribution::t_quantile;
use crate::stats::paired::one_sample;
use crate::stats::regression::line;

/// Most bins of a histogram.
const MAX_BINS: f64 = 101.0;

const ONE: &str = "fewer than two ratings";
const ONE_SUBJECT: &str = "fewer than two subjects";
const NO_REPETITION: &str = "no cell has two ratings";

pub(super) fn describe(cells: &Cells<'_>, rules: &Rules, values: &mut Values) {
    let table = cells.table(&cells.test_models());
    let bins = whole_scale(cells);
    design(cells, &table, values);
    all(cells, bins, values);
    by_model(cells, bins, rules, values);
    cousineau_morey(cells, &table, values);
    by_subject(cells, &table, values);
    duplicates(cells, values);
    alone(cells, values);
}

/// Smallest and largest rating, if all are whole and near enough.
fn whole_scale(cells: &Cells<'_>) -> Option<(f64, f64)> {
    let rated = sorted(&rated(cells));
    let (low, high) = (*rated.first()?, *rated.last()?);
    let whole = rated.iter().all(|v| v.fract() == 0.0);
    (whole && high - low < MAX_BINS).then_some((low, high))
}

fn rated(cells: &Cells<'_>) -> Vec<f64> {
    let all = cells.ratings.rating.iter();
    all.copied().filter(|v| v.is_finite()).collect()
}

fn design(cells: &Cells<'_>, table: &Table, values: &mut Values) {
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

/// Sum of squares and degrees of freedom within some cells.
fn within<'c>(
    cells: &Cells<'_>,
    some: impl Iterator<Item = &'c super::cells::Cell>,
) -> (f64, usize) {
    let (mut ss, mut df) = (0.0, 0);
    for cell in some.filter(|c| c.rows.len() > 1) {
        ss += sum_of_squares(&cells.of_cell(cell))
            .unwrap_or(f64::NAN)
            .max(0.0);
        df += cell.rows.len() - 1;
    }
    (ss, df)
}

fn all(cells: &Cells<'_>, bins: Option<(f64, f64)>, values: &mut Values) {
    let rated = rated(cells);
    let mut g = values.group("desc_all", "no ratings");
    g.maybe("mean", mean(&rated));
    g.put_or("sd", sd(&rated), ONE);
    let (ss, df) = within(cells, cells.cells.iter());
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

fn by_model(cells: &Cells<'_>, bins: Option<(f64, f64)>, rules: &Rules, values: &mut Values) {
    let r = cells.ratings;
    let mut by_model: Vec<Vec<f64>> = vec![Vec::new(); r.models.len()];
    for &i in &cells.order {
        by_model[r.model[i] as usize].push(r.rating[i]);
    }
    let subject_means = cells.subject_means();
    for (m, x) in by_model.iter().enumerate() {
        let id = cells.model_name(m);
        let s = sorted(x);
        let mut g = values.group(format!("desc/{id}"), "no ratings");
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
        let mut g = values.group(format!("desc/{id}/subject_mean"), ONE_SUBJECT);
        let centre = mean(x);
        let spread = sd(x);
        let sem = spread.map(|s| s / (x.len() as f64).sqrt());
        let half = sem.and_then(|s| Some(s * t_quantile(0.975, x.len() as f64 - 1.0)?));
        let centre = centre.map(|c| c + cells.offset);
        g.put("n", x.len() as f64);
        g.put_or("mean", centre, "no ratings");
        g.maybe("sd", spread);
        g.maybe("sem", sem);
        let ends = centre.zip(half).map(|(c, h)| (c - h, c + h));
        g.interval("ci95", ends);
        if let Some(from) = rules.realistic_from {
            let x = &by_model[m];
            let share = (!x.is_empty())
                .then(|| x.iter().filter(|v| **v >= from).count() as f64 / x.len() as f64);
            let mut g = values.group(format!("realistic/{id}"), "no ratings");
            g.put("n", x.len() as f64);
            g.maybe("share", share);
        }
    }
}

/// Normalised to C − row mean + grand mean (Cousineau 2005); SEM × √(M/(M−1))
/// (Morey 2008).
fn cousineau_morey(cells: &Cells<'_>, table: &Table, values: &mut Values) {
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
            let centre = mean(row).unwrap_or(f64::NAN);
            row.iter().map(|v| v - centre).collect()
        })
        .collect();
    let t = t_quantile(0.975, s as f64 - 1.0).filter(|_| m >= 2);
    for (j, &model) in table.models.iter().enumerate() {
        let column: Vec<f64> = normal.iter().map(|r| r[j]).collect();
        let correction = (m as f64 / (m as f64 - 1.0)).sqrt();
        let sem = sd(&column)
            .filter(|_| m >= 2)
            .map(|v| v / (s as f64).sqrt() * correction);
        let id = cells.model_name(model);
        let mut g = values.group(format!("desc/{id}/cousineau_morey"), why);
        g.maybe("sem", sem);
        g.maybe("ci95_half", sem.zip(t).map(|(a, b)| a * b));
    }
}

fn by_subject(cells: &Cells<'_>, table: &Table, values: &mut Values) {
    let r = cells.ratings;
    let mut rows: Vec<Vec<usize>> = vec![Vec::new(); r.subjects.len()];
    for i in (0..r.len()).filter(|&i| r.rating[i].is_finite()) {
        rows[r.subject[i] as usize].push(i);
    }
    let mut within_cells: Vec<Option<f64>> = vec![None; rows.len()];
    for own in cells.cells.chunk_by(|a, b| a.subject == b.subject) {
        let (ss, df) = within(cells, own.iter());
        within_cells[own[0].subject] = (df > 0).then(|| (ss / df as f64).sqrt());
    }
    let others = leave_one_out(table);
    for (s, rows) in rows.iter_mut().enumerate() {
        let x: Vec<f64> = rows.iter().map(|&i| r.rating[i]).collect();
        let ordered = rows.iter().all(|&i| r.trial_index[i] > 0);
        rows.sort_by_key(|&i| r.trial_index[i]);
        let in_order: Vec<f64> = rows.iter().map(|&i| r.rating[i]).collect();
        let run = in_order.chunk_by(|a, b| a == b).map(<[f64]>::len).max();
        let mut distinct = sorted(&x);
        distinct.dedup();
        let mut g = values.group(format!("subject/{}", cells.subject_name(s)), "no ratings");
        g.put("n", x.len() as f64);
        g.maybe("mean", mean(&x));
        g.put_or("sd", sd(&x), ONE);
        g.put("distinct", distinct.len() as f64);
        let run = run.filter(|_| ordered).map(|n| n as f64);
        g.put_or("longest_run", run, "the order of the trials is not known");
        g.put_or("within_cell_sd", within_cells[s], NO_REPETITION);
        let r = table
            .subjects
            .binary_search(&s)
            .ok()
            .and_then(|i| others[i]);
        let why = "not all realizations rated, or a constant rater, or nobody else";
        g.put_or("leave_one_out_r", r, why);
    }
}

/// Each subject's cells against the mean of all the others'.
fn leave_one_out(table: &Table) -> Vec<Option<f64>> {
    let m = table.models.len();
    let sums: Vec<f64> = (0..m).map(|j| table.column(j).iter().sum()).collect();
    let others = table.rows.len() as f64 - 1.0;
    table
        .rows
        .iter()
        .map(|row| {
            if others < 1.0 {
                return None;
            }
            let rest: Vec<f64> = (0..m).map(|j| (sums[j] - row[j]) / others).collect();
            pearson(row, &rest)
        })
        .collect()
}

/// Hidden repeats against their originals: repeat minus original over subjects.
fn duplicates(cells: &Cells<'_>, values: &mut Values) {
    let models = &cells.ratings.models;
    for (d, model) in models.iter().enumerate() {
        let Some(original) = &model.duplicate_of else {
            continue;
        };
        let Some(o) = models.iter().position(|m| m.id == *original) else {
            continue;
        };
        let pair = cells.table(&[d, o]);
        let differences: Vec<f64> = pair.rows.iter().map(|r| tidy(r[0] - r[1])).collect();
        let sizes: Vec<f64> = differences.iter().map(|v| v.abs()).collect();
        let test = one_sample(&differences);
        let mut g = values.group(format!("duplicate/{}", model.id), "fewer than two subjects");
        g.put("n", differences.len() as f64);
        g.maybe("mean_diff", test.map(|t| t.mean));
        g.interval("ci95", test.and_then(|t| t.ci95));
        g.maybe("mean_absolute_diff", mean(&sizes));
    }
}

/// Data of one subject: nothing but numbers, or numbers against VAF.
fn alone(cells: &Cells<'_>, values: &mut Values) {
    let r = cells.ratings;
    if r.subjects.len() != 1 {
        return;
    }
    let rows: Vec<usize> = (0..r.len()).filter(|&i| r.rating[i].is_finite()).collect();
    let x: Vec<f64> = rows.iter().map(|&i| r.rating[i]).collect();
    if r.models.len() <= 1 {
        let mut g = values.group("univariate", "all numbers are equal");
        g.put("n", x.len() as f64);
        g.maybe("mean", mean(&x));
        g.put_or("sd", sd(&x), ONE);
        g.maybe("lag1_autocorrelation", lag1_autocorrelation(&x));
    }
    let once =
        cells.cells.iter().all(|c| c.rows.len() == 1) || r.model.iter().all(|m| *m == NO_MODEL);
    let vaf: Vec<f64> = rows.iter().map(|&i| r.vaf[i]).collect();
    if !once || vaf.len() < 3 || !vaf.iter().all(|v| v.is_finite()) {
        return;
    }
    let Some(l) = line(&vaf, &x) else {
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
