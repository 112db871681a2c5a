//! The clock of a runner: real or virtual.

use chrono::{DateTime, FixedOffset, Local};
use std::cell::Cell;
use std::rc::Rc;
use std::time::{Duration, Instant};
use study_core::outcome::Moment;

/// Reads wall clock and monotonic clock together.
pub trait Clock {
    /// The present moment. The monotonic part never decreases.
    fn now(&self) -> Moment;
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
        let elapsed = self.elapsed.get();
        let wall = chrono::Duration::from_std(elapsed)
            .ok()
            .and_then(|by| self.start.checked_add_signed(by))
            .unwrap_or(self.start);
        Moment {
            wall,
            mono_ns: u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX),
        }
    }
}
