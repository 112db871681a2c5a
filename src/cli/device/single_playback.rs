//! One playback of a table without a session.

use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_device::{Device, DeviceError, Report, Stimulus};
use study_session::outcome::Playback;

/// Time for a load, a start or a stop.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// Time between two polls, as in a session.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// The time of a playback.
#[derive(Debug, Clone, Copy)]
pub(super) enum Pace {
    /// Since this instant.
    Real(Instant),
    /// Virtual time, which passes while somebody waits.
    #[cfg(test)]
    Virtual(Duration),
}

impl Pace {
    /// The real time, from now on.
    pub(super) fn real() -> Self {
        Self::Real(Instant::now())
    }

    pub(super) fn at(self) -> Duration {
        match self {
            Self::Real(start) => start.elapsed(),
            #[cfg(test)]
            Self::Virtual(at) => at,
        }
    }

    pub(super) fn wait(&mut self) {
        match self {
            Self::Real(_) => std::thread::sleep(POLL_INTERVAL),
            #[cfg(test)]
            Self::Virtual(at) => *at += POLL_INTERVAL,
        }
    }
}

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

/// Plays a stimulus for `duration`. `turn` receives the reports of each poll, before the next
/// one: if it stands still, the screen does.
pub(super) fn play(
    device: &mut dyn Device,
    stimulus: &Stimulus<'_>,
    limits: Limits,
    duration: Duration,
    pace: &mut Pace,
    turn: &mut dyn FnMut(&[Report]),
) -> Result<Playback, PlaybackError> {
    device.load(stimulus, limits, pace.at())?;
    let mut stop_at = None;
    let mut due = pace.at() + ANSWER_TIMEOUT;
    loop {
        let reports = device.poll(pace.at());
        for report in &reports {
            match report {
                Report::Loaded => device.start(pace.at())?,
                Report::Started => {
                    stop_at = Some(pace.at() + duration);
                    due = pace.at() + duration + ANSWER_TIMEOUT;
                }
                Report::Stopped(playback) => {
                    turn(&reports);
                    return Ok(*playback);
                }
                Report::Fault(reason) | Report::Lost(reason) => {
                    turn(&reports);
                    return Err(PlaybackError::Reported(reason.clone()));
                }
                _ => {}
            }
        }
        if stop_at.take_if(|stop_at| pace.at() >= *stop_at).is_some() {
            device.stop(pace.at())?;
        }
        if pace.at() > due {
            return Err(PlaybackError::Timeout);
        }
        pace.wait();
        turn(&reports);
    }
}
