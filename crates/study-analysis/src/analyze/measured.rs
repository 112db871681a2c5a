//! The statistics of measured outcomes: `outcomes/*`. [`super::outcomes`] computes them.

use super::effects::Anova;
use super::factorial::FactorialTests;
use super::record::{EffectName, Interval, OutcomeName, RealizationName, Stat, statistics};
use std::collections::BTreeMap;

statistics! {
    /// An outcome in the trials of one realization, in the unit of the outcome.
    pub struct OutcomeMean {
        /// trials in which it was measured
        n: Stat,
        /// over these trials
        mean: Stat,
        /// n − 1, over these trials
        sd: Stat,
        /// type 7 of Hyndman & Fan (1996)
        median: Stat,
        /// exp of the mean logarithm of these trials; only with `transform = "log"`
        geometric_mean: Option<Stat>,
        /// participants in whom it was measured
        n_participants: Stat,
        /// what is compared, of a test realization: `adjusted/M/mean` of what is analyzed, as a number of the outcome's unit. Without a missing cell it is the mean of the participants' means, with `transform = "log"` the geometric mean of their geometric means
        center: Option<Stat>,
        /// its interval, from `adjusted/M/ci95`
        center_ci95: Option<Interval>,
    }

    /// Whether an outcome differs between the realizations: the test that would decide of ratings with these cells ([report.md](report.md#which-test-decides)).
    pub struct OutcomeTest {
        /// F; χ² of Friedman's test
        statistic: Stat,
        /// first degrees of freedom, corrected where the test corrects them
        df1: Stat,
        /// second degrees of freedom
        df2: Stat,
        /// of this test alone
        p: Stat,
        /// by Holm (1979) over the tests of all outcomes
        p_holm: Stat,
        /// generalized η²; Kendall's W of Friedman's test
        effect: Stat,
        /// participants on whom it rests
        n_participants: Stat,
    }

    /// An outcome and VAF over the test realizations, described: no test is made of it.
    pub struct OutcomeVaf {
        /// realizations with a VAF
        n: Stat,
        /// Pearson's correlation of VAF with the means that are compared; with `transform = "log"` of their logarithms
        r: Stat,
        /// Spearman's
        rho: Stat,
    }

    /// A time and another outcome, over the participants' means of the test realizations, within participants (Bakdash & Marusich 2017), of what is analyzed; only where the study says of both which end is better. Described: no test is made of it.
    pub struct OutcomePair {
        /// the correlation within participants
        r: Stat,
        /// cells less participants less 1
        df: Stat,
        /// by Fisher's z
        ci95: Interval,
    }

    /// The effect by the ratio of the likelihoods with and without it.
    pub struct OutcomeModelTest {
        /// the likelihood ratio
        chi2: Stat,
        /// fixed effects that are left out
        df: Stat,
        /// of `chi2`, of this test alone; too small with few participants
        p: Stat,
        /// of a factor with two levels: the mean at the second over that at the first, of a binomial model the odds
        ratio: Option<Stat>,
        /// its interval, by the standard error of its logarithm
        ratio_ci95: Option<Interval>,
    }

    /// A generalized mixed model of the numbers of the trials ([statistics-mixed.md](statistics-mixed.md#8-counts-shares-and-positive-numbers)), with intercepts of participants and, where numbers repeat in them or are counts, of the cells of participant and realization and, with several factors within participants, of participants at the levels of each and of two of three; by Laplace's approximation, with intercepts of participants alone by quadrature. It decides nothing.
    pub struct OutcomeModel {
        /// trials of test realizations
        n: Stat,
        /// log-likelihood
        loglik: Stat,
        /// Akaike's criterion
        aic: Stat,
        /// standard deviation of the participants, on the scale of the link
        sd_participant: Stat,
        /// standard deviation of the cells, on the scale of the link
        sd_cell: Option<Stat>,
        /// standard deviation of a participant's intercepts at the levels of a factor, or of two of three, on the scale of the link
        sds: BTreeMap<EffectName, Stat> as "sd",
        /// variance over squared mean, of a gamma model
        dispersion: Option<Stat>,
        /// of the realizations, in a study without factors
        differ: Option<OutcomeModelTest>,
        /// by effect
        effects: BTreeMap<EffectName, OutcomeModelTest> as "effect",
    }

    /// A measured outcome, in the trials whose rating is analyzed. It decides no question of the study.
    pub struct MeasuredOutcome {
        /// trials in which it was measured
        n: Stat,
        /// trials with a rating in which it was not
        n_missing: Stat,
        /// trials in which it was 0 or less, which has no logarithm; only with `transform = "log"`
        n_left_out: Option<Stat>,
        /// by realization
        means: BTreeMap<RealizationName, OutcomeMean> as "desc",
        /// between the realizations, in a study without factors
        differ: Option<OutcomeTest>,
        /// the analysis of variance of what is analyzed, in a study without factors
        rmanova: Option<Anova>,
        /// the effects of the factors on what is analyzed; `p_holm` is corrected over the effects on all outcomes together
        factorial: Option<FactorialTests> as "",
        /// with VAF
        vaf: Option<OutcomeVaf>,
        /// of a time with what else was measured: speed and accuracy
        pairs: BTreeMap<OutcomeName, OutcomePair> as "with",
        /// where the study asks for one, as a second opinion
        model: Option<OutcomeModel>,
    }
}
