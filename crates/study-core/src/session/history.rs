//! What has happened so far: the fold of a session's events.
//!
//! What the session records and what it reads back on a resume go through the
//! same [`History::apply`], so that a session that was picked up cannot differ
//! from one that was never left. A journal with a damaged line is folded as far
//! as it goes: what is not there counts as not done.

use crate::outcome::{Choice, Event, Failure, Moment, Place, Playback, State};
use crate::protocol::{Answer, Trial};
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::QuestionId;

/// The state of a session, as far as events tell it.
#[derive(Debug, Default)]
pub(super) struct History {
    /// Whether the first event is there.
    pub(super) started: bool,
    /// Every planned trial.
    pub(super) schedule: Vec<Trial>,
    /// Trials that are not closed, the present or next one first.
    pub(super) queue: Vec<u32>,
    /// Whether the participant agreed, if they were asked.
    pub(super) consent: Option<bool>,
    /// Last answers in the order of their first.
    pub(super) answers: Vec<Given>,
    /// Whether the instructions are behind us.
    pub(super) instructions_read: bool,
    /// The attempt under way.
    pub(super) open: Option<Open>,
    /// The trial that counts that was finished last, until it is marked bad.
    pub(super) last_done: Option<u32>,
    /// The break under way: when it began.
    pub(super) open_break: Option<Moment>,
    /// Set from outside or on dropping out.
    pub(super) state: Option<State>,
    /// Whether everything is done.
    pub(super) finished: bool,
    /// When somebody last took part.
    pub(super) last_activity: Option<Moment>,
    trials: BTreeMap<u32, Known>,
    visits: Vec<u32>,
    breaks: BTreeSet<u32>,
}

/// An answer that was given.
#[derive(Debug)]
pub(super) struct Given {
    pub(super) place: Place,
    pub(super) question: QuestionId,
    pub(super) answer: Answer,
}

/// An attempt under way.
#[derive(Debug)]
pub(super) struct Open {
    pub(super) trial: Trial,
    pub(super) attempt: u32,
    /// What the device confirmed, and whether it was stopped.
    pub(super) ended: Option<(Playback, bool)>,
    /// Rating time spent before the program was left, s.
    pub(super) rated_earlier_s: f64,
    rating: Option<(Moment, Moment)>,
}

/// What is known of a planned trial.
#[derive(Debug, Default)]
struct Known {
    attempts: u32,
    failures: u32,
    /// Attempt and the number under which it stood on the screen.
    done: Option<(u32, u32)>,
    closed: bool,
}

impl Open {
    pub(super) fn place(&self) -> Place {
        Place::Trial {
            trial: self.trial.trial,
            attempt: self.attempt,
        }
    }
}

/// Whether a failure counts towards `max_attempts`: those that are nobody's
/// wish. A stop and an interruption only mean that it is felt again.
pub(super) fn counts(failure: Failure) -> bool {
    match failure {
        Failure::DeviceFault | Failure::PlaybackLost | Failure::MarkedBad => true,
        Failure::Stopped | Failure::Interrupted => false,
    }
}

impl History {
    /// Takes in one event.
    pub(super) fn apply(&mut self, event: &Event, at: Moment) {
        match event {
            Event::Remark { .. }
            | Event::Corrected { .. }
            | Event::ClockStepped { .. }
            | Event::Revealed { .. }
            | Event::StateSet { .. } => {}
            _ => self.last_activity = Some(at),
        }
        match event {
            Event::SessionStarted(start) => {
                self.started = true;
                self.schedule = start.schedule.clone();
                self.queue = self.schedule.iter().map(|t| t.trial).collect();
            }
            Event::Reopened { choice, queue, .. } => self.reopened(*choice, queue, at),
            Event::Consented { accepted, .. } => self.consent = Some(*accepted),
            Event::Answered {
                place,
                question,
                answer,
            } => {
                self.set_answer(*place, question, answer);
                if let Some(open) = self.open.as_mut().filter(|o| o.place() == *place)
                    && let Some((_, last)) = &mut open.rating
                {
                    *last = at;
                }
            }
            Event::Corrected {
                place,
                question,
                to,
                ..
            } => self.set_answer(*place, question, to),
            Event::AttemptStarted { trial, attempt, .. } => {
                let known = self.trials.entry(*trial).or_default();
                known.attempts = known.attempts.max(*attempt);
                self.open = self.planned(*trial).cloned().map(|trial| Open {
                    trial,
                    attempt: *attempt,
                    ended: None,
                    rated_earlier_s: 0.0,
                    rating: None,
                });
            }
            Event::PlaybackStarted { trial, .. } => {
                if self.visits.last() != Some(trial) {
                    self.visits.push(*trial);
                }
            }
            Event::PlaybackEnded {
                trial,
                attempt,
                playback,
                stopped,
            } => {
                if let Some(open) = self.open_as(*trial, *attempt) {
                    open.ended = Some((*playback, *stopped));
                    open.rating = Some((at, at));
                }
            }
            Event::AttemptFailed {
                trial,
                attempt,
                failure,
                queue,
                ..
            } => self.failed(*trial, *attempt, *failure, queue),
            Event::TrialDone { trial, attempt, .. } => self.done(*trial, *attempt),
            Event::TrialClosed { trial, .. } => {
                self.trials.entry(*trial).or_default().closed = true;
                self.queue.retain(|t| t != trial);
            }
            Event::InstructionsRead => self.instructions_read = true,
            Event::BreakStarted { after } => {
                self.breaks.insert(*after);
                self.open_break = Some(at);
            }
            Event::BreakEnded { .. } => self.open_break = None,
            Event::Finished => self.finished = true,
            Event::StateSet { state, .. } => self.state = Some(*state),
            Event::Remark { .. }
            | Event::Paused
            | Event::Unpaused { .. }
            | Event::ClockStepped { .. }
            | Event::Interrupted { .. }
            | Event::Revealed { .. } => {}
        }
    }

    fn reopened(&mut self, choice: Option<Choice>, queue: &[u32], at: Moment) {
        if let Some(open) = &mut self.open
            && let Some((from, last)) = open.rating.replace((at, at))
        {
            open.rated_earlier_s += last.seconds_since(&from);
        }
        self.queue = self.known_only(queue);
        if choice == Some(Choice::RestartBlock) {
            for trial in &self.queue {
                if let Some(known) = self.trials.get_mut(trial) {
                    known.failures = 0;
                    known.done = None;
                    known.closed = false;
                }
            }
            self.last_done = self.last_done.filter(|t| !self.queue.contains(t));
            let closed = self.closed(false);
            self.breaks.retain(|after| *after <= closed);
        }
    }

    fn failed(&mut self, trial: u32, attempt: u32, failure: Failure, queue: &[u32]) {
        self.queue = self.known_only(queue);
        if self.open_as(trial, attempt).is_some() {
            self.open = None;
        }
        if self.last_done == Some(trial) {
            self.last_done = None;
        }
        let known = self.trials.entry(trial).or_default();
        known.failures += u32::from(counts(failure));
        known.done = known.done.filter(|(done, _)| *done != attempt);
    }

    fn done(&mut self, trial: u32, attempt: u32) {
        let practice = self.planned(trial).is_some_and(|t| t.practice);
        let number = self.closed(practice) + 1;
        self.trials.entry(trial).or_default().done = Some((attempt, number));
        self.queue.retain(|t| *t != trial);
        self.open = None;
        if !practice {
            self.last_done = Some(trial);
        }
    }

    fn set_answer(&mut self, place: Place, question: &QuestionId, answer: &Answer) {
        let old = self
            .answers
            .iter_mut()
            .find(|g| g.place == place && g.question == *question);
        match old {
            Some(given) => given.answer = answer.clone(),
            None => self.answers.push(Given {
                place,
                question: question.clone(),
                answer: answer.clone(),
            }),
        }
    }

    fn known_only(&self, queue: &[u32]) -> Vec<u32> {
        let known = |trial: &&u32| self.planned(**trial).is_some();
        queue.iter().filter(known).copied().collect()
    }

    fn open_as(&mut self, trial: u32, attempt: u32) -> Option<&mut Open> {
        self.open
            .as_mut()
            .filter(|o| o.trial.trial == trial && o.attempt == attempt)
    }

    /// A planned trial by its number.
    pub(super) fn planned(&self, trial: u32) -> Option<&Trial> {
        self.schedule.iter().find(|t| t.trial == trial)
    }

    /// The trial to be felt next, or under way.
    pub(super) fn next_trial(&self) -> Option<&Trial> {
        self.queue.first().and_then(|t| self.planned(*t))
    }

    /// Trials that count (or practice trials) that are done or given up.
    pub(super) fn closed(&self, practice: bool) -> u32 {
        self.count(|t, known| t.practice == practice && (known.done.is_some() || known.closed))
    }

    /// Trials that count and are answered, where `also` holds.
    pub(super) fn answered(&self, also: impl Fn(u32) -> bool) -> u32 {
        self.count(|t, known| !t.practice && known.done.is_some() && also(t.trial))
    }

    fn count(&self, which: impl Fn(&Trial, &Known) -> bool) -> u32 {
        let holds = |t: &&Trial| self.trials.get(&t.trial).is_some_and(|k| which(t, k));
        u32::try_from(self.schedule.iter().filter(holds).count()).unwrap_or(u32::MAX)
    }

    /// Planned trials that count, or practice trials.
    pub(super) fn planned_total(&self, practice: bool) -> u32 {
        let all = self.schedule.iter().filter(|t| t.practice == practice);
        u32::try_from(all.count()).unwrap_or(u32::MAX)
    }

    /// Attempts at a trial so far.
    pub(super) fn attempts(&self, trial: u32) -> u32 {
        self.trials.get(&trial).map_or(0, |k| k.attempts)
    }

    /// Failures of a trial so far that count towards `max_attempts`.
    pub(super) fn failures(&self, trial: u32) -> u32 {
        self.trials.get(&trial).map_or(0, |k| k.failures)
    }

    /// The attempt of a finished trial, and its number on the screen.
    pub(super) fn done_as(&self, trial: u32) -> Option<(u32, u32)> {
        self.trials.get(&trial).and_then(|k| k.done)
    }

    /// Whether an attempt was made at any trial, or at any that counts.
    pub(super) fn any_attempt(&self, counted_only: bool) -> bool {
        self.count(|t, known| known.attempts > 0 && !(counted_only && t.practice)) > 0
    }

    /// Trials that are neither to come nor closed although they failed so often:
    /// the program ended between the two events.
    pub(super) fn owed_closings(&self, max_attempts: u32) -> Vec<(u32, u32)> {
        self.trials
            .iter()
            .filter(|(trial, known)| {
                known.done.is_none()
                    && !known.closed
                    && known.failures >= max_attempts
                    && !self.queue.contains(trial)
            })
            .map(|(trial, known)| (*trial, known.attempts))
            .collect()
    }

    /// Where a trial that counts would stand if it were felt now: one more than
    /// the counted trials felt so far, each as often as the hand came back to it
    /// from another one. Felt again at once, it keeps its place. Practice trials
    /// are counted by themselves.
    pub(super) fn position(&self, trial: &Trial) -> u32 {
        let same_kind = |t: &&u32| {
            self.planned(**t)
                .is_some_and(|t| t.practice == trial.practice)
        };
        let before = self.visits.iter().filter(same_kind).count();
        let again = self.visits.last() == Some(&trial.trial);
        let before = u32::try_from(before).unwrap_or(u32::MAX);
        before.saturating_add(u32::from(!again))
    }

    /// What the hand felt, in order.
    pub(super) fn felt(&self) -> Vec<&Trial> {
        self.visits
            .iter()
            .filter_map(|t| self.planned(*t))
            .collect()
    }

    /// Whether a break is due that comes after every `every` trials.
    pub(super) fn break_due(&self, every: u32) -> Option<u32> {
        let closed = self.closed(false);
        let due = every > 0 && closed > 0 && closed.is_multiple_of(every);
        let more = self.next_trial().is_some_and(|t| !t.practice);
        (due && more && !self.breaks.contains(&closed)).then_some(closed)
    }

    /// The answer to a question.
    pub(super) fn answer(&self, place: Place, question: &QuestionId) -> Option<&Answer> {
        self.answers
            .iter()
            .find(|g| g.place == place && g.question == *question)
            .map(|g| &g.answer)
    }

    /// Whether any question was answered there.
    pub(super) fn any_answer(&self, place: Place) -> bool {
        self.answers.iter().any(|g| g.place == place)
    }

    /// Whether answers given there still count: not those of failed attempts.
    pub(super) fn is_current(&self, place: Place) -> bool {
        match place {
            Place::Setup | Place::Intake | Place::Outro => true,
            Place::Trial { trial, attempt } => {
                let open = self.open.as_ref().is_some_and(|o| o.place() == place);
                open || self.done_as(trial).is_some_and(|(done, _)| done == attempt)
            }
        }
    }

    /// The queue after the block under way is started again, if one is: all its
    /// trials as planned, then the rest.
    pub(super) fn restarted_queue(&self) -> Vec<u32> {
        let Some(block) = self.next_trial().map(|t| t.block) else {
            return Vec::new();
        };
        let in_block = |trial: &u32| self.planned(*trial).is_some_and(|t| t.block == block);
        let again = self.schedule.iter().filter(|t| t.block == block);
        again
            .map(|t| t.trial)
            .chain(self.queue.iter().filter(|t| !in_block(t)).copied())
            .collect()
    }

    /// Whether nothing more is to be asked.
    pub(super) fn over(&self) -> bool {
        self.finished || self.state.is_some_and(|s| s != State::Unfinished)
    }
}
