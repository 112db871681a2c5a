//! A zero-phase low-pass filter: second-order Butterworth, forward and backward.
//!
//! The filter of scipy's `butter(2, corner, fs=rate)` and `filtfilt`: bilinear
//! transform with prewarping; the signal is extended at both ends by odd reflection,
//! and each pass starts in the steady state of its first value. Forward and backward
//! passes together have no delay and the squared gain, so half of the amplitude
//! (−6 dB) remains at the corner frequency.
//!
//! The extension is longer than scipy's 9 samples if the corner frequency is far below
//! the sampling rate: at 10 kHz and 30 Hz a transient does not decay in 9 samples.

use super::SignalError;
use std::f64::consts::{PI, SQRT_2};

/// scipy's default `padlen` for a filter of this order.
const MIN_PAD: usize = 9;

/// What recordings and model files say about a signal that was filtered at
/// `corner_hz`.
pub fn description(corner_hz: f64) -> String {
    format!("zero-phase low-pass, Butterworth of 2nd order both ways, at {corner_hz} Hz")
}

/// The corner of the filter that a header describes, Hz: the number before the last "Hz".
/// `Some(None)` if it says that there was none; `None` if it says nothing that can be read.
///
/// ```
/// use study_haptics::identify::signal::filter::{description, stated_hz};
/// assert_eq!(stated_hz(&description(30.0)), Some(Some(30.0)));
/// assert_eq!(stated_hz("none; as measured"), Some(None));
/// assert_eq!(stated_hz("moving average over 5 ms"), None);
/// ```
pub fn stated_hz(description: &str) -> Option<Option<f64>> {
    let text = description.trim();
    if text.starts_with("none") {
        return Some(None);
    }
    let before = text[..text.rfind("Hz")?].trim_end();
    let number = |c: char| c.is_ascii_digit() || c == '.';
    let digits = before.rsplit(|c| !number(c)).next()?;
    let hz: f64 = digits.parse().ok()?;
    (hz > 0.0).then_some(Some(hz))
}

/// A zero-phase low-pass filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    b: [f64; 3],
    /// a1 and a2; a0 is 1.
    a: [f64; 2],
    /// Length of the extension at each end, samples.
    pad: usize,
}

impl LowPass {
    /// A filter with the corner frequency `corner_hz` for signals sampled at `rate_hz`.
    ///
    /// # Errors
    /// [`SignalError::Corner`] unless 0 < corner < rate/2.
    pub fn new(corner_hz: f64, rate_hz: f64) -> Result<Self, SignalError> {
        if !(corner_hz > 0.0 && corner_hz < 0.5 * rate_hz && rate_hz.is_finite()) {
            return Err(SignalError::Corner { corner_hz, rate_hz });
        }
        let k = libm::tan(PI * corner_hz / rate_hz);
        let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let gain = k * k * norm;
        Ok(Self {
            b: [gain, 2.0 * gain, gain],
            a: [
                2.0 * (k * k - 1.0) * norm,
                (1.0 - SQRT_2 * k + k * k) * norm,
            ],
            // one period of the corner frequency, after which a transient is at e^-4
            pad: ((rate_hz / corner_hz).ceil().min(1e6) as usize).max(MIN_PAD),
        })
    }

    /// The filtered signal, without delay. A signal of one sample is returned unchanged.
    ///
    /// ```
    /// # use study_haptics::identify::signal::{LowPass, SignalError};
    /// let low_pass = LowPass::new(30.0, 1000.0)?;
    /// // The mean passes, what alternates does not.
    /// let fast: Vec<f64> = (0..200).map(|i| if i % 2 == 0 { 3.0 } else { 1.0 }).collect();
    /// let slow = low_pass.zero_phase(&fast);
    /// assert!(slow[50..150].iter().all(|x| (x - 2.0).abs() < 0.01));
    /// # Ok::<(), SignalError>(())
    /// ```
    pub fn zero_phase(&self, signal: &[f64]) -> Vec<f64> {
        let n = signal.len();
        if n < 2 {
            return signal.to_vec();
        }
        let pad = self.pad.min(n - 1);
        let (first, last) = (signal[0], signal[n - 1]);
        let mut extended = Vec::with_capacity(n + 2 * pad);
        extended.extend((1..=pad).rev().map(|i| 2.0 * first - signal[i]));
        extended.extend_from_slice(signal);
        extended.extend((1..=pad).map(|i| 2.0 * last - signal[n - 1 - i]));
        self.pass(extended.iter_mut());
        self.pass(extended.iter_mut().rev());
        extended.drain(..pad);
        extended.truncate(n);
        extended
    }

    /// One pass, starting in the steady state of the first value (direct form II
    /// transposed).
    fn pass<'s>(&self, signal: impl Iterator<Item = &'s mut f64>) {
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        let mut state: Option<[f64; 2]> = None;
        for value in signal {
            let x = *value;
            // the steady state y = x for constant x: z1 = x − b0·x, z2 = b2·x − a2·x
            let [z1, z2] = state.unwrap_or([(1.0 - b0) * x, (b2 - a2) * x]);
            let y = b0 * x + z1;
            state = Some([b1 * x - a1 * y + z2, b2 * x - a2 * y]);
            *value = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// sin(0.37 i) + 0.2 i, and 0.5 more at every seventh from the third.
    fn signal() -> Vec<f64> {
        (0..40)
            .map(|i| {
                let jump = if i % 7 == 3 { 0.5 } else { 0.0 };
                (0.37 * f64::from(i)).sin() + 0.2 * f64::from(i) + jump
            })
            .collect()
    }

    /// Reference: scipy 1.17.1, `signal.butter(2, 30, fs=1000)`; 1e-14.
    #[test]
    fn the_coefficients_are_those_of_scipy() {
        let filter = LowPass::new(30.0, 1000.0).unwrap();
        let expected = [0.007820208033497193, -1.734725768809275, 0.7660066009432638];
        let found = [filter.b[0], filter.a[0], filter.a[1]];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    /// Reference: scipy 1.17.1, `signal.filtfilt(*butter(2, 30, fs=1000), x)`, with
    /// its default padlen of 9 and with padlen=34 (one period of the corner frequency);
    /// 1e-12.
    #[test]
    fn the_result_is_that_of_filtfilt() {
        let indices = [0, 1, 7, 20, 38, 39];
        let filter = LowPass::new(30.0, 1000.0).unwrap();
        for (filter, expected) in [
            (
                LowPass { pad: 9, ..filter },
                [
                    -0.11043960516167856,
                    0.11946492704352034,
                    1.4110920545941108,
                    4.12009641319142,
                    8.159157543959044,
                    8.373163379150093,
                ],
            ),
            (
                filter,
                [
                    0.005111484519291342,
                    0.23785888048746162,
                    1.4891006058231708,
                    4.0654777978497085,
                    8.42074575401701,
                    8.756639280249901,
                ],
            ),
        ] {
            let found = filter.zero_phase(&signal());
            for (i, expected) in indices.into_iter().zip(expected) {
                let found: f64 = found[i];
                assert!((found - expected).abs() < 1e-12, "{i}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_straight_line_and_a_single_sample_come_through_unchanged() {
        let filter = LowPass::new(30.0, 10_000.0).unwrap();
        let line: Vec<f64> = (0..5000).map(|i| 3.0 + 0.01 * f64::from(i)).collect();
        // away from the ends, where the filter starts from rest
        let found = filter.zero_phase(&line);
        for i in 1000..4000 {
            assert!(
                (found[i] - line[i]).abs() < 1e-6,
                "{i}: {} {}",
                found[i],
                line[i]
            );
        }
        assert_eq!(filter.zero_phase(&[4.0]), [4.0]);
        assert!(filter.zero_phase(&[]).is_empty());
        let two = filter.zero_phase(&[1.0, 1.0]);
        assert!(two.iter().all(|y| (y - 1.0).abs() < 1e-12));
    }

    #[test]
    fn at_the_corner_half_of_the_amplitude_is_left_and_nothing_is_late() {
        let filter = LowPass::new(30.0, 1000.0).unwrap();
        let wave = |t: f64| (std::f64::consts::TAU * 30.0 * t).sin();
        let x: Vec<f64> = (0..4000).map(|i| wave(f64::from(i) * 1e-3)).collect();
        let y = filter.zero_phase(&x);
        for i in 1000..3000 {
            assert!((y[i] - 0.5 * x[i]).abs() < 1e-6, "{i}");
        }
    }
}
