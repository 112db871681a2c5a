//! The device's clock as the host knows it: offset and drift, from round trips.
//!
//! A reply carries the device's clock at some moment between request and reply; the
//! middle is taken, so the error is at most half the round trip. Of each second the
//! quickest round trip counts.

use std::collections::VecDeque;
use std::time::Duration;

/// Seconds of which the quickest round trips are kept for the drift.
const SECONDS: usize = 600;
/// Round trips that are kept for their median and percentiles.
const TRIPS: usize = 4096;

/// What is known of the device's clock.
#[derive(Debug, Clone, Default)]
pub struct DeviceClock {
    /// The last reading without the wraps of 32 bits, ms.
    last_ms: Option<u64>,
    /// Of each second the quickest trip; the last is still open.
    best: VecDeque<Reading>,
    trips: VecDeque<Duration>,
}

#[derive(Debug, Clone, Copy)]
struct Reading {
    second: u64,
    trip: Duration,
    /// Middle of the trip by the host's clock, ms.
    host_ms: f64,
    /// Device minus host, ms.
    offset_ms: f64,
}

impl DeviceClock {
    /// Takes in a reply that came at `received` to what went out at `sent`.
    pub fn note(&mut self, sent: Duration, received: Duration, clock_ms: u32) {
        let last_ms = self.last_ms.unwrap_or(u64::from(clock_ms));
        // the step since the last reading, backwards at most half the range
        let step = clock_ms.wrapping_sub(last_ms as u32) as i32;
        let device_ms = last_ms.saturating_add_signed(i64::from(step));
        self.last_ms = Some(device_ms.max(last_ms));
        let trip = received.saturating_sub(sent);
        if self.trips.len() == TRIPS {
            self.trips.pop_front();
        }
        self.trips.push_back(trip);
        let host_ms = ms(sent) + 0.5 * ms(trip);
        let reading = Reading {
            second: received.as_secs(),
            trip,
            host_ms,
            // the clock shows whole ms that have passed
            offset_ms: device_ms as f64 + 0.5 - host_ms,
        };
        match self.best.back_mut() {
            Some(best) if best.second == reading.second => {
                if reading.trip < best.trip {
                    *best = reading;
                }
            }
            _ => {
                if self.best.len() == SECONDS {
                    self.best.pop_front();
                }
                self.best.push_back(reading);
            }
        }
    }

    /// Device minus host, ms, by the quickest trip of the last two seconds.
    pub fn offset_ms(&self) -> Option<f64> {
        let recent = self.best.iter().rev().take(2);
        recent.min_by_key(|r| r.trip).map(|r| r.offset_ms)
    }

    /// The device's clock at a moment, ms, wrapping; `None` before the first reading.
    pub fn at(&self, at: Duration) -> Option<u32> {
        let device_ms = ms(at) + self.offset_ms()?;
        Some(device_ms.max(0.0) as u64 as u32)
    }

    /// How much faster than the host's it runs, parts in a million, by least squares
    /// over at least ten seconds.
    pub fn drift_ppm(&self) -> Option<f64> {
        let span_ms = self.best.back()?.host_ms - self.best.front()?.host_ms;
        if span_ms < 10_000.0 {
            return None;
        }
        let n = self.best.len() as f64;
        let mean = |f: fn(&Reading) -> f64| self.best.iter().map(f).sum::<f64>() / n;
        let (x, y) = (mean(|r| r.host_ms), mean(|r| r.offset_ms));
        let (mut xy, mut xx) = (0.0, 0.0);
        for reading in &self.best {
            xy += (reading.host_ms - x) * (reading.offset_ms - y);
            xx += (reading.host_ms - x).powi(2);
        }
        Some(1e6 * xy / xx)
    }

    /// Round trips of late, in the order in which they were made.
    pub fn trips(&self) -> impl Iterator<Item = Duration> + '_ {
        self.trips.iter().copied()
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a clock that is `ahead_ms` ahead and `ppm` fast, every 100 ms for
    /// `seconds`; trips of 2 ms, every seventh of 20 ms with a late reply.
    fn read(ahead_ms: f64, ppm: f64, seconds: u64) -> DeviceClock {
        let mut clock = DeviceClock::default();
        for i in 0..10 * seconds {
            let sent = Duration::from_millis(100 * i);
            let device = |at: Duration| (ms(at) * (1.0 + ppm * 1e-6) + ahead_ms) as u64 as u32;
            let there = sent + Duration::from_millis(1);
            let late = if i % 7 == 0 { 18 } else { 0 };
            clock.note(sent, there + Duration::from_millis(1 + late), device(there));
        }
        clock
    }

    #[test]
    fn offset_and_drift_are_found_in_spite_of_late_replies() {
        let clock = read(12_345.0, 0.0, 20);
        assert!((clock.offset_ms().unwrap() - 12_345.0).abs() <= 0.6);
        let at = Duration::from_secs(20);
        assert!(clock.at(at).unwrap().abs_diff(32_345) <= 1);
        assert!(clock.drift_ppm().unwrap().abs() < 1.0);
        let fast = read(0.0, 200.0, 120).drift_ppm().unwrap();
        assert!((fast - 200.0).abs() < 10.0, "{fast}");
        assert_eq!(read(0.0, 0.0, 5).drift_ppm(), None);
    }

    /// 32 bits of ms last 49.7 days.
    #[test]
    fn a_clock_that_wraps_goes_on() {
        let clock = read(f64::from(u32::MAX) - 5_000.0, 0.0, 20);
        let at = Duration::from_secs(20);
        assert!(
            clock.at(at).unwrap().abs_diff(15_000) <= 2,
            "{:?}",
            clock.at(at)
        );
    }
}
