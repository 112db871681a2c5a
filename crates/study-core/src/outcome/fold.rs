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

use super::event::{Choice, Entry, Event, Place, Start, State};
use super::rows::{AttemptRow, ParticipantRow, RatingRow};
use crate::protocol::{Answer, Protocol};
use std::collections::BTreeMap;
use study_base::text::{ModelId, ParticipantId};
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
        protocol_version: start.map(|s| s.protocol_version),
        trials_done: count(counted().filter(|t| read.is_closed(t.trial)).count()),
        trials_planned: count(counted().count()),
        started_at: entries
            .iter()
            .find(|e| matches!(e.event, Event::SessionStarted(_)))
            .map(|e| e.at.wall),
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

#[cfg(test)]
mod tests {
    use super::super::event::{Failure, Moment, Playback};
    use super::super::rows::Status;
    use super::*;
    use crate::protocol::fingerprint::Fingerprints;
    use crate::protocol::{DeviceKind, Seat, Trial, example};
    use study_base::text::QuestionId;

    fn at(second: u64) -> Moment {
        let start = chrono::DateTime::parse_from_rfc3339("2007-03-22T10:00:00+01:00").unwrap();
        Moment {
            wall: start + chrono::TimeDelta::seconds(i64::try_from(second).unwrap()),
            mono_ns: second,
        }
    }

    /// The journal of a session of A, B, C in this order.
    fn journal(events: Vec<Event>) -> Vec<Entry> {
        let trial = |(id, n): (&str, u32)| Trial {
            trial: n,
            block: 1,
            position: n,
            model: ModelId::new(id).unwrap(),
            repetition: 1,
            practice: false,
        };
        let start = Event::SessionStarted(Box::new(Start {
            study: "example".to_owned(),
            participant: ParticipantId::new("P01").unwrap(),
            session: 1,
            seat: Seat::Row(1),
            operator: "first".to_owned(),
            device_kind: DeviceKind::Simulated,
            device_id: "sim".to_owned(),
            device_check: None,
            tool_version: "0".to_owned(),
            protocol_version: 1,
            fingerprints: Fingerprints {
                stimulus: String::new(),
                wording: String::new(),
                analysis: String::new(),
            },
            schedule: ["A", "B", "C"].into_iter().zip(1..).map(trial).collect(),
        }));
        std::iter::once(start)
            .chain(events)
            .zip(1..)
            .map(|(event, seq)| Entry {
                seq,
                at: at(seq),
                event,
            })
            .collect()
    }

    fn begin(trial: u32, attempt: u32) -> Event {
        Event::AttemptStarted {
            trial,
            attempt,
            position: trial,
            model: ModelId::new(["A", "B", "C"][trial as usize - 1]).unwrap(),
            reference_s: 1.0,
        }
    }

    fn play(trial: u32, attempt: u32, samples: u64) -> [Event; 3] {
        [
            begin(trial, attempt),
            Event::PlaybackStarted { trial, attempt },
            Event::PlaybackEnded {
                trial,
                attempt,
                playback: Playback {
                    exploration_s: 2.0,
                    strokes: 3,
                    least_energy_j: f64::NAN,
                    samples,
                    ..Playback::default()
                },
                stopped: false,
            },
        ]
    }

    fn rate(trial: u32, attempt: u32, rating: i64) -> Event {
        Event::Answered {
            place: Place::Trial { trial, attempt },
            question: QuestionId::new("realism").unwrap(),
            answer: Answer::Rating(rating),
        }
    }

    fn done(trial: u32, attempt: u32) -> Event {
        Event::TrialDone {
            trial,
            attempt,
            response_s: 1.5,
        }
    }

    fn reopened(choice: Option<Choice>, queue: &[u32]) -> Event {
        Event::Reopened {
            operator: "second".to_owned(),
            tool_version: "1".to_owned(),
            device_id: "sim-2".to_owned(),
            gap_s: 90_000.0,
            choice,
            queue: queue.to_vec(),
        }
    }

    fn fail(trial: u32, attempt: u32) -> Event {
        Event::AttemptFailed {
            trial,
            attempt,
            failure: Failure::DeviceFault,
            detail: String::new(),
            queue: Vec::new(),
            constraint_broken: false,
        }
    }

    fn rows(events: Vec<Event>) -> Vec<RatingRow> {
        ratings(&journal(events), &example::protocol(3, 1))
    }

    fn statuses(rows: &[RatingRow]) -> Vec<Status> {
        rows.iter().map(|r| r.status).collect()
    }

    #[test]
    fn every_planned_trial_has_a_row_before_anything_was_felt() {
        let rows = rows(Vec::new());
        assert_eq!(statuses(&rows), [Status::Missing; 3]);
        assert!(
            rows.iter()
                .all(|r| r.position.is_none() && r.attempt.is_none())
        );
        assert_eq!(rows[2].planned_position, 3);
    }

    #[test]
    fn an_answer_on_disk_counts_although_the_trial_was_never_closed() {
        let mut events = play(1, 1, 9).to_vec();
        events.push(rate(1, 1, 6));
        let rows = rows(events);
        assert_eq!(rows[0].status, Status::Ok);
        assert_eq!(rows[0].rated_at, Some(at(5).wall));
        assert_eq!(rows[0].response_s, None);
    }

    #[test]
    fn a_restarted_block_is_felt_again_and_its_first_answers_do_not_count() {
        let mut events = play(1, 1, 9).to_vec();
        events.extend([rate(1, 1, 6), done(1, 1)]);
        events.push(reopened(Some(Choice::RestartBlock), &[1, 2, 3]));
        assert_eq!(statuses(&rows(events.clone())), [Status::Missing; 3]);
        events.extend(play(1, 2, 9));
        events.extend([rate(1, 2, 2), done(1, 2)]);
        let row = rows(events).remove(0);
        assert_eq!((row.status, row.attempt), (Status::Ok, Some(2)));
        assert_eq!(row.answers.values().next().unwrap().number(), Some(2.0));
        assert_eq!(
            (row.operator.as_str(), row.device_id.as_str()),
            ("second", "sim-2")
        );
    }

    #[test]
    fn a_resume_that_goes_on_keeps_what_was_answered() {
        let mut events = play(1, 1, 9).to_vec();
        events.extend([
            rate(1, 1, 6),
            done(1, 1),
            reopened(Some(Choice::Continue), &[2, 3]),
        ]);
        let row = rows(events).remove(0);
        assert_eq!((row.status, row.operator.as_str()), (Status::Ok, "first"));
    }

    #[test]
    fn a_trial_that_was_given_up_is_failed_and_shows_its_last_attempt() {
        let mut events = vec![begin(1, 1), fail(1, 1)];
        events.extend(play(1, 2, 9));
        events.extend([
            fail(1, 2),
            Event::TrialClosed {
                trial: 1,
                attempt: 2,
            },
        ]);
        events.extend(play(2, 1, 0));
        let entries = journal(events);
        let rows = ratings(&entries, &example::protocol(3, 1));
        assert_eq!((rows[0].status, rows[0].attempt), (Status::Failed, Some(2)));
        assert!(rows[0].answers.is_empty());
        // The first attempt was never felt, the second was.
        assert_eq!(rows[0].previous_model, None);
        assert_eq!(rows[1].previous_model.as_ref().unwrap().as_str(), "A");
        let row = participant(&ParticipantId::new("P01").unwrap(), 1, &entries);
        assert_eq!((row.trials_done, row.trials_planned), (1, 3));
    }

    #[test]
    fn without_telemetry_there_are_no_strokes_and_no_number_is_never_a_number() {
        let rows = rows([play(1, 1, 0), play(2, 1, 5)].concat());
        assert_eq!((rows[0].strokes, rows[0].exploration_s), (None, Some(2.0)));
        assert_eq!((rows[1].strokes, rows[1].least_energy_j), (Some(3), None));
    }

    #[test]
    fn the_last_word_on_the_state_counts() {
        let state = |events| standing(&journal(events)).state;
        assert_eq!(state(vec![]), State::Unfinished);
        assert_eq!(state(vec![Event::Finished]), State::Done);
        let excluded = Event::StateSet {
            state: State::Excluded,
            reason: "fell asleep".to_owned(),
        };
        assert_eq!(state(vec![Event::Finished, excluded]), State::Excluded);
        assert_eq!(
            state(vec![reopened(Some(Choice::DropOut), &[])]),
            State::DroppedOut
        );
    }
}
