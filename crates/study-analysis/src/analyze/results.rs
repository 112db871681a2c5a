//! The statistics of an analysis as records.

pub use super::adjusted::{AdjustedCells, AdjustedMean, CellModel};
pub use super::correlation::{
    Correlation, Kendall, LeaveOneOut, Pearson, Permuted, Share, Spearman, Without,
};
pub use super::disagreement::{Disagree, Interaction};
pub use super::effects::{Anova, Differences, Friedman, TwoWay, TwoWayEffect};
pub use super::headline::{
    EquivalenceOfVaf, Realistic, Sensitivity, SmallCorrelation, SmallEffect, Variance,
    VarianceShares,
};
pub use super::memory::{Covariates, Line, LogMemory, Quadratic};
pub use super::mixed::{
    Coefficients, Likelihood, LmmCrossed, LmmModel, LmmVaf, LmmVafCrossed, LmmVafSlope,
    LmmVariance, MarginalMean, Mixed, SlopeVariance,
};
pub use super::order::{CarryOver, Drift, Order, RepetitionMean, Slope};
pub use super::pairs::{PairEquivalence, PairTest, PairTests};
use super::record::statistics;
pub use super::record::{
    CovariateName, Declared, DuplicateName, Field, Interval, Key, List, Number, PairName,
    ParticipantName, RealizationName, ReferenceName, SiteName, Stat, Why,
};
pub use super::reference::{DuplicateTest, ReferenceEquivalence, ReferenceTest, References};
pub use super::rendering::{DeliveredVaf, Gain, Judged, Playbacks, RenderedVaf, Rendering};
pub use super::sites::{
    SiteDifference, SiteLevels, SiteMean, SiteProfiles, SiteTest, Sites, VafOfSite, VafOfSites,
};
use super::values::Values;
use std::collections::BTreeMap;

statistics! {
    /// What the findings rest on. A finding takes its groups from here, so that none of them
    /// can be left out where this is made.
    pub struct Evidence {
        /// of VAF with the means over subjects of the cells
        corr: Correlation,
        /// the same with the adjusted means; the permutations exchange them between the realizations
        corr_adjusted: Correlation,
        /// whether VAF has no effect that matters
        equivalence: EquivalenceOfVaf,
        /// whether the force was that of the table, and whether what was delivered predicts the rating
        rendering: Option<Rendering> as "",
        /// the crossed mixed model with VAF
        crossed: LmmVafCrossed as "lmm_vaf_crossed",
        /// whether realizations differ
        differences: Differences as "",
        /// the means on which verdicts rest
        cells: AdjustedCells as "",
        /// pairs of realizations
        pairs: Option<PairTests> as "pair",
        /// realizations that are not tested
        references: References as "",
        /// whether sites agree
        sites: Option<Sites> as "",
        /// learning and carry-over
        order: Order as "",
        /// whether participants differ in how they rate the realizations
        disagreement: Disagree,
        /// covariates of the realizations, above all the forgetting factor
        covariates: Covariates as "covariate",
        /// components of the variance of the ratings
        variance: Variance,
        /// the same by a mixed model, for an effect size
        lmm_variance: Option<LmmVariance>,
    }

    /// All statistics of ratings.
    pub struct Results {
        /// what the findings rest on
        evidence: Evidence as "",
        /// mixed models on which no finding rests
        mixed: Mixed as "",
        /// shares of high ratings
        realistic: BTreeMap<RealizationName, Realistic>,
        /// what the design can find
        sensitivity: Sensitivity,
    }
}

impl Evidence {
    /// Its statistics by identifier.
    pub fn values(&self) -> Values {
        let mut values = Values::default();
        self.put("", &mut values);
        values
    }
}

impl Results {
    /// All statistics by identifier.
    pub fn values(&self) -> Values {
        let mut values = Values::default();
        self.put("", &mut values);
        values
    }

    /// What an analysis can hold, in the order of the declarations.
    pub fn declared() -> Vec<Declared> {
        let mut all = Vec::new();
        Self::declare("", "", &mut all);
        all
    }
}
