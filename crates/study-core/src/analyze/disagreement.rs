//! Whether participants differ in how they rate the realizations: `disagreement/*`.

use super::cells::{Cell, Cells};
use super::values::Values;
use study_stats::disagreement::{Disagreement, disagreement as interaction, slopes_differ};
use study_stats::lmm::CellSummary;
use study_stats::regression::slope;

pub(super) fn disagreement(cells: &Cells<'_>, values: &mut Values) {
    let models = cells.tested();
    let own: Vec<CellSummary> = (cells.cells.iter())
        .filter(|c| models.binary_search(&c.model).is_ok())
        .filter_map(Cell::summary)
        .collect();
    let why = if own.iter().all(|c| c.n < 2) {
        "no cell has two ratings"
    } else if own.iter().all(|c| c.within <= 0.0) {
        "the ratings of each cell are equal: there is no variance of error"
    } else {
        "too few participants or realizations, or more than 200 realizations"
    };
    put("interaction", interaction(&own), why, values);
    let with_vaf: Vec<usize> = (models.iter().copied())
        .filter(|&m| cells.vaf[m].is_some())
        .collect();
    let vaf: Vec<f64> = with_vaf.iter().filter_map(|&m| cells.vaf[m]).collect();
    let table = cells.table(&with_vaf);
    let why = "fewer than two complete participants, or three realizations with different VAF, or \
               no variance of error";
    let found = slopes_differ(&table.rows, &vaf);
    put("slopes", found, why, values);
    let slopes: Vec<f64> = (table.rows.iter())
        .filter(|_| vaf.len() > 2)
        .filter_map(|row| slope(&vaf, row))
        .collect();
    let mut g = values.group("disagreement", "");
    g.put(
        "n_rising",
        slopes.iter().filter(|b| **b > 0.0).count() as f64,
    );
    g.put(
        "n_falling",
        slopes.iter().filter(|b| **b < 0.0).count() as f64,
    );
}

fn put(name: &str, found: Option<Disagreement>, why: &str, values: &mut Values) {
    let mut g = values.group(format!("disagreement/{name}"), why);
    g.maybe("df1", found.map(|f| f.df1));
    g.maybe("df2", found.map(|f| f.df2));
    g.maybe("F", found.map(|f| f.f));
    g.maybe("p", found.and_then(|f| f.p));
}
