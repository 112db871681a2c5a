//! What became of each trial of a session.

use crate::outcome::event::{Choice, Entry, Event, Moment, Place, Playback, Start};
use crate::outcome::rows::{RatingRow, Status};
use crate::protocol::{Answer, Protocol, Role, Trial};
use std::collections::BTreeMap;
use study_base::text::{ModelId, QuestionId};

/// Everything of a session that rows need.
#[derive(Debug, Default)]
pub(super) struct Session {
    trials: BTreeMap<u32, Felt>,
    /// Last answers of setup, intake and outro.
    pub(super) answers: BTreeMap<QuestionId, Answer>,
    /// Version of the document that was agreed to.
    pub(super) consent: Option<String>,
    with: With,
}

/// With what a trial was run.
#[derive(Debug, Clone, Default)]
struct With {
    operator: String,
    tool_version: String,
    device_id: String,
}

/// What became of a trial so far.
#[derive(Debug, Default)]
struct Felt {
    remarks: Vec<String>,
    last: Option<Attempt>,
    /// Given up after the last attempt.
    given_up: bool,
}

#[derive(Debug)]
struct Attempt {
    number: u32,
    at: Moment,
    model: ModelId,
    position: u32,
    previous: Option<ModelId>,
    reference_s: f64,
    with: With,
    playback: Option<Playback>,
    answers: BTreeMap<QuestionId, Answer>,
    answered_at: BTreeMap<QuestionId, Moment>,
    corrected: bool,
    done: Option<(Moment, f64)>,
    /// Failed, or to be felt again: its answers do not count.
    void: bool,
}

impl Felt {
    fn is_closed(&self) -> bool {
        self.given_up || self.counted().is_some_and(|a| a.done.is_some())
    }

    fn counted(&self) -> Option<&Attempt> {
        self.last.as_ref().filter(|a| !a.void)
    }

    fn attempt(&mut self, number: u32) -> Option<&mut Attempt> {
        self.last.as_mut().filter(|a| a.number == number)
    }
}

impl Session {
    pub(super) fn read(entries: &[Entry]) -> Self {
        let mut session = Self::default();
        let mut felt: Option<ModelId> = None;
        for entry in entries {
            session.event(entry, &mut felt);
        }
        session
    }

    /// Whether a trial is done or given up.
    pub(super) fn is_closed(&self, trial: u32) -> bool {
        self.trials.get(&trial).is_some_and(Felt::is_closed)
    }

    fn attempt(&mut self, trial: u32, attempt: u32) -> Option<&mut Attempt> {
        self.trials.get_mut(&trial)?.attempt(attempt)
    }

    fn event(&mut self, entry: &Entry, felt: &mut Option<ModelId>) {
        let at = entry.at;
        match &entry.event {
            Event::SessionStarted(start) => {
                self.with = With {
                    operator: start.operator.clone(),
                    tool_version: start.tool_version.clone(),
                    device_id: start.device_id.clone(),
                };
            }
            Event::Reopened {
                operator,
                tool_version,
                device_id,
                choice,
                queue,
                ..
            } => {
                self.with = With {
                    operator: operator.clone(),
                    tool_version: tool_version.clone(),
                    device_id: device_id.clone(),
                };
                if *choice == Some(Choice::RestartBlock) {
                    for trial in queue {
                        self.send_back(*trial);
                    }
                }
            }
            Event::Consented {
                version, accepted, ..
            } => self.consent = accepted.then(|| version.clone()),
            Event::Answered {
                place,
                question,
                answer,
            } => self.answer(*place, question, answer, Some(at)),
            Event::Corrected {
                place,
                question,
                to,
                ..
            } => self.answer(*place, question, to, None),
            Event::AttemptStarted {
                trial,
                attempt,
                position,
                model,
                reference_s,
            } => {
                let with = self.with.clone();
                let felt_trial = self.trials.entry(*trial).or_default();
                felt_trial.given_up = false;
                felt_trial.last = Some(Attempt {
                    number: *attempt,
                    at,
                    model: model.clone(),
                    position: *position,
                    previous: felt.clone(),
                    reference_s: *reference_s,
                    with,
                    playback: None,
                    answers: BTreeMap::new(),
                    answered_at: BTreeMap::new(),
                    corrected: false,
                    done: None,
                    void: false,
                });
            }
            Event::PlaybackStarted { trial, attempt } => {
                if let Some(attempt) = self.attempt(*trial, *attempt) {
                    *felt = Some(attempt.model.clone());
                }
            }
            Event::PlaybackEnded {
                trial,
                attempt,
                playback,
                ..
            } => {
                if let Some(attempt) = self.attempt(*trial, *attempt) {
                    attempt.playback = Some(*playback);
                }
            }
            Event::AttemptFailed { trial, attempt, .. } => {
                if let Some(attempt) = self.attempt(*trial, *attempt) {
                    attempt.void = true;
                }
            }
            Event::TrialDone {
                trial,
                attempt,
                response_s,
            } => {
                if let Some(attempt) = self.attempt(*trial, *attempt) {
                    attempt.done = Some((at, *response_s));
                }
            }
            Event::TrialClosed { trial, .. } => {
                self.trials.entry(*trial).or_default().given_up = true;
            }
            Event::Remark {
                trial: Some(trial),
                text,
                ..
            } => {
                let trial = self.trials.entry(*trial).or_default();
                trial.remarks.push(text.clone());
            }
            _ => {}
        }
    }

    fn send_back(&mut self, trial: u32) {
        if let Some(felt) = self.trials.get_mut(&trial) {
            felt.given_up = false;
            if let Some(attempt) = &mut felt.last {
                attempt.void = true;
            }
        }
    }

    /// `at` for a first answer, `None` for a correction.
    fn answer(&mut self, place: Place, question: &QuestionId, answer: &Answer, at: Option<Moment>) {
        let Place::Trial { trial, attempt } = place else {
            self.answers.insert(question.clone(), answer.clone());
            return;
        };
        if let Some(attempt) = self.attempt(trial, attempt) {
            attempt.answers.insert(question.clone(), answer.clone());
            match at {
                Some(at) => {
                    attempt.answered_at.insert(question.clone(), at);
                }
                None => attempt.corrected = true,
            }
        }
    }

    pub(super) fn row(&self, start: &Start, trial: &Trial, protocol: &Protocol) -> RatingRow {
        let felt = self.trials.get(&trial.trial);
        let last = felt.and_then(|f| f.last.as_ref());
        let counted = felt.and_then(Felt::counted);
        // Of a trial that was given up the last attempt is shown, without answers.
        let given_up = felt.is_some_and(|f| f.given_up);
        let shown = counted.or(last.filter(|_| given_up));
        let answers = counted.map(|a| a.answers.clone()).unwrap_or_default();
        let primary = &protocol.analysis.primary;
        let status = if given_up {
            Status::Failed
        } else {
            status_of(answers.get(primary))
        };
        let entry = protocol.model(&trial.model);
        let played = shown.and_then(|a| a.playback);
        let sampled = played.filter(|p| p.samples > 0);
        let finite = |x: f64| Some(x).filter(|x| x.is_finite());
        let done = counted.and_then(|a| a.done);
        let with = shown.map_or(&self.with, |a| &a.with);
        RatingRow {
            study: start.study.clone(),
            participant: start.participant.clone(),
            session: start.session,
            row: start.seat.row(),
            trial: trial.trial,
            block: trial.block,
            position: shown.map(|a| a.position),
            planned_position: trial.position,
            model: trial.model.clone(),
            role: entry.map_or(Role::Test, |m| m.role),
            repetition: trial.repetition,
            previous_model: shown.and_then(|a| a.previous.clone()),
            practice: trial.practice,
            pilot: start.seat.is_pilot(),
            simulated: start.seat.is_simulated(),
            device_kind: entry
                .and_then(|m| m.device)
                .filter(|_| !start.seat.is_pilot() && !start.seat.is_simulated())
                .unwrap_or(start.device_kind),
            device_id: with.device_id.clone(),
            operator: with.operator.clone(),
            tool_version: with.tool_version.clone(),
            protocol_version: start.protocol_version,
            corrected: counted.is_some_and(|a| a.corrected),
            declined: answers.values().any(Answer::is_declined),
            remarks: felt.map(|f| f.remarks.join(" | ")).unwrap_or_default(),
            reference_s: shown.map(|a| a.reference_s),
            exploration_s: played.and_then(|p| finite(p.exploration_s)),
            response_s: done.map(|(_, response_s)| response_s),
            strokes: sampled.map(|p| p.strokes),
            least_energy_j: sampled.and_then(|p| finite(p.least_energy_j)),
            switches_per_s: sampled.and_then(|p| finite(p.switches_per_s)),
            clamp_count: sampled.map(|p| p.clamp_count),
            started_at: shown.map(|a| a.at.wall),
            rated_at: counted
                .and_then(|a| a.answered_at.get(primary))
                .or(done.as_ref().map(|(at, _)| at))
                .map(|at| at.wall),
            attempt: shown.map(|a| a.number),
            status,
            vaf: entry.and_then(|m| m.vaf),
            covariates: entry.map(|m| m.covariates.clone()).unwrap_or_default(),
            answers,
        }
    }
}

fn status_of(primary: Option<&Answer>) -> Status {
    match primary {
        None => Status::Missing,
        Some(Answer::Declined { .. }) => Status::Declined,
        Some(Answer::Text(text)) if text.is_empty() => Status::Missing,
        Some(Answer::Choice(chosen)) if chosen.is_empty() => Status::Missing,
        Some(_) => Status::Ok,
    }
}
