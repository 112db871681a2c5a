//! Whether participants differ in how they rate the realizations: `disagreement/*`.

use super::cells::{Cell, Cells};
use super::record::{Stat, statistics};
use study_stats::disagreement::{Disagreement, disagreement as interaction, slopes_differ};
use study_stats::lmm::CellSummary;
use study_stats::regression::slope;

statistics! {
    /// A test of differences between participants.
    pub struct Interaction {
        /// degrees of freedom of the differences
        df1: Stat,
        /// degrees of freedom of the error
        df2: Stat,
        /// mean square of the differences over that of the error
        f: Stat as "F",
        /// of `F`
        p: Stat,
    }

    /// Whether participants differ in how they rate the realizations.
    pub struct Disagree {
        /// participants × realizations against the variance within cells, by least squares, also with missing cells (Searle 1987); it needs repetitions
        interaction: Interaction,
        /// whether the slopes on VAF of the complete participants differ, against the rest of the interaction (Mandel 1961, with VAF as the known covariate)
        slopes: Interaction,
        /// complete participants whose own slope on VAF is positive
        n_rising: Stat,
        /// complete participants whose own slope on VAF is negative
        n_falling: Stat,
    }
}

pub(super) fn disagreement(cells: &Cells<'_>) -> Disagree {
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
    let by_interaction = of_test(interaction(&own), why);
    let with_vaf: Vec<usize> = (models.iter().copied())
        .filter(|&m| cells.vaf[m].is_some())
        .collect();
    let vaf: Vec<f64> = with_vaf.iter().filter_map(|&m| cells.vaf[m]).collect();
    let table = cells.table(&with_vaf);
    let why = "fewer than two complete participants, or three realizations with different VAF, or \
               no variance of error";
    let by_slopes = of_test(slopes_differ(&table.rows, &vaf), why);
    let slopes: Vec<f64> = (table.rows.iter())
        .filter(|_| vaf.len() > 2)
        .filter_map(|row| slope(&vaf, row))
        .collect();
    Disagree {
        interaction: by_interaction,
        slopes: by_slopes,
        n_rising: Stat::count(slopes.iter().filter(|b| **b > 0.0).count()),
        n_falling: Stat::count(slopes.iter().filter(|b| **b < 0.0).count()),
    }
}

fn of_test(found: Option<Disagreement>, why: &'static str) -> Interaction {
    let Some(found) = found else {
        return Interaction::undefined(why);
    };
    Interaction {
        df1: Stat::of(found.df1),
        df2: Stat::of(found.df2),
        f: Stat::of(found.f),
        p: Stat::or(found.p, why),
    }
}
