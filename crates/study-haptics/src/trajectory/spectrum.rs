//! How much of each frequency a trajectory contains.
//!
//! Amplitudes of the position about its mean under a Hann window, over what a
//! recording keeps, so that a sine of A mm shows as A at its frequency. By
//! Goertzel's recursion: only the few frequencies of a picture are needed.

use super::Trajectory;
use std::f64::consts::TAU;

/// Samples a period of the highest frequency that is asked for.
const SAMPLES_PER_PERIOD: f64 = 8.0;
/// No more than this.
const MOST_SAMPLES: f64 = 65_536.0;

/// The largest amplitude, mm, in each of `bands` equal bands up to `to_hz`.
pub fn bands(trajectory: &Trajectory, to_hz: f64, bands: usize) -> Vec<f64> {
    let [from_s, until_s] = trajectory.kept_s();
    let duration_s = until_s - from_s;
    // above twice what the trajectory holds: PRBS and steps have weak overtones
    let rate_hz = SAMPLES_PER_PERIOD * to_hz.max(2.0 * trajectory.top_hz());
    // at most MOST_SAMPLES, so the cast is exact
    let n = (duration_s * rate_hz).ceil().clamp(64.0, MOST_SAMPLES) as usize;
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
    // lines at multiples of 1/duration; a band of less than one line takes the nearest
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

/// Amplitude of `k` cycles in all of `values`.
fn amplitude(values: &[f64], k: usize) -> f64 {
    let n = values.len() as f64;
    let turn = 2.0 * libm::cos(TAU * k as f64 / n);
    let (mut one, mut two) = (0.0, 0.0);
    for value in values {
        (one, two) = (value + turn * one - two, one);
    }
    let power = one * one + two * two - turn * one * two;
    2.0 * libm::sqrt(power.max(0.0)) / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Part, Sine};

    #[test]
    fn a_sine_shows_with_its_amplitude_at_its_frequency() {
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
