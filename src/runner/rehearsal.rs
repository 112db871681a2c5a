//! Sessions with raters (simulated participants): the same runner, store, device and
//! session on a virtual clock.
//!
//! The rater sees the view, as a person does, and is told which realization was played,
//! which stands for feeling it. Dates are virtual and start at [`first_day`], one day
//! per participant, so that the same protocol and seed give the same bytes.

use super::clock::VirtualClock;
use super::{Runner, Setup};
use crate::rater::{Aim, Percepts, Rater};
use chrono::{DateTime, FixedOffset};
use std::time::Duration;
use study_base::text::{ModelId, QuestionId};
use study_plan::protocol::{Answer, Protocol, Question, Stimuli, Trial, Turn};
use study_session::outcome::FormId;
use study_session::session::view::Adjusting;
use study_session::session::{Config, Ending, Input, Screen, View};

/// Time that a rater spends on a screen without a question, s.
const GLANCE_S: f64 = 2.0;
/// Time with a level that is set, relative to that with a realization.
const LEVEL: f64 = 0.2;
/// Maximum number of turns; a session that does not end by then has a bug.
const MAX_TURNS: u32 = 5_000_000;

/// Date of the first simulated session.
pub fn first_day() -> DateTime<FixedOffset> {
    DateTime::parse_from_rfc3339("2007-03-22T09:00:00+00:00").expect("a valid date")
}

/// Why a rehearsal failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RehearsalError {
    /// The session could not be opened.
    #[error("the session of {participant} could not be opened: {why}")]
    Refused {
        /// The participant.
        participant: String,
        /// The reason given by the store.
        why: String,
    },
    /// An event could not be written.
    #[error("the session of {participant} could not be saved: {why}")]
    NotSaved {
        /// The participant.
        participant: String,
        /// The reason given by the store.
        why: String,
    },
    /// The session does not end.
    #[error("the session of {participant} does not end: it stays at {screen}")]
    Stuck {
        /// The participant.
        participant: String,
        /// The screen at which it stays.
        screen: String,
    },
}

/// Runs one simulated participant's session from the first screen to the last.
///
/// # Errors
/// [`RehearsalError`] if the session cannot be opened, saved or ended.
pub fn run_one(
    setup: Setup,
    participant: &str,
    clock: &VirtualClock,
    rater: &mut Rater,
    percepts: &Percepts,
) -> Result<Ending, RehearsalError> {
    let config = Config {
        participant: participant.to_owned(),
        operator: "simulated".to_owned(),
        front: None,
        auto_identify: true,
        ..Config::default()
    };
    let protocol = setup.protocol.clone();
    let mut runner = Runner::new(setup, config);
    let mut plan = Plan::default();
    for _ in 0..MAX_TURNS {
        let view = runner.view();
        match &view.screen {
            Screen::Who {
                claiming: false, ..
            } => {
                if let Some(why) = view.notice.clone() {
                    return Err(RehearsalError::Refused {
                        participant: participant.to_owned(),
                        why,
                    });
                }
            }
            Screen::SaveTrouble { what } => {
                return Err(RehearsalError::NotSaved {
                    participant: participant.to_owned(),
                    why: what.clone(),
                });
            }
            _ => {}
        }
        let felt = Felt {
            protocol: &protocol,
            percepts,
            model: runner.felt(),
            trial: runner.presented(),
        };
        let inputs = plan.turn(&view, rater, &felt, clock);
        runner.took_time();
        if let Some(ended) = runner.step(inputs) {
            let why = match ended.unsaved {
                None => return Ok(ended.ending),
                Some(unsaved) => unsaved.why.unwrap_or_default(),
            };
            return Err(RehearsalError::NotSaved {
                participant: participant.to_owned(),
                why,
            });
        }
    }
    Err(RehearsalError::Stuck {
        participant: participant.to_owned(),
        screen: format!("{:?}", runner.view().screen),
    })
}

/// What stands for feeling: the realization that was played last, and the whole trial.
struct Felt<'a> {
    protocol: &'a Protocol,
    percepts: &'a Percepts,
    model: Option<&'a ModelId>,
    trial: Option<(&'a Trial, &'a [ModelId])>,
}

/// State of a rater during a session.
#[derive(Debug, Default)]
struct Plan {
    /// Remaining exploration time, s; `None`: not drawn yet for this playback.
    exploring_s: Option<f64>,
    /// Where the hand goes in a trial of adjustment.
    aim: Option<(u32, Aim)>,
}

impl Plan {
    /// Advances the clock by the time that a person would take; returns the inputs.
    fn turn(
        &mut self,
        view: &View,
        rater: &mut Rater,
        felt: &Felt<'_>,
        clock: &VirtualClock,
    ) -> Vec<Input> {
        let pass = |s: f64| clock.advance(Duration::from_secs_f64(s.max(0.0)));
        if !matches!(view.screen, Screen::Playing { .. }) {
            self.exploring_s = None;
        }
        match &view.screen {
            Screen::Who { .. } | Screen::Loading { .. } | Screen::Stopping | Screen::Saving => {
                pass(0.02);
                Vec::new()
            }
            Screen::ResumeChoice { .. } => {
                vec![Input::Resume(study_session::outcome::Choice::Continue)]
            }
            Screen::Consent { .. } => {
                pass(GLANCE_S);
                vec![Input::Consent(true)]
            }
            Screen::Message { .. }
            | Screen::Mount { .. }
            | Screen::End { .. }
            | Screen::Paused { .. } => {
                pass(GLANCE_S);
                vec![Input::Advance]
            }
            Screen::Reference { wait_s, .. } => {
                pass(rater.reference_s().max(*wait_s));
                vec![Input::Advance]
            }
            Screen::Break { wait_s, .. } => {
                pass(wait_s + GLANCE_S);
                vec![Input::Advance]
            }
            Screen::Playing {
                since_s,
                keep_exploring,
                exposure,
                ..
            } => {
                // In small steps, so that telemetry arrives as in a real session.
                const PIECE_S: f64 = 0.25;
                let most_s = exposure.max_s.map_or(f64::INFINITY, |max| 0.8 * max);
                let left = self.exploring_s.get_or_insert_with(|| {
                    let whole_s = rater.exploration_s();
                    match view.adjusting {
                        Some(_) => (LEVEL * whole_s).min(most_s),
                        None => whole_s,
                    }
                });
                let until = exposure.left_s(*since_s).unwrap_or(PIECE_S);
                pass(PIECE_S.min(left.max(0.02)).min(until));
                *left -= PIECE_S;
                let over = *left <= 0.0;
                let turn = match &view.adjusting {
                    Some(own) if over => self.adjust(own, rater, felt),
                    _ => None,
                };
                if let Some(turn) = turn {
                    vec![Input::Adjust(turn)]
                } else if over && !keep_exploring {
                    vec![Input::Advance]
                } else {
                    Vec::new()
                }
            }
            Screen::Stopped { can_rate } => {
                pass(GLANCE_S);
                vec![if *can_rate && view.adjusting.is_none() {
                    Input::RateStopped
                } else {
                    Input::PlayAgain
                }]
            }
            Screen::DeviceTrouble { can_go_on, .. } => {
                pass(0.5);
                if *can_go_on {
                    vec![Input::Advance]
                } else {
                    Vec::new()
                }
            }
            Screen::Form {
                form: FormId::Consent,
                questions,
                ..
            } => {
                pass(GLANCE_S);
                let initials = |q: &Question| (q.id.clone(), Answer::Text("SIM".to_owned()));
                vec![Input::Answer(questions.iter().map(initials).collect())]
            }
            Screen::Form { questions, .. } => {
                pass(rater.response_s());
                vec![Input::Answer(answers(questions, rater, felt))]
            }
            Screen::SaveTrouble { .. } => Vec::new(),
        }
    }
}

impl Plan {
    /// What the hand does to the level that it feels; `None` if it goes on.
    fn adjust(&mut self, own: &Adjusting, rater: &mut Rater, felt: &Felt<'_>) -> Option<Turn> {
        let (trial, _) = felt.trial.filter(|_| !own.at_standard)?;
        let part = trial.part.as_ref()?;
        let task = felt.protocol.part(part)?.task.adjustment()?;
        let Stimuli::Adjusted { start, .. } = &trial.stimuli else {
            return None;
        };
        let known = self.aim.filter(|(of, _)| *of == trial.trial);
        let Some((_, aim)) = known else {
            let aim = rater.aim(task, start, felt.percepts.equal(part));
            self.aim = Some((trial.trial, aim));
            return match aim.compares && own.has_standard {
                true => Some(Turn::Standard),
                false => aim.turn(task, felt.model?),
            };
        };
        aim.turn(task, felt.model?)
    }
}

/// The answers to the questions of a page; an empty optional text is omitted.
fn answers(
    questions: &[Question],
    rater: &mut Rater,
    felt: &Felt<'_>,
) -> Vec<(QuestionId, Answer)> {
    let impression = felt.model.and_then(|id| felt.percepts.impression(id));
    let mut answer = |question: &Question| {
        let trial = felt.trial;
        let compared =
            trial.and_then(|trial| rater.compare(question, trial, felt.protocol, felt.percepts));
        let counted = felt.protocol.analysis.share_of(&question.id);
        compared.unwrap_or_else(|| match counted {
            Some(counted) => rater.answer_counted(question, counted, impression),
            None => rater.answer(question, impression),
        })
    };
    questions
        .iter()
        .map(|q| (q.id.clone(), answer(q)))
        .filter(|(_, answer)| !matches!(answer, Answer::Text(text) if text.is_empty()))
        .collect()
}
