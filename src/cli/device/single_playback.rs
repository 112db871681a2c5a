//! One playback of a table without a session.

use crate::device::{Device, DeviceError, Report, Stimulus};
use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_core::outcome::Playback;

/// Time for a load, a start or a stop.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// Time between two polls, as in a session.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Why a playback failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum PlaybackError {
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A fault or a loss, as reported by the device.
    #[error("{0}")]
    Reported(String),
    #[error("it does not answer in time")]
    Timeout,
}

/// Plays a stimulus for `duration`. `turn` receives the reports of each poll.
pub(super) fn play(
    device: &mut dyn Device,
    stimulus: &Stimulus<'_>,
    limits: Limits,
    duration: Duration,
    turn: &mut dyn FnMut(&[Report]),
) -> Result<Playback, PlaybackError> {
    let start = Instant::now();
    let at = || start.elapsed();
    device.load(stimulus, limits, at())?;
    let mut stop_at = None;
    let mut due = ANSWER_TIMEOUT;
    loop {
        let reports = device.poll(at());
        turn(&reports);
        for report in reports {
            match report {
                Report::Loaded => device.start(at())?,
                Report::Started => {
                    stop_at = Some(at() + duration);
                    due = at() + duration + ANSWER_TIMEOUT;
                }
                Report::Stopped(playback) => return Ok(playback),
                Report::Fault(reason) | Report::Lost(reason) => {
                    return Err(PlaybackError::Reported(reason));
                }
                _ => {}
            }
        }
        if stop_at.take_if(|stop_at| at() >= *stop_at).is_some() {
            device.stop(at())?;
        }
        if at() > due {
            return Err(PlaybackError::Timeout);
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}
