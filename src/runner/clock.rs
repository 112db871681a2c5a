//! The clock of a runner: real or virtual.

use chrono::{DateTime, FixedOffset, Local};
use std::cell::Cell;
use std::rc::Rc;
use std::time::{Duration, Instant};
use study_session::outcome::Moment;

/// Reads wall clock and monotonic clock together.
pub trait Clock {
    /// The present moment. The monotonic part never decreases.
    fn now(&self) -> Moment;

    /// How long a person has to be waited for while `time` passes on this clock.
    fn wait(&self, time: Duration) -> Duration {
        time
    }
}

/// The clocks of the machine.
#[derive(Debug, Clone)]
pub struct RealClock {
    origin: Instant,
}

impl Default for RealClock {
    fn default() -> Self {
        Self {
            origin: Instant::now(),
        }
    }
}

impl Clock for RealClock {
    fn now(&self) -> Moment {
        let mono = self.origin.elapsed().as_nanos();
        Moment {
            wall: Local::now().fixed_offset(),
            mono_ns: u64::try_from(mono).unwrap_or(u64::MAX),
        }
    }
}

/// A clock that moves only by [`VirtualClock::advance`]. Clones share their time.
#[derive(Debug, Clone)]
pub struct VirtualClock {
    start: DateTime<FixedOffset>,
    elapsed: Rc<Cell<Duration>>,
}

impl VirtualClock {
    /// A clock that starts at a date.
    pub fn starting_at(start: DateTime<FixedOffset>) -> Self {
        Self {
            start,
            elapsed: Rc::default(),
        }
    }

    /// Advances the clock.
    pub fn advance(&self, by: Duration) {
        self.elapsed.set(self.elapsed.get() + by);
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Moment {
        moment(self.start, self.elapsed.get())
    }
}

/// A clock that goes several times as fast as that of the machine: for tests of the program
/// on the simulated device.
///
/// It never jumps by more than `MOST`: a machine that was busy lets a session wait, and
/// does not let a playback run out unseen.
#[derive(Debug)]
pub struct HurriedClock {
    start: DateTime<FixedOffset>,
    times: u32,
    /// The machine's time at the last reading, and what this clock showed.
    last: Cell<(Instant, Duration)>,
}

/// Largest step between two readings of a [`HurriedClock`].
const MOST: Duration = Duration::from_millis(100);

impl HurriedClock {
    /// A clock that starts now and is `times` as fast as the machine's, at least once.
    pub fn new(times: u32) -> Self {
        Self {
            start: Local::now().fixed_offset(),
            times: times.max(1),
            last: Cell::new((Instant::now(), Duration::ZERO)),
        }
    }
}

impl Clock for HurriedClock {
    fn now(&self) -> Moment {
        let (before, shown) = self.last.get();
        let at = Instant::now();
        let shown = shown + (at.duration_since(before) * self.times).min(MOST);
        self.last.set((at, shown));
        moment(self.start, shown)
    }

    fn wait(&self, time: Duration) -> Duration {
        time / self.times
    }
}

fn moment(start: DateTime<FixedOffset>, elapsed: Duration) -> Moment {
    let wall = chrono::Duration::from_std(elapsed)
        .ok()
        .and_then(|by| start.checked_add_signed(by))
        .unwrap_or(start);
    Moment {
        wall,
        mono_ns: u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hurried_clock_is_faster_and_does_not_jump() {
        let (clock, real) = (HurriedClock::new(10), Instant::now());
        let begin = clock.now();
        let mut before = begin;
        for _ in 0..20 {
            std::thread::sleep(Duration::from_millis(2));
            let now = clock.now();
            assert!(now.mono_ns - before.mono_ns <= MOST.as_nanos() as u64);
            before = now;
        }
        let shown = Duration::from_nanos(before.mono_ns - begin.mono_ns);
        // Each sleep is at least 2 ms, or 20 ms on this clock.
        assert!(shown >= Duration::from_millis(400), "{shown:?}");
        assert!(shown <= real.elapsed() * 10, "{shown:?}");
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(clock.now().mono_ns - before.mono_ns, MOST.as_nanos() as u64);
        assert_eq!(clock.wait(MOST), MOST / 10);
    }
}
