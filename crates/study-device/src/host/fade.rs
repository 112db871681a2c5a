//! The end of a playback with a force that falls.

use super::{Host, Stage, servo};
use crate::{DeviceError, Report};
use std::time::Duration;
use study_wire::message::{Fault, Outcome, Request, Stop};
use study_wire::servo::ServoSettings;

impl Host {
    /// [`Device::fade`](crate::Device::fade), with its errors.
    pub fn fade(&mut self, at: Duration) -> Result<(), DeviceError> {
        let told = self.identity.and_then(|device| device.constants);
        let fades = told.is_some_and(|told| told.features.fade);
        match self.stage {
            Stage::Playing { .. } if fades => {
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
