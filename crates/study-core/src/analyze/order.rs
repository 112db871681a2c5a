//! Learning and carry-over: `order_trial/*`, `order_previous_rating/*`,
//! `order_repetition/*`, `drift/*`.

use super::cells::Cells;
use super::identifiers::group_id;
use super::values::Values;
use std::collections::BTreeMap;
use study_stats::carry_over::{OrderedRating, carry_over};
use study_stats::describe::Sum;
use study_stats::paired::holm;
use study_stats::two_way_slope::{TwoWaySlope, two_way_slope};

pub(super) fn order(cells: &Cells<'_>, values: &mut Values) {
    let r = cells.ratings;
    // Rows of a subject are adjacent.
    let known: Vec<(usize, u32)> = (cells.order.iter())
        .filter_map(|&i| Some((i, r.trial_index[i]?)))
        .collect();
    // The rating of the immediately preceding trial.
    let (mut rows, mut previous) = (Vec::new(), Vec::new());
    let mut trials: Vec<(u32, usize)> = Vec::new();
    for own in known.chunk_by(|a, b| r.subject[a.0] == r.subject[b.0]) {
        trials.clear();
        trials.extend(own.iter().map(|&(i, trial)| (trial, i)));
        trials.sort_by_key(|p| p.0);
        for &(i, trial) in own {
            let before = trial - 1;
            let first = trials.partition_point(|p| p.0 < before);
            // If several rows have this index, the preceding one is not known.
            if let [(index, j), after, ..] = &trials[first..]
                && *index == before
                && after.0 != before
            {
                rows.push(i);
                previous.extend(cells.centred[*j]);
            }
        }
    }
    let (known, trial): (Vec<usize>, Vec<f64>) =
        known.into_iter().map(|(i, t)| (i, f64::from(t))).unzip();
    let (by_trial, by_previous) = rayon::join(
        || slope(cells, &known, &trial),
        || slope(cells, &rows, &previous),
    );
    put("order_trial", by_trial, values);
    put("order_previous_rating", by_previous, values);
    drift(cells, &known, &trial, values);
    carry_over_of(cells, values);
    let mut by_repetition: BTreeMap<u32, (Sum, f64)> = BTreeMap::new();
    for (&i, &v) in cells.order.iter().zip(&cells.sorted) {
        let (sum, n) = by_repetition.entry(r.repetition[i]).or_default();
        sum.add(v);
        *n += 1.0;
    }
    if by_repetition.len() > MAX_REPETITIONS {
        return;
    }
    for (repetition, (sum, n)) in by_repetition {
        values
            .group(format!("order_repetition/{repetition}"), "no ratings")
            .put("mean", sum.get() / n + cells.offset);
    }
}

/// Most realizations whose drift is given.
const MAX_DRIFTS: usize = 60;

/// The change of the rating of each realization per trial, with fixed effects of subjects.
fn drift(cells: &Cells<'_>, rows: &[usize], trial: &[f64], values: &mut Values) {
    let tested = cells.tested();
    let repeated = cells.cells.iter().any(|c| c.rows.len() > 1);
    if !repeated || rows.is_empty() || tested.len() > MAX_DRIFTS {
        return;
    }
    let mut own: Vec<(Vec<usize>, Vec<f64>)> = vec![Default::default(); cells.ratings.models.len()];
    for (&i, &t) in rows.iter().zip(trial) {
        if let Some(m) = cells.ratings.model[i] {
            own[m as usize].0.push(i);
            own[m as usize].1.push(t);
        }
    }
    let found: Vec<Option<TwoWaySlope>> = (tested.iter())
        .map(|&m| slope(cells, &own[m].0, &own[m].1))
        .collect();
    let p_holm = holm(&found.iter().map(|f| f.as_ref()?.p).collect::<Vec<_>>());
    for ((&m, found), p_holm) in tested.iter().zip(found).zip(p_holm) {
        let id = group_id("drift", &[cells.model_name(m)]);
        put(&id, found, values);
        values.group(id, NOT_KNOWN).maybe("p_holm", p_holm);
    }
}

const NOT_KNOWN: &str = "the order is not known, or is confounded with subjects and realizations";

/// The dependence of a rating on the one before it, by comparison with all orders of a
/// block. A block is a repetition if each participant's repetitions follow each other.
fn carry_over_of(cells: &Cells<'_>, values: &mut Values) {
    let r = cells.ratings;
    let mut rows = Vec::with_capacity(cells.order.len());
    for own in cells.order.chunk_by(|&a, &b| r.subject[a] == r.subject[b]) {
        let mut trials: Vec<(u32, usize)> = (own.iter())
            .filter_map(|&i| Some((r.trial_index[i]?, i)))
            .collect();
        trials.sort_unstable();
        let known = trials.len() == own.len();
        if !known || trials.windows(2).any(|w| w[0].0 == w[1].0) {
            rows.clear();
            break;
        }
        rows.extend(trials.into_iter().map(|(_, i)| i));
    }
    let same = |w: &[usize]| r.subject[w[0]] == r.subject[w[1]];
    let blocked = rows
        .windows(2)
        .all(|w| !same(w) || r.repetition[w[0]] <= r.repetition[w[1]]);
    let ordered: Vec<OrderedRating> = (rows.iter())
        .filter_map(|&i| {
            Some(OrderedRating {
                subject: r.subject[i],
                realization: r.model[i]?,
                block: if blocked { r.repetition[i] } else { 0 },
                rating: cells.centred[i]?,
            })
        })
        .collect();
    let found = carry_over(&ordered);
    let why = if rows.is_empty() {
        "the order of the trials is not known"
    } else {
        "fewer than two participants, or no variance"
    };
    let mut g = values.group("carry_over", why);
    g.maybe("slope", found.map(|f| f.slope));
    g.maybe("se", found.map(|f| f.se));
    g.maybe("t", found.map(|f| f.t));
    g.maybe("df", found.map(|f| f.df));
    g.maybe("p", found.map(|f| f.p));
    g.interval("ci95", found.map(|f| f.ci95));
}

/// Largest number of repetitions whose means are listed.
const MAX_REPETITIONS: usize = 10_000;

/// The slope of the rating on x with fixed effects of subjects and realizations.
fn slope(cells: &Cells<'_>, rows: &[usize], x: &[f64]) -> Option<TwoWaySlope> {
    let r = cells.ratings;
    let y: Vec<f64> = rows.iter().filter_map(|&i| cells.centred[i]).collect();
    let subjects: Vec<u32> = rows.iter().map(|&i| r.subject[i]).collect();
    let models: Vec<u32> = rows.iter().filter_map(|&i| r.model[i]).collect();
    two_way_slope(x, &y, &subjects, &models)
}

fn put(id: &str, found: Option<TwoWaySlope>, values: &mut Values) {
    let mut g = values.group(id, NOT_KNOWN);
    g.maybe("slope", found.map(|f| f.slope));
    g.maybe("se", found.map(|f| f.se));
    g.maybe("t", found.and_then(|f| f.t));
    g.maybe("p", found.and_then(|f| f.p));
    g.maybe("df", found.map(|f| f.df));
}
