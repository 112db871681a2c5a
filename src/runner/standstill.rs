//! A loop that stood still: the computer was suspended, or the process was stopped.
//!
//! A device on a port goes limp by itself when the heartbeats stop. What plays in this process,
//! or in a program that was suspended with it, goes on as if nothing had been. Nor could anybody
//! answer meanwhile.

use super::Runner;
use study_session::session::Input;

/// Longest time between two turns of the loop, s. Usually they are 20 ms apart in a playback, and
/// 100 ms otherwise.
const LONGEST_S: f64 = 1.0;

impl Runner {
    /// Tells the session of a standstill, before anything that was typed or played meanwhile.
    pub(super) fn notice_standstill(&mut self) {
        let at = self.setup.clock.now();
        let before = std::mem::replace(&mut self.turned, at);
        let seconds = at.seconds_since(&before);
        if seconds > LONGEST_S {
            self.feed(Input::StoodStill { seconds });
        }
        // Where the monotonic clock stands still with the computer, only the wall clock went on. The
        // session compares both.
        if (at.wall - before.wall).as_seconds_f64() - seconds > LONGEST_S {
            self.feed(Input::Tick);
        }
    }

    /// The time since the last turn was no standstill: a session was opened, or a rater, whose
    /// clock goes on in one step, took it.
    pub(super) fn took_time(&mut self) {
        self.turned = self.setup.clock.now();
    }
}
