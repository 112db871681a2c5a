//! The low-pass filter of acceleration and force.

/// Butterworth low-pass with two poles, by the bilinear transform.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass {
    gain: f64,
    feedback: [f64; 2],
    /// Transposed direct form II.
    memory: [f64; 2],
}

impl LowPass {
    pub(super) fn new(corner_hz: f64, rate_hz: f64) -> Self {
        let k = libm::tan(core::f64::consts::PI * corner_hz / rate_hz);
        let norm = 1.0 / (1.0 + core::f64::consts::SQRT_2 * k + k * k);
        Self {
            gain: k * k * norm,
            feedback: [
                2.0 * (k * k - 1.0) * norm,
                (1.0 - core::f64::consts::SQRT_2 * k + k * k) * norm,
            ],
            memory: [0.0; 2],
        }
    }

    pub(super) fn step(&mut self, input: f64) -> f64 {
        let scaled = self.gain * input;
        let output = scaled + self.memory[0];
        self.memory[0] = 2.0 * scaled - self.feedback[0] * output + self.memory[1];
        self.memory[1] = scaled - self.feedback[1] * output;
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest output after a second of a sine of amplitude 1.
    fn gain_at(hz: f64) -> f64 {
        let mut filter = LowPass::new(20.0, 4000.0);
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

    #[test]
    fn gain_is_minus_3_db_at_the_corner_and_minus_40_a_decade_above() {
        assert!((gain_at(0.5) - 1.0).abs() < 1e-3);
        assert!((gain_at(20.0) - 0.5f64.sqrt()).abs() < 1e-3);
        assert!((0.008..0.011).contains(&gain_at(200.0)));
    }
}
