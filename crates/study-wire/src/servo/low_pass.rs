//! The low-pass filters of acceleration and force: Butterworth with two poles, by the
//! bilinear transform.

use crate::real::Real;
use core::f64::consts::{PI, SQRT_2};

/// The filter of the acceleration, as two trapezoidal integrators. In single precision
/// this form keeps a constant, which [`DirectForm`] with its poles close to 1 does not:
/// its error was 2.6 mN with a shipped table at 10 kHz.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass<R> {
    gains: [R; 3],
    /// The states of the integrators.
    state: [R; 2],
}

impl<R: Real> LowPass<R> {
    /// A filter without output.
    pub(super) const ZERO: Self = Self {
        gains: [R::ZERO; 3],
        state: [R::ZERO; 2],
    };

    pub(super) fn new(corner_hz: f64, rate_hz: f64) -> Self {
        let k = libm::tan(PI * corner_hz / rate_hz);
        let first = 1.0 / (1.0 + k * (k + SQRT_2));
        Self {
            gains: [first, k * first, k * k * first].map(R::of),
            ..Self::ZERO
        }
    }

    pub(super) fn step(&mut self, input: R) -> R {
        let [first, second, third] = self.gains;
        let [band, low] = self.state;
        let error = input - low;
        let band_now = first * band + second * error;
        let output = low + second * band + third * error;
        self.state = [band_now + band_now - band, output + output - low];
        output
    }
}

/// The filter for the roughness of the force, in the transposed direct form II.
#[derive(Debug, Clone, Copy)]
pub(super) struct DirectForm<R> {
    gain: R,
    feedback: [R; 2],
    memory: [R; 2],
}

impl<R: Real> DirectForm<R> {
    /// A filter without output.
    pub(super) const ZERO: Self = Self {
        gain: R::ZERO,
        feedback: [R::ZERO; 2],
        memory: [R::ZERO; 2],
    };

    pub(super) fn new(corner_hz: f64, rate_hz: f64) -> Self {
        let k = libm::tan(PI * corner_hz / rate_hz);
        let norm = 1.0 / (1.0 + SQRT_2 * k + k * k);
        Self {
            gain: R::of(k * k * norm),
            feedback: [
                2.0 * (k * k - 1.0) * norm,
                (1.0 - SQRT_2 * k + k * k) * norm,
            ]
            .map(R::of),
            ..Self::ZERO
        }
    }

    pub(super) fn step(&mut self, input: R) -> R {
        let scaled = self.gain * input;
        let output = scaled + self.memory[0];
        self.memory[0] = (scaled + scaled) - self.feedback[0] * output + self.memory[1];
        self.memory[1] = scaled - self.feedback[1] * output;
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest output after a second of a sine of amplitude 1.
    fn gain_at(hz: f64) -> f64 {
        let mut filter = LowPass::<f64>::new(20.0, 4000.0);
        let mut largest = 0.0f64;
        for i in 0..8000 {
            let phase = core::f64::consts::TAU * hz * f64::from(i) / 4000.0;
            let output = filter.step(libm::sin(phase));
            if i >= 4000 {
                largest = largest.max(output.abs());
            }
        }
        largest
    }

    /// The direct form is the difference equation of docs/wire.md 7.3.
    #[test]
    fn both_forms_have_the_same_output() {
        let mut direct = DirectForm::<f64>::new(20.0, 4000.0);
        let mut double = LowPass::<f64>::new(20.0, 4000.0);
        let mut single = LowPass::<f32>::new(20.0, 4000.0);
        let mut worst = 0.0_f64;
        for i in 0..40_000 {
            let t = f64::from(i) / 4000.0;
            let input = 40.0 * libm::sin(30.0 * t * t) + if i % 1000 < 500 { 10.0 } else { -3.0 };
            let output = direct.step(input);
            assert!((double.step(input) - output).abs() < 1e-9, "{i}");
            let error = f64::from(single.step(input as f32)) - output;
            worst = worst.max(error.abs());
        }
        // of 40 m/s²; with 1 kg it is 0.1 mN
        assert!(worst < 1e-4, "{worst} m/s²");
    }

    #[test]
    fn gain_is_minus_3_db_at_the_corner_and_minus_40_a_decade_above() {
        assert!((gain_at(0.5) - 1.0).abs() < 1e-3);
        assert!((gain_at(20.0) - 0.5f64.sqrt()).abs() < 1e-3);
        assert!((0.008..0.011).contains(&gain_at(200.0)));
    }
}
