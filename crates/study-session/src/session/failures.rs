//! Failed attempts and the new places of their trials.

use super::phase::{DeviceProblem, LOAD_WITHIN_S, Phase, STOP_WITHIN_S};
use super::{Effect, Session};
use crate::outcome::{Event, Failure, Moment};
use study_base::sort::SmallSort as _;
use study_plan::protocol::Trial;
use study_plan::schedule::{self, Felt};

impl Session {
    pub(super) fn device_fault(&mut self, what: &str, at: Moment) {
        self.report_problem(what, Failure::DeviceFault, at);
    }

    pub(super) fn device_gone(&mut self, what: &str, at: Moment) {
        self.device_lost = true;
        self.report_problem(what, Failure::PlaybackLost, at);
    }

    /// The device sends no more telemetry while it plays: its end will not be
    /// confirmed.
    pub(super) fn playback_lost(&mut self, what: &str, at: Moment) {
        self.out.push(Effect::Limp);
        if self.phase.armed() {
            self.lose_attempt(Failure::PlaybackLost, what, at);
        }
    }

    pub(super) fn device_ready(&mut self) {
        self.device_lost = false;
        if self.in_form() {
            self.device_problem = None;
        }
    }

    fn report_problem(&mut self, what: &str, failure: Failure, at: Moment) {
        self.out.push(Effect::Limp);
        if !self.phase.under_way() || matches!(self.phase, Phase::End) {
            return;
        }
        if self.phase.armed() {
            return self.lose_attempt(failure, what, at);
        }
        self.set_problem(what, failure);
    }

    /// Fails the attempt under way because of the device, or its step alone where a level is set.
    pub(super) fn lose_attempt(&mut self, failure: Failure, what: &str, at: Moment) {
        let shown = self.shown_loss(failure, what);
        if !self.step_failed(failure, what, at) {
            self.fail(failure, what, at);
            self.proceed(at);
        }
        self.set_problem(&shown, failure);
    }

    /// Fails the attempt under way in any case: something may have been felt that is not known.
    pub(super) fn lose_all(&mut self, failure: Failure, what: &str, at: Moment) {
        let shown = self.shown_loss(failure, what);
        self.fail(failure, what, at);
        self.proceed(at);
        self.set_problem(&shown, failure);
    }

    /// What is shown of a loss: why a force is not played may tell which one it is. A program that
    /// presents something else says what it lacks, such as a player of sounds.
    fn shown_loss(&self, failure: Failure, what: &str) -> String {
        let hidden = self.presents_force();
        let refused = failure == Failure::DeviceFault && self.phase.preparing() && hidden;
        let shown = if refused { REFUSED } else { what };
        shown.to_owned()
    }

    fn set_problem(&mut self, what: &str, failure: Failure) {
        let fault = failure == Failure::DeviceFault;
        let what = self.sanitized(what);
        let what = if fault { without_numbers(&what) } else { what };
        self.device_problem = Some(DeviceProblem { what, fault });
    }

    /// One text for every defect and every realization.
    pub(super) fn show_wrong_force(&mut self) {
        self.device_problem = Some(DeviceProblem {
            what: WRONG_FORCE.to_owned(),
            fault: false,
        });
    }

    pub(super) fn show_device_lost(&mut self) {
        self.device_problem = Some(DeviceProblem {
            what: "the device does not respond".to_owned(),
            fault: false,
        });
    }

    pub(super) fn device_deadlines(&mut self, at: Moment) {
        let (since, within_s, limped, what) = match &self.phase {
            Phase::Loading { since } => (since, LOAD_WITHIN_S, false, "the table"),
            Phase::Ready { since } => (since, LOAD_WITHIN_S, false, "the start"),
            Phase::Stopping { since, limped, .. } => (since, STOP_WITHIN_S, *limped, "the stop"),
            _ => return,
        };
        let by_hand = |s: &Self| s.history.open().is_some_and(|o| s.by_hand(o.trial));
        if at.seconds_since(since) < within_s || by_hand(self) {
            return;
        }
        let pause = matches!(self.phase, Phase::Stopping { pause: true, .. });
        self.out.push(Effect::Limp);
        if limped {
            self.phase = Phase::Stopped { since: at };
        } else {
            let what = format!("the device did not confirm {what} within {within_s} s");
            self.lose_attempt(Failure::PlaybackLost, &what, at);
        }
        if pause {
            self.start_pause(at);
        }
    }

    pub(super) fn mark_bad(&mut self, reason: String, at: Moment) {
        let Some((trial, attempt, number)) = self.markable() else {
            return self.notify("no trial can be marked now");
        };
        if let Err(why) = super::forms::check_free_text(&reason) {
            return self.notify(why.to_string());
        }
        if self.phase.armed() {
            self.out.push(Effect::Limp);
        }
        let under_way = self.history.open().is_some();
        self.fail_trial(trial, attempt, Failure::MarkedBad, &reason, at);
        if under_way || matches!(self.phase, Phase::Reference { .. } | Phase::Form(_)) {
            self.proceed(at);
        }
        self.notify(format!("{number} is marked as bad"));
    }

    /// The trial that can be marked as bad now (the one under way, or else the last
    /// completed one), its attempt and its title; none once the session is over.
    pub(super) fn markable(&self) -> Option<(u32, u32, String)> {
        if self.history.over() {
            return None;
        }
        if let Some(open) = self.history.open() {
            let practice = open.trial.practice;
            let number = self.history.closed(practice) + 1;
            return Some((
                open.trial.trial,
                open.attempt.number,
                title(practice, number),
            ));
        }
        let between = matches!(
            self.phase,
            Phase::Reference { .. } | Phase::Break { .. } | Phase::Saving | Phase::Form(_)
        );
        let trial = self.history.last_done.filter(|_| between)?;
        let (attempt, done) = self.history.completion(trial)?;
        Some((trial, attempt, title(false, done.number)))
    }

    /// Records the attempt under way as failed.
    pub(super) fn fail(&mut self, failure: Failure, detail: &str, at: Moment) {
        if let Some(open) = self.history.open() {
            let (trial, attempt) = (open.trial.trial, open.attempt.number);
            self.fail_trial(trial, attempt, failure, detail, at);
        }
    }

    /// After a failure that does not count the trial comes next again. Any other
    /// moves it to the end of its block, or closes it after `max_attempts`.
    fn fail_trial(
        &mut self,
        number: u32,
        attempt: u32,
        failure: Failure,
        detail: &str,
        at: Moment,
    ) {
        let Some(trial) = self.history.planned(number).cloned() else {
            return;
        };
        let failed = trial.clone();
        let planned = |n: &u32| self.history.planned(*n).cloned();
        let mut rest: Vec<Trial> = self.history.queue.iter().filter_map(planned).collect();
        rest.retain(|t| t.trial != number);
        // What is not told to a track, or to practice, that has ended takes it up again.
        if self.history.has_ended(&trial) {
            rest.extend(self.dropped(&[number]));
            rest.small_sort_by_key(|t| t.trial);
        }
        let design = &self.protocol.design_of(trial.part.as_ref());
        let mut constraint_broken = false;
        let mut given_up = false;
        let queue = if !failure.counts() {
            rest.insert(0, trial);
            rest
        } else if self.history.failures(number) + 1 >= design.max_attempts {
            given_up = true;
            constraint_broken = schedule::breaks_constraint(&self.felt(), &rest, design);
            rest
        } else {
            let again = schedule::requeue(&self.felt(), &rest, &trial, design);
            constraint_broken = again.constraint_broken;
            again.queue
        };
        let event = Event::AttemptFailed {
            trial: number,
            attempt,
            failure,
            detail: detail.to_owned(),
            queue: queue.iter().map(|t| t.trial).collect(),
            constraint_broken,
            paused_s: (self.paused_s())
                .filter(|_| failure == Failure::Interrupted && self.is_forgotten(0.0)),
        };
        self.record(event, at);
        if given_up {
            let trial = number;
            self.record(Event::TrialClosed { trial, attempt }, at);
        }
        self.leave_points_out(&failed, at);
    }

    /// The trials that the ends of the tracks, and of the practice, of these trials have dropped.
    pub(super) fn dropped(&self, again: &[u32]) -> Vec<Trial> {
        let of = |n: &u32| self.history.planned(*n);
        let again: Vec<&Trial> = again.iter().filter_map(of).collect();
        let schedule = self.history.schedule().iter();
        let same = |t: &&Trial| {
            let track = t.track().is_some();
            again.iter().any(|again| match track {
                true => again.track() == t.track(),
                false => again.practice && t.practice && again.part == t.part,
            })
        };
        schedule
            .filter(same)
            .filter(|t| !self.history.takes_place(t.trial))
            .cloned()
            .collect()
    }

    /// What the constraints of the order look back to.
    pub(super) fn felt(&self) -> Felt<'_> {
        Felt {
            trials: self.history.felt().collect(),
            goes_on: self.history.goes_on(),
        }
    }
}

/// What the screen shows instead of a device's reason for not playing a realization.
const REFUSED: &str = "the device does not play this trial; attempts.csv will have its reason";

/// What the screen shows after a playback with a wrong force.
const WRONG_FORCE: &str = "the device did not do what it was told";

/// The text with "…" for each number: a position or speed may depend on the realization.
fn without_numbers(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(from) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(from);
        out.push_str(before);
        out.push('…');
        let in_number = |c: char| c.is_ascii_digit() || c == '.';
        rest = number.trim_start_matches(in_number);
    }
    out + rest
}

/// "trial 7", "practice 1". `number` is that on the screen, not the planned one.
pub(super) fn title(practice: bool, number: u32) -> String {
    let what = if practice { "practice" } else { "trial" };
    format!("{what} {number}")
}
