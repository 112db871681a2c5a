//! Does VAF predict the rating? The verdict and the tests beside it, without the other
//! statistics of an analysis: for thousands of simulated studies.

use super::adjusted::Adjusted;
use super::cells::Cells;
use super::design::Design;
use super::findings::{self, Finding};
use super::values::Values;
use super::{Rules, mixed, select, vaf};
use crate::outcome::ratings::Ratings;

/// What [`super::analyze`] says about VAF.
#[derive(Debug, Clone, PartialEq)]
pub struct Deciding {
    /// The finding, with the same verdict, test and estimate; `None` if no realization
    /// has a VAF.
    pub finding: Option<Finding>,
    /// The statistics `corr_adjusted/n_models`, `corr_adjusted/pearson/*` and
    /// `lmm_vaf_crossed/*`.
    pub values: Values,
}

/// The part of [`super::analyze`] that answers whether VAF predicts the rating.
pub fn deciding(ratings: &Ratings, rules: &Rules) -> Deciding {
    let (decisions, _) = select::decide(ratings, rules);
    let used = super::rows(ratings, |i| decisions[i].is_none());
    let cells = Cells::of(&used);
    let mut values = Values::default();
    vaf::deciding(&cells, &Adjusted::of(&cells), rules, &mut values);
    mixed::only_crossed(&cells, &mut values);
    Deciding {
        finding: findings::of_vaf(&cells, Design::of(&cells), rules, &values),
        values,
    }
}
