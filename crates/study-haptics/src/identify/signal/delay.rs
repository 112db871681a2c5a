//! The delay between two channels.
//!
//! The lag of the maximum of the cross-correlation, interpolated between samples by a
//! parabola through three points. The error is a small share of a sample for signals
//! well below the sampling rate, which a low-pass filter ensures.
//!
//! Only two measurements of one quantity can be compared: the accelerometer and the
//! second difference of the encoder. The lag of the force behind the motion is an
//! effect of damping, so the delay of the force sensor requires a known load.

use super::{Acceleration, Settings, SignalError, prepare, sampling_interval_s, second_difference};
use crate::recording::Recording;

/// Corner frequency of the filter applied to both channels, Hz.
const CORNER_HZ: f64 = 20.0;
/// Longest delay that can be found, s.
const MAX_DELAY_S: f64 = 0.05;
/// Number of samples that suffice.
const MAX_SAMPLES: usize = 200_000;
/// Below this correlation the channels do not measure the same quantity.
const MIN_CORRELATION: f64 = 0.5;

/// The delay of the accelerometer relative to the encoder, s; positive if the
/// accelerometer is later. `None` if the two are hardly correlated.
///
/// # Errors
/// [`SignalError`] if the recording is not evenly sampled, or at 40 Hz or less.
pub fn accelerometer_s(recording: &Recording) -> Result<Option<f64>, SignalError> {
    let step_s = sampling_interval_s(recording)?;
    let smooth = prepare(
        recording.clone(),
        Settings {
            filter_hz: Some(CORNER_HZ),
            acceleration: Acceleration::Accelerometer,
        },
    )?;
    let encoder = second_difference(&smooth.x_mm, step_s);
    // bounded by the length of the recording
    let most = (MAX_DELAY_S / step_s).ceil() as usize;
    Ok(in_samples(&encoder, &smooth.a_m_s2, most).map(|lag| lag * step_s))
}

/// The delay of `other` relative to `reference` in samples, between −`most` and
/// `most`. `None` without a clear maximum of the correlation.
pub fn in_samples(reference: &[f64], other: &[f64], most: usize) -> Option<f64> {
    let n = reference.len().min(other.len()).min(MAX_SAMPLES);
    if most == 0 || n < 4 * most + 8 {
        return None;
    }
    let centered = |values: &[f64]| -> Vec<f64> {
        let mean = values[..n].iter().sum::<f64>() / n as f64;
        values[..n].iter().map(|v| v - mean).collect()
    };
    let (reference, other) = (centered(reference), centered(other));
    let middle = &reference[most..n - most];
    let correlation = |lag: usize| -> f64 {
        // lag 0 is `most` samples early
        let shifted = &other[lag..lag + middle.len()];
        let product: f64 = middle.iter().zip(shifted).map(|(a, b)| a * b).sum();
        let squares: f64 = shifted.iter().map(|b| b * b).sum();
        product / libm::sqrt(squares)
    };
    let all: Vec<f64> = (0..=2 * most).map(correlation).collect();
    let top = (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b]))?;
    let own: f64 = middle.iter().map(|a| a * a).sum();
    let maximum = all[top] / libm::sqrt(own);
    // NaN for a constant signal
    if maximum.is_nan() || maximum < MIN_CORRELATION || top == 0 || top == 2 * most {
        return None;
    }
    let [before, at, after] = [all[top - 1], all[top], all[top + 1]];
    let curvature = before - 2.0 * at + after;
    let fraction = if curvature < 0.0 {
        0.5 * (before - after) / curvature
    } else {
        0.0
    };
    Some(top as f64 - most as f64 + fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(late: f64) -> Vec<f64> {
        (0..4000)
            .map(|i| {
                let t = (f64::from(i) - late) * 1e-3;
                (19.0 * t).sin() + 0.5 * (71.0 * t + 1.0).sin()
            })
            .collect()
    }

    #[test]
    fn a_delay_between_samples_is_found() {
        for late in [-7.3, -0.25, 0.0, 0.4, 3.5, 12.9] {
            let found = in_samples(&wave(0.0), &wave(late), 40).unwrap();
            assert!((found - late).abs() < 0.02, "{late}: {found}");
        }
    }

    #[test]
    fn uncorrelated_signals_have_no_delay() {
        let mut noise = study_base::rng::Stream::new(1, &["noise"]);
        let noise: Vec<f64> = (0..4000).map(|_| noise.normal()).collect();
        assert_eq!(in_samples(&wave(0.0), &noise, 40), None);
        assert_eq!(in_samples(&wave(0.0), &vec![1.0; 4000], 40), None);
        assert_eq!(in_samples(&[1.0, 2.0], &[1.0, 2.0], 1), None);
    }

    #[test]
    fn the_delay_of_an_accelerometer_is_found() {
        let mut text = String::from("t_s,x_mm,a_m_s2,f_n\n");
        for i in 0..5000 {
            let t = f64::from(i) * 1e-3;
            let (w1, w2) = (6.0, 17.0);
            let late = t - 0.0024;
            let x = 8.0 * (w1 * t).sin() + 3.0 * (w2 * t).sin();
            let a = -1e-3 * (8.0 * w1 * w1 * (w1 * late).sin() + 3.0 * w2 * w2 * (w2 * late).sin());
            text += &format!("{t},{x},{a},{}\n", t.sin());
        }
        let recording = crate::recording::read("r", text.as_bytes()).unwrap();
        let found = accelerometer_s(&recording).unwrap().unwrap();
        assert!((found - 0.0024).abs() < 2e-5, "{found}");
    }
}
