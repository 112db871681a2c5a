//! Saving and leaving: the session ends only after its events are on disk.

use super::phase::{CLOCK_STEP_S, LEAVE_WITHIN_S, Phase};
use super::view::Mirror;
use super::{Effect, Ending, Session};
use crate::outcome::{Event, Failure, Moment};
use std::collections::{BTreeMap, VecDeque};

/// Which events of this process are on disk.
#[derive(Debug, Default)]
pub(super) struct SaveState {
    /// Number of events on disk.
    pub(super) saved: u64,
    /// The later events, in order: they are not known to be on disk.
    pub(super) unsaved: VecDeque<(Moment, Event)>,
    /// The participant's copy of the consent document, until it and its event are known to be on disk. It may have what was
    /// typed as a signature, and is never shown.
    pub(super) copy: Option<String>,
    /// Trial → number of events sent when it was completed.
    pub(super) done: BTreeMap<u32, u64>,
    /// Why saving failed.
    pub(super) trouble: Option<String>,
    /// A retry is under way.
    pub(super) retrying: bool,
}

impl SaveState {
    /// Number of events sent to the store.
    fn sent(&self) -> u64 {
        self.saved + self.unsaved.len() as u64
    }

    pub(super) fn send(&mut self, event: Event, at: Moment) {
        self.unsaved.push_back((at, event));
        if let Some((_, Event::TrialDone { trial, .. })) = self.unsaved.back() {
            self.done.insert(*trial, self.sent());
        }
    }

    pub(super) fn all_saved(&self) -> bool {
        self.unsaved.is_empty()
    }

    /// Whether the completion of a trial is on disk. Trials read from the journal
    /// are.
    pub(super) fn has_trial(&self, trial: u32) -> bool {
        self.done.get(&trial).is_none_or(|n| *n <= self.saved)
    }
}

impl Session {
    pub(super) fn saved(&mut self, count: u64, at: Moment) {
        while self.saves.saved < count
            && let Some((_, event)) = self.saves.unsaved.pop_front()
        {
            self.saves.saved += 1;
            // The copy is written before its event.
            if matches!(event, Event::Consented { .. }) {
                self.saves.copy = None;
            }
        }
        if self.saves.all_saved() {
            self.saves.trouble = None;
            self.saves.retrying = false;
        }
        self.proceed_if_saved(at);
    }

    pub(super) fn mirrored(&mut self, results: Option<String>, mirror: Option<String>) {
        let (state, folder, why) = match (results, mirror) {
            (None, None) => return self.mirror = Some(Mirror::InStep),
            (None, Some(why)) => (Mirror::OnlyResults, "the mirror", why),
            (Some(why), _) => (Mirror::OnlyMirror, "the results folder", why),
        };
        self.mirror = Some(state);
        let why = self.sanitized(&why);
        self.notify(format!(
            "{folder} is not written any more ({why}); answers are saved in the other one"
        ));
    }

    /// Leaves [`Phase::Saving`] and [`Phase::Leaving`] once everything is on disk.
    pub(super) fn proceed_if_saved(&mut self, at: Moment) {
        if !self.saves.all_saved() {
            return;
        }
        match &self.phase {
            Phase::Saving => self.proceed(at),
            Phase::Leaving { ending, .. } => self.end(ending.clone()),
            _ => {}
        }
    }

    pub(super) fn save_failed(&mut self, what: String, at: Moment) {
        self.out.push(Effect::Limp);
        self.saves.trouble = Some(what);
        let again = std::mem::take(&mut self.saves.retrying);
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
            phase if phase.preparing() => {
                let what = "the journal could not be written";
                if !self.step_failed(Failure::Stopped, what, at) {
                    self.fail(Failure::Stopped, what, at);
                    self.proceed(at);
                }
            }
            Phase::Playing { .. } => {
                self.phase = Phase::Stopping {
                    since: at,
                    aborted: true,
                    limped: true,
                    pause: false,
                    confirmed: None,
                };
            }
            Phase::Stopping { limped, .. } => *limped = true,
            _ => {}
        }
    }

    pub(super) fn retry_save(&mut self) {
        if self.saves.trouble.is_some() && !self.saves.retrying {
            self.saves.retrying = true;
            self.out.push(Effect::RetrySave);
        }
    }

    /// Makes the device limp and exits as soon as the last event is on disk. After
    /// an abort, or if saving had already failed, saving is retried once; otherwise
    /// a failure is shown. A second request exits at once.
    pub(super) fn quit(&mut self, reason: &str, aborted: bool, at: Moment) {
        match &self.phase {
            Phase::Over(_) => return,
            Phase::Identify | Phase::Claiming => return self.end(Ending::Nothing),
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
                .open()
                .is_some_and(|o| o.attempt.ended.is_none())
            {
                self.fail(Failure::Interrupted, reason, at);
            }
            let reason = reason.to_owned();
            self.record(Event::Interrupted { reason }, at);
        }
        self.leave(aborted, at);
    }

    /// Exits as soon as everything is on disk.
    pub(super) fn leave(&mut self, aborted: bool, at: Moment) {
        let forced = aborted || self.saves.trouble.is_some();
        let ending = if self.history.finished() {
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
        self.proceed_if_saved(at);
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
        self.end_gap(at);
        self.end_exposure(at);
        self.watch_media(at);
        self.device_deadlines(at);
        self.watch_clock(at);
    }

    fn watch_clock(&mut self, at: Moment) {
        if self.history.start().is_none() || self.history.over() || !self.phase.under_way() {
            return;
        }
        let wall_s = (at.wall - self.clock.wall).as_seconds_f64();
        let by_s = wall_s - at.seconds_since(&self.clock);
        if by_s.abs() > CLOCK_STEP_S {
            self.clock = at;
            self.record(Event::ClockStepped { by_s }, at);
            // A computer that was suspended counts the time by its wall clock only.
            if by_s > 0.0 {
                self.stood_still(by_s, at);
                self.was_away(by_s, at);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chrono::DateTime;

    #[test]
    fn a_trial_is_saved_with_its_last_event_and_not_before() {
        let at = Moment {
            wall: DateTime::UNIX_EPOCH.fixed_offset(),
            mono_ns: 0,
        };
        let mut saves = SaveState::default();
        saves.send(Event::ClockStepped { by_s: 1.0 }, at);
        let done = Event::TrialDone {
            trial: 1,
            attempt: 1,
            response_s: 1.0,
            paused_s: None,
        };
        saves.send(done, at);
        for (saved, shown) in [(0, false), (1, false), (2, true)] {
            saves.saved = saved;
            assert_eq!(saves.has_trial(1), shown, "{saved} of 2 events on disk");
        }
        assert!(saves.has_trial(7), "from the journal");
    }
}
