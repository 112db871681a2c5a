//! What is on disk, what is not, and leaving: no way out before the disk has it.

use super::phase::{CLOCK_STEP_S, LEAVE_WITHIN_S, Phase};
use super::{Effect, Ending, Session};
use crate::outcome::{Event, Failure, Moment};
use std::collections::BTreeMap;

/// The account of events sent to the store by this process.
#[derive(Debug, Default)]
pub(super) struct Ledger {
    pub(super) sent: u64,
    pub(super) saved: u64,
    /// Trial → how many events were sent when it was done.
    pub(super) done: BTreeMap<u32, u64>,
    /// Why it cannot be saved.
    pub(super) trouble: Option<String>,
    /// Whether saving again is under way.
    pub(super) retrying: bool,
}

impl Ledger {
    pub(super) fn all_saved(&self) -> bool {
        self.saved >= self.sent
    }

    /// Whether the end of a trial is on disk; what was read from there is.
    pub(super) fn has_trial(&self, trial: u32) -> bool {
        self.done.get(&trial).is_none_or(|n| *n <= self.saved)
    }
}

impl Session {
    pub(super) fn saved(&mut self, count: u64, at: Moment) {
        self.ledger.saved = self.ledger.saved.max(count.min(self.ledger.sent));
        if self.ledger.all_saved() {
            self.ledger.trouble = None;
            self.ledger.retrying = false;
        }
        self.go_on_if_saved(at);
    }

    /// Leaves [`Phase::Saving`] and [`Phase::Leaving`] once everything is on disk.
    pub(super) fn go_on_if_saved(&mut self, at: Moment) {
        if !self.ledger.all_saved() {
            return;
        }
        match &self.phase {
            Phase::Saving => self.go_on(at),
            Phase::Leaving { ending, .. } => self.end(ending.clone()),
            _ => {}
        }
    }

    pub(super) fn save_failed(&mut self, what: String, at: Moment) {
        self.out.push(Effect::Limp);
        self.ledger.trouble = Some(what);
        let again = std::mem::take(&mut self.ledger.retrying);
        match &mut self.phase {
            Phase::Leaving {
                ending,
                forced: true,
                ..
            } => {
                let ending = ending.clone();
                if again {
                    self.end(ending);
                } else {
                    self.retry_save();
                }
            }
            Phase::Loading { .. } | Phase::Mounting { .. } | Phase::Ready { .. } => {
                self.fail(Failure::Stopped, "the journal could not be written", at);
                self.go_on(at);
            }
            Phase::Playing { .. } => {
                self.phase = Phase::Stopping {
                    since: at,
                    broken_off: true,
                    limped: true,
                    pause: false,
                };
            }
            Phase::Stopping { limped, .. } => *limped = true,
            _ => {}
        }
    }

    pub(super) fn retry_save(&mut self) {
        if self.ledger.trouble.is_some() && !self.ledger.retrying {
            self.ledger.retrying = true;
            self.out.push(Effect::RetrySave);
        }
    }

    /// Limp, then out as soon as the last event is on disk. Where nobody can help
    /// (an abort) or somebody knows (the disk had failed already), the disk gets
    /// one more chance; else a failure is shown. Asked again, it waits no longer.
    pub(super) fn quit(&mut self, reason: &str, aborted: bool, at: Moment) {
        match &self.phase {
            Phase::Over(_) => return,
            Phase::Who | Phase::Claiming => return self.end(Ending::Nothing),
            Phase::Leaving { ending, .. } => {
                let ending = ending.clone();
                return self.end(ending);
            }
            _ => self.out.push(Effect::Limp),
        }
        if self.history.over() {
            return self.leave(aborted, at);
        }
        if !matches!(self.phase, Phase::ResumeChoice { .. }) {
            if self
                .history
                .open
                .as_ref()
                .is_some_and(|o| o.ended.is_none())
            {
                self.fail(Failure::Interrupted, reason, at);
            }
            let reason = reason.to_owned();
            self.record(Event::Interrupted { reason }, at);
        }
        self.leave(aborted, at);
    }

    /// Ends the program as soon as everything is on disk.
    pub(super) fn leave(&mut self, aborted: bool, at: Moment) {
        let forced = aborted || self.ledger.trouble.is_some();
        let ending = if self.history.finished {
            Ending::Finished
        } else if self.history.over() {
            Ending::DroppedOut
        } else {
            Ending::Interrupted
        };
        self.phase = Phase::Leaving {
            since: at,
            ending,
            forced,
        };
        self.retry_save();
        self.go_on_if_saved(at);
    }

    fn end(&mut self, ending: Ending) {
        self.out.push(Effect::End(ending.clone()));
        self.phase = Phase::Over(ending);
    }

    pub(super) fn tick(&mut self, at: Moment) {
        if let Phase::Leaving {
            since,
            ending,
            forced: true,
        } = &self.phase
            && at.seconds_since(since) >= LEAVE_WITHIN_S
        {
            let ending = ending.clone();
            return self.end(ending);
        }
        self.device_deadlines(at);
        self.watch_clock(at);
    }

    fn watch_clock(&mut self, at: Moment) {
        if !self.history.started || self.history.over() || !self.phase.under_way() {
            return;
        }
        let wall_s = (at.wall - self.clock.wall).as_seconds_f64();
        let by_s = wall_s - at.seconds_since(&self.clock);
        if by_s.abs() > CLOCK_STEP_S {
            self.clock = at;
            self.record(Event::ClockStepped { by_s }, at);
        }
    }
}
