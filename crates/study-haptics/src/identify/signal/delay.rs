//! How much later one channel is than another.
//!
//! The lag at which the cross-correlation of two signals is largest, between
//! samples by the parabola through the three highest. That is good to a small
//! share of a sample where both signals are well below the sampling rate, which a
//! low-pass makes sure of.
//!
//! What can be compared are two measurements of one quantity: the accelerometer
//! with the second difference of the encoder. The force is another quantity, and
//! its lag against the motion is what damping is: a delay of the force sensor
//! needs a known load.

use super::{Acceleration, Settings, SignalError, even_step_s, prepare, second_difference};
use crate::recording::Recording;

/// Corner of the filter that both go through before they are compared, Hz.
const CORNER_HZ: f64 = 20.0;
/// Longest delay that is looked for, s.
const LONGEST_S: f64 = 0.05;
/// Samples that are enough.
const MOST_SAMPLES: usize = 200_000;
/// Correlation below which the two are not one quantity.
const LEAST_CORRELATION: f64 = 0.5;

/// How late the accelerometer is against the encoder, s; positive: later. `None`
/// if the two have little to do with one another.
///
/// # Errors
/// [`SignalError`] if the recording has no one sampling rate, or one below 40 Hz.
pub fn accelerometer_s(recording: &Recording) -> Result<Option<f64>, SignalError> {
    let step_s = even_step_s(recording)?;
    let smooth = prepare(
        recording,
        Settings {
            filter_hz: Some(CORNER_HZ),
            acceleration: Acceleration::Accelerometer,
        },
    )?;
    let encoder = second_difference(&smooth.x_mm, step_s);
    // bounded by the length of the recording
    let most = (LONGEST_S / step_s).ceil() as usize;
    Ok(samples(&encoder, &smooth.a_m_s2, most).map(|lag| lag * step_s))
}

/// By how many samples `other` is later than `reference`, at most `most` either
/// way. `None` without a clear maximum inside.
pub fn samples(reference: &[f64], other: &[f64], most: usize) -> Option<f64> {
    let n = reference.len().min(other.len()).min(MOST_SAMPLES);
    if most == 0 || n < 4 * most + 8 {
        return None;
    }
    let centred = |values: &[f64]| -> Vec<f64> {
        let mean = values[..n].iter().sum::<f64>() / n as f64;
        values[..n].iter().map(|v| v - mean).collect()
    };
    let (reference, other) = (centred(reference), centred(other));
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
    let alike = all[top] / libm::sqrt(own);
    // a constant gives a NaN
    if alike.is_nan() || alike < LEAST_CORRELATION || top == 0 || top == 2 * most {
        return None;
    }
    let [before, here, after] = [all[top - 1], all[top], all[top + 1]];
    let bend = before - 2.0 * here + after;
    let between = if bend < 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    };
    Some(top as f64 - most as f64 + between)
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
            let found = samples(&wave(0.0), &wave(late), 40).unwrap();
            assert!((found - late).abs() < 0.02, "{late}: {found}");
        }
    }

    #[test]
    fn what_has_no_common_course_has_no_delay() {
        let mut noise = study_base::rng::Stream::new(1, &["noise"]);
        let noise: Vec<f64> = (0..4000).map(|_| noise.normal()).collect();
        assert_eq!(samples(&wave(0.0), &noise, 40), None);
        assert_eq!(samples(&wave(0.0), &vec![1.0; 4000], 40), None);
        assert_eq!(samples(&[1.0, 2.0], &[1.0, 2.0], 1), None);
    }

    #[test]
    fn a_late_accelerometer_shows_in_a_recording() {
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
