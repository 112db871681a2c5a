//! The fold of events into rows.
//!
//! Pure. The rules, where an event leaves a choice:
//!
//! * The attempt of a trial that counts is the last one started, unless it failed
//!   or a resume sent its trial back to be felt again. Its answers are the row's;
//!   those of other attempts are in `attempts.csv` only.
//! * An answer that is on disk counts although the trial was never closed.
//! * What the hand last felt is the last realization whose playback the device
//!   confirmed, failed attempts and practice included.
//! * A playback without telemetry samples has no strokes, energy, switches, clamps.
//! * The state is the last one that the events say.

use super::columns::{AttemptRow, ParticipantRow, RatingRow, Status};
use super::event::{Choice, Entry, Event, Moment, Place, Playback, Start, State};
use crate::protocol::{Answer, Protocol, Trial};
use crate::text::{ModelId, ParticipantId, QuestionId};
use std::collections::BTreeMap;

/// The state of a session and who set it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Standing {
    /// State.
    pub state: State,
    /// Why; empty where the session itself says so.
    pub reason: String,
}

/// What the events of a session say of its state.
pub fn standing(entries: &[Entry]) -> Standing {
    let mut now = Standing {
        state: State::Unfinished,
        reason: String::new(),
    };
    for entry in entries {
        let (state, reason) = match &entry.event {
            Event::Finished => (State::Done, String::new()),
            Event::Consented {
                accepted: false, ..
            } => (State::DroppedOut, "did not consent".to_owned()),
            Event::Reopened {
                choice: Some(Choice::DropOut),
                ..
            } => (State::DroppedOut, "did not come back".to_owned()),
            Event::StateSet { state, reason } => (*state, reason.clone()),
            _ => continue,
        };
        now = Standing { state, reason };
    }
    now
}

/// Whether any trial was rated: from then on a session cannot be void.
pub fn has_rating(entries: &[Entry]) -> bool {
    entries.iter().any(|e| match &e.event {
        Event::TrialDone { .. } => true,
        Event::Answered { place, .. } => matches!(place, Place::Trial { .. }),
        _ => false,
    })
}

/// The first event, if the session has started.
pub fn start(entries: &[Entry]) -> Option<&Start> {
    entries.iter().find_map(|e| match &e.event {
        Event::SessionStarted(start) => Some(start.as_ref()),
        _ => None,
    })
}

/// One row for each planned trial, practice included. Empty if the session never
/// started. `protocol` gives roles, VAF and covariates; a realization's VAF is that
/// of its entry.
pub fn ratings(entries: &[Entry], protocol: &Protocol) -> Vec<RatingRow> {
    let Some(start) = start(entries) else {
        return Vec::new();
    };
    let session = Session::read(entries);
    start
        .schedule
        .iter()
        .map(|trial| session.row(start, trial, protocol))
        .collect()
}

/// The row of a participant whose last session this is.
pub fn participant(id: &ParticipantId, session: u32, entries: &[Entry]) -> ParticipantRow {
    let Standing { state, reason } = standing(entries);
    let start = start(entries);
    let read = Session::read(entries);
    let counted = || {
        start
            .iter()
            .flat_map(|s| &s.schedule)
            .filter(|t| !t.practice)
    };
    let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    ParticipantRow {
        participant: id.clone(),
        session,
        state,
        reason,
        row: start.and_then(|s| s.seat.row()),
        pilot: start.is_some_and(|s| s.seat.is_pilot()),
        simulated: start.is_some_and(|s| s.seat.is_simulated()),
        erased: false,
        consent_version: read.consent,
        protocol_version: start.map_or(0, |s| s.protocol_version),
        trials_done: count(
            counted()
                .filter(|t| read.trials.get(&t.trial).is_some_and(Felt::is_closed))
                .count(),
        ),
        trials_planned: count(counted().count()),
        started_at: entries.first().map(|e| e.at.wall),
        answers: read.answers,
    }
}

/// Every attempt, answer, correction, failure, remark and change of state, in the
/// order in which they happened.
pub fn attempts(id: &ParticipantId, session: u32, entries: &[Entry]) -> Vec<AttemptRow> {
    let start = start(entries);
    let mut models: BTreeMap<u32, ModelId> = start
        .iter()
        .flat_map(|s| &s.schedule)
        .map(|t| (t.trial, t.model.clone()))
        .collect();
    let mut rows = Vec::new();
    for entry in entries {
        let mut row = AttemptRow {
            participant: id.clone(),
            session,
            simulated: start.is_some_and(|s| s.seat.is_simulated()),
            pilot: start.is_some_and(|s| s.seat.is_pilot()),
            trial: None,
            attempt: None,
            model: None,
            what: "",
            question: None,
            from: None,
            to: None,
            failure: None,
            by: None,
            text: String::new(),
            at: entry.at.wall,
        };
        match &entry.event {
            Event::AttemptStarted {
                trial,
                attempt,
                model,
                ..
            } => {
                models.insert(*trial, model.clone());
                row.what = "attempt";
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
            }
            Event::Answered {
                place,
                question,
                answer,
            } => {
                row.what = "answer";
                (row.trial, row.attempt) = trial_of(*place);
                row.question = Some(question.clone());
                row.text = declined_reason(answer);
                row.to = Some(answer.clone());
            }
            Event::Corrected {
                place,
                question,
                from,
                to,
                reason,
                by,
            } => {
                row.what = "correction";
                (row.trial, row.attempt) = trial_of(*place);
                row.question = Some(question.clone());
                (row.from, row.to) = (from.clone(), Some(to.clone()));
                row.text.clone_from(reason);
                row.by = Some(*by);
            }
            Event::AttemptFailed {
                trial,
                attempt,
                failure,
                detail,
                constraint_broken,
                ..
            } => {
                row.what = "failure";
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
                row.failure = Some(*failure);
                row.text.clone_from(detail);
                if *constraint_broken {
                    row.text
                        .push_str(" [its new place breaks the order's constraint]");
                }
            }
            Event::TrialClosed { trial, attempt } => {
                row.what = "closed";
                (row.trial, row.attempt) = (Some(*trial), Some(*attempt));
            }
            Event::Remark { by, trial, text } => {
                row.what = "remark";
                row.trial = *trial;
                row.by = Some(*by);
                row.text.clone_from(text);
            }
            Event::Reopened { gap_s, choice, .. } => {
                row.what = "resume";
                row.text = resume_text(*gap_s, *choice);
            }
            Event::StateSet { state, reason } => {
                row.what = "state";
                row.text = format!("{}: {reason}", state.as_str());
            }
            Event::Revealed { reason } => {
                row.what = "reveal";
                row.text.clone_from(reason);
            }
            _ => continue,
        }
        row.model = row.trial.and_then(|t| models.get(&t).cloned());
        rows.push(row);
    }
    rows
}

fn resume_text(gap_s: f64, choice: Option<Choice>) -> String {
    let choice = match choice {
        None => "went on",
        Some(Choice::RestartBlock) => "restarted the block",
        Some(Choice::Continue) => "continued late",
        Some(Choice::DropOut) => "dropped out",
    };
    format!("{choice} after {gap_s:.0} s")
}

fn trial_of(place: Place) -> (Option<u32>, Option<u32>) {
    match place {
        Place::Trial { trial, attempt } => (Some(trial), Some(attempt)),
        Place::Setup | Place::Intake | Place::Outro => (None, None),
    }
}

fn declined_reason(answer: &Answer) -> String {
    match answer {
        Answer::Declined { reason } => reason.clone(),
        _ => String::new(),
    }
}

/// Everything of a session that rows need.
#[derive(Debug, Default)]
struct Session {
    trials: BTreeMap<u32, Felt>,
    answers: BTreeMap<QuestionId, Answer>,
    consent: Option<String>,
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
    fn read(entries: &[Entry]) -> Self {
        let mut session = Self::default();
        let mut felt: Option<ModelId> = None;
        for entry in entries {
            session.event(entry, &mut felt);
        }
        session
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

    fn row(&self, start: &Start, trial: &Trial, protocol: &Protocol) -> RatingRow {
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
            role: entry.map_or(crate::protocol::Role::Test, |m| m.role),
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
