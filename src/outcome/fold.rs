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

mod trials;

use super::columns::{AttemptRow, ParticipantRow, RatingRow};
use super::event::{Choice, Entry, Event, Place, Start, State};
use crate::protocol::{Answer, Protocol};
use crate::text::{ModelId, ParticipantId};
use std::collections::BTreeMap;
use trials::Session;

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
        consent_version: read.consent.clone(),
        protocol_version: start.map_or(0, |s| s.protocol_version),
        trials_done: count(counted().filter(|t| read.is_closed(t.trial)).count()),
        trials_planned: count(counted().count()),
        started_at: entries.first().map(|e| e.at.wall),
        answers: read.answers.clone(),
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
