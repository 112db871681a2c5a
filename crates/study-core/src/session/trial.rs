//! One attempt at a trial: load, play, stop, rate.

use super::phase::Phase;
use super::{Effect, Session};
use crate::outcome::{Event, Failure, Fidelity, Moment, Playback, Verdict};
use crate::protocol::{DeviceKind, Trial};

impl Session {
    /// Requests the next trial from the device. The event comes first, so that
    /// nothing is felt that is not in the journal.
    pub(super) fn begin_attempt(&mut self, reference_s: f64, at: Moment) {
        let Some(trial) = self.history.next_trial().cloned() else {
            return self.proceed(at);
        };
        let attempt = self.history.attempts(trial.trial) + 1;
        let started = Event::AttemptStarted {
            trial: trial.trial,
            attempt,
            position: self.position(&trial),
            model: trial.model.clone(),
            reference_s,
        };
        self.record(started, at);
        self.out.push(Effect::Load {
            trial: trial.trial,
            attempt,
            model: trial.model,
        });
        self.phase = Phase::Loading { since: at };
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
        if matches!(self.phase, Phase::Loading { .. }) {
            self.out.push(Effect::Start);
            self.phase = Phase::Ready { since: at };
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
        self.out.push(Effect::Start);
        self.phase = Phase::Ready { since: at };
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
                };
                self.record(started, at);
                self.phase = Phase::Playing {
                    since: at,
                    strokes: 0,
                    telemetry,
                };
            }
            (Phase::Playing { .. }, _) => {}
            (Phase::Loading { .. } | Phase::Mounting { .. }, _) => {
                self.out.push(Effect::Limp);
                self.lose_attempt(Failure::DeviceFault, "the device started unasked", at);
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
        let (aborted, pause) = match self.phase {
            Phase::Playing { .. } => (false, false),
            Phase::Stopping { aborted, pause, .. } => (aborted, pause),
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
        };
        self.record(ended, at);
        match rendering {
            Some(found) if found.verdict == Verdict::Fault => self.wrong_force(&found, at),
            _ => self.after_playback(at),
        }
        if pause {
            self.start_pause(at);
        }
    }

    /// The force was not that of the table: nothing is asked about it.
    fn wrong_force(&mut self, found: &Fidelity, at: Moment) {
        self.out.push(Effect::Limp);
        let defects: Vec<&str> = found.defects.iter().map(|d| d.as_str()).collect();
        self.fail(Failure::Rendering, &defects.join(", "), at);
        self.proceed(at);
        self.show_wrong_force();
    }

    /// Enters the rating, or the choice if the playback was stopped or too short.
    pub(super) fn after_playback(&mut self, at: Moment) {
        let Some(open) = self.history.open() else {
            return self.proceed(at);
        };
        let begun = self.history.any_answer(open.form());
        let aborted = open.attempt.ended.is_none_or(|e| e.stopped);
        if begun || (!aborted && self.can_rate()) {
            self.open_trial_form(at);
        } else {
            self.phase = Phase::Stopped;
        }
    }

    /// Whether the attempt under way has a confirmed end and enough strokes.
    pub(super) fn can_rate(&self) -> bool {
        let Some(open) = self.history.open() else {
            return false;
        };
        open.attempt
            .ended
            .is_some_and(|e| e.playback.strokes >= self.minimum_strokes(open.trial))
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

    /// Whether the sample is mounted by a person, so that no deadline applies.
    pub(super) fn by_hand(&self, trial: &Trial) -> bool {
        let own = self.protocol.model(&trial.model).and_then(|m| m.device);
        let kind = own.or(self.claim.as_ref().map(|c| c.device_kind));
        kind == Some(DeviceKind::Manual)
    }

    pub(super) fn rate_stopped(&mut self, at: Moment) {
        if !matches!(self.phase, Phase::Stopped) {
        } else if self.can_rate() {
            self.open_trial_form(at);
        } else {
            self.notify("not enough was felt for a rating");
        }
    }

    pub(super) fn play_again(&mut self, at: Moment) {
        if !matches!(self.phase, Phase::Stopped) {
            return;
        }
        self.fail(Failure::Stopped, "played again", at);
        if self.device_lost {
            self.proceed(at);
            self.show_device_lost();
        } else {
            self.begin_attempt(0.0, at);
        }
    }

    /// Requests the stop that precedes the rating.
    pub(super) fn finish_playing(&mut self, strokes: u32, at: Moment) {
        let Some(open) = self.history.open() else {
            return;
        };
        if strokes < self.minimum_strokes(open.trial) {
            return self.notify("keep exploring");
        }
        self.request_stop(false, false, at);
    }

    fn request_stop(&mut self, aborted: bool, pause: bool, at: Moment) {
        self.out.push(Effect::Stop);
        self.phase = Phase::Stopping {
            since: at,
            aborted,
            limped: false,
            pause,
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
            Phase::Loading { .. } | Phase::Mounting { .. } | Phase::Ready { .. } => {
                self.out.push(Effect::Limp);
                self.fail(Failure::Stopped, "stopped before it played", at);
                self.proceed(at);
                self.notify("stopped");
            }
            _ => self.out.push(Effect::Limp),
        }
    }

    pub(super) fn pause(&mut self, at: Moment) {
        match &mut self.phase {
            Phase::Playing { .. } => self.request_stop(true, true, at),
            Phase::Stopping { pause, .. } => *pause = true,
            Phase::Loading { .. } | Phase::Mounting { .. } | Phase::Ready { .. } => {
                self.stop(at);
                self.start_pause(at);
            }
            Phase::ResumeChoice { .. } | Phase::End => self.notify("nothing can be paused now"),
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
