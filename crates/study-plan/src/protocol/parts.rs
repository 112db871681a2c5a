//! Parts of a session, families of realizations and tracks: `study-protocol/2`.
//!
//! A protocol without parts is one rating part. A *family* is one dimension of the
//! stimulus: a finite ladder of levels, each a realization of its own, named after the
//! family and the step. A *track* compares levels with a standard, by a rule of
//! [`crate::procedure`].

use super::keys::words;
use super::presentations::{Magnitude, Mushra, Presentations};
use super::{
    Adjustment, Answer, Identification, Pairs, Protocol, Ranking, Relative, SearchTask, Seat,
    Similarity,
};
use crate::procedure::{Ladder, ProcedureError, Rule, Track};
use serde::{Deserialize, Serialize};
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId, QuestionId};
use study_stats::psychometric::{Core, Spacing};

/// One of `[[parts]]`: trials of one kind, in an order of their own.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Part {
    /// Identifier of the part.
    pub id: PartId,
    /// What a trial is.
    pub task: Task,
    /// Shown before its first trial.
    pub text: Option<String>,
    /// The questions of a trial, by id, in order. The first is the answer of the trial.
    pub asks: Vec<QuestionId>,
    /// How long each interval is felt.
    pub exposure: Exposure,
    /// From the end of an interval to the start of the next, s.
    pub gap_s: f64,
}

/// What a trial of a part is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Task {
    /// One realization is felt and rated.
    Rating(Presentations),
    /// One level of a family, or one realization, is felt and given a positive number.
    Magnitude(Magnitude),
    /// One realization is rated from 0 to 100 beside a reference.
    Mushra(Mushra),
    /// One realization is felt, and one of several labels is chosen for it.
    Identification(Identification),
    /// Two realizations are felt, and one is chosen.
    Pairs(Pairs),
    /// Levels are told from a standard, on one track or several interleaved ones.
    Discrimination {
        /// `[[tracks]]`, by id.
        tracks: Vec<PartId>,
    },
    /// Two points of a space are felt, and one is chosen; which come next follows from the answers.
    Search(SearchTask),
    /// Two realizations are felt, and how different they are is rated.
    Similarity(Similarity),
    /// Several realizations are felt, and each is given a rank.
    Ranking(Ranking),
    /// A level of a family is set, step by step, until it feels equal to a standard or as it should.
    Adjustment(Adjustment),
}

impl Task {
    /// The realizations of a part whose trials each present one.
    pub fn presentations(&self) -> Option<&Presentations> {
        match self {
            Self::Rating(own) => Some(own),
            Self::Magnitude(own) => Some(&own.presentations),
            Self::Mushra(own) => Some(&own.presentations),
            Self::Identification(own) => Some(&own.presentations),
            Self::Pairs(_)
            | Self::Discrimination { .. }
            | Self::Search(_)
            | Self::Similarity(_)
            | Self::Ranking(_)
            | Self::Adjustment(_) => None,
        }
    }

    /// The reference or standard that is felt before each realization.
    pub fn reference(&self) -> Option<&ModelId> {
        match self {
            Self::Mushra(own) => own.reference.as_ref(),
            Self::Magnitude(own) => own.standard.as_ref().map(|standard| &standard.model),
            Self::Adjustment(own) => own.standard.as_ref(),
            Self::Rating(_)
            | Self::Identification(_)
            | Self::Pairs(_)
            | Self::Discrimination { .. }
            | Self::Search(_)
            | Self::Similarity(_)
            | Self::Ranking(_) => None,
        }
    }

    /// What a part of adjustment sets.
    pub fn adjustment(&self) -> Option<&Adjustment> {
        match self {
            Self::Adjustment(own) => Some(own),
            _ => None,
        }
    }

    /// The labels of a part of identification.
    pub fn identification(&self) -> Option<&Identification> {
        match self {
            Self::Identification(own) => Some(own),
            _ => None,
        }
    }
}

/// How long an interval is felt.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Exposure {
    /// Least time, s.
    pub min_s: f64,
    /// The device stops after this time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_s: Option<f64>,
    /// How often all intervals of a trial can be felt again before the answer.
    pub replays: u32,
}

impl Exposure {
    /// The time until the device stops by itself, s; `None` if it does not.
    pub fn left_s(&self, felt_s: f64) -> Option<f64> {
        Some((self.max_s? - felt_s).max(0.0))
    }
}

/// One of `[[families]]`: one dimension of the stimulus.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FamilyRules {
    /// Identifier of the family.
    pub id: PartId,
    /// Model file that is varied, relative to the protocol.
    pub from: String,
    /// What varies.
    pub vary: Vary,
    /// Model file at level 1 of a blend.
    pub to: Option<String>,
    /// The levels.
    pub ladder: Ladder,
    /// How they are spaced; over it the functions of its tracks are fitted.
    #[serde(skip)]
    pub spacing: Spacing,
    /// Unit of the levels, for people.
    pub unit: Option<String>,
}

words! {
    /// What a level of a family changes in a table.
    Vary {
        /// A weighted mean of two tables: 0 is `from`, 1 is `to`.
        Blend = "blend",
        /// The damping, multiplied by the level.
        Damping = "b",
        /// The mass, multiplied by the level.
        Mass = "mass",
        /// The elastic force (the mean of both directions), multiplied by the level: the strength of the detents.
        Detent = "detent",
        /// Coulomb friction, added: the level in N against the motion.
        Friction = "friction",
    }
}

/// One of `[[tracks]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackRules {
    /// Identifier of the track.
    pub id: PartId,
    /// The kind of trial.
    pub method: Method,
    /// What is compared.
    pub compared: Compared,
    /// How levels are counted; `None`: as the family does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative: Option<Relative>,
    /// Which level comes next.
    pub rule: Rule,
    /// Whether the participant is told if the answer was correct.
    pub feedback: bool,
    /// Share of trials without a signal: yes–no and same–different.
    pub catch: f64,
    /// Share of trials at the top of the ladder.
    pub easy: f64,
    /// How its psychometric functions are fitted, a matter of the analysis.
    #[serde(skip)]
    pub fit: FitRules,
    /// The condition that it measures together with other tracks, a matter of the analysis;
    /// `None`: one of its own.
    #[serde(skip)]
    pub measures: Option<PartId>,
}

/// How the psychometric functions of a track are fitted, where the protocol says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitRules {
    /// The scale of the levels; otherwise that of the family.
    pub scale: Option<Spacing>,
    /// The shape; otherwise a cumulative normal, over logarithms a Weibull function.
    pub core: Option<Core>,
    /// λ of maximum likelihood.
    pub lapse: f64,
}

impl Default for FitRules {
    fn default() -> Self {
        Self {
            scale: None,
            core: None,
            lapse: 0.02,
        }
    }
}

/// What a track compares.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Compared {
    /// Levels of a family with one of its levels.
    Levels {
        /// One of `[[families]]`.
        family: PartId,
        /// Its level in the other intervals; it need not be a step of the ladder.
        standard: f64,
    },
    /// Two realizations.
    Models {
        /// The standard, then the comparison.
        models: [ModelId; 2],
    },
}

words! {
    /// The kind of a trial of a track.
    Method {
        /// Two intervals; the participant says which one is the comparison.
        TwoIntervals = "2ifc",
        /// The same with three intervals.
        ThreeIntervals = "3ifc",
        /// Two intervals, the same or different.
        SameDifferent = "same-different",
        /// Standard and comparison in either order, then one of them again: which was it?
        Abx = "abx",
        /// Three intervals, two of them alike: which is the odd one?
        OddOneOut = "odd-one-out",
        /// One interval, with the comparison or, in catch trials, the standard.
        YesNo = "yes-no",
    }
}

/// What an interval of a track presents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Interval {
    /// The standard.
    Standard,
    /// The level that the track proposes.
    Comparison,
}

use Interval::{Comparison as C, Standard as S};

impl Method {
    /// The sequences of intervals with a signal, equally often; each has a comparison.
    pub fn sequences(self) -> &'static [&'static [Interval]] {
        match self {
            Self::TwoIntervals => &[&[C, S], &[S, C]],
            Self::ThreeIntervals => &[&[C, S, S], &[S, C, S], &[S, S, C]],
            Self::SameDifferent => &[&[S, C], &[C, S]],
            Self::Abx => &[&[S, C, S], &[S, C, C], &[C, S, C], &[C, S, S]],
            Self::OddOneOut => &[
                &[S, S, C],
                &[S, C, S],
                &[C, S, S],
                &[C, C, S],
                &[C, S, C],
                &[S, C, C],
            ],
            Self::YesNo => &[&[C]],
        }
    }

    /// The sequences of catch trials, which have no signal.
    pub fn catch_sequences(self) -> &'static [&'static [Interval]] {
        match self {
            Self::SameDifferent => &[&[S, S], &[C, C]],
            Self::YesNo => &[&[S]],
            _ => &[],
        }
    }

    /// The answers from which the participant chooses.
    pub fn answers(self) -> &'static [&'static str] {
        match self {
            Self::TwoIntervals | Self::Abx => &["first", "second"],
            Self::ThreeIntervals | Self::OddOneOut => &["first", "second", "third"],
            Self::SameDifferent => &["same", "different"],
            Self::YesNo => &["yes", "no"],
        }
    }

    /// Whether a trial has no signal.
    pub fn is_catch(self, intervals: &[Interval]) -> bool {
        self.catch_sequences().contains(&intervals)
    }

    /// The correct answer to a trial; `None` if it is no trial of this kind.
    pub fn correct(self, intervals: &[Interval]) -> Option<&'static str> {
        let odd = |intervals: &[Interval]| {
            let lone = |i: &usize| intervals.iter().filter(|o| **o == intervals[*i]).count() == 1;
            (0..intervals.len()).find(lone)
        };
        let at = match (self, intervals) {
            (Self::YesNo, [interval]) => usize::from(*interval == S),
            (Self::SameDifferent, [a, b]) => usize::from(a != b),
            (Self::Abx, [a, b, x]) if a != b => usize::from(x == b),
            (Self::TwoIntervals, [_, _]) => intervals.iter().position(|i| *i == C)?,
            (Self::ThreeIntervals | Self::OddOneOut, [_, _, _]) => odd(intervals)?,
            _ => return None,
        };
        self.answers().get(at).copied()
    }

    /// Share of correct answers by guessing, where it follows from the method.
    ///
    /// ```
    /// # use study_plan::protocol::{Interval, Method};
    /// assert_eq!(Method::TwoIntervals.guess_rate(), Some(0.5));
    /// let trial = [Interval::Standard, Interval::Comparison];
    /// assert_eq!(Method::TwoIntervals.correct(&trial), Some("second"));
    /// ```
    pub fn guess_rate(self) -> Option<f64> {
        match self {
            Self::TwoIntervals | Self::Abx => Some(0.5),
            Self::ThreeIntervals | Self::OddOneOut => Some(1.0 / 3.0),
            Self::SameDifferent | Self::YesNo => None,
        }
    }
}

impl FamilyRules {
    /// What its levels are, with their unit, as the label of an axis.
    pub fn dimension(&self) -> String {
        let unit = self.unit.as_ref();
        let unit = unit.map_or_else(String::new, |unit| format!(" ({unit})"));
        format!("{}{unit}", self.id)
    }

    /// The realization of a step of the ladder, from 0.
    pub fn realization(&self, step: usize) -> ModelId {
        named(&self.id, &(step + 1).to_string())
    }

    /// The level of one of its realizations.
    pub fn level_of(&self, model: &ModelId) -> Option<f64> {
        let step = model
            .as_str()
            .strip_prefix(self.id.as_str())?
            .strip_prefix('.')?;
        let step: usize = step.parse().ok()?;
        self.ladder.levels().get(step.checked_sub(1)?).copied()
    }

    /// All realizations with their levels, the lowest first.
    pub fn realizations(&self) -> impl Iterator<Item = (ModelId, f64)> {
        let levels = self.ladder.levels().iter().enumerate();
        levels.map(|(step, level)| (self.realization(step), *level))
    }
}

/// Most levels of a family: the name of a step has at most three digits.
pub const MAX_LEVELS: usize = 999;

/// `name.of` as the id of a realization. Both are short enough.
pub(super) fn named(name: &PartId, of: &str) -> ModelId {
    let id = ModelId::new(format!("{name}.{of}"));
    id.expect("a part id has at most 20 characters and those of a model id")
}

impl TrackRules {
    /// Whether an answer is the correct one; `None` if it was declined.
    pub fn is_correct(&self, intervals: &[Interval], answer: &Answer) -> Option<bool> {
        let Answer::Choice(chosen) = answer else {
            return None;
        };
        let correct = self.method.correct(intervals)?;
        chosen.first().map(|given| given == correct)
    }

    /// The realization of the standard.
    pub fn standard(&self) -> ModelId {
        match &self.compared {
            Compared::Levels { .. } => named(&self.id, "standard"),
            Compared::Models { models } => models[0].clone(),
        }
    }

    /// The level of the standard, if it is one of a family.
    pub fn standard_level(&self) -> Option<f64> {
        match self.compared {
            Compared::Levels { standard, .. } => Some(standard),
            Compared::Models { .. } => None,
        }
    }

    /// The family, if it has one.
    pub fn family(&self) -> Option<&PartId> {
        match &self.compared {
            Compared::Levels { family, .. } => Some(family),
            Compared::Models { .. } => None,
        }
    }
}

/// The ladder of a track that compares two realizations.
fn one_step() -> Ladder {
    Ladder::new(vec![1.0]).expect("one level")
}

impl Protocol {
    /// A part by its id.
    pub fn part(&self, id: &PartId) -> Option<&Part> {
        self.parts.iter().find(|p| p.id == *id)
    }

    /// A track by its id.
    pub fn track(&self, id: &PartId) -> Option<&TrackRules> {
        self.tracks.iter().find(|t| t.id == *id)
    }

    /// A family by its id.
    pub fn family(&self, id: &PartId) -> Option<&FamilyRules> {
        self.families.iter().find(|f| f.id == *id)
    }

    /// The level of a realization that is a step of a family or the standard of a track.
    pub fn level_of(&self, model: &ModelId) -> Option<f64> {
        let standard = self.tracks.iter().find(|t| t.standard() == *model);
        let standard = standard.and_then(TrackRules::standard_level);
        standard.or_else(|| self.families.iter().find_map(|f| f.level_of(model)))
    }

    /// The levels that a track may present, as it counts them. Two realizations that are
    /// compared have one, level 1.
    pub fn ladder(&self, track: &TrackRules) -> Ladder {
        let family = track.family().and_then(|id| self.family(id));
        let ladder = family.and_then(|family| track.ladder_of(&family.ladder));
        ladder.unwrap_or_else(one_step)
    }

    /// What the levels of a track are, with their unit, as the label of an axis.
    pub fn dimension(&self, track: &TrackRules) -> Option<String> {
        let family = self.family(track.family()?)?;
        Some(match track.relative {
            None => family.dimension(),
            Some(Relative::Increment) => format!("{} above the standard", family.dimension()),
            Some(Relative::Fraction) => {
                format!("{} above the standard, as a fraction of it", family.id)
            }
        })
    }

    /// The realization of a step of a track's ladder, from 0.
    pub fn comparison(&self, track: &TrackRules, step: usize) -> Option<ModelId> {
        match &track.compared {
            Compared::Levels { family, .. } => {
                let family = self.family(family)?;
                let first = track.steps_left_out(&family.ladder);
                Some(family.realization(first + step))
            }
            Compared::Models { models } => Some(models[1].clone()),
        }
    }

    /// A track before its first trial.
    ///
    /// # Errors
    /// [`ProcedureError`] if its rule and ladder do not fit; those of a protocol do.
    pub fn start(&self, track: &TrackRules, seat: Seat) -> Result<Track, ProcedureError> {
        let number = seat.number().to_string();
        let path = ["track", track.id.as_str(), seat.stream(), &number];
        let mut stream = Stream::new(self.study.seed, &path);
        Track::new(&track.rule, &self.ladder(track), &mut stream)
    }

    /// Whether the answers to a question are numbers but no ratings of a realization: estimates of magnitude, how different two are,
    /// ranks, or levels that were set.
    pub fn has_other_numbers(&self, question: &QuestionId) -> bool {
        self.parts.iter().any(|part| match part.task {
            Task::Magnitude(_) | Task::Similarity(_) | Task::Adjustment(_) => {
                part.asks.first() == Some(question)
            }
            Task::Ranking(_) => part.asks.contains(question),
            _ => false,
        })
    }

    /// Whether the number of trials of a session depends on the answers.
    pub fn is_adaptive(&self) -> bool {
        self.tracks.iter().any(|track| match &track.rule {
            Rule::Staircase(_) => true,
            Rule::QuestPlus(rule) => rule.sd_below.is_some() || rule.entropy_below.is_some(),
            Rule::Constant(_) => false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const METHODS: [Method; 6] = [
        Method::TwoIntervals,
        Method::ThreeIntervals,
        Method::SameDifferent,
        Method::Abx,
        Method::OddOneOut,
        Method::YesNo,
    ];

    #[test]
    fn over_all_sequences_each_answer_is_correct_equally_often() {
        for method in METHODS {
            let with_signal = method.sequences().iter();
            let all = with_signal.chain(method.catch_sequences());
            let mut counts = vec![0; method.answers().len()];
            for sequence in all {
                let correct = method.correct(sequence).unwrap();
                let at = method.answers().iter().position(|a| *a == correct);
                counts[at.unwrap()] += 1;
            }
            assert!(
                counts.iter().all(|n| *n == counts[0] && *n > 0),
                "{method:?}: {counts:?}"
            );
        }
    }

    #[test]
    fn the_correct_answer_follows_from_the_intervals() {
        for (method, intervals, correct) in [
            (Method::TwoIntervals, &[S, C][..], Some("second")),
            (Method::ThreeIntervals, &[S, S, C], Some("third")),
            (Method::Abx, &[S, C, S], Some("first")),
            (Method::Abx, &[C, S, S], Some("second")),
            (Method::OddOneOut, &[C, S, C], Some("second")),
            (Method::SameDifferent, &[C, C], Some("same")),
            (Method::SameDifferent, &[S, C], Some("different")),
            (Method::YesNo, &[C], Some("yes")),
            (Method::YesNo, &[S], Some("no")),
            (Method::Abx, &[S, S, C], None),
            (Method::TwoIntervals, &[C], None),
            (Method::YesNo, &[], None),
        ] {
            assert_eq!(
                method.correct(intervals),
                correct,
                "{method:?} {intervals:?}"
            );
        }
        for (method, guess) in [
            (Method::TwoIntervals, Some(1.0 / 2.0)),
            (Method::Abx, Some(1.0 / 2.0)),
            (Method::ThreeIntervals, Some(1.0 / 3.0)),
            (Method::OddOneOut, Some(1.0 / 3.0)),
            (Method::SameDifferent, None),
            (Method::YesNo, None),
        ] {
            assert_eq!(method.guess_rate(), guess, "{method:?}");
        }
        assert!(Method::SameDifferent.is_catch(&[C, C]) && Method::YesNo.is_catch(&[S]));
        assert!(!Method::YesNo.is_catch(&[C]) && !Method::TwoIntervals.is_catch(&[S, C]));
    }
}
