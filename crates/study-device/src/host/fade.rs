//! The end of a playback with a force that falls.

use super::{Host, Stage, servo};
use crate::{DeviceError, Report};
use std::time::Duration;
use study_wire::message::{Fault, Outcome, Request, Stop};
use study_wire::servo::ServoSettings;

/// Longest fall that is asked for, s: the longest ramp of docs/wire.md, 7.7, and half of it for forces
/// that the slew limit lets fall no faster. A session awaits the end of a playback for 2 s.
const LONGEST_FALL_S: f64 = 1.5;

impl Host {
    /// [`Device::fade`](crate::Device::fade), with its errors.
    pub fn fade(&mut self, at: Duration) -> Result<(), DeviceError> {
        match self.stage {
            Stage::Playing { .. } if self.falls_in_time() => {
                self.fades = true;
                self.stage = Stage::Fading { since: at };
                let playback = self.playback;
                self.send(Request::Fade(Stop { playback }), at);
                Ok(())
            }
            Stage::Fading { .. } => Ok(()),
            // What has not started, or has ended, has no force that could fall.
            _ => self.stop(at),
        }
    }

    /// Whether the device lets a force fall, and within [`LONGEST_FALL_S`] from the force limit of
    /// what is loaded.
    fn falls_in_time(&self) -> bool {
        let Some(device) = &self.identity else {
            return false;
        };
        let Some(told) = device.constants.filter(|told| told.features.fade) else {
            return false;
        };
        let servo = ServoSettings {
            force_n: self.limit_n,
            ..servo(device, &told)
        };
        f64::from(servo.fade_periods()) <= LONGEST_FALL_S * device.servo_hz
    }

    /// From when the force fell in a playback that has ended; `None` if something else ended it.
    /// A fall has a fixed number of servo periods, and ends the playback.
    pub(super) fn faded(&self, outcome: &Outcome) -> Option<Report> {
        let device = self.identity.as_ref()?;
        let servo = ServoSettings {
            force_n: outcome.limit_n,
            ..servo(device, &device.constants?)
        };
        let from = outcome.ticks.saturating_sub(servo.fade_periods());
        let ended_it = self.fades && outcome.fault == Fault::None;
        ended_it.then(|| Report::Faded {
            from_s: f64::from(from) / device.servo_hz,
        })
    }
}
