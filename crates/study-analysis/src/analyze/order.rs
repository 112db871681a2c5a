//! Learning and carry-over: `order_trial/*`, `order_previous_rating/*`,
//! `order_repetition/*`, `drift/*`.

use super::cells::Cells;
use super::record::{Interval, RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_stats::carry_over::{OrderedRating, carry_over};
use study_stats::describe::Sum;
use study_stats::paired::holm;
use study_stats::two_way_slope::{TwoWaySlope, two_way_slope};

statistics! {
    /// A slope of the rating, adjusted for fixed subjects and realizations.
    pub struct Slope {
        /// change of the rating
        slope: Stat,
        /// its standard error
        se: Stat,
        /// `slope`/`se`
        t: Stat,
        /// two-sided
        p: Stat,
        /// residual degrees of freedom
        df: Stat,
    }

    /// The change of the ratings of one realization per trial.
    pub struct Drift {
        /// with an intercept for each subject
        slope: Slope as "",
        /// corrected over the test realizations
        p_holm: Stat,
    }

    /// The dependence of a rating on the one before it, compared with all orders of a block.
    pub struct CarryOver {
        /// change of the rating per point of the one before it
        slope: Stat,
        /// its standard error
        se: Stat,
        /// over participants
        t: Stat,
        /// participants less one
        df: Stat,
        /// two-sided
        p: Stat,
        /// interval of `slope`
        ci95: Interval,
    }

    /// The ratings of one repetition.
    pub struct RepetitionMean {
        /// their mean
        mean: Stat,
    }

    /// Learning and carry-over.
    pub struct Order {
        /// slope of the rating on the position of the trial in the session
        trial: Slope as "order_trial",
        /// slope on the rating of the immediately preceding trial, which is missing if several rows share that position
        previous: Slope as "order_previous_rating",
        /// as `order_trial`, from the ratings of one realization (up to 60); only if cells repeat
        drift: BTreeMap<RealizationName, Drift>,
        /// products of neighboring ratings, less the means of participant and realization, compared with their mean over all orders of the trials within their blocks; a block is a repetition if each participant's repetitions follow each other, else the whole session
        carry_over: CarryOver,
        /// by the number of the repetition
        repetition: BTreeMap<u32, RepetitionMean> as "order_repetition",
    }
}

pub(super) fn order(cells: &Cells<'_>) -> Order {
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
        trials.small_sort_by_key(|p| p.0);
        for &(i, trial) in own {
            let before = trial - 1;
            let first = trials.partition_point(|p| p.0 < before);
            // If several rows have this index, the preceding one is not known.
            if let [(index, j), after, ..] = &trials[first..]
                && *index == before
                && after.0 != before
            {
                rows.push(i);
                previous.extend(cells.centered[*j]);
            }
        }
    }
    let (known, trial): (Vec<usize>, Vec<f64>) =
        known.into_iter().map(|(i, t)| (i, f64::from(t))).unzip();
    let (by_trial, by_previous) = rayon::join(
        || slope(cells, &known, &trial),
        || slope(cells, &rows, &previous),
    );
    Order {
        trial: of_slope(by_trial),
        previous: of_slope(by_previous),
        drift: drift(cells, &known, &trial),
        carry_over: carry_over_of(cells),
        repetition: by_repetition(cells),
    }
}

/// The mean of each repetition.
fn by_repetition(cells: &Cells<'_>) -> BTreeMap<u32, RepetitionMean> {
    let mut sums: BTreeMap<u32, (Sum, f64)> = BTreeMap::new();
    for (&i, &v) in cells.order.iter().zip(&cells.sorted) {
        let (sum, n) = sums.entry(cells.ratings.repetition[i]).or_default();
        sum.add(v);
        *n += 1.0;
    }
    if sums.len() > MAX_REPETITIONS {
        return BTreeMap::new();
    }
    let mean = |(sum, n): (Sum, f64)| RepetitionMean {
        mean: Stat::of(sum.get() / n + cells.offset),
    };
    sums.into_iter().map(|(r, own)| (r, mean(own))).collect()
}

/// Most realizations whose drift is given.
const MAX_DRIFTS: usize = 60;

/// The change of the rating of each realization per trial, with fixed effects of subjects.
fn drift(cells: &Cells<'_>, rows: &[usize], trial: &[f64]) -> BTreeMap<RealizationName, Drift> {
    let tested = cells.tested();
    let repeated = cells.cells.iter().any(|c| c.rows.len() > 1);
    if !repeated || rows.is_empty() || tested.len() > MAX_DRIFTS {
        return BTreeMap::new();
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
    let all = tested.iter().zip(found).zip(p_holm);
    all.map(|((&m, found), p_holm)| {
        let drift = Drift {
            slope: of_slope(found),
            p_holm: Stat::or(p_holm, NOT_KNOWN),
        };
        (cells.model_name(m).into(), drift)
    })
    .collect()
}

const NOT_KNOWN: &str = "the order is not known, or is confounded with subjects and realizations";

/// The dependence of a rating on the one before it, by comparison with all orders of a
/// block. A block is a repetition if each participant's repetitions follow each other.
fn carry_over_of(cells: &Cells<'_>) -> CarryOver {
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
                rating: cells.centered[i]?,
            })
        })
        .collect();
    let found = carry_over(&ordered);
    let why = if rows.is_empty() {
        "the order of the trials is not known"
    } else {
        "fewer than two participants, or no variance"
    };
    let Some(found) = found else {
        return CarryOver::undefined(why);
    };
    CarryOver {
        slope: Stat::of(found.slope),
        se: Stat::of(found.se),
        t: Stat::of(found.t),
        df: Stat::of(found.df),
        p: Stat::of(found.p),
        ci95: Interval::or(Some(found.ci95), why),
    }
}

/// Largest number of repetitions whose means are listed.
const MAX_REPETITIONS: usize = 10_000;

/// The slope of the rating on x with fixed effects of subjects and realizations.
fn slope(cells: &Cells<'_>, rows: &[usize], x: &[f64]) -> Option<TwoWaySlope> {
    let r = cells.ratings;
    let y: Vec<f64> = rows.iter().filter_map(|&i| cells.centered[i]).collect();
    let subjects: Vec<u32> = rows.iter().map(|&i| r.subject[i]).collect();
    let models: Vec<u32> = rows.iter().filter_map(|&i| r.model[i]).collect();
    two_way_slope(x, &y, &subjects, &models)
}

fn of_slope(found: Option<TwoWaySlope>) -> Slope {
    let Some(found) = found else {
        return Slope::undefined(NOT_KNOWN);
    };
    Slope {
        slope: Stat::of(found.slope),
        se: Stat::of(found.se),
        t: Stat::or(found.t, NOT_KNOWN),
        p: Stat::or(found.p, NOT_KNOWN),
        df: Stat::of(found.df),
    }
}
