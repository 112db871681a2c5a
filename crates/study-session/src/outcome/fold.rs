//! The history of a session: what its events add up to.
//!
//! This is the only place where a sequence of events is interpreted. A running
//! session remembers by it, the tables are derived from it (`rows`) and the
//! results folder reads states and rows from it. Pure: no clock, no files.
//!
//! The rules, where an event leaves a choice:
//!
//! * The attempt of a trial that counts is the last one, unless it failed or a
//!   restart of its block sent the trial back. Only its answers count.
//! * An answer that is in the journal counts even if the trial was never completed.
//! * A realization counts as felt once the device has confirmed that it plays,
//!   whether or not the attempt fails, practice included. A trial that was stopped or
//!   interrupted and is felt again at once is felt once.
//! * The last event that sets a state determines it.
//! * An event of an attempt whose start is missing from a damaged journal stands
//!   for the start: nothing that was measured or answered is lost with one line.

mod adjusting;
mod answers;
mod attempt_log;
mod facts;
mod interval_log;
mod media;
mod rows;
mod search;
mod tracks;
mod trial;

pub use attempt_log::attempt_rows;
pub use interval_log::interval_rows;
pub use trial::{Attempt, AttemptStart, Completion, Ended, FormDelay, Presentation, Sitting};

use super::event::{Channel, Choice, Entry, Event, Failure, FormId, Moment, Start, State};
use super::media::Onset;
use media::Came;
use search::Failing;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::{PartId, ParticipantId, QuestionId};
use study_plan::protocol::{Answer, Stimuli, Trial};
use trial::TrialHistory;

/// What the events of a session add up to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    /// The first event and when it happened.
    start: Option<(Moment, Box<Start>)>,
    sitting: Sitting,
    /// Ids that were mistyped and corrected, the oldest first.
    pub former_ids: Vec<ParticipantId>,
    /// The state of the session.
    pub standing: Standing,
    /// Numbers of the trials still to come, the present or next one first.
    pub queue: Vec<u32>,
    /// The participant's decision, if they were asked for consent.
    pub consent: Option<Consent>,
    /// The current answers in the order in which the questions were first answered.
    pub answers: Vec<GivenAnswer>,
    /// Whether the instructions were read.
    pub instructions_read: bool,
    /// Whether what the study was about was shown.
    pub debriefed: bool,
    trials: BTreeMap<u32, TrialHistory>,
    /// The trial whose last attempt is under way.
    open: Option<u32>,
    /// The trial that counts that was completed last, until it is marked as bad.
    pub last_done: Option<u32>,
    /// Trial and attempt of each presentation, in order.
    felt: Vec<(u32, u32)>,
    /// Whether the last presentation was stopped or interrupted.
    goes_on: bool,
    /// Tracks whose other planned trials do not take place.
    ended_tracks: BTreeSet<PartId>,
    /// Parts whose practice reached its criterion.
    ended_practice: BTreeSet<PartId>,
    /// Completed trials of tracks, searches and practice, in the order in which these were told.
    told: Vec<(u32, u32)>,
    /// What the device failed at in the searches, and what they present no more.
    failing: Failing,
    /// The media that came.
    came: Vec<Came>,
    /// Numbers of closed trials after which a break began.
    pub breaks: BTreeSet<u32>,
    /// When the break under way began.
    pub open_break: Option<Moment>,
    /// When somebody last took part. Remarks, corrections and what was done from
    /// outside the session do not count.
    pub last_activity: Option<Moment>,
}

/// The state of a session and the reason for it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Standing {
    /// State.
    pub state: State,
    /// Reason; empty where the session itself determined the state.
    pub reason: String,
}

/// The participant's decision on the consent document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consent {
    /// Whether they agreed.
    pub accepted: bool,
    /// Version of the document.
    pub version: String,
}

/// The current answer to a question.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenAnswer {
    /// Form in which it was asked.
    pub form: FormId,
    /// Question.
    pub question: QuestionId,
    /// Answer after all corrections.
    pub answer: Answer,
    /// When it was answered, before any correction; `None` if a damaged journal
    /// holds only the correction.
    pub answered_at: Option<Moment>,
    /// Whether it was corrected.
    pub corrected: bool,
    /// How it was entered last, if that is known.
    pub channel: Option<Channel>,
}

/// An attempt under way: before, during or after its playback, not yet rated.
#[derive(Debug, Clone, Copy)]
pub struct OpenAttempt<'a> {
    /// Trial.
    pub trial: &'a Trial,
    /// Attempt.
    pub attempt: &'a Attempt,
}

impl OpenAttempt<'_> {
    /// The form of its rating.
    pub fn form(&self) -> FormId {
        FormId::Trial {
            trial: self.trial.trial,
            attempt: self.attempt.number,
        }
    }
}

impl Failure {
    /// Whether it counts towards `max_attempts`. A stop and an interruption do not:
    /// the trial is simply felt again.
    pub fn counts(self) -> bool {
        match self {
            Self::DeviceFault | Self::PlaybackLost | Self::MarkedBad => true,
            Self::Rendering | Self::Media => true,
            Self::Stopped | Self::Interrupted => false,
        }
    }
}

impl History {
    /// The history after these events.
    pub fn of(entries: &[Entry]) -> Self {
        let mut history = Self::default();
        for entry in entries {
            history.apply(&entry.event, entry.at);
        }
        history
    }

    /// Adds one event.
    pub fn apply(&mut self, event: &Event, at: Moment) {
        match event {
            Event::Remark { .. }
            | Event::Corrected { .. }
            | Event::ClockStepped { .. }
            | Event::Revealed { .. }
            | Event::TelemetryLost { .. }
            | Event::NumbersSent { .. }
            | Event::IdCorrected { .. }
            | Event::StateSet { .. } => {}
            _ => self.last_activity = Some(at),
        }
        match event {
            Event::SessionStarted(start) => self.started(start, at),
            Event::Reopened {
                operator,
                tool_version,
                device_id,
                front,
                choice,
                queue,
                ..
            } => {
                self.sitting = Sitting {
                    operator: operator.clone(),
                    tool_version: tool_version.clone(),
                    device_id: device_id.clone(),
                    front: front.clone(),
                };
                self.reopened(*choice, queue, at);
            }
            Event::Consented {
                version, accepted, ..
            } => {
                self.consent = Some(Consent {
                    accepted: *accepted,
                    version: version.clone(),
                });
                if !accepted {
                    self.set_state(State::DroppedOut, "did not consent");
                }
            }
            Event::Answered {
                form,
                question,
                answer,
                channel,
            } => self.answered(*form, question, (answer, *channel), at),
            Event::Corrected {
                form,
                question,
                to,
                channel,
                ..
            } => self.given(*form, question, (to, *channel)).corrected = true,
            Event::AttemptStarted {
                trial,
                attempt,
                position,
                model,
                reference_s,
                intervals,
                level,
            } => {
                let start = AttemptStart {
                    at,
                    position: *position,
                    previous: self.last_model().cloned(),
                    reference_s: *reference_s,
                };
                let mut attempt = Attempt::new(*attempt, &self.sitting, Some(start));
                attempt.models = match model {
                    Some(model) => vec![model.clone()],
                    None => intervals.clone(),
                };
                attempt.level = *level;
                if let Some(Stimuli::Adjusted { standard, .. }) =
                    self.planned(*trial).map(|t| &t.stimuli)
                {
                    attempt.adjusts(standard.is_some());
                }
                self.begin(*trial, attempt);
            }
            Event::PlaybackStarted {
                trial,
                attempt,
                interval,
            } => {
                if let Some(attempt) = self.attempt_mut(*trial, *attempt) {
                    attempt.started(interval.unwrap_or(1), at);
                }
                self.presented(*trial, *attempt);
            }
            Event::PlaybackEnded {
                trial,
                attempt,
                playback,
                stopped,
                telemetry: _,
                rendering,
                interval,
            } => {
                if let Some(attempt) = self.attempt_mut(*trial, *attempt) {
                    let ended = Ended {
                        playback: *playback,
                        stopped: *stopped,
                    };
                    attempt.interval_ended(interval.unwrap_or(1), ended, rendering.as_deref(), at);
                }
            }
            Event::MediaShown {
                trial,
                attempt,
                interval,
                medium,
                offset_ms,
                uncertainty_ms,
            } => {
                let onset = Onset {
                    offset_ms: *offset_ms,
                    uncertainty_ms: *uncertainty_ms,
                };
                let interval = interval.unwrap_or(1);
                self.came((*trial, *attempt), interval, (*medium, onset));
            }
            Event::NumbersSent {
                trial: Some(trial),
                attempt: Some(attempt),
                numbers,
            } => {
                if let Some(attempt) = self.attempt_mut(*trial, *attempt) {
                    attempt.sent(numbers);
                }
            }
            Event::Adjusted {
                trial,
                attempt,
                to,
                standard,
            } => {
                if let Some(attempt) = self.attempt_mut(*trial, *attempt) {
                    attempt.adjusted(to, *standard);
                }
            }
            Event::StepFailed {
                trial,
                attempt,
                failure,
                ..
            } => {
                if let Some(attempt) = self.attempt_mut(*trial, *attempt) {
                    attempt.step_failed(*failure);
                }
            }
            Event::Replayed { trial, attempt } => {
                if let Some(attempt) = self.attempt_mut(*trial, *attempt) {
                    attempt.replays += 1;
                    attempt.ended = None;
                }
            }
            Event::TrackEnded { track, .. } => {
                self.ended_tracks.insert(track.clone());
                let queue = std::mem::take(&mut self.queue);
                self.set_queue(&queue);
            }
            Event::PointLeftOut { part, point } => self.leave_out(part, point),
            Event::PracticeEnded { part } => {
                self.ended_practice.insert(part.clone());
                let queue = std::mem::take(&mut self.queue);
                self.set_queue(&queue);
            }
            Event::AttemptFailed {
                trial,
                attempt,
                failure,
                queue,
                paused_s,
                ..
            } => {
                self.failed_at_point(*trial, *attempt, *failure);
                self.failed(*trial, *attempt, *failure, queue);
                let trial = self.trials.entry(*trial).or_default();
                trial.again_after_s = paused_s.or(trial.again_after_s);
            }
            Event::TrialDone {
                trial,
                attempt,
                response_s,
                paused_s,
            } => self.done(*trial, *attempt, (*response_s, *paused_s), at),
            Event::FormDelayed {
                trial,
                attempt,
                paused_s,
                late,
            } => {
                let (paused_s, late) = (*paused_s, *late);
                self.delayed((*trial, *attempt), FormDelay { paused_s, late });
            }
            Event::TrialClosed { trial, .. } => {
                self.trials.entry(*trial).or_default().given_up = true;
                self.queue.retain(|t| t != trial);
            }
            Event::Remark {
                trial: Some(trial),
                text,
                ..
            } => {
                let trial = self.trials.entry(*trial).or_default();
                trial.remarks.push(text.clone());
            }
            Event::InstructionsRead => self.instructions_read = true,
            Event::Debriefed => self.debriefed = true,
            Event::BreakStarted { after } => {
                self.breaks.insert(*after);
                self.open_break = Some(at);
            }
            Event::BreakEnded { .. } => self.open_break = None,
            Event::Finished => self.set_state(State::Done, ""),
            Event::IdCorrected { from, to, .. } => {
                self.former_ids.push(from.clone());
                if let Some((_, start)) = &mut self.start {
                    start.participant = to.clone();
                }
            }
            Event::StateSet { state, reason } => self.set_state(*state, reason),
            Event::Remark { trial: None, .. }
            | Event::NumbersSent { .. }
            | Event::Paused
            | Event::Unpaused { .. }
            | Event::ClockStepped { .. }
            | Event::Interrupted { .. }
            | Event::TelemetryLost { .. }
            | Event::SelfWeighed(_)
            | Event::Revealed { .. } => {}
        }
    }

    fn set_state(&mut self, state: State, reason: &str) {
        self.standing = Standing {
            state,
            reason: reason.to_owned(),
        };
    }

    fn started(&mut self, start: &Start, at: Moment) {
        if self.start.is_none() {
            self.queue = start.schedule.iter().map(|t| t.trial).collect();
            self.sitting = Sitting {
                operator: start.operator.clone(),
                tool_version: start.tool_version.clone(),
                device_id: start.device_id.clone(),
                front: start.front.clone(),
            };
            self.start = Some((at, Box::new(start.clone())));
        }
    }

    fn reopened(&mut self, choice: Option<Choice>, queue: &[u32], at: Moment) {
        if let Some(open) = self.open_mut()
            && let Some((from, last)) = open.rating.replace((at, at))
        {
            // The time over the gap counts, by the wall clock: its processes are two.
            let gap_s = (at.wall - last.wall).as_seconds_f64().max(0.0);
            open.rated_earlier_s += last.seconds_since(&from) + gap_s;
        }
        self.reopen_tracks(queue);
        self.set_queue(queue);
        match choice {
            Some(Choice::RestartBlock) => self.restarted(queue),
            Some(Choice::DropOut) => self.set_state(State::DroppedOut, "did not come back"),
            Some(Choice::Continue) | None => {}
        }
    }

    fn restarted(&mut self, queue: &[u32]) {
        for number in queue {
            if let Some(trial) = self.trials.get_mut(number) {
                trial.send_back();
            }
        }
        self.untold(|(trial, _)| queue.contains(&trial));
        self.open = self.open.filter(|t| !queue.contains(t));
        self.last_done = self.last_done.filter(|t| !queue.contains(t));
        let closed = self.closed(false);
        self.breaks.retain(|after| *after <= closed);
    }

    /// Starts an attempt; whatever was open or given up before is so no longer.
    fn begin(&mut self, trial: u32, attempt: Attempt) {
        self.open = self.planned(trial).map(|t| t.trial);
        let history = self.trials.entry(trial).or_default();
        history.given_up = false;
        history.attempts.push(attempt);
    }

    /// An attempt by its number; begun now if its start is missing.
    fn attempt_mut(&mut self, trial: u32, attempt: u32) -> Option<&mut Attempt> {
        let last = self.attempts(trial);
        if attempt > last {
            let mut begun = Attempt::new(attempt, &self.sitting, None);
            // Each change adds an interval to the first ones, which are planned.
            if let Some(Stimuli::Adjusted { start, standard }) =
                self.planned(trial).map(|t| &t.stimuli)
            {
                begun.models = standard.iter().chain([start]).cloned().collect();
                begun.adjusts(standard.is_some());
            }
            self.begin(trial, begun);
        }
        let attempts = &mut self.trials.get_mut(&trial)?.attempts;
        attempts.iter_mut().rfind(|a| a.number == attempt)
    }

    /// Adds a pause before the questionnaires after an attempt. One whose line is damaged is not begun by it.
    fn delayed(&mut self, (trial, attempt): (u32, u32), pause: FormDelay) {
        let attempts = self.trials.get_mut(&trial).map(|t| &mut t.attempts);
        let own = attempts.and_then(|all| all.iter_mut().rfind(|a| a.number == attempt));
        if let Some(own) = own {
            own.delay = Some(own.delay.map_or(pause, |delay| delay.and(pause)));
        }
    }

    fn open_mut(&mut self) -> Option<&mut Attempt> {
        self.trials.get_mut(&self.open?)?.attempts.last_mut()
    }

    /// Adds a presentation, or continues the last one.
    fn presented(&mut self, trial: u32, attempt: u32) {
        let goes_on = std::mem::take(&mut self.goes_on);
        match self.felt.last_mut() {
            Some(last) if *last == (trial, attempt) || (goes_on && last.0 == trial) => {
                last.1 = attempt;
            }
            _ => self.felt.push((trial, attempt)),
        }
    }

    fn failed(&mut self, trial: u32, attempt: u32, failure: Failure, queue: &[u32]) {
        if let Some(attempt) = self.attempt_mut(trial, attempt) {
            attempt.void = true;
        }
        self.untold(|t| t == (trial, attempt));
        self.reopen_tracks(queue);
        self.set_queue(queue);
        if self.open == Some(trial) && self.attempts(trial) == attempt {
            self.open = None;
        }
        self.last_done = self.last_done.filter(|t| *t != trial);
        if self.felt.last() == Some(&(trial, attempt)) {
            self.goes_on = !failure.counts();
        }
        let failures = &mut self.trials.entry(trial).or_default().failures;
        *failures += u32::from(failure.counts());
    }

    fn done(
        &mut self,
        trial: u32,
        attempt: u32,
        (response_s, paused_s): (f64, Option<f64>),
        at: Moment,
    ) {
        let practice = self.planned(trial).is_some_and(|t| t.practice);
        let number = self.closed(practice) + 1;
        let told = self.first_answer(trial, attempt);
        if let Some(attempt) = self.attempt_mut(trial, attempt) {
            attempt.told = told;
            attempt.done = Some(Completion {
                at,
                response_s,
                paused_s,
                number,
            });
        }
        if practice || self.planned(trial).is_some_and(Trial::follows_from_answers) {
            self.told.push((trial, attempt));
            self.played(trial, attempt);
        }
        self.queue.retain(|t| *t != trial);
        self.open = None;
        if !practice {
            self.last_done = Some(trial);
        }
    }

    /// Sets the trials to come: those that are planned, and of no track and no practice that has ended. One that failed before
    /// that end does not come again.
    fn set_queue(&mut self, queue: &[u32]) {
        let comes = |trial: &&u32| self.planned(**trial).is_some_and(|t| !self.has_ended(t));
        self.queue = queue.iter().filter(comes).copied().collect();
    }

    /// A trial that comes again takes its track, or its practice, up again, if that had ended.
    fn reopen_tracks(&mut self, queue: &[u32]) {
        let again: Vec<PartId> = (queue.iter())
            .filter_map(|t| self.planned(*t)?.track().cloned())
            .collect();
        self.ended_tracks.retain(|track| !again.contains(track));
        let again: Vec<PartId> = (queue.iter())
            .filter_map(|t| self.planned(*t).filter(|t| t.practice)?.part.clone())
            .collect();
        self.ended_practice.retain(|part| !again.contains(part));
    }
}

#[cfg(test)]
mod tests;
