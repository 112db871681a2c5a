//! What a playback delivered, compared with the target: VAF of the predicted force with
//! the gain and the delay of the playback.
//!
//! With gain 1 and delay 0 it is the VAF of the identification. A constant error does not
//! change it, as in every VAF, and neither does a wrong shape of the force, which a gain
//! and a delay do not describe.

use super::vaf;
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance};
use std::sync::Arc;

/// A realization on a recording of the target.
#[derive(Debug, Clone, PartialEq)]
pub struct Delivery {
    recorded_n: Arc<[f64]>,
    predicted_n: Vec<f64>,
    period_s: f64,
}

impl Delivery {
    /// `recorded_n` is the force of the recording, so that realizations can share it.
    /// `None` for a recording of fewer than two samples.
    pub fn of(
        realization: &Realization,
        recording: &Recording,
        recorded_n: &Arc<[f64]>,
    ) -> Option<Self> {
        let steps = recording.len().checked_sub(1).filter(|n| *n > 0)?;
        Some(Self {
            recorded_n: Arc::clone(recorded_n),
            predicted_n: vaf::predict(realization, recording).collect(),
            period_s: recording.duration_s() / steps as f64,
        })
    }

    /// 1 − var(F − F̂)/var(F) with F̂(t) = gain · predicted(t − delay), over the samples that
    /// have both. `None` if there are none, or the recorded force does not vary.
    pub fn vaf(&self, gain: f64, delay_s: f64) -> Option<f64> {
        let shift = delay_s / self.period_s;
        if !(gain.is_finite() && shift.abs() < self.predicted_n.len() as f64) {
            return None;
        }
        let whole = shift.floor();
        let part = shift - whole;
        let (mut errors, mut forces) = (Vec::new(), Vec::new());
        for (i, force) in self.recorded_n.iter().enumerate() {
            // Between the samples i − whole − 1 and i − whole.
            let Some(right) = i.checked_add_signed(-(whole as isize)) else {
                continue;
            };
            let Some(here) = self.predicted_n.get(right) else {
                continue;
            };
            let before = match right.checked_sub(1) {
                Some(left) => self.predicted_n[left],
                None if part == 0.0 => *here,
                None => continue,
            };
            let predicted = here + part * (before - here);
            errors.push(force - gain * predicted);
            forces.push(*force);
        }
        let (_, variance) = mean_and_variance(&forces);
        let (_, spread) = mean_and_variance(&errors);
        (!forces.is_empty() && variance > 0.0).then(|| 1.0 - spread / variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A prediction that is exact: a sine of 2 Hz at 1 kHz.
    fn exact() -> Delivery {
        let sine: Vec<f64> = (0..3000)
            .map(|i| (f64::from(i) * 1e-3 * std::f64::consts::TAU * 2.0).sin())
            .collect();
        Delivery {
            recorded_n: sine.clone().into(),
            predicted_n: sine,
            period_s: 1e-3,
        }
    }

    /// Closed forms for a sine: a gain g leaves 1 − (1 − g)², a delay d leaves
    /// 1 − 4 sin²(ωd/2).
    #[test]
    fn gain_and_delay_of_a_sine_have_closed_forms() {
        let delivery = exact();
        let near = |found: Option<f64>, expected: f64, most: f64| {
            let found = found.unwrap();
            assert!((found - expected).abs() < most, "{found} {expected}");
        };
        near(delivery.vaf(1.0, 0.0), 1.0, 1e-12);
        near(delivery.vaf(0.5, 0.0), 0.75, 1e-12);
        near(delivery.vaf(-1.0, 0.0), -3.0, 1e-9);
        for delay_ms in [-20.0, -0.5, 0.25, 5.0, 20.0] {
            let half = std::f64::consts::PI * 2.0 * delay_ms * 1e-3;
            let expected = 1.0 - 4.0 * half.sin().powi(2);
            near(delivery.vaf(1.0, 1e-3 * delay_ms), expected, 0.01);
        }
        assert!(delivery.vaf(1.0, 0.0).unwrap() > delivery.vaf(1.0, 0.001).unwrap());
        // A playback that is 20 ms late delivers a target that is as late.
        let late: Vec<f64> = (0..3000)
            .map(|i| ((f64::from(i) - 20.0) * 1e-3 * std::f64::consts::TAU * 2.0).sin())
            .collect();
        let delivered = Delivery {
            recorded_n: late.into(),
            ..exact()
        };
        near(delivered.vaf(1.0, 0.02), 1.0, 1e-9);
        assert_eq!(delivery.vaf(f64::NAN, 0.0), None);
        assert_eq!(delivery.vaf(1.0, 4.0), None);
    }
}
