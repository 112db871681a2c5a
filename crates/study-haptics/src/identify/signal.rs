//! Signal processing: from a probe's recording to signals for identification.
//!
//! [`prepare`] low-pass filters position, acceleration and force with the same
//! zero-phase filter ([`filter`]) and computes the velocity by central differences;
//! [`thin()`] removes most samples of dwells; [`excitation`] shows whether a, v and x
//! vary independently enough to identify their parameters; [`delay`] measures the lag
//! between accelerometer and encoder.
//!
//! x, a and F need the same filter, because a difference between them would appear as
//! mass or damping. A filtered or thinned recording keeps the name and hash of its
//! file.

pub mod delay;
pub mod excitation;
pub mod filter;
pub mod thin;

pub use excitation::Excitation;
pub use filter::LowPass;
pub use thin::thin;

use crate::recording::{JITTER, Recording};
use std::fmt;

/// A sampling interval may differ from the mean one by this share.
const INTERVAL_TOLERANCE: f64 = 0.1;
/// So many samples that are missing in a row are interpolated …
pub const LOST_IN_A_ROW: f64 = 5.0;
/// … if no more than this share is missing in all.
pub const LOST_SHARE: f64 = 0.1;

study_base::named! {
    /// The source of the acceleration.
    Acceleration {
        /// The column of the recording, filtered like the others.
        Accelerometer = "accelerometer",
        /// The second central difference of the filtered position.
        Encoder = "encoder",
    }
}

/// How signals are prepared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Corner frequency of the filter, Hz; `None`: no filter.
    pub filter_hz: Option<f64>,
    /// The source of the acceleration.
    pub acceleration: Acceleration,
}

/// Why signals cannot be prepared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum SignalError {
    #[error(
        "the corner frequency of the filter has to be above 0 and below half the sampling rate of {rate_hz} Hz, not {corner_hz}"
    )]
    Corner { corner_hz: f64, rate_hz: f64 },
    #[error(
        "{recording}: the sampling interval at {at_s} s is {interval_s} s instead of {mean_s} s: a filter or a simulation needs a recording without gaps of more than {most} samples: divide it there, several are accepted", most = LOST_IN_A_ROW
    )]
    Uneven {
        recording: String,
        at_s: f64,
        interval_s: f64,
        mean_s: f64,
    },
}

/// The sampling interval of an evenly sampled recording, s.
///
/// # Errors
/// [`SignalError::Uneven`] with the first interval that differs from the mean by more
/// than a tenth.
pub fn sampling_interval_s(recording: &Recording) -> Result<f64, SignalError> {
    let mean_s = recording.duration_s() / (recording.len() - 1) as f64;
    for pair in recording.t_s.windows(2) {
        let interval_s = pair[1] - pair[0];
        if (interval_s / mean_s - 1.0).abs() > INTERVAL_TOLERANCE {
            return Err(SignalError::Uneven {
                recording: recording.name.clone(),
                at_s: pair[0],
                interval_s,
                mean_s,
            });
        }
    }
    Ok(mean_s)
}

/// How a recording was brought to even intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evened {
    /// The largest deviation of a sample from its even time, s.
    pub jitter_s: f64,
    /// Samples that were missing.
    pub lost: usize,
}

impl fmt::Display for Evened {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.lost {
            0 => {
                let microseconds = 1e6 * self.jitter_s;
                write!(f, "intervals deviate by up to {microseconds:.1} µs: ")?;
            }
            1 => write!(f, "1 sample is missing: ")?,
            lost => write!(
                f,
                "{lost} samples are missing, at most {LOST_IN_A_ROW} in a row: "
            )?,
        }
        write!(f, "resampled at even intervals by cubics")
    }
}

/// A recording with jitter or with lost samples, interpolated at even intervals by cubics through the
/// samples. `None` if it is even, or so uneven that it has to be divided: if a sample is later than [`JITTER`]
/// allows, if more than [`LOST_IN_A_ROW`] samples are missing at a place, or more than [`LOST_SHARE`] of all.
pub fn evened(recording: &Recording) -> Option<(Recording, Evened)> {
    let (t, given) = (&recording.t_s, recording.len());
    let mut intervals: Vec<f64> = t.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = intervals.len() / 2;
    let median_s = *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
    // of the median interval; what jitter explains is one
    let steps = |pair: &[f64]| {
        let ratio = (pair[1] - pair[0]) / median_s;
        if ratio > 1.0 + JITTER {
            ratio.round()
        } else {
            1.0
        }
    };
    let most = t.windows(2).map(steps).fold(1.0, f64::max);
    let n = 1 + t.windows(2).map(steps).sum::<f64>() as usize;
    let lost = n - given;
    if most > 1.0 + LOST_IN_A_ROW || lost as f64 > LOST_SHARE * n as f64 {
        return None;
    }
    let mean_s = recording.duration_s() / (n - 1) as f64;
    let deviation = |pair: &[f64]| (pair[1] - pair[0] - steps(pair) * mean_s).abs();
    let jitter_s = t.windows(2).map(deviation).fold(0.0, f64::max);
    if lost == 0 && jitter_s <= INTERVAL_TOLERANCE * mean_s || jitter_s > JITTER * mean_s {
        return None;
    }
    let even: Vec<f64> = (0..n).map(|i| t[0] + i as f64 * mean_s).collect();
    let mut left = 0;
    let places: Vec<usize> = (even.iter())
        .map(|at| {
            while left + 2 < given && t[left + 1] <= *at {
                left += 1;
            }
            left
        })
        .collect();
    let resampled = |y: &[f64]| -> Vec<f64> {
        let chord = |i: usize| (y[i + 1] - y[i]) / (t[i + 1] - t[i]);
        // of the parabola through a sample and its neighbors
        let slope = |i: usize| match i {
            0 => chord(0),
            _ if i + 1 == given => chord(i - 1),
            _ => {
                let (before, after) = (t[i] - t[i - 1], t[i + 1] - t[i]);
                (after * chord(i - 1) + before * chord(i)) / (before + after)
            }
        };
        (even.iter().zip(&places))
            .map(|(at, i)| {
                let h = t[i + 1] - t[*i];
                let u = ((at - t[*i]) / h).clamp(0.0, 1.0);
                let (u2, u3) = (u * u, u * u * u);
                (2.0 * u3 - 3.0 * u2 + 1.0) * y[*i]
                    + (u3 - 2.0 * u2 + u) * h * slope(*i)
                    + (3.0 * u2 - 2.0 * u3) * y[i + 1]
                    + (u3 - u2) * h * slope(i + 1)
            })
            .collect()
    };
    let even = Recording {
        x_mm: resampled(&recording.x_mm),
        v_mm_s: resampled(&recording.v_mm_s),
        a_m_s2: resampled(&recording.a_m_s2),
        f_n: resampled(&recording.f_n),
        t_s: even,
        ..recording.clone()
    };
    Some((even, Evened { jitter_s, lost }))
}

/// The recording with its signals filtered and its velocity and acceleration computed
/// as `settings` demand.
///
/// # Errors
/// [`SignalError`] if the corner frequency does not suit the sampling rate, or the
/// recording is not evenly sampled.
pub fn prepare(mut recording: Recording, settings: Settings) -> Result<Recording, SignalError> {
    if settings.filter_hz.is_none() && settings.acceleration == Acceleration::Accelerometer {
        return Ok(recording);
    }
    let step_s = sampling_interval_s(&recording)?;
    if let Some(corner_hz) = settings.filter_hz {
        let low_pass = LowPass::new(corner_hz, 1.0 / step_s)?;
        for column in [
            &mut recording.x_mm,
            &mut recording.a_m_s2,
            &mut recording.f_n,
        ] {
            *column = low_pass.zero_phase(column);
        }
        recording.v_mm_s = difference(&recording.x_mm, step_s);
    }
    if settings.acceleration == Acceleration::Encoder {
        recording.a_m_s2 = second_difference(&recording.x_mm, step_s);
    }
    Ok(recording)
}

/// The velocity by central differences, one-sided at the ends, mm/s.
///
/// ```
/// # use study_haptics::identify::signal::difference;
/// assert_eq!(difference(&[0.0, 1.0, 4.0], 0.5), [2.0, 4.0, 6.0]);
/// ```
pub fn difference(x_mm: &[f64], step_s: f64) -> Vec<f64> {
    let last = x_mm.len().saturating_sub(1);
    (0..x_mm.len())
        .map(|i| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            (x_mm[after] - x_mm[before]) / ((after - before).max(1) as f64 * step_s)
        })
        .collect()
}

/// The acceleration by second central differences, at the ends that of the neighbor,
/// m/s².
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

    /// 5 sin 2π2t mm at 1 kHz, with an accelerometer.
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
    fn all_signals_pass_the_same_filter_and_v_is_the_difference_of_the_filtered_x() {
        let raw = recording(2000, None);
        let settings = Settings {
            filter_hz: Some(8.0),
            acceleration: Acceleration::Accelerometer,
        };
        let done = prepare(raw.clone(), settings).unwrap();
        let low_pass = LowPass::new(8.0, 1000.0).unwrap();
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close(&done.f_n, &low_pass.zero_phase(&raw.f_n)));
        assert!(close(&done.a_m_s2, &low_pass.zero_phase(&raw.a_m_s2)));
        let v = (done.x_mm[501] - done.x_mm[499]) / 2e-3;
        assert!((done.v_mm_s[500] - v).abs() < 1e-9);
        assert_eq!(done.sha256, raw.sha256);
        // the second difference of x agrees with this accelerometer
        let encoder = prepare(
            raw,
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
    fn jitter_is_resampled() {
        let even = recording(2000, None);
        assert_eq!(evened(&even), None);
        // the same motion at times that deviate by up to 0.3 ms
        let mut text = String::from("t_s,x_mm,f_n\n");
        let w = TAU * 2.0;
        for i in 0..2000_u32 {
            let t = 1e-3 * f64::from(i) + 3e-4 * (0.5 - f64::from(i * 7919 % 100) / 99.0);
            text += &format!("{t:.9},{},{}\n", 5.0 * (w * t).sin(), (w * t).cos());
        }
        let rough = crate::recording::read("r", text.as_bytes()).unwrap();
        assert!(sampling_interval_s(&rough).is_err());
        let (smooth, how) = evened(&rough).unwrap();
        assert!(how.jitter_s > 1e-4 && how.jitter_s < 6.5e-4, "{how:?}");
        assert_eq!(how.lost, 0);
        assert!(sampling_interval_s(&smooth).is_ok());
        for (t, x) in smooth.t_s.iter().zip(&smooth.x_mm) {
            assert!((x - 5.0 * (w * t).sin()).abs() < 1e-4, "{t}");
        }
    }

    /// Two in a hundred samples, and twice three in a row.
    #[test]
    fn lost_samples_are_interpolated_and_a_pause_is_not() {
        let whole = recording(2000, None);
        let kept: Vec<usize> = (0..2000)
            .filter(|i| i % 53 != 7 && !(400..403).contains(i) && !(900..903).contains(i))
            .collect();
        let (filled, how) = evened(&whole.select(&kept)).unwrap();
        assert_eq!(how.lost, 2000 - kept.len());
        assert_eq!(filled.len(), 2000);
        for (a, b) in filled.x_mm.iter().zip(&whole.x_mm) {
            // 0.01 % of the amplitude of 5 mm
            assert!((a - b).abs() < 5e-4, "{a} {b}");
        }
        let pause: Vec<usize> = (0..2000).filter(|i| !(400..406).contains(i)).collect();
        assert_eq!(evened(&whole.select(&pause)), None);
        let every_ninth: Vec<usize> = (0..2000).filter(|i| i % 9 != 4).collect();
        assert_eq!(evened(&whole.select(&every_ninth)), None);
    }

    #[test]
    fn a_gap_in_time_and_an_impossible_corner_frequency_are_refused() {
        let settings = |hz| Settings {
            filter_hz: Some(hz),
            acceleration: Acceleration::Accelerometer,
        };
        let gap = prepare(recording(300, Some(100)), settings(30.0)).unwrap_err();
        assert!(
            gap.to_string()
                .starts_with("r: the sampling interval at 0.099 s is"),
            "{gap}"
        );
        for bad in [0.0, -1.0, 500.0, f64::NAN, f64::INFINITY] {
            let refused = prepare(recording(300, None), settings(bad)).unwrap_err();
            assert!(matches!(refused, SignalError::Corner { .. }), "{bad}");
        }
    }
}
