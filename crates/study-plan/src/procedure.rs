//! Procedures: which level a track presents next.
//!
//! A track is one sequence of trials of one participant in one condition. It is a pure
//! function: the same rule, ladder, stream and answers give the same next level, on
//! every machine (only `libm` and sums in a fixed order are used). A journal therefore
//! holds answers, and [`verify`] finds the trial at which it does not agree with its
//! rule.
//!
//! A level is a number on the dimension of the stimulus. What is presented comes from a
//! finite [`Ladder`], so that every level is certified before the session. An answer is
//! *positive* if it is correct or, in a yes–no track, "yes"; positive answers lead
//! down.

mod constant;
mod ladder;
mod passes;
pub mod quest;
pub mod search;
pub mod staircase;

pub use constant::Constant;
pub use ladder::Ladder;
pub use passes::Passes;
pub use quest::{Function, Parameter, QuestPlus};
pub use search::{Choose, Lattice, Preferred, Search, SearchRule};
pub use staircase::{Reversal, Scale, Staircase, Stop};

use serde::{Deserialize, Serialize};
use study_base::rng::Stream;
use thiserror::Error;

/// The rule of a track, with all its numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "rule", rename_all = "kebab-case")]
pub enum Rule {
    /// Transformed or weighted up–down.
    Staircase(Staircase),
    /// QUEST+, of which Psi is a special case.
    #[serde(rename = "quest+")]
    QuestPlus(QuestPlus),
    /// Constant stimuli.
    Constant(Constant),
}

impl Rule {
    /// The most trials that a track can take, without easy trials.
    pub fn most_trials(&self) -> u32 {
        match self {
            Self::Staircase(rule) => rule.stop.max_trials,
            Self::QuestPlus(rule) => rule.trials,
            Self::Constant(rule) => rule.trials(),
        }
    }
}

/// Why a rule, a ladder or a formula cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ProcedureError {
    /// A list that must have an entry has none.
    #[error("{what} is empty")]
    Empty {
        /// Such as `steps`.
        what: String,
    },
    /// A number outside its range.
    #[error("{what} is {value}; it must be {range}")]
    Range {
        /// The key.
        what: String,
        /// The number.
        value: f64,
        /// Such as "above 0".
        range: &'static str,
    },
    /// Levels that do not rise.
    #[error("the levels of a ladder must rise: {after} follows {before}")]
    NotRising {
        /// A level.
        before: f64,
        /// The one that follows it.
        after: f64,
    },
    /// A level that the ladder does not have.
    #[error("{level} is not a level of the ladder, {first} to {last}")]
    NotOnLadder {
        /// The level.
        level: f64,
        /// The lowest of the ladder.
        first: f64,
        /// The highest.
        last: f64,
    },
    /// A step that has no effect, because the scale multiplies.
    #[error("with a log or dB scale {what} must be above 0, and is {value}")]
    NotPositive {
        /// What is not positive.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Weights of a prior that do not match the values.
    #[error("the prior of {name} has {weights} weights for {values} values")]
    Prior {
        /// The parameter.
        name: String,
        /// Number of weights.
        weights: usize,
        /// Number of values.
        values: usize,
    },
    /// The table of a QUEST+ would be too large.
    #[error(
        "{stimuli} stimuli times {cells} combinations of parameters are more than {limit} cells; take fewer values"
    )]
    TooLarge {
        /// Number of stimuli.
        stimuli: usize,
        /// Number of combinations.
        cells: usize,
        /// Most cells.
        limit: usize,
    },
    /// A formula that cannot be read.
    #[error("formula: {what} at character {at}")]
    Formula {
        /// What is wrong.
        what: String,
        /// Counted from 1.
        at: usize,
    },
    /// A function whose value is not a probability.
    #[error("the function gives {value}, which is no probability, at {at}")]
    NoProbability {
        /// The value.
        value: f64,
        /// The point and parameters.
        at: String,
    },
}

/// What a track proposes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// The rule's own level, which a staircase does not round.
    pub level: f64,
    /// The step of the ladder that is presented, from 0.
    pub step: usize,
}

/// The answer to one trial of a track, as it was given first: a later correction
/// changes the analysis, not the track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The level that was presented.
    pub presented: f64,
    /// Correct, or "yes" in a yes–no track.
    pub positive: bool,
    /// An easy trial, which the rule did not propose. It moves no staircase and counts
    /// for no limit; QUEST+ learns from it.
    #[serde(default)]
    pub easy: bool,
}

/// A track in progress.
#[derive(Debug, Clone)]
pub struct Track {
    ladder: Ladder,
    state: State,
}

#[derive(Debug, Clone)]
enum State {
    Staircase(staircase::Progress),
    QuestPlus(Box<quest::Progress>),
    Constant(constant::Progress),
}

impl Track {
    /// A track before its first trial. `ladder` has the levels that it may present;
    /// `stream` gives the order of constant stimuli, and the other rules draw nothing.
    pub fn new(rule: &Rule, ladder: &Ladder, stream: &mut Stream) -> Result<Self, ProcedureError> {
        let state = match rule {
            Rule::Staircase(rule) => {
                State::Staircase(staircase::Progress::new(rule, Some(ladder))?)
            }
            Rule::QuestPlus(rule) => {
                State::QuestPlus(Box::new(quest::Progress::on_ladder(rule, ladder)?))
            }
            Rule::Constant(rule) => State::Constant(constant::Progress::new(rule, ladder, stream)?),
        };
        Ok(Self {
            ladder: ladder.clone(),
            state,
        })
    }

    /// What the next trial presents; `None` when the track has ended.
    pub fn next(&self) -> Option<Proposal> {
        let level = match &self.state {
            State::Staircase(state) => state.next(),
            State::QuestPlus(state) => state.next().map(|point| point[0]),
            State::Constant(state) => state.next(),
        }?;
        let step = self.ladder.nearest(level);
        Some(Proposal { level, step })
    }

    /// Takes the answer to a trial. A track that has ended takes only easy trials.
    pub fn answer(&mut self, answer: &Answer) {
        if self.next().is_none() && !answer.easy {
            return;
        }
        match &mut self.state {
            State::Staircase(state) if !answer.easy => state.answer(answer.positive),
            State::Constant(state) if !answer.easy => state.answer(),
            State::Staircase(_) | State::Constant(_) => {}
            State::QuestPlus(state) if answer.easy => {
                state.learn(&[answer.presented], answer.positive);
            }
            State::QuestPlus(state) => state.answer(&[answer.presented], answer.positive),
        }
    }

    /// How far the track is.
    pub fn summary(&self) -> Summary {
        match &self.state {
            State::Staircase(state) => state.summary(),
            State::QuestPlus(state) => state.summary(),
            State::Constant(state) => Summary {
                trials: state.answered(),
                ended: state.next().is_none(),
                finished: state.next().is_none(),
                ..Summary::default()
            },
        }
    }
}

/// How far a track is, and what it estimates.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Answered trials that the rule proposed.
    pub trials: u32,
    /// No further trial follows.
    pub ended: bool,
    /// The rule's own criterion was reached, not only its largest number of trials.
    pub finished: bool,
    /// State of a staircase.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reversals: Vec<Reversal>,
    /// Of a staircase: the mean of its last reversals, if it has enough of them.
    /// Of QUEST+: the posterior mean of the first parameter.
    pub estimate: Option<f64>,
    /// Standard deviation of those reversals (of log10 under log and dB), or of the
    /// posterior. That of reversals is no standard error, because they are correlated.
    pub spread: Option<f64>,
    /// Of a staircase: trials at which a limit held the level back. After more than
    /// three the estimate is biased.
    pub held: u32,
    /// Of QUEST+: the posterior of each parameter that has more than one value.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub posterior: Vec<quest::Marginal>,
}

/// What a track that has had `answers` presents next.
pub fn next(
    rule: &Rule,
    ladder: &Ladder,
    stream: &mut Stream,
    answers: &[Answer],
) -> Result<Option<Proposal>, ProcedureError> {
    Ok(replay(rule, ladder, stream, answers)?.next())
}

/// The track after `answers`.
pub fn replay(
    rule: &Rule,
    ladder: &Ladder,
    stream: &mut Stream,
    answers: &[Answer],
) -> Result<Track, ProcedureError> {
    let mut track = Track::new(rule, ladder, stream)?;
    for answer in answers {
        track.answer(answer);
    }
    Ok(track)
}

/// A trial of a track as a journal has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recorded {
    /// The rule's level; `None` for an easy trial.
    pub proposed: Option<f64>,
    /// What was presented and answered.
    pub answer: Answer,
}

/// A journal that its rule would not have produced.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Mismatch {
    /// Another level was proposed.
    #[error("trial {trial} of the track proposes {recorded}, and its rule {computed}")]
    Proposed {
        /// Trial of the track, from 1, easy trials included.
        trial: usize,
        /// The level of the journal.
        recorded: f64,
        /// The level of the rule.
        computed: f64,
    },
    /// The level that was presented is not the step of the ladder.
    #[error("trial {trial} of the track presents {recorded}, and the ladder has {computed}")]
    Presented {
        /// Trial of the track, from 1.
        trial: usize,
        /// The level of the journal.
        recorded: f64,
        /// The level of the ladder.
        computed: f64,
    },
    /// The rule had ended the track.
    #[error("trial {trial} of the track is after its end")]
    Ended {
        /// Trial of the track, from 1.
        trial: usize,
    },
}

/// Replays a track and compares every level, bit for bit. The first mismatch is an
/// error. `track` has had no answer yet.
pub fn verify(mut track: Track, trials: &[Recorded]) -> Result<(), Mismatch> {
    for (trial, recorded) in (1..).zip(trials) {
        if let Some(level) = recorded.proposed {
            let proposal = track.next().ok_or(Mismatch::Ended { trial })?;
            if proposal.level.to_bits() != level.to_bits() {
                return Err(Mismatch::Proposed {
                    trial,
                    recorded: level,
                    computed: proposal.level,
                });
            }
            let on_ladder = track.ladder.level(proposal.step);
            if on_ladder.to_bits() != recorded.answer.presented.to_bits() {
                return Err(Mismatch::Presented {
                    trial,
                    recorded: recorded.answer.presented,
                    computed: on_ladder,
                });
            }
        }
        track.answer(&recorded.answer);
    }
    Ok(())
}

/// `value`, if it is above 0.
fn above_0(what: &str, value: f64) -> Result<(), ProcedureError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ProcedureError::Range {
        what: what.to_owned(),
        value,
        range: "above 0",
    })
}

/// An error for an empty list.
fn filled<T>(what: &str, list: &[T]) -> Result<(), ProcedureError> {
    if list.is_empty() {
        return Err(ProcedureError::Empty {
            what: what.to_owned(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
