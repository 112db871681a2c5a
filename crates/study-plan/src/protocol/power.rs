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
        /// The realization with the highest VAF is equivalent to the hidden reference, within
        /// the margin of the analysis (two one-sided t tests over participants).
        ReferenceEquivalence = "reference-equivalence",
        /// Of a part of pairs: a realization is preferred to another.
        Preferred = "preferred",
        /// Of a part of pairs: VAF predicts which realization is preferred.
        PreferenceVaf = "preference-vaf",
        /// Of a part of tracks: thresholds differ between its tracks.
        Thresholds = "thresholds",
        /// Of a part of tracks: the two realizations of every track are told apart.
        ToldApart = "told-apart",
        /// Of a factorial study: each effect that is tested, with Holm's correction over all.
        Effect = "effect",
        /// Of a part of ranking: participants rank the realizations alike.
        RankedAlike = "ranked-alike",
        /// Of a part of ranking: one realization is above each other one.
        RankedFirst = "ranked-first",
        /// Of a part of similarity: the map follows the level of a family, or VAF.
        MapFollows = "map-follows",
        /// Of a part of adjustment: settings differ from the standard.
        Adjusted = "adjusted",
        /// Of a part of identification: the right label is given more often than by guessing.
        Identified = "identified",
    }
}

impl PowerTest {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::Verdict,
        Self::Pearson,
        Self::Permutation,
        Self::Crossed,
        Self::Friedman,
        Self::Clmm,
        Self::Equivalence,
        Self::ReferenceEquivalence,
        Self::Preferred,
        Self::PreferenceVaf,
        Self::Thresholds,
        Self::ToldApart,
        Self::Effect,
        Self::RankedAlike,
        Self::RankedFirst,
        Self::MapFollows,
        Self::Adjusted,
        Self::Identified,
    ];

    /// Whether it is one of ratings, and not of another part.
    pub fn is_of_ratings(self) -> bool {
        !matches!(
            self,
            Self::Preferred
                | Self::PreferenceVaf
                | Self::Thresholds
                | Self::ToldApart
                | Self::Effect
                | Self::RankedAlike
                | Self::RankedFirst
                | Self::MapFollows
                | Self::Adjusted
                | Self::Identified
        )
    }
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
    /// Standard logistic residuals, with the thresholds that a pilot allows.
    FromPilot,
}

/// What is assumed of participants on tracks.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PowerTrack {
    /// Threshold on the first track, in its levels.
    pub threshold: Option<f64>,
    /// Threshold on the last track over that on the first.
    pub ratio: Option<f64>,
    /// The same as a difference, for levels without ratios.
    pub difference: Option<f64>,
    /// From 5 to 95 % of the function, in levels.
    pub width: Option<f64>,
    /// Share of lapses.
    pub lapse: Option<f64>,
    /// Share of "yes" without a signal.
    pub guess: Option<f64>,
    /// d′ of two realizations.
    pub d: Option<f64>,
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
    /// Target power.
    pub targets: Vec<f64>,
    /// Tests; the first one decides.
    pub tests: Vec<PowerTest>,
    /// Rating points per standard deviation of VAF.
    pub slope: Option<f64>,
    /// The other way to state it: the correlation of VAF with the true means.
    pub rho: Option<f64>,
    /// The smallest slope of interest.
    pub smallest: Option<f64>,
    /// Mean rating; of adjustment the mean level that is set, of identification the share of correct answers.
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
    /// The true mean of the hidden reference minus that of the realization with the highest
    /// VAF.
    pub reference: Option<f64>,
    /// Effects of a factorial study and their sizes, in rating points.
    pub effects: Vec<(String, f64)>,
    /// Share of "no difference" between two realizations that are alike.
    pub ties: Option<f64>,
    /// Participants on tracks.
    pub track: PowerTrack,
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

/// Reads an effect and its size: `friction=0.5`, `friction:detent=0.5`.
///
/// # Errors
/// What is expected, in words.
///
/// ```
/// # use study_plan::protocol::power::effect;
/// assert_eq!(effect("friction:detent = 0.5"), Ok(("friction:detent".to_owned(), 0.5)));
/// assert!(effect("friction").is_err());
/// ```
pub fn effect(text: &str) -> Result<(String, f64), &'static str> {
    const EXPECTED: &str =
        "write an effect and its size in rating points: friction=0.5 or friction:detent=0.5";
    let (name, size) = text.split_once('=').ok_or(EXPECTED)?;
    let size: f64 = size.trim().parse().map_err(|_| EXPECTED)?;
    let name = name.trim();
    match size.is_finite() && !name.is_empty() {
        true => Ok((name.to_owned(), size)),
        false => Err(EXPECTED),
    }
}

impl PowerPlan {
    /// What is stated here, and of the rest what `earlier` states. Slope and rho are one
    /// statement.
    pub fn or(self, earlier: &Self) -> Self {
        let list = |own: Vec<u32>, earlier: &Vec<u32>| match own.is_empty() {
            true => earlier.clone(),
            false => own,
        };
        let (slope, rho) = match self.slope.is_some() || self.rho.is_some() {
            true => (self.slope, self.rho),
            false => (earlier.slope, earlier.rho),
        };
        let (sd, track) = (earlier.sd, earlier.track);
        Self {
            studies: self.studies.or(earlier.studies),
            targets: match self.targets.is_empty() {
                true => earlier.targets.clone(),
                false => self.targets,
            },
            tests: match self.tests.is_empty() {
                true => earlier.tests.clone(),
                false => self.tests,
            },
            slope,
            rho,
            smallest: self.smallest.or(earlier.smallest),
            mean: self.mean.or(earlier.mean),
            sd: PowerSpread {
                participant: self.sd.participant.or(sd.participant),
                realization: self.sd.realization.or(sd.realization),
                interaction: self.sd.interaction.or(sd.interaction),
                residual: self.sd.residual.or(sd.residual),
                slope: self.sd.slope.or(sd.slope),
            },
            scale: self.scale.or_else(|| earlier.scale.clone()),
            vaf: self.vaf.or(earlier.vaf),
            dropout: self.dropout.or(earlier.dropout),
            missing: self.missing.or(earlier.missing),
            reference: self.reference.or(earlier.reference),
            effects: match self.effects.is_empty() {
                true => earlier.effects.clone(),
                false => self.effects,
            },
            ties: self.ties.or(earlier.ties),
            track: PowerTrack {
                threshold: self.track.threshold.or(track.threshold),
                ratio: self.track.ratio.or(track.ratio),
                difference: self.track.difference.or(track.difference),
                width: self.track.width.or(track.width),
                lapse: self.track.lapse.or(track.lapse),
                guess: self.track.guess.or(track.guess),
                d: self.track.d.or(track.d),
            },
            within: self.within.or(earlier.within),
            max_session_min: self.max_session_min.or(earlier.max_session_min),
            participants: list(self.participants, &earlier.participants),
            realizations: list(self.realizations, &earlier.realizations),
            repetitions: list(self.repetitions, &earlier.repetitions),
        }
    }
}
