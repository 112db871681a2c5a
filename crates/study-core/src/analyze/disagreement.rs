//! Whether participants differ in how they rate the realizations: `disagreement/*`.

use super::cells::Cells;
use super::values::Values;
use study_stats::additivity::{AdditivityCell, Interaction, interaction, slopes_differ};
use study_stats::regression::slope;

pub(super) fn disagreement(cells: &Cells<'_>, values: &mut Values) {
    let models = cells.tested();
    let columns = cells.columns(&models);
    let own: Vec<AdditivityCell> = (cells.cells.iter())
        .filter(|c| c.squares.is_finite())
        .filter_map(|c| {
            Some(AdditivityCell {
                subject: c.subject,
                realization: columns[c.model]?,
                n: c.rows.len(),
                mean: c.mean,
                within: c.squares,
            })
        })
        .collect();
    let why = if own.iter().all(|c| c.n < 2) {
        "no cell has two ratings"
    } else {
        "too few participants or realizations, or more than 300 realizations"
    };
    put("interaction", interaction(&own), why, values);
    let with_vaf: Vec<usize> = (models.iter().copied())
        .filter(|&m| cells.vaf[m].is_some())
        .collect();
    let vaf: Vec<f64> = with_vaf.iter().filter_map(|&m| cells.vaf[m]).collect();
    let table = cells.table(&with_vaf);
    let why = "fewer than two complete participants, or three realizations with different VAF";
    let found = slopes_differ(&table.rows, &vaf);
    put("slopes", found, why, values);
    let slopes: Vec<f64> = (table.rows.iter())
        .filter_map(|row| slope(&vaf, row))
        .filter(|_| found.is_some())
        .collect();
    let mut g = values.group("disagreement", "");
    let count = |rising: bool| {
        slopes
            .iter()
            .filter(|b| **b != 0.0 && (**b > 0.0) == rising)
            .count()
    };
    g.put("n_rising", count(true) as f64);
    g.put("n_falling", count(false) as f64);
}

fn put(name: &str, found: Option<Interaction>, why: &str, values: &mut Values) {
    let mut g = values.group(format!("disagreement/{name}"), why);
    g.maybe("df1", found.map(|f| f.df1));
    g.maybe("df2", found.map(|f| f.df2));
    let why = match found {
        Some(_) => "the ratings leave no variance of error",
        None => why,
    };
    g.put_or("F", found.and_then(|f| f.f), why);
    g.put_or("p", found.and_then(|f| f.p), why);
}
