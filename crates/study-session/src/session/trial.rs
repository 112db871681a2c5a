//! One attempt at a trial: load, play, stop, rate.

use super::phase::Phase;
use super::{Effect, Session};
use crate::outcome::fold::{Ended, Presentation};
use crate::outcome::{Event, Failure, Fidelity, Moment, Playback, Verdict};
use study_plan::protocol::{DeviceKind, Exposure, Trial};

/// Why an attempt failed that was stopped and is played again.
pub(super) const PLAYED_AGAIN: &str = "played again";

impl Session {
    /// Requests the next trial from the device. The event comes first, so that
    /// nothing is felt that is not in the journal.
    pub(super) fn begin_attempt(&mut self, reference_s: f64, at: Moment) {
        let Some(trial) = self.history.next_trial().cloned() else {
            return self.proceed(at);
        };
        let Some(presenting) = self.presenting(&trial) else {
            return self.notify("this trial cannot be presented; see `study verify`");
        };
        let attempt = self.history.attempts(trial.trial) + 1;
        let (model, intervals) = match <[_; 1]>::try_from(presenting.models) {
            Ok([only]) => (Some(only), Vec::new()),
            Err(several) => (None, several),
        };
        let started = Event::AttemptStarted {
            trial: trial.trial,
            attempt,
            position: self.position(&trial),
            model,
            reference_s,
            intervals,
            level: presenting.level,
        };
        self.away_s = 0.0;
        self.record(started, at);
        self.load_interval(at);
    }

    /// Requests the next interval of the attempt under way from the device: each anew,
    /// also one that is equal to the last, so that a swap tells nothing.
    pub(super) fn load_interval(&mut self, at: Moment) {
        let (Some(open), Some(model)) = (self.history.open(), self.playing_model()) else {
            return self.proceed(at);
        };
        let load = Effect::Load {
            trial: open.trial.trial,
            attempt: open.attempt.number,
            model: model.clone(),
            interval: self.interval(),
        };
        self.out.push(load);
        self.phase = Phase::Loading { since: at };
    }

    /// The interval under way, from 1, if the trial has several.
    pub(super) fn interval(&self) -> Option<u32> {
        let attempt = self.history.open()?.attempt;
        attempt.interval().filter(|_| attempt.is_numbered())
    }

    /// The number of intervals of the trial under way, if it has several.
    pub(super) fn intervals(&self) -> Option<u32> {
        let intervals = self.history.open()?.attempt.intervals();
        (intervals > 1).then_some(intervals)
    }

    /// Where a trial would stand if it were felt now: one more than the trials of
    /// its kind (practice or not) felt so far, each as often as the hand came back
    /// to it from another one. Felt again at once, it keeps its position.
    fn position(&self, trial: &Trial) -> u32 {
        let mut felt: Vec<&Trial> = self.history.felt().collect();
        felt.dedup_by_key(|t| t.trial);
        let same_kind = |t: &&&Trial| t.practice == trial.practice;
        let before = felt.iter().filter(same_kind).count();
        let last = felt.last();
        let again = last.is_some_and(|t| t.trial == trial.trial);
        let before = u32::try_from(before).unwrap_or(u32::MAX);
        before.saturating_add(u32::from(!again))
    }

    pub(super) fn device_loaded(&mut self, at: Moment) {
        if !matches!(self.phase, Phase::Loading { .. }) {
            return;
        }
        match self.gap(at) {
            Some((ended, start_after_s)) => {
                self.phase = Phase::Gap {
                    ended,
                    start_after_s,
                };
                self.end_gap(at);
            }
            None => self.start_playback(at),
        }
    }

    fn start_playback(&mut self, at: Moment) {
        if self.lacks_page(at) {
            return;
        }
        self.out.push(Effect::Start);
        self.phase = Phase::Ready { since: at };
    }

    /// The end of the interval before, and when the next one starts after it: after the
    /// gap, or, if loading took longer, after a multiple of it.
    fn gap(&self, at: Moment) -> Option<(Moment, f64)> {
        let open = self.history.open()?;
        let gap_s = self.part_of(open.trial)?.gap_s;
        let (ended, _) = open.attempt.presentations.last()?.ended?;
        let late = (at.seconds_since(&ended) / gap_s).ceil().max(1.0);
        (gap_s > 0.0).then_some((ended, gap_s * late))
    }

    /// Starts the next interval at the end of the gap, unless that took too long. Nothing starts in a pause, or while the
    /// journal cannot be written.
    pub(super) fn end_gap(&mut self, at: Moment) {
        if self.saves.trouble.is_some() || self.paused.is_some() {
            return;
        }
        if let Phase::Gap {
            ended,
            start_after_s,
        } = self.phase
            && at.seconds_since(&ended) >= start_after_s
            && !self.are_apart(ended, at)
        {
            self.start_playback(at);
        }
    }

    /// A person must mount a sample and confirm it.
    pub(super) fn device_mount(&mut self, code: String) {
        if matches!(self.phase, Phase::Loading { .. }) {
            self.phase = Phase::Mounting { code };
        }
    }

    /// The sample is mounted: what is felt from here on counts.
    pub(super) fn mounted(&mut self, at: Moment) {
        self.start_playback(at);
    }

    /// A device that starts without a request is made limp, which also cancels a
    /// load.
    pub(super) fn device_started(&mut self, at: Moment) {
        match (&mut self.phase, self.history.open()) {
            (Phase::Ready { .. }, Some(open)) => {
                let telemetry = self.counted(open.trial).then_some(at);
                let started = Event::PlaybackStarted {
                    trial: open.trial.trial,
                    attempt: open.attempt.number,
                    interval: self.interval(),
                };
                self.record(started, at);
                self.phase = Phase::Playing {
                    since: at,
                    strokes: 0,
                    telemetry,
                };
                self.present_media(at);
            }
            (Phase::Playing { .. }, _) => {}
            (Phase::Loading { .. } | Phase::Mounting { .. } | Phase::Gap { .. }, _) => {
                self.out.push(Effect::Limp);
                self.lose_all(Failure::DeviceFault, "the device started unasked", at);
            }
            (Phase::Stopping { limped, .. }, _) => {
                *limped = true;
                self.out.push(Effect::Limp);
            }
            _ => self.out.push(Effect::Limp),
        }
    }

    pub(super) fn device_sampled(&mut self, at: Moment) {
        if let Phase::Playing { telemetry, .. } = &mut self.phase {
            *telemetry = Some(at);
        }
    }

    pub(super) fn device_progress(&mut self, so_far: u32) {
        if let Phase::Playing { strokes, .. } = &mut self.phase {
            *strokes = so_far;
        }
    }

    /// The confirmed end of the playback. Only after it can the trial be rated.
    pub(super) fn device_stopped(&mut self, playback: Playback, at: Moment) {
        let rendering = self.judged.take();
        let (aborted, pause, confirmed) = match self.phase {
            Phase::Playing { .. } => (false, false, None),
            Phase::Stopping {
                aborted,
                pause,
                confirmed,
                ..
            } => (aborted, pause, confirmed),
            _ => return,
        };
        let Some(open) = self.history.open() else {
            return;
        };
        if !is_finite(&playback) {
            self.out.push(Effect::Limp);
            return self.lose_attempt(
                Failure::PlaybackLost,
                "the device's account of the playback is no number",
                at,
            );
        }
        let ended = Event::PlaybackEnded {
            trial: open.trial.trial,
            attempt: open.attempt.number,
            playback,
            stopped: aborted,
            // The saver knows the file.
            telemetry: None,
            rendering: rendering.clone(),
            interval: self.interval(),
        };
        self.record(ended, at);
        self.away_s = 0.0;
        match rendering {
            Some(found) if found.verdict == Verdict::Fault => self.wrong_force(&found, at),
            _ => match confirmed.filter(|_| !aborted) {
                Some(confirmed) => self.settle(confirmed, at),
                None => self.after_playback(at),
            },
        }
        if pause {
            self.start_pause(at);
        }
    }

    /// The force was not that of the table: nothing is asked about it.
    fn wrong_force(&mut self, found: &Fidelity, at: Moment) {
        self.out.push(Effect::Limp);
        let defects: Vec<&str> = found.defects.iter().map(|d| d.as_str()).collect();
        let defects = defects.join(", ");
        if !self.step_failed(Failure::Rendering, &defects, at) {
            self.fail(Failure::Rendering, &defects, at);
            self.proceed(at);
        }
        self.show_wrong_force();
    }

    /// Enters the rating, or the choice if the playback was stopped or too short.
    pub(super) fn after_playback(&mut self, at: Moment) {
        if self.comes_too_late() {
            self.feel_again(at);
            return self.proceed(at);
        }
        if self.ended_without_media(at) {
            return;
        }
        let Some(open) = self.history.open() else {
            return self.proceed(at);
        };
        if open.attempt.is_adjusted() && !self.history.any_answer(open.form()) {
            return self.after_level(at);
        }
        if open.attempt.interval().is_some() {
            let last = open.attempt.presentations.last();
            let on = |(_, ended): (Moment, Ended)| !ended.stopped;
            if last.is_some_and(|p| p.ended.is_some_and(on) && self.suffices(p)) {
                self.load_interval(at);
            } else {
                self.phase = Phase::Stopped { since: at };
            }
            return;
        }
        let begun = self.history.any_answer(open.form());
        let aborted = open.attempt.ended.is_none_or(|e| e.stopped);
        if begun || (!aborted && self.can_rate()) {
            self.open_trial_form(at);
        } else {
            self.phase = Phase::Stopped { since: at };
        }
    }

    /// Whether the attempt under way has a confirmed end and enough of it was felt.
    pub(super) fn can_rate(&self) -> bool {
        self.history.open().is_some_and(|open| {
            if open.attempt.is_adjusted() {
                return self.can_settle(open.attempt);
            }
            let mut ended = open.attempt.presentations.iter();
            let felt = open.attempt.ended.is_some() && ended.all(|p| self.suffices(p));
            felt && !self.lacks_media()
        })
    }

    /// Whether a presentation of the attempt under way was felt long enough and with enough
    /// strokes. One without an end is none.
    pub(super) fn suffices(&self, presentation: &Presentation) -> bool {
        let (Some((_, ended)), Some(felt_s)) = (presentation.ended, presentation.felt_s()) else {
            return true;
        };
        !self.too_little(felt_s, ended.playback.strokes)
    }

    /// Strokes required before a rating; 0 where they are not counted.
    pub(super) fn minimum_strokes(&self, trial: &Trial) -> u32 {
        if self.counted(trial) {
            self.protocol.trial.minimum_strokes
        } else {
            0
        }
    }

    /// Whether the device reports strokes for this trial.
    fn counted(&self, trial: &Trial) -> bool {
        self.claim.as_ref().is_some_and(|c| c.device_telemetry) && !self.by_hand(trial)
    }

    /// Least and largest time that an interval of the trial under way is felt, s.
    pub(super) fn exposure(&self) -> Exposure {
        let part = self
            .history
            .open()
            .and_then(|open| self.part_of(open.trial));
        part.map_or(self.protocol.trial.exposure, |part| part.exposure)
    }

    /// Whether the sample is mounted by a person, so that no deadline applies.
    pub(super) fn by_hand(&self, trial: &Trial) -> bool {
        let model = self.playing_model().or(trial.model());
        let own = model.and_then(|id| self.protocol.model(id)?.device);
        let kind = own.or(self.claim.as_ref().map(|c| c.device_kind));
        kind == Some(DeviceKind::Manual)
    }

    pub(super) fn rate_stopped(&mut self, at: Moment) {
        let Phase::Stopped { since } = self.phase else {
            return;
        };
        let stopped_s = at.seconds_since(&since);
        if self.is_forgotten(stopped_s) {
            self.notify("it was felt too long ago for a rating");
        } else if self.can_rate() {
            self.away_s += stopped_s;
            if self.adjusting().is_some() {
                let by = self.confirmed();
                self.settle(by, at);
            } else {
                self.open_trial_form(at);
            }
        } else {
            self.notify("not enough was felt for a rating");
        }
    }

    pub(super) fn play_again(&mut self, at: Moment) {
        if self.can_replay()
            && let Some(open) = self.history.open()
        {
            let replayed = Event::Replayed {
                trial: open.trial.trial,
                attempt: open.attempt.number,
            };
            self.record(replayed, at);
            return self.load_interval(at);
        }
        if !matches!(self.phase, Phase::Stopped { .. }) || self.feel_level_again(at) {
            return;
        }
        self.fail(Failure::Stopped, PLAYED_AGAIN, at);
        if self.device_lost {
            self.proceed(at);
            self.show_device_lost();
        } else {
            self.begin_attempt(0.0, at);
        }
    }

    /// Whether all intervals may be felt again: before an answer, as often as the part
    /// permits.
    pub(super) fn can_replay(&self) -> bool {
        let (Phase::Form(form), Some(open)) = (&self.phase, self.history.open()) else {
            return false;
        };
        form.id == open.form()
            && !self.history.any_answer(form.id)
            && open.attempt.replays < self.exposure().replays
            && !self.device_lost
    }

    /// Whether some trial of the study may be felt again.
    pub(super) fn has_replays(&self) -> bool {
        let mut parts = self.protocol.parts.iter();
        self.protocol.trial.exposure.replays > 0 || parts.any(|part| part.exposure.replays > 0)
    }

    /// Whether more exploration is required after this time and these strokes.
    pub(super) fn too_little(&self, felt_s: f64, strokes: u32) -> bool {
        let open = self.history.open();
        let least = open.map_or(0, |open| self.minimum_strokes(open.trial));
        strokes < least || felt_s < self.exposure().min_s
    }

    /// Requests the stop that precedes the rating or the next interval.
    pub(super) fn finish_playing(&mut self, felt_s: f64, strokes: u32, at: Moment) {
        if self.history.open().is_none() {
            return;
        }
        if self.too_little(felt_s, strokes) {
            return self.notify("keep exploring");
        }
        if self.awaits_media() {
            return self.notify("the participant's page has not shown and played everything yet");
        }
        if self.adjusting().is_some() {
            return self.leave_level(at);
        }
        self.request_stop(false, false, at);
    }

    /// Stops the playback after the longest exposure.
    pub(super) fn end_exposure(&mut self, at: Moment) {
        if let Phase::Playing { since, .. } = &self.phase
            && let Some(max_s) = self.exposure().max_s
            && at.seconds_since(since) >= max_s
        {
            match self.feels_standard() {
                // The level follows, as after Enter.
                true => self.leave_level(at),
                false => self.request_stop(false, false, at),
            }
        }
    }

    pub(super) fn request_stop(&mut self, aborted: bool, pause: bool, at: Moment) {
        self.out.push(Effect::Stop);
        self.await_stop(aborted, pause, at);
    }

    /// Requests the end of what is felt, without a step of its force where the device can do so.
    /// A stop meanwhile makes the device limp at once, as during every stop.
    pub(super) fn request_fade(&mut self, at: Moment) {
        self.out.push(Effect::Fade);
        self.await_stop(false, false, at);
    }

    fn await_stop(&mut self, aborted: bool, pause: bool, at: Moment) {
        self.phase = Phase::Stopping {
            since: at,
            aborted,
            limped: false,
            pause,
            confirmed: None,
        };
    }

    /// Esc: the device reports what was felt before it stops. A second request, or
    /// one while nothing plays, makes the device limp.
    pub(super) fn stop(&mut self, at: Moment) {
        match &mut self.phase {
            Phase::Playing { .. } => self.request_stop(true, false, at),
            Phase::Stopping {
                aborted, limped, ..
            } => {
                *aborted = true;
                *limped = true;
                self.out.push(Effect::Limp);
            }
            phase if phase.preparing() => {
                self.out.push(Effect::Limp);
                let what = "stopped before it played";
                if !self.step_failed(Failure::Stopped, what, at) {
                    self.fail(Failure::Stopped, what, at);
                    self.proceed(at);
                }
                self.notify("stopped");
            }
            _ => self.out.push(Effect::Limp),
        }
    }

    pub(super) fn pause(&mut self, at: Moment) {
        match &mut self.phase {
            Phase::Playing { .. } => self.request_stop(true, true, at),
            Phase::Stopping { pause, .. } => *pause = true,
            phase if phase.preparing() => {
                self.stop(at);
                self.start_pause(at);
            }
            Phase::ResumeChoice { .. } => {
                self.notify("a pause is possible once the session goes on: choose how");
            }
            Phase::End => self.notify("nothing can be paused any more: the session is over"),
            _ => self.start_pause(at),
        }
    }

    pub(super) fn start_pause(&mut self, at: Moment) {
        self.record(Event::Paused, at);
        self.paused = Some(at);
    }
}

fn is_finite(playback: &Playback) -> bool {
    [
        playback.exploration_s,
        playback.least_energy_j,
        playback.switches_per_s,
    ]
    .iter()
    .all(|n| n.is_finite())
}
