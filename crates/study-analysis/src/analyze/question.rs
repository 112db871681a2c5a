//! The questions of a study, and the numbers of their answers: `finding/QUESTION/*`.

use super::identifiers::group_id;
use super::record::{Interval, Key, Stat, statistics};
use std::borrow::Cow;

/// A question of the study.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Question {
    /// Does VAF predict the rating?
    Vaf,
    /// Does the VAF of what was delivered predict the rating?
    Delivered,
    /// Does the memory of the identification (the forgetting factor) matter?
    Memory,
    /// Does the best-rated realization differ from the second best?
    Best,
    /// Do the realizations differ?
    Differ,
    /// Which pairs of realizations differ?
    Pairs,
    /// Do participants differ in how they rate the realizations?
    Disagreement,
    /// Do ratings drift over the session?
    Order,
    /// Does a rating depend on the one before it?
    CarryOver,
    /// Does the best-rated realization differ from this reference?
    Reference(String),
    /// Is it equivalent to this reference, within the stated margin?
    Equivalence(String),
    /// Does this hidden duplicate differ from its original?
    Repeat(String),
    /// Do the differences between realizations depend on the site?
    SiteRealizations,
    /// Does the effect of VAF depend on the site?
    SiteVaf,
    /// Do the sites differ in their mean rating?
    SiteLevel,
    /// Does this factor matter or, of several joined by `:`, does the effect of one depend on the others?
    Effect(String),
}

impl Question {
    /// The identifier in `--json` and of its statistics, `finding/ID/*`.
    pub fn id(&self) -> String {
        match self {
            Self::Vaf => "vaf".to_owned(),
            Self::Delivered => "delivered".to_owned(),
            Self::Memory => "memory".to_owned(),
            Self::Best => "best".to_owned(),
            Self::Differ => "differ".to_owned(),
            Self::Pairs => "pairs".to_owned(),
            Self::Disagreement => "disagreement".to_owned(),
            Self::Order => "order".to_owned(),
            Self::CarryOver => "carry-over".to_owned(),
            Self::Reference(name) => group_id("reference", &[name]),
            Self::Equivalence(name) => group_id("equivalence", &[name]),
            Self::Repeat(name) => group_id("repeat", &[name]),
            Self::SiteRealizations => "site-realizations".to_owned(),
            Self::SiteVaf => "site-vaf".to_owned(),
            Self::SiteLevel => "site-level".to_owned(),
            Self::Effect(name) => group_id("effect", &[name]),
        }
    }
}

impl Key for Question {
    const PLACEHOLDER: &'static str = "QUESTION";

    fn part(&self) -> Cow<'_, str> {
        self.id().into()
    }
}

statistics! {
    /// The answer to a question of the report: `vaf`, `delivered`, `memory`, `best`, `differ`, `pairs`, `disagreement`, `order`, `carry-over`, `reference/R`, `equivalence/R` (the realization with the best mean against the reference, anchor or physical sample R) or `repeat/D` (the hidden duplicate D), with several sites also `site-realizations`, `site-vaf` and `site-level`, with factors also `effect/E` (the factor E, or the interaction of several, joined by `:`).
    pub struct FindingNumbers {
        /// 1 (yes) or 0 (not shown)
        verdict: Stat,
        /// corrected for the number of comparisons and held against `level`
        p: Stat,
        /// the level of significance of the test
        level: Stat,
        /// of the test that decides ([report.md](report.md))
        statistic: Stat,
        /// first degrees of freedom
        df1: Stat,
        /// second degrees of freedom
        df2: Stat,
        /// main estimate
        estimate: Stat,
        /// its interval
        ci95: Interval,
        /// standardized effect size
        effect: Stat,
        /// participants on whom it rests
        n_participants: Stat,
        /// realizations on which it rests
        n_realizations: Stat,
    }
}
