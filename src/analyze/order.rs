//! Learning and carry-over: `order_trial/*`, `order_previous_rating/*`,
//! `order_repetition/*`.

use super::cells::Cells;
use super::values::Values;
use crate::stats::describe::mean;
use crate::stats::regression::beside_factors;
use std::collections::{BTreeMap, HashMap};

pub(super) fn order(cells: &Cells<'_>, values: &mut Values) {
    let r = cells.ratings;
    let known: Vec<usize> = cells
        .order
        .iter()
        .copied()
        .filter(|&i| r.trial_index[i] > 0)
        .collect();
    let trial: Vec<f64> = known.iter().map(|&i| f64::from(r.trial_index[i])).collect();
    put(cells, "order_trial", &known, &trial, values);
    // The rating of the trial just before, and of no other.
    let places: HashMap<(u32, u32), usize> = known
        .iter()
        .map(|&i| ((r.subject[i], r.trial_index[i]), i))
        .collect();
    let (mut rows, mut previous) = (Vec::new(), Vec::new());
    for &i in &known {
        if let Some(&before) = places.get(&(r.subject[i], r.trial_index[i] - 1)) {
            rows.push(i);
            previous.push(cells.centred[before]);
        }
    }
    put(cells, "order_previous_rating", &rows, &previous, values);
    let mut by_repetition: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for &i in &cells.order {
        by_repetition
            .entry(r.repetition[i])
            .or_default()
            .push(r.rating[i]);
    }
    for (repetition, x) in by_repetition {
        values
            .group(format!("order_repetition/{repetition}"), "no ratings")
            .maybe("mean", mean(&x));
    }
}

/// The slope of the rating on x beside fixed subjects and realizations.
fn put(cells: &Cells<'_>, id: &str, rows: &[usize], x: &[f64], values: &mut Values) {
    let r = cells.ratings;
    let y: Vec<f64> = rows.iter().map(|&i| cells.centred[i]).collect();
    let subjects: Vec<u32> = rows.iter().map(|&i| r.subject[i]).collect();
    let models: Vec<u32> = rows.iter().map(|&i| r.model[i]).collect();
    let found = beside_factors(x, &y, &subjects, &models);
    let why = "the order is not known, or is one with subjects and realizations";
    let mut g = values.group(id, why);
    g.maybe("slope", found.map(|f| f.slope));
    g.maybe("se", found.map(|f| f.se));
    g.maybe("t", found.and_then(|f| f.t));
    g.maybe("p", found.and_then(|f| f.p));
    g.maybe("df", found.map(|f| f.df));
}
