//! Estimate of the device's clock, its offset and drift, from round trips.
//!
//! A reply contains the device's time at some moment between request and reply. The
//! midpoint is used, so the error is at most half of the round trip. Only the shortest
//! round trip of each second counts.

use std::collections::VecDeque;
use std::time::Duration;

/// Number of seconds used for the drift.
const SECONDS: usize = 600;

/// Estimate of the device's clock.
///
/// ```
/// # use study_device::host::DeviceClock;
/// # use std::time::Duration;
/// let mut clock = DeviceClock::default();
/// // Asked at 1 s, answered 10 ms later: about 1005 ms here are 400 ms there.
/// clock.add(Duration::from_millis(1000), Duration::from_millis(1010), 400);
/// assert_eq!(clock.at(Duration::from_millis(2005)), Some(1400));
/// ```
#[derive(Debug, Clone, Default)]
pub struct DeviceClock {
    /// Last reading, extended beyond 32 bits, ms.
    last_ms: Option<u64>,
    /// Reading with the shortest round trip of each second, the current one included.
    best: VecDeque<Reading>,
}

#[derive(Debug, Clone, Copy)]
struct Reading {
    second: u64,
    trip: Duration,
    /// Midpoint of the round trip on the host's clock, ms.
    host_ms: f64,
    /// Device minus host, ms.
    offset_ms: f64,
}

impl DeviceClock {
    /// Adds the time in a reply received at `received` to a request sent at `sent`.
    pub fn add(&mut self, sent: Duration, received: Duration, clock_ms: u32) {
        let last_ms = self.last_ms.unwrap_or(u64::from(clock_ms));
        // The signed step since the last reading.
        let step = clock_ms.wrapping_sub(last_ms as u32) as i32;
        let device_ms = last_ms.saturating_add_signed(i64::from(step));
        self.last_ms = Some(device_ms.max(last_ms));
        let trip = received.saturating_sub(sent);

        let host_ms = ms(sent) + 0.5 * ms(trip);
        let reading = Reading {
            second: received.as_secs(),
            trip,
            host_ms,
            // The clock counts completed ms.
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

    /// Device time minus host time, ms, from the shortest round trip of the last two
    /// seconds.
    pub fn offset_ms(&self) -> Option<f64> {
        let recent = self.best.iter().rev().take(2);
        recent.min_by_key(|r| r.trip).map(|r| r.offset_ms)
    }

    /// The device's time at `at`, ms, wrapping; `None` before the first reading.
    pub fn at(&self, at: Duration) -> Option<u32> {
        let device_ms = ms(at) + self.offset_ms()?;
        Some(device_ms.max(0.0) as u64 as u32)
    }

    /// Drift relative to the host's clock, parts per million, by least squares; `None`
    /// before ten seconds.
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
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a clock that is `ahead_ms` ahead and `ppm` fast every 100 ms for `seconds`.
    /// Round trips take 2 ms, every seventh 20 ms.
    fn read(ahead_ms: f64, ppm: f64, seconds: u64) -> DeviceClock {
        let mut clock = DeviceClock::default();
        for i in 0..10 * seconds {
            let sent = Duration::from_millis(100 * i);
            let device = |at: Duration| (ms(at) * (1.0 + ppm * 1e-6) + ahead_ms) as u64 as u32;
            let there = sent + Duration::from_millis(1);
            let late = if i % 7 == 0 { 18 } else { 0 };
            clock.add(sent, there + Duration::from_millis(1 + late), device(there));
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
    fn a_clock_that_wraps_continues() {
        let clock = read(f64::from(u32::MAX) - 5_000.0, 0.0, 20);
        let at = Duration::from_secs(20);
        assert!(
            clock.at(at).unwrap().abs_diff(15_000) <= 2,
            "{:?}",
            clock.at(at)
        );
    }
}
