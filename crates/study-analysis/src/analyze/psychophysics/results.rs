//! The statistics of a part as records.

pub use super::abilities::AbilityDifference;
pub use super::adjustment::{Adjusted, ConstantError, OwnSettings, SettingSpread, SidesOfStart};
pub use super::again::{Again, Courses, Groups, Profiles, Retest};
pub use super::detection::Sensitivity;
pub use super::fits::{
    Fitted, FreeLapse, Function, Functions, GroupThresholds, MaximumLikelihood, Mode,
    PooledFunction, Posterior, ThresholdSummary, WithStandard,
};
pub use super::identification::{
    AboveGuessing, Identified, LabelPair, LabelUse, OwnIdentification, Recall, Transfer,
};
pub use super::marginal::Marginal;
pub use super::over_participants::{
    AboveChance, Center, ConditionModel, Contrast, FTest, GroupSensitivity, Sample,
};
pub use super::population::{Convergence, Pooled, PooledContrast, PopulationModel};
pub use super::preferences::{Ability, OrderEffect, Preferences, Ties, Triads};
pub use super::ranking::{
    BestRank, OwnRanking, RankAgreement, RankTie, RankedItem, RankedPair, Rankings,
};
pub use super::scales::{
    GeometricMean, Magnitudes, MeanExponent, Mushra, OwnExponent, PowerLaw, Rated, Screened,
};
pub use super::sequential::{SequentialEffect, SequentialResult};
pub use super::similarity::{
    Agreed, IdenticalPairs, MapFit, MapOf, OrderOfPairs, OwnDifferences, OwnWeights,
    PairDifference, Place, SecondDimension, Similarities, StressByChance, WeightedPlace, Weights,
};
pub use super::standards::{AboveStandard, WebersLaw};
pub use super::tracks::{
    EasyTrials, MarginalResult, QuestPlusResult, StaircaseResult, TrackResult,
};
pub use crate::analyze::keys::{
    At, CellName, ConditionName, ConfusionName, DimensionsName, GroupName, ItemName, LabelName,
    ParameterName, PropertyName, TiedName,
};
use crate::analyze::record::{Interval, ParticipantName, RealizationName, Stat, statistics};
use crate::analyze::results::Pearson;
use std::collections::BTreeMap;

statistics! {
    /// The answers to an item, as they were given.
    pub struct ItemAnswers {
        /// number of answers
        n: Stat,
        /// their mean
        mean: Stat,
        /// their standard deviation
        sd: Stat,
    }

    /// The scores after one condition, block or part.
    pub struct ScoresAfter {
        /// participants with a score
        n: Stat,
        /// mean of the participants' means
        mean: Stat,
        /// their standard deviation
        sd: Stat,
        /// t interval of the mean
        ci95: Interval,
    }

    /// The scores of a subscale of a questionnaire of the study's own.
    pub struct SubscaleScores {
        /// participants with a score
        n: Stat,
        /// mean of the participants' means
        mean: Stat,
        /// their standard deviation
        sd: Stat,
        /// t interval of the mean
        ci95: Interval,
    }

    /// A questionnaire.
    pub struct QuestionnaireResult {
        /// by participant; in a study of several sessions by participant@session
        score: BTreeMap<ParticipantName, Stat>,
        /// by item
        item: BTreeMap<ItemName, ItemAnswers>,
        /// by subscale
        scale: BTreeMap<ItemName, SubscaleScores>,
        /// between the trials, by condition, block or part
        after: BTreeMap<ConditionName, ScoresAfter>,
        /// questionnaires without an answer to every item
        n_incomplete: Stat,
        /// participants with a score
        n: Stat,
        /// mean of the participants' means
        mean: Stat,
        /// their median
        median: Stat,
        /// their standard deviation
        sd: Stat,
        /// t interval of the mean
        ci95: Interval,
    }

    /// What participants have in common; it depends on who is excluded.
    pub struct OverParticipants {
        /// thresholds of a condition
        psy_group: BTreeMap<ConditionName, GroupThresholds>,
        /// thresholds in several conditions
        psy_mixed: Option<ConditionModel>,
        /// Weber's law, of tracks that count levels from several standards
        webers_law: Option<WebersLaw>,
        /// thresholds learned together, of tracks of several participants
        psy_population: Option<PopulationModel>,
        /// sensitivities of a condition
        sdt_group: BTreeMap<ConditionName, GroupSensitivity>,
        /// estimated magnitudes
        magnitude: Option<Magnitudes>,
        /// ratings beside a reference
        mushra: Option<Mushra>,
        /// whether answers depend on the trial before
        sequential: Option<SequentialResult>,
        /// labels that were given
        identification: Option<Identified>,
        /// how different realizations are
        similarity: Option<Similarities>,
        /// ranks of realizations
        ranking: Option<Rankings>,
        /// levels that were set
        adjustment: Option<Adjusted>,
        /// groups and sessions
        again: Again as "",
    }

    /// Preferences without the exclusions.
    pub struct PreferencesBefore {
        /// the ability of a realization
        ability: BTreeMap<RealizationName, Stat>,
        /// their correlation with VAF
        vaf: Option<CorrelationBefore>,
    }

    /// A correlation without the exclusions.
    pub struct CorrelationBefore {
        /// Pearson's
        pearson: Pearson,
    }

    /// What depends on the exclusions, as it would be without them.
    pub struct BeforeExclusion {
        /// what participants have in common
        over: OverParticipants as "",
        /// preferences
        pairs: Option<PreferencesBefore>,
    }

    /// All statistics of a part that is no rating, of a questionnaire, or of a table of trials.
    pub struct PartResults {
        /// how tracks went
        track: BTreeMap<CellName, TrackResult>,
        /// psychometric functions
        psy: BTreeMap<CellName, Function>,
        /// with several participants of a condition, functions of their summed counts
        pooled: BTreeMap<ConditionName, PooledFunction> as "psy/pooled",
        /// sensitivities
        sdt: BTreeMap<CellName, Sensitivity>,
        /// paired preferences
        pairs: Option<Preferences>,
        /// estimated magnitudes of realizations, one mean of logarithms for each participant and realization
        magnitude_mixed: Option<ConditionModel>,
        /// ratings beside a reference over everybody, if somebody is screened
        mushra_unscreened: BTreeMap<ConditionName, Rated>,
        /// a questionnaire
        questionnaire: Option<QuestionnaireResult>,
        /// what participants have in common
        over: OverParticipants as "",
        /// without the exclusions, if there are any
        before_exclusion: Option<BeforeExclusion>,
    }
}

impl PartResults {
    /// What depends on the exclusions.
    pub(super) fn before_exclusion(self) -> BeforeExclusion {
        let of_pairs = |pairs: Preferences| PreferencesBefore {
            ability: (pairs.items.0.into_iter())
                .map(|(name, item)| (name, item.ability))
                .collect(),
            vaf: pairs.vaf.map(|vaf| CorrelationBefore {
                pearson: vaf.pearson,
            }),
        };
        BeforeExclusion {
            over: self.over,
            pairs: self.pairs.map(of_pairs),
        }
    }
}
