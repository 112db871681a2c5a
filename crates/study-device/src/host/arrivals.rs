//! Times at which the samples of a playback arrive, to compare the device's time with
//! that of the host.

use std::time::Duration;

/// Shortest playback of which the times are compared, s.
const LEAST_S: f64 = 2.0;

/// Distance of the messages that are compared, s.
const APART_S: f64 = 0.5;

/// When samples arrived. A message can be late and a simulated device can pause: the median
/// over all pairs counts in which as many messages lie between as usually come in half a
/// second.
#[derive(Debug, Clone, Default)]
pub struct Arrivals {
    /// Host time and time of the sample, s.
    all: Vec<(f64, f64)>,
}

impl Arrivals {
    /// A sample of time `t_s` has arrived.
    pub fn add(&mut self, at: Duration, t_s: f64) {
        self.all.push((at.as_secs_f64(), t_s));
    }

    /// Time of the samples over time of the host; `None` for a short playback.
    pub fn time_ratio(&self) -> Option<f64> {
        let lasted_s = self.all.last()?.0 - self.all.first()?.0;
        if lasted_s < LEAST_S {
            return None;
        }
        let apart = (self.all.len() as f64 * APART_S / lasted_s).ceil() as usize;
        let pairs = self.all.iter().zip(self.all.iter().skip(apart));
        let mut ratios: Vec<f64> = pairs.map(|(a, b)| (b.1 - a.1) / (b.0 - a.0)).collect();
        let middle = ratios.len() / 2;
        (!ratios.is_empty())
            .then(|| *ratios.select_nth_unstable_by(middle, f64::total_cmp).1)
            .filter(|ratio| ratio.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A simulated device on a busy computer stands still now and then.
    #[test]
    fn pauses_do_not_change_the_ratio_of_the_clocks() {
        let mut arrivals = Arrivals::default();
        let mut paused_ms = 0;
        for i in 0..600 {
            if [100, 101, 280, 450].contains(&i) {
                paused_ms += 300;
            }
            arrivals.add(Duration::from_millis(10 * i + paused_ms), 0.01 * i as f64);
        }
        let found = arrivals.time_ratio().unwrap();
        assert!((found - 1.0).abs() < 1e-9, "{found}");
    }

    /// Ten seconds of a clock with this ratio; every seventh message is late by `late_ms`.
    fn ratio(of: f64, late_ms: u64) -> Option<f64> {
        let mut arrivals = Arrivals::default();
        for i in 0..1000 {
            let late = if i % 7 == 3 { late_ms } else { 0 };
            let at = Duration::from_millis(10 * i + 5 + late);
            arrivals.add(at, 0.01 * i as f64 * of);
        }
        arrivals.time_ratio()
    }

    #[test]
    fn late_messages_do_not_change_the_ratio_of_the_clocks() {
        for of in [0.5, 0.98, 1.0, 1.1] {
            for late_ms in [0, 3, 80] {
                let found = ratio(of, late_ms).unwrap();
                assert!((found - of).abs() < 2e-3, "{of}, {late_ms} ms: {found}");
            }
        }
        assert_eq!(Arrivals::default().time_ratio(), None);
        let mut short = Arrivals::default();
        (0..100).for_each(|i| short.add(Duration::from_millis(10 * i), 0.01 * i as f64));
        assert_eq!(short.time_ratio(), None);
    }
}
