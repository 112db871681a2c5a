//! The amplitude spectrum of a trajectory.
//!
//! Amplitudes of the position about its mean with a Hann window, over the recorded
//! time; a sine of A mm has the amplitude A at its frequency. Computed by Goertzel's
//! algorithm, because a picture needs only a few frequencies.

use super::Trajectory;
use std::f64::consts::TAU;

/// Samples per period of the highest frequency of the spectrum.
const SAMPLES_PER_PERIOD: f64 = 8.0;
/// Most samples.
const MAX_SAMPLES: f64 = 65_536.0;

/// The largest amplitude, mm, in each of `bands` equal bands up to `to_hz`.
pub fn bands(trajectory: &Trajectory, to_hz: f64, bands: usize) -> Vec<f64> {
    let [from_s, until_s] = trajectory.recorded_s();
    let duration_s = until_s - from_s;
    // at least twice the highest frequency: PRBS and steps have weak overtones
    let rate_hz = SAMPLES_PER_PERIOD * to_hz.max(2.0 * trajectory.top_hz());
    // at most MAX_SAMPLES, so the cast is exact
    let n = (duration_s * rate_hz).ceil().clamp(64.0, MAX_SAMPLES) as usize;
    let step_s = duration_s / n as f64;
    let positions: Vec<f64> = (0..n)
        .map(|i| trajectory.at(from_s + step_s * i as f64).x_mm)
        .collect();
    let mean = positions.iter().sum::<f64>() / n as f64;
    let windowed: Vec<f64> = positions
        .iter()
        .enumerate()
        .map(|(i, x)| (x - mean) * (1.0 - libm::cos(TAU * i as f64 / n as f64)))
        .collect();
    // lines are multiples of 1/duration; a band narrower than one takes the nearest
    let line = |hz: f64| (hz * duration_s).round() as usize;
    (0..bands)
        .map(|band| {
            let width = to_hz / bands as f64;
            let first = line(band as f64 * width).max(1);
            let last = line((band + 1) as f64 * width).max(first + 1);
            (first..last)
                .filter(|k| 2 * k < n)
                .map(|k| amplitude(&windowed, k))
                .fold(0.0, f64::max)
        })
        .collect()
}

/// The amplitude of the sinusoid with `k` cycles over all `values`.
fn amplitude(values: &[f64], k: usize) -> f64 {
    let n = values.len() as f64;
    let factor = 2.0 * libm::cos(TAU * k as f64 / n);
    let (mut one, mut two) = (0.0, 0.0);
    for value in values {
        (one, two) = (value + factor * one - two, one);
    }
    let power = one * one + two * two - factor * one * two;
    2.0 * libm::sqrt(power.max(0.0)) / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Part, Sine};

    #[test]
    fn a_sine_has_its_amplitude_at_its_frequency() {
        let sine = |amplitude_mm, frequency_hz| {
            Part::Sine(Sine {
                amplitude_mm,
                frequency_hz,
                phase_deg: 10.0,
            })
        };
        let trajectory = Trajectory {
            title: None,
            offset_mm: 17.5,
            duration_s: 10.0,
            ramp_s: 0.5,
            parts: vec![sine(12.0, 0.5), sine(4.0, 3.25)],
            limits: None,
        };
        let found = bands(&trajectory, 5.0, 10);
        assert!((found[1] - 12.0).abs() < 0.1, "{found:?}");
        assert!((found[6] - 4.0).abs() < 0.8, "{found:?}");
        assert!(found[3] < 0.1 && found[9] < 0.1, "{found:?}");
    }
}
