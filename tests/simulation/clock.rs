//! The clocks of a simulated computer, and the time that really passes.

use chrono::{DateTime, FixedOffset, TimeDelta};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::time::Duration;
use study::runner::clock::Clock;
use study_session::outcome::Moment;

/// Real time since the start of a process, and what its two clocks show. Clones share it.
#[derive(Debug, Clone)]
pub(crate) struct SimClock {
    /// What the wall clock showed at the start.
    start: DateTime<FixedOffset>,
    /// What the monotonic clock showed at the start.
    origin: Duration,
    times: Arc<Times>,
}

#[derive(Debug, Default)]
struct Times {
    real_ns: AtomicU64,
    /// Of these the monotonic clock has not counted so many.
    asleep_ns: AtomicU64,
    /// By how much the wall clock was set.
    set_ms: AtomicI64,
}

impl SimClock {
    pub(crate) fn new(start: DateTime<FixedOffset>, origin: Duration) -> Self {
        Self {
            start,
            origin,
            times: Arc::default(),
        }
    }

    /// Time since the start, for the device and for people.
    pub(crate) fn real(&self) -> Duration {
        Duration::from_nanos(self.times.real_ns.load(Ordering::Relaxed))
    }

    /// Lets time pass.
    pub(crate) fn pass(&self, time: Duration) {
        let time_ns = u64::try_from(time.as_nanos()).unwrap();
        self.times.real_ns.fetch_add(time_ns, Ordering::Relaxed);
    }

    /// Lets time pass while the computer is suspended: its monotonic clock stands still.
    pub(crate) fn suspend(&self, time: Duration) {
        self.pass(time);
        let time_ns = u64::try_from(time.as_nanos()).unwrap();
        self.times.asleep_ns.fetch_add(time_ns, Ordering::Relaxed);
    }

    /// Sets the wall clock, ms forward.
    pub(crate) fn set(&self, by_ms: i64) {
        self.times.set_ms.fetch_add(by_ms, Ordering::Relaxed);
    }

    /// By how much the wall clock was set in all, ms.
    pub(crate) fn set_ms(&self) -> i64 {
        self.times.set_ms.load(Ordering::Relaxed)
    }
}

impl Clock for SimClock {
    fn now(&self) -> Moment {
        let real = self.real();
        let asleep = Duration::from_nanos(self.times.asleep_ns.load(Ordering::Relaxed));
        let shown = TimeDelta::from_std(real).unwrap() + TimeDelta::milliseconds(self.set_ms());
        Moment {
            wall: self.start + shown,
            mono_ns: u64::try_from((self.origin + real - asleep).as_nanos()).unwrap(),
        }
    }
}
