//! A loop that stood still: the computer was suspended, or the process was stopped.
//!
//! A device on a port goes limp by itself when the heartbeats stop. What plays in this process,
//! or in a program that was suspended with it, goes on as if nothing had been. Nor could anybody
//! answer meanwhile.

use super::Runner;
use std::time::Duration;
use study_session::session::Input;

/// Longest time between two turns of the loop. Usually they are 20 ms apart in a playback, and 100 ms
/// otherwise.
const LONGEST: Duration = Duration::from_secs(1);

impl Runner {
    /// Tells the session of a standstill, before anything that was typed or played meanwhile.
    pub(super) fn notice_standstill(&mut self) {
        let at = self.device_time();
        let still = at.saturating_sub(self.turned);
        self.turned = at;
        if still > LONGEST {
            let seconds = still.as_secs_f64();
            self.feed(Input::StoodStill { seconds });
        }
    }

    /// The time since the last turn was no standstill: a session was opened, or a rater, whose
    /// clock goes on in one step, took it.
    pub(super) fn took_time(&mut self) {
        self.turned = self.device_time();
    }
}
