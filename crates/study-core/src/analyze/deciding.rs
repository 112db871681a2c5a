//! Verdicts without the other statistics of an analysis: for thousands of simulated studies.

use super::adjusted::{self, Adjusted};
use super::cells::Cells;
use super::design::Design;
use super::findings::{self, Finding};
use super::values::Values;
use super::{Rules, disagreement, effects, memory, mixed, order, pairs, reference, select, vaf};
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

/// The findings of [`super::analyze`], with the statistics that decide them; effect sizes
/// and caveats may be missing.
pub fn all_findings(ratings: &Ratings, rules: &Rules) -> (Vec<Finding>, Values) {
    let (decisions, _) = select::decide(ratings, rules);
    let used = super::rows(ratings, |i| decisions[i].is_none());
    let cells = Cells::of(&used);
    let adjusted = Adjusted::of(&cells);
    let mut values = Values::default();
    order::order(&cells, &mut values);
    vaf::raw(&cells, rules, &mut values);
    vaf::deciding(&cells, &adjusted, rules, &mut values);
    effects::ranks_and_anova(&cells, &mut values);
    mixed::only_crossed(&cells, &mut values);
    reference::reference(&cells, rules, &mut values);
    adjusted::adjusted(&cells, &adjusted, &mut values);
    pairs::pairs(&cells, &adjusted, rules, &mut values);
    disagreement::disagreement(&cells, &mut values);
    memory::memory(&cells, &mut values);
    let (findings, _) = findings::findings(&cells, Design::of(&cells), rules, &mut values);
    (findings, values)
}
