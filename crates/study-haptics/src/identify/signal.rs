//! From what a probe measured to signals that can be identified from.
//!
//! [`prepare`] low-passes position, acceleration and force with one and the same
//! zero-phase filter and derives velocity by central difference; [`thin()`] takes
//! the samples of a dwell away; [`excitation`] says whether a, v and x move
//! independently enough to tell their parameters apart; [`delay`] compares the
//! accelerometer with the encoder in time.
//!
//! The filter is the same on x, a and F because a filter that differs between them
//! would show as a mass or a damping that is not there. It is run forward and
//! backward, so that it delays nothing: [`filter`].
//!
//! Not here: reading, and what a protocol or a terminal makes of it. A filtered or
//! thinned recording keeps the name and hash of the file that it came from.

pub mod delay;
pub mod excitation;
pub mod filter;
pub mod thin;

pub use excitation::Excitation;
pub use filter::LowPass;
pub use thin::{Dwell, thin};

use crate::recording::Recording;

/// Steps of time may differ by this share from the usual one.
const STEP_TOLERANCE: f64 = 0.1;

/// Where the acceleration comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Acceleration {
    /// The column of the recording, filtered like the others.
    Accelerometer,
    /// The second central difference of the filtered position.
    Encoder,
}

/// How signals are prepared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Corner of the filter, Hz; `None`: nothing is filtered.
    pub filter_hz: Option<f64>,
    /// Where the acceleration comes from.
    pub acceleration: Acceleration,
}

/// Why signals cannot be prepared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SignalError {
    /// The corner is out of range.
    #[error(
        "a filter corner has to be above 0 and below half the sampling rate of {rate_hz} Hz, not {corner_hz}"
    )]
    Corner {
        /// Hz.
        corner_hz: f64,
        /// Hz.
        rate_hz: f64,
    },
    /// A filter needs samples at equal times.
    #[error(
        "{recording}: the step of time at {at_s} s is {step_s} s where the usual one is {usual_s} s: a filter needs equal steps"
    )]
    Uneven {
        /// Its name.
        recording: String,
        /// s.
        at_s: f64,
        /// s.
        step_s: f64,
        /// s.
        usual_s: f64,
    },
}

/// The usual step of time of a recording, s: the mean, if no step is far from it.
///
/// # Errors
/// [`SignalError::Uneven`] with the first step that is.
pub fn even_step_s(recording: &Recording) -> Result<f64, SignalError> {
    let usual_s = recording.duration_s() / (recording.len() - 1) as f64;
    for pair in recording.t_s.windows(2) {
        let step_s = pair[1] - pair[0];
        if (step_s / usual_s - 1.0).abs() > STEP_TOLERANCE {
            return Err(SignalError::Uneven {
                recording: recording.name.clone(),
                at_s: pair[0],
                step_s,
                usual_s,
            });
        }
    }
    Ok(usual_s)
}

/// The recording with its signals prepared.
///
/// # Errors
/// [`SignalError`] if the corner does not suit the sampling rate, or there is no
/// one sampling rate.
pub fn prepare(recording: &Recording, settings: Settings) -> Result<Recording, SignalError> {
    let mut prepared = recording.clone();
    if settings.filter_hz.is_none() && settings.acceleration == Acceleration::Accelerometer {
        return Ok(prepared);
    }
    let step_s = even_step_s(recording)?;
    if let Some(corner_hz) = settings.filter_hz {
        let low_pass = LowPass::new(corner_hz, 1.0 / step_s)?;
        for column in [&mut prepared.x_mm, &mut prepared.a_m_s2, &mut prepared.f_n] {
            *column = low_pass.both_ways(column);
        }
        prepared.v_mm_s = difference(&prepared.x_mm, step_s);
    }
    if settings.acceleration == Acceleration::Encoder {
        prepared.a_m_s2 = second_difference(&prepared.x_mm, step_s);
    }
    Ok(prepared)
}

/// Central difference, one-sided at the ends, mm/s.
pub fn difference(x_mm: &[f64], step_s: f64) -> Vec<f64> {
    let last = x_mm.len().saturating_sub(1);
    (0..x_mm.len())
        .map(|i| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            (x_mm[after] - x_mm[before]) / ((after - before).max(1) as f64 * step_s)
        })
        .collect()
}

/// Second central difference, that of the neighbour at the ends, m/s².
pub fn second_difference(x_mm: &[f64], step_s: f64) -> Vec<f64> {
    if x_mm.len() < 3 {
        return vec![0.0; x_mm.len()];
    }
    (0..x_mm.len())
        .map(|i| {
            let i = i.clamp(1, x_mm.len() - 2);
            1e-3 * (x_mm[i + 1] - 2.0 * x_mm[i] + x_mm[i - 1]) / (step_s * step_s)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// 5 sin 2π2t mm at 1 kHz with an accelerometer of its own scale.
    fn recording(rows: usize, gap_at: Option<usize>) -> Recording {
        let mut text = String::from("t_s,x_mm,a_m_s2,f_n\n");
        for i in 0..rows {
            let late = if gap_at.is_some_and(|at| i >= at) {
                5
            } else {
                0
            };
            let t = (i + late) as f64 * 1e-3;
            let w = TAU * 2.0;
            let (x, a) = (5.0 * (w * t).sin(), -5e-3 * w * w * (w * t).sin());
            text += &format!("{t},{x},{a},{}\n", (w * t).cos());
        }
        crate::recording::read("r", text.as_bytes()).unwrap()
    }

    #[test]
    fn all_signals_go_through_the_same_filter_and_v_is_of_the_filtered_x() {
        let raw = recording(2000, None);
        let settings = Settings {
            filter_hz: Some(8.0),
            acceleration: Acceleration::Accelerometer,
        };
        let done = prepare(&raw, settings).unwrap();
        let low_pass = LowPass::new(8.0, 1000.0).unwrap();
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close(&done.f_n, &low_pass.both_ways(&raw.f_n)));
        assert!(close(&done.a_m_s2, &low_pass.both_ways(&raw.a_m_s2)));
        let v = (done.x_mm[501] - done.x_mm[499]) / 2e-3;
        assert!((done.v_mm_s[500] - v).abs() < 1e-9);
        assert_eq!(done.sha256, raw.sha256);
        // the second difference of x is what this accelerometer measured
        let encoder = prepare(
            &raw,
            Settings {
                acceleration: Acceleration::Encoder,
                ..settings
            },
        )
        .unwrap();
        let worst = (300..1700)
            .map(|i| (encoder.a_m_s2[i] - done.a_m_s2[i]).abs())
            .fold(0.0, f64::max);
        assert!(worst < 2e-4, "{worst}");
    }

    #[test]
    fn a_gap_in_time_and_a_corner_that_cannot_be_are_refused() {
        let settings = |hz| Settings {
            filter_hz: Some(hz),
            acceleration: Acceleration::Accelerometer,
        };
        let gap = prepare(&recording(300, Some(100)), settings(30.0)).unwrap_err();
        assert!(
            gap.to_string()
                .starts_with("r: the step of time at 0.099 s is"),
            "{gap}"
        );
        for bad in [0.0, -1.0, 500.0, f64::NAN, f64::INFINITY] {
            let refused = prepare(&recording(300, None), settings(bad)).unwrap_err();
            assert!(matches!(refused, SignalError::Corner { .. }), "{bad}");
        }
    }
}
