//! How long round trips take.

use std::collections::VecDeque;
use std::time::Duration;

/// Number of round trips that are kept.
const KEPT: usize = 64;
/// The usual one is longer than this share of them.
const USUAL: f64 = 0.9;

/// The last round trips of heartbeats.
#[derive(Debug, Clone, Default)]
pub struct Trips(VecDeque<Duration>);

impl Trips {
    /// Adds one.
    pub fn add(&mut self, trip: Duration) {
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(trip);
    }

    /// One that is longer than nine tenths of them; `None` before the first.
    ///
    /// ```
    /// # use study_device::host::Trips;
    /// # use std::time::Duration;
    /// let mut trips = Trips::default();
    /// (1..=20).for_each(|ms| trips.add(Duration::from_millis(ms)));
    /// assert_eq!(trips.usual(), Some(Duration::from_millis(18)));
    /// ```
    pub fn usual(&self) -> Option<Duration> {
        let mut sorted: Vec<Duration> = self.0.iter().copied().collect();
        sorted.sort_unstable();
        let rank = (USUAL * sorted.len() as f64).ceil() as usize;
        sorted.get(rank.checked_sub(1)?).copied()
    }
}
