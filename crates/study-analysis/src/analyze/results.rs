//! The statistics of an analysis as records.

pub use super::adjusted::{AdjustedCells, AdjustedMean, CellModel, WithinCells};
pub use super::agreement::{Agreement, Coefficient, Intraclass, Krippendorff, Repeatability};
pub use super::checks::{Ends, Residuals};
pub use super::correlation::{
    Correlation, Kendall, LeaveOneOut, Pearson, Permuted, Share, Spearman, Trend, Without,
};
pub use super::describe::{
    CousineauMorey, Described, DescribedAll, Descriptives, Regression, Sizes, SubjectMean,
    Univariate,
};
pub use super::disagreement::{Disagree, Interaction};
pub use super::effects::{Anova, Differences, Friedman, Posthoc, TwoWay, TwoWayEffect};
pub use super::factorial::{
    ClusteredEffect, ContrastEquivalence, FactorialContrast, FactorialEffect, FactorialMean,
    FactorialTests,
};
pub use super::headline::{
    EquivalenceOfVaf, Realistic, Sensitivity, SmallCorrelation, SmallEffect, Variance,
    VarianceShares,
};
pub use super::influence::Influence;
pub use super::measured::{
    MeasuredOutcome, OutcomeMean, OutcomeModel, OutcomeModelTest, OutcomePair, OutcomeTest,
    OutcomeVaf,
};
pub use super::memory::{Covariates, Line, LogMemory, Quadratic};
pub use super::missing::{AllMoved, MissingOf, MissingRatings, Moved};
pub use super::mixed::{
    Coefficients, Likelihood, LmmCrossed, LmmModel, LmmVaf, LmmVafCrossed, LmmVafSlope,
    LmmVariance, MarginalMean, Mixed, SlopeVariance,
};
pub use super::order::{CarryOver, Drift, Order, RepetitionMean, Slope};
pub use super::ordinal::{
    ByModel, ByVaf, CrossedByVaf, FixedByVaf, MixedByModel, MixedByVaf, Ordinal, Proportional,
    ThresholdName,
};
pub use super::pairs::{PairEquivalence, PairTest, PairTests};
pub use super::posterior::{
    PosteriorModel, PosteriorPair, PosteriorRealization, PosteriorSlope, Probability,
};
pub use super::question::FindingNumbers;
use super::question::Question;
use super::record::statistics;
pub use super::record::{
    ContrastName, CovariateName, Declared, DuplicateName, EffectName, Field, Interval, Key,
    LevelsName, List, Number, OutcomeName, PairName, ParticipantName, RealizationName,
    ReferenceName, SiteName, Stat, Why,
};
pub use super::reference::{DuplicateTest, ReferenceEquivalence, ReferenceTest, References};
pub use super::rendering::{DeliveredVaf, Gain, Judged, Playbacks, RenderedVaf, Rendering};
pub use super::sites::{
    SiteDifference, SiteLevels, SiteMean, SiteProfiles, SiteTest, Sites, VafOfSite, VafOfSites,
};
pub use super::subjects::{Screen, Screened, Screening};
pub use super::vaf::{
    Bootstrap, OfSubject, OverParticipants, Page, SubjectCorr, SubjectSlope, Within,
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
        /// the effects of the factors
        factorial: Option<FactorialTests> as "",
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
        /// how much of it hangs on one realization or one participant
        influence: Influence,
        /// missing ratings; absent if there are none
        missing: Option<MissingRatings>,
        /// components of the variance of the ratings
        variance: Variance,
        /// the same by a mixed model, for an effect size
        lmm_variance: Option<LmmVariance>,
    }

    /// Of the correlation with adjusted means what is compared.
    pub struct Adjusted {
        /// decides whether VAF predicts the rating
        pearson: Pearson,
    }

    /// The main results without any exclusion.
    pub struct BeforeExclusion {
        /// adjusted means
        adjusted: BTreeMap<RealizationName, AdjustedMean>,
        /// their model
        lmm_cells: CellModel,
        /// of VAF with the means
        corr: Correlation,
        /// of VAF with the adjusted means
        corr_adjusted: Adjusted,
        /// ratings of each realization
        desc: BTreeMap<RealizationName, Described>,
        /// counts
        design: Sizes,
        /// differences by ranks
        friedman: Friedman,
        /// differences of cell means
        rmanova: Anova,
        /// the crossed mixed model with VAF
        lmm_vaf_crossed: LmmVafCrossed,
        /// pairs
        posthoc: BTreeMap<PairName, Posthoc>,
        /// shares of high ratings
        realistic: BTreeMap<RealizationName, Realistic>,
        /// differences from references
        reference: BTreeMap<ReferenceName, BTreeMap<RealizationName, ReferenceTest>>,
        /// components of the variance
        variance: Variance,
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
        /// the ratings
        descriptives: Descriptives as "",
        /// the participants
        screening: Screening as "",
        /// tests of pairs on which no verdict rests
        posthoc: BTreeMap<PairName, Posthoc>,
        /// of participants and of repetitions
        agreement: Agreement as "",
        /// what does not generalize to other realizations
        over_participants: OverParticipants as "",
        /// ordinal models
        ordinal: Ordinal as "",
        /// ratings at the ends of the scale
        ends: BTreeMap<RealizationName, Ends>,
        /// what participants and realizations leave unexplained
        residuals: Residuals,
        /// measured outcomes
        outcomes: BTreeMap<OutcomeName, MeasuredOutcome>,
        /// a second opinion, if it is asked for
        posterior: Option<PosteriorModel> as "ordinal_posterior",
        /// the answers to the questions of the report
        finding: BTreeMap<Question, FindingNumbers>,
        /// if a rule excluded anything
        before_exclusion: Option<Box<BeforeExclusion>>,
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
    /// What is compared with the results without the exclusion rules.
    pub(super) fn before_exclusion(self) -> BeforeExclusion {
        let evidence = self.evidence;
        BeforeExclusion {
            adjusted: evidence.cells.means,
            lmm_cells: evidence.cells.model,
            corr: Correlation {
                leave_one_out: None,
                ..evidence.corr
            },
            corr_adjusted: Adjusted {
                pearson: evidence.corr_adjusted.pearson,
            },
            desc: self.descriptives.desc,
            design: self.descriptives.design,
            friedman: evidence.differences.friedman,
            rmanova: evidence.differences.rmanova,
            lmm_vaf_crossed: evidence.crossed,
            posthoc: self.posthoc,
            realistic: self.realistic,
            reference: evidence.references.reference,
            variance: evidence.variance,
        }
    }

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
