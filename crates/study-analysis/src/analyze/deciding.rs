//! Verdicts without the other statistics of an analysis: for thousands of simulated studies.

use super::adjusted::Adjusted;
use super::cells::Cells;
use super::design::Design;
use super::findings::{self, Finding};
use super::results::{Correlation, Evidence, LmmVafCrossed};
use super::{Rules, mixed, select, vaf};
use study_session::outcome::ratings::Ratings;

/// What [`super::analyze`] says about VAF.
#[derive(Debug, Clone, PartialEq)]
pub struct Deciding {
    /// The finding, with the same verdict, test and estimate; `None` if no realization
    /// has a VAF.
    pub finding: Option<Finding>,
    /// The correlation on which it rests.
    pub corr_adjusted: Correlation,
    /// The crossed mixed model.
    pub crossed: LmmVafCrossed,
}

/// The part of [`super::analyze`] that answers whether VAF predicts the rating.
pub fn deciding(ratings: &Ratings, rules: &Rules) -> Deciding {
    let (decisions, _) = select::decide(ratings, rules);
    let used = super::rows(ratings, |i| decisions[i].is_none());
    let cells = Cells::of(&used);
    let corr_adjusted = vaf::deciding(&cells, &Adjusted::of(&cells), rules);
    let about = findings::AboutVaf {
        adjusted: &corr_adjusted,
        beside: None,
        influence: None,
    };
    Deciding {
        finding: findings::of_vaf(&cells, Design::of(&cells), rules, &about),
        crossed: mixed::only_crossed(&cells),
        corr_adjusted,
    }
}

/// The findings of [`super::analyze`], with the statistics that decide them; the effect size
/// of one may be missing.
pub fn all_findings(ratings: &Ratings, rules: &Rules) -> (Vec<Finding>, Evidence) {
    let (decisions, _) = select::decide(ratings, rules);
    let used = super::rows(ratings, |i| decisions[i].is_none());
    let cells = Cells::of(&used);
    let adjusted = Adjusted::of(&cells);
    let inputs = super::Inputs {
        cells: &cells,
        adjusted: &adjusted,
        rules,
    };
    let corr_adjusted = vaf::deciding(&cells, &adjusted, rules);
    let (corr, crossed) = (vaf::raw(&cells, rules), mixed::only_crossed(&cells));
    let evidence = super::evidence(&inputs, corr, corr_adjusted, crossed);
    let (findings, _) = findings::findings(&cells, Design::of(&cells), rules, &evidence);
    (findings, evidence)
}
