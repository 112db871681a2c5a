//! Times at which the samples of a playback arrive, to compare the device's time with
//! that of the host.

use std::time::Duration;

/// Shortest playback of which the times are compared, s.
const LEAST_S: f64 = 2.0;

/// When samples arrived. Messages can be late, never early: the least delay at the
/// beginning and at the end counts.
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
        let third = self.all.len() / 3;
        let (first, last) = (self.all.get(..third)?, self.all.get(2 * third..)?);
        let earliest = |part: &[(f64, f64)]| {
            part.iter()
                .copied()
                .min_by(|a, b| f64::total_cmp(&(a.0 - a.1), &(b.0 - b.1)))
        };
        let (from, to) = (earliest(first)?, earliest(last)?);
        let (host_s, device_s) = (to.0 - from.0, to.1 - from.1);
        (self.all.last()?.0 - self.all.first()?.0 >= LEAST_S && host_s > 0.0)
            .then(|| device_s / host_s)
            .filter(|ratio| ratio.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
                // A clock that is slow seems to be late more and more: one message.
                assert!((found - of).abs() < 2e-3, "{of}, {late_ms} ms: {found}");
            }
        }
        assert_eq!(Arrivals::default().time_ratio(), None);
        let mut short = Arrivals::default();
        (0..100).for_each(|i| short.add(Duration::from_millis(10 * i), 0.01 * i as f64));
        assert_eq!(short.time_ratio(), None);
    }
}
