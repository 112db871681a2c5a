//! `[power]`: what is assumed before the study, for `study power`. In no fingerprint: it
//! changes no session and no result.

use super::keys::words;

words! {
    /// A test whose power is simulated.
    PowerTest {
        /// The verdict of the analysis on whether VAF predicts the rating.
        Verdict = "verdict",
        /// Pearson's r over realizations, t test.
        Pearson = "pearson",
        /// The permutation test of Pearson's r, on which the verdict rests.
        Permutation = "permutation",
        /// The slope of the crossed mixed model.
        Crossed = "crossed",
        /// Friedman's test that realizations differ.
        Friedman = "friedman",
        /// The slope of the crossed ordinal model, by its likelihood ratio.
        Clmm = "clmm",
        /// The effect of VAF lies within the equivalence margin of the analysis (two one-sided
        /// tests of the slope of the crossed mixed model).
        Equivalence = "equivalence",
    }
}

impl PowerTest {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Verdict,
        Self::Pearson,
        Self::Permutation,
        Self::Crossed,
        Self::Friedman,
        Self::Clmm,
        Self::Equivalence,
    ];
}

words! {
    /// Where the VAF of simulated studies come from.
    PowerVaf {
        /// Those of `[[models]]`; only for as many realizations as are listed.
        Listed = "listed",
        /// Even steps over the range of those of `[[models]]`.
        Spread = "spread",
        /// Drawn from a normal distribution in each study: they are not known yet.
        Drawn = "drawn",
    }
}

words! {
    /// The distribution of the residual below an ordered scale.
    PowerLink {
        /// Normal.
        Probit = "probit",
        /// Standard logistic.
        Logit = "logit",
    }
}

/// How a number becomes a rating.
#[derive(Debug, Clone, PartialEq)]
pub enum PowerScale {
    /// It is the rating.
    Continuous,
    /// It is rounded to the scale of the primary question.
    Rounded,
    /// The rating follows from thresholds.
    Ordinal {
        /// Distribution of the residual.
        link: PowerLink,
        /// Rising.
        thresholds: Vec<f64>,
    },
}

/// Standard deviations of the random effects, in rating points.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PowerSpread {
    /// Levels of the participants.
    pub participant: Option<f64>,
    /// Means of the realizations about the line.
    pub realization: Option<f64>,
    /// Participant × realization.
    pub interaction: Option<f64>,
    /// Repetition to repetition.
    pub residual: Option<f64>,
    /// Slopes of the participants.
    pub slope: Option<f64>,
}

/// `[power]`; what is absent has a default that `study power` states.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PowerPlan {
    /// Simulated studies of each design.
    pub studies: Option<u64>,
    /// Power that is wanted.
    pub targets: Vec<f64>,
    /// Tests; the first one decides.
    pub tests: Vec<PowerTest>,
    /// Rating points per standard deviation of VAF.
    pub slope: Option<f64>,
    /// The other way to state it: the correlation of VAF with the true means.
    pub rho: Option<f64>,
    /// The smallest slope of interest.
    pub smallest: Option<f64>,
    /// Mean rating.
    pub mean: Option<f64>,
    /// Standard deviations.
    pub sd: PowerSpread,
    /// How a number becomes a rating.
    pub scale: Option<PowerScale>,
    /// Where VAF come from.
    pub vaf: Option<PowerVaf>,
    /// Share of participants that are lost whole.
    pub dropout: Option<f64>,
    /// Share of trials without a rating.
    pub missing: Option<f64>,
    /// Half-width of the interval of the power at which a design has enough studies.
    pub within: Option<f64>,
    /// The longest session, min.
    pub max_session_min: Option<f64>,
    /// Numbers of participants to compare.
    pub participants: Vec<u32>,
    /// Numbers of realizations to compare.
    pub realizations: Vec<u32>,
    /// Numbers of repetitions to compare.
    pub repetitions: Vec<u32>,
}
