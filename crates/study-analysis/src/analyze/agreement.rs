//! Agreement of participants and of repetitions: `icc_*`, `krippendorff_*`, over the tested
//! realizations.

use super::cells::Cells;
use super::effects::{FEW, NO_ERROR};
use super::record::{Stat, statistics};
use study_stats::agreement::{self, Alpha, Icc, icc, krippendorff};

/// Largest number of distinct repetitions for agreement.
const MAX_LABELS: usize = 10_000;

const NO_END: &str = "the interval of ICC2 ends where Spearman–Brown's formula has its pole";

statistics! {
    /// A coefficient of agreement with its 95 % interval by F.
    pub struct Coefficient {
        /// the coefficient
        value: Stat as "",
        /// lower end
        lo: Option<Stat>,
        /// upper end
        hi: Option<Stat>,
    }

    /// Intraclass correlations (Shrout & Fleiss 1979).
    pub struct Intraclass {
        /// mean square of the targets
        ms_targets: Option<Stat>,
        /// of the raters
        ms_raters: Option<Stat>,
        /// of the error
        ms_error: Option<Stat>,
        /// by the mean square within targets
        f_1: Option<Stat> as "F_1",
        /// of `F_1`
        p_1: Option<Stat>,
        /// by the residual mean square
        f_3: Option<Stat> as "F_3",
        /// of `F_3`
        p_3: Option<Stat>,
        /// of a single rating, one way
        icc1: Coefficient as "ICC1",
        /// of a single rating, two ways, raters at random
        icc2: Coefficient as "ICC2",
        /// of a single rating, two ways, these raters
        icc3: Coefficient as "ICC3",
        /// of the mean, one way
        icc1k: Stat as "ICC1k",
        /// of the mean, raters at random; the interval is that of ICC2 transformed by the Spearman–Brown formula
        icc2k: Coefficient as "ICC2k",
        /// of the mean, these raters
        icc3k: Coefficient as "ICC3k",
    }

    /// Agreement of repetitions; targets are the cells with every repetition.
    pub struct Repeatability {
        /// raters are the repetitions
        icc: Intraclass as "",
        /// targets
        n_cells: Stat,
        /// √`ms_error`
        sem: Stat,
        /// 1.96·√2·`sem`
        smallest_detectable_change: Stat,
    }

    /// Krippendorff's α (2011).
    pub struct Krippendorff {
        /// of categories
        nominal: Stat,
        /// of ranks
        ordinal: Stat,
        /// of numbers
        interval: Stat,
    }

    /// Agreement.
    pub struct Agreement {
        /// targets are the realizations, raters the participants
        icc_subjects: Intraclass,
        /// of repetitions
        icc_repetitions: Repeatability,
        /// a unit is a repetition of a realization
        krippendorff_subjects: Krippendorff,
        /// a unit is a cell
        krippendorff_repetitions: Krippendorff,
    }
}

pub(super) fn agreement(cells: &Cells<'_>) -> Agreement {
    let models = cells.tested();
    let table = cells.table(&models);
    let transposed: Vec<Vec<f64>> = (0..table.models.len()).map(|j| table.column(j)).collect();
    let r = cells.ratings;
    let labels = labels(cells, &models);
    // A unit is one repetition of one realization.
    let columns = cells.columns(&models);
    let mut by_repetition = vec![Vec::new(); models.len() * labels.len()];
    for (&i, &v) in cells.order.iter().zip(&cells.sorted) {
        let column = r.model[i].and_then(|m| columns[m as usize]);
        if let (Ok(k), Some(j)) = (labels.binary_search(&r.repetition[i]), column) {
            by_repetition[j * labels.len() + k].push(v);
        }
    }
    let by_cell: Vec<&[f64]> = (cells.cells.iter())
        .filter(|c| models.binary_search(&c.model).is_ok())
        .map(|c| cells.of_cell(c))
        .collect();
    Agreement {
        icc_subjects: intraclass(icc(&transposed).as_ref(), FEW),
        icc_repetitions: repeatability(&by_cell, labels.len()),
        krippendorff_subjects: alpha(&krippendorff(&by_repetition)),
        krippendorff_repetitions: alpha(&krippendorff(&by_cell)),
    }
}

/// The distinct repetition numbers of some realizations, sorted.
fn labels(cells: &Cells<'_>, models: &[usize]) -> Vec<u32> {
    let r = cells.ratings;
    let mut labels: Vec<u32> = Vec::new();
    for cell in &cells.cells {
        if models.binary_search(&cell.model).is_err() {
            continue;
        }
        for &i in &cells.order[cell.rows.clone()] {
            if let Err(at) = labels.binary_search(&r.repetition[i]) {
                labels.insert(at, r.repetition[i]);
            }
        }
        // In a table that numbers all rows these are no repetitions.
        if labels.len() > MAX_LABELS {
            return Vec::new();
        }
    }
    labels
}

/// Agreement of so many repetitions, over the cells that have all of them.
fn repeatability(cells: &[&[f64]], repetitions: usize) -> Repeatability {
    let complete: Vec<&[f64]> = (cells.iter().copied())
        .filter(|cell| cell.len() == repetitions)
        .collect();
    let found = icc(&complete);
    let why = "fewer than two cells with two repetitions or more";
    let sem = found.as_ref().map(|i| i.ms_error.max(0.0).sqrt());
    let change = sem.map(|s| 1.96 * std::f64::consts::SQRT_2 * s);
    Repeatability {
        icc: intraclass(found.as_ref(), why),
        n_cells: Stat::count(if repetitions > 1 { complete.len() } else { 0 }),
        sem: Stat::or(sem, why),
        smallest_detectable_change: Stat::or(change, why),
    }
}

fn intraclass(found: Option<&Icc>, few: &'static str) -> Intraclass {
    let Some(i) = found else {
        return Intraclass::undefined(few);
    };
    let or = |x: Option<f64>| Stat::or(x, NO_ERROR);
    Intraclass {
        ms_targets: Some(Stat::of(i.ms_targets)),
        ms_raters: Some(Stat::of(i.ms_raters)),
        ms_error: Some(Stat::of(i.ms_error)),
        f_1: Some(or(i.f_1)),
        p_1: Some(or(i.p_1)),
        f_3: Some(or(i.f_3)),
        p_3: Some(or(i.p_3)),
        icc1: coefficient(i.icc1),
        icc2: coefficient(i.icc2),
        icc3: coefficient(i.icc3),
        icc1k: or(i.icc1k),
        icc2k: coefficient(i.icc2k),
        icc3k: coefficient(i.icc3k),
    }
}

fn coefficient(found: Option<agreement::Coefficient>) -> Coefficient {
    let ends = found.and_then(|c| c.ci95);
    let end = |end: Option<Option<f64>>| {
        let why = if end == Some(None) { NO_END } else { NO_ERROR };
        Some(Stat::or(end.flatten(), why))
    };
    Coefficient {
        value: Stat::or(found.map(|c| c.value), NO_ERROR),
        lo: end(ends.map(|e| e.0)),
        hi: end(ends.map(|e| e.1)),
    }
}

fn alpha(alpha: &Alpha) -> Krippendorff {
    let why = "no unit has two ratings, or all are equal, or more than 1000 differ";
    Krippendorff {
        nominal: Stat::or(alpha.nominal, why),
        ordinal: Stat::or(alpha.ordinal, why),
        interval: Stat::or(alpha.interval, why),
    }
}
