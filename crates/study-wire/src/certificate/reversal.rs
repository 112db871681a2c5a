//! Friction by the sign of the speed, on a device with an encoder of finite steps, a servo period
//! and a slew limit.
//!
//! The force of such friction turns later than the hand, so that every reversal may draw energy. No
//! damping of a device prevents this: what it takes is proportional to the speed, and a hand may
//! turn at any speed. But damping bounds the energy of a reversal, and above a speed it takes more
//! than the friction gives. `docs/identification.md` derives both numbers.

/// A device that renders friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Renderer {
    /// Servo periods per second.
    pub servo_hz: f64,
    /// Step of the encoder, mm.
    pub encoder_mm: f64,
    /// Slew limit, N/s.
    pub slew_n_s: f64,
    /// Damping of its own beside what the springs and dampers of the table need, N·s/mm.
    pub damping_n_s_per_mm: f64,
}

/// What a reversal of the hand may draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reversal {
    /// Energy of one reversal, mJ, at most.
    pub most_mj: f64,
    /// At higher speeds the damping of the device takes more than the friction gives, mm/s.
    pub up_to_mm_s: f64,
}

impl Renderer {
    /// What a reversal draws where the force changes by `gap_n` with the sign of the speed. `None`
    /// without a gap, or if the device has no damping left.
    ///
    /// ```
    /// # use study_wire::certificate::reversal::Renderer;
    /// // 100 N/mm at 4 kHz: K T/2 = 0.0125 N·s/mm.
    /// let device = Renderer { servo_hz: 4000.0, encoder_mm: 0.005, slew_n_s: 2000.0, damping_n_s_per_mm: 0.0125 };
    /// // 2 N: 0.005 mJ for the step and 4/(4·0.0125)·(0.25 + 0.333) ms.
    /// let found = device.reversal(2.0).unwrap();
    /// assert!((found.most_mj - 0.0516667).abs() < 1e-6);
    /// ```
    pub fn reversal(&self, gap_n: f64) -> Option<Reversal> {
        let (damping, period_s) = (self.damping_n_s_per_mm, 1.0 / self.servo_hz);
        let holds = gap_n > 0.0 && gap_n.is_finite() && damping > 0.0;
        if !holds {
            return None;
        }
        let slewing_s = gap_n / self.slew_n_s;
        let step_mj = 0.5 * gap_n * self.encoder_mm;
        let most_mj = step_mj + gap_n * gap_n * (period_s + slewing_s / 3.0) / (4.0 * damping);
        // b v² (T + G/σ) = G Δ/2 + G v (T + G/2σ)
        let takes = damping * (period_s + slewing_s);
        let gives = gap_n * (period_s + 0.5 * slewing_s);
        let up_to_mm_s =
            (gives + libm::sqrt(gives * gives + 4.0 * takes * step_mj)) / (2.0 * takes);
        Some(Reversal {
            most_mj,
            up_to_mm_s,
        })
    }
}
