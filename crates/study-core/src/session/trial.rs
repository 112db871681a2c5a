//! One attempt at a trial: load, play, stop, and the way to its rating.

use super::phase::Phase;
use super::view::Counts;
use super::{Effect, Session};
use crate::outcome::{Event, Failure, Moment, Playback};
use crate::protocol::{DeviceKind, Trial};

impl Session {
    /// Asks the device for the next trial: the event first, so that the journal
    /// never knows less than the hand.
    pub(super) fn begin_attempt(&mut self, reference_s: f64, at: Moment) {
        let Some(trial) = self.history.next_trial().cloned() else {
            return self.go_on(at);
        };
        let attempt = self.history.attempts(trial.trial) + 1;
        let started = Event::AttemptStarted {
            trial: trial.trial,
            attempt,
            position: self.history.position(&trial),
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

    pub(super) fn device_loaded(&mut self, at: Moment) {
        if matches!(self.phase, Phase::Loading { .. }) {
            self.out.push(Effect::Start);
            self.phase = Phase::Ready { since: at };
        }
    }

    /// A sample is mounted by a person, who says when it is done.
    pub(super) fn device_mount(&mut self, code: String) {
        if matches!(self.phase, Phase::Loading { .. }) {
            self.phase = Phase::Mounting { code };
        }
    }

    /// It is mounted: what is felt from here on counts.
    pub(super) fn mounted(&mut self, at: Moment) {
        self.out.push(Effect::Start);
        self.phase = Phase::Ready { since: at };
    }

    /// A device that starts unasked is made limp, and with it what was on its way.
    pub(super) fn device_started(&mut self, at: Moment) {
        match (&mut self.phase, &self.history.open) {
            (Phase::Ready { .. }, Some(open)) => {
                let counts = self.counted(&open.trial).then(Counts::default);
                let started = Event::PlaybackStarted {
                    trial: open.trial.trial,
                    attempt: open.attempt,
                };
                self.record(started, at);
                self.phase = Phase::Playing { since: at, counts };
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

    pub(super) fn device_progress(&mut self, strokes: u32, clamps: u64) {
        if let Phase::Playing { counts, .. } = &mut self.phase {
            *counts = Some(Counts { strokes, clamps });
        }
    }

    /// The confirmed end. Only from here does a way lead to the rating.
    pub(super) fn device_stopped(&mut self, playback: Playback, at: Moment) {
        let (broken_off, pause) = match self.phase {
            Phase::Playing { .. } => (false, false),
            Phase::Stopping {
                broken_off, pause, ..
            } => (broken_off, pause),
            _ => return,
        };
        let Some(open) = &self.history.open else {
            return;
        };
        if !is_sound(&playback) {
            self.out.push(Effect::Limp);
            return self.lose_attempt(
                Failure::PlaybackLost,
                "the device's account of the playback is no number",
                at,
            );
        }
        let ended = Event::PlaybackEnded {
            trial: open.trial.trial,
            attempt: open.attempt,
            playback,
            stopped: broken_off,
        };
        self.record(ended, at);
        self.after_playback(at);
        if pause {
            self.start_pause(at);
        }
    }

    /// To the rating, or to the choice if it was broken off or too short.
    pub(super) fn after_playback(&mut self, at: Moment) {
        let Some(open) = &self.history.open else {
            return self.go_on(at);
        };
        let begun = self.history.any_answer(open.place());
        let broken_off = open.ended.is_none_or(|(_, stopped)| stopped);
        if begun || (!broken_off && self.can_rate()) {
            self.open_trial_form(at);
        } else {
            self.phase = Phase::Stopped;
        }
    }

    /// Whether the attempt under way has a confirmed end and strokes enough.
    pub(super) fn can_rate(&self) -> bool {
        let Some(open) = &self.history.open else {
            return false;
        };
        open.ended
            .is_some_and(|(playback, _)| playback.strokes >= self.minimum_strokes(&open.trial))
    }

    /// Strokes that a rating needs; none where nobody counts them.
    pub(super) fn minimum_strokes(&self, trial: &Trial) -> u32 {
        if self.counted(trial) {
            self.protocol.trial.minimum_strokes
        } else {
            0
        }
    }

    /// Whether strokes and clamps of this trial are known.
    fn counted(&self, trial: &Trial) -> bool {
        self.claim.as_ref().is_some_and(|c| c.device_telemetry) && !self.by_hand(trial)
    }

    /// Whether the realization is mounted by a person, who may take their time.
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
            self.say("too little was felt to be rated");
        }
    }

    pub(super) fn play_again(&mut self, at: Moment) {
        if !matches!(self.phase, Phase::Stopped) {
            return;
        }
        self.fail(Failure::Stopped, "played again", at);
        if self.device_lost {
            self.go_on(at);
            self.show_trouble_again();
        } else {
            self.begin_attempt(0.0, at);
        }
    }

    /// Stops playing in order to rate.
    pub(super) fn finish_playing(&mut self, strokes: u32, at: Moment) {
        let Some(open) = &self.history.open else {
            return;
        };
        let missing = self.minimum_strokes(&open.trial).saturating_sub(strokes);
        if missing > 0 {
            return self.say(format!("{missing} more full strokes first"));
        }
        self.ask_to_stop(false, false, at);
    }

    fn ask_to_stop(&mut self, broken_off: bool, pause: bool, at: Moment) {
        self.out.push(Effect::Stop);
        self.phase = Phase::Stopping {
            since: at,
            broken_off,
            limped: false,
            pause,
        };
    }

    /// Esc. A stop keeps the device's account of what was felt; asked twice, or
    /// where nothing plays, the device is simply made limp.
    pub(super) fn stop(&mut self, at: Moment) {
        match &mut self.phase {
            Phase::Playing { .. } => self.ask_to_stop(true, false, at),
            Phase::Stopping {
                broken_off, limped, ..
            } => {
                *broken_off = true;
                *limped = true;
                self.out.push(Effect::Limp);
            }
            Phase::Loading { .. } | Phase::Mounting { .. } | Phase::Ready { .. } => {
                self.out.push(Effect::Limp);
                self.fail(Failure::Stopped, "stopped before it played", at);
                self.go_on(at);
                self.say("stopped");
            }
            _ => self.out.push(Effect::Limp),
        }
    }

    pub(super) fn pause(&mut self, at: Moment) {
        match &mut self.phase {
            Phase::Playing { .. } => self.ask_to_stop(true, true, at),
            Phase::Stopping { pause, .. } => *pause = true,
            Phase::Loading { .. } | Phase::Mounting { .. } | Phase::Ready { .. } => {
                self.stop(at);
                self.start_pause(at);
            }
            Phase::ResumeChoice { .. } | Phase::End => self.say("there is nothing to pause"),
            _ => self.start_pause(at),
        }
    }

    pub(super) fn start_pause(&mut self, at: Moment) {
        self.record(Event::Paused, at);
        self.paused = Some(at);
    }
}

fn is_sound(playback: &Playback) -> bool {
    [
        playback.exploration_s,
        playback.least_energy_j,
        playback.switches_per_s,
    ]
    .iter()
    .all(|n| n.is_finite())
}
