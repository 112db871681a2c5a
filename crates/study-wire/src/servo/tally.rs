//! Totals of a playback: energy, strokes, counts.

use crate::real::Real;

/// Totals since the start of a playback, in double precision also with a servo in single
/// precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally<R = f64> {
    /// Servo periods.
    pub steps: u64,
    /// Energy that the hand has put in, J.
    pub energy_j: f64,
    /// Smallest value of that energy, zero or negative, J.
    pub least_energy_j: f64,
    /// Sign changes of the direction state.
    pub switches: u64,
    /// How often the force reached its limit; each run into the limit counts once.
    pub clamps: u64,
    /// Servo periods in which the slew limit was active.
    pub slewed: u64,
    /// Servo periods in which the mass was raised to the smallest one.
    pub mass_held: u64,
    /// Full strokes, each from one end of the range to the other.
    pub strokes: u32,
    /// Largest magnitude of the force, N.
    pub peak_force_n: f64,
    /// Sum of the squares of the force above 20 Hz, N².
    rough_sum: f64,
    last_x_mm: Option<R>,
    last_end: Option<End>,
}

/// End of the range, where a full stroke begins or ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Low,
    High,
}

/// Fraction of the range at either side that counts as its end.
const END_FRACTION: f64 = 0.2;

impl<R: Real> Default for Tally<R> {
    fn default() -> Self {
        Self::new()
    }
}

impl<R: Real> Tally<R> {
    /// Before the first servo period.
    pub const fn new() -> Self {
        Self {
            steps: 0,
            energy_j: 0.0,
            least_energy_j: 0.0,
            switches: 0,
            clamps: 0,
            slewed: 0,
            mass_held: 0,
            strokes: 0,
            peak_force_n: 0.0,
            rough_sum: 0.0,
            last_x_mm: None,
            last_end: None,
        }
    }

    /// Mean square of the force above 20 Hz, N², a measure of roughness.
    pub fn rough_n2(&self) -> f64 {
        if self.steps == 0 {
            0.0
        } else {
            self.rough_sum / self.steps as f64
        }
    }

    /// Position in the previous period, mm.
    pub(super) fn last_x_mm(&self) -> Option<R> {
        self.last_x_mm
    }

    /// Adds a servo period with the force `held_n`, of which `rough_n` is above 20 Hz.
    pub(super) fn add_force(&mut self, held_n: R, rough_n: R) {
        self.steps += 1;
        self.peak_force_n = self.peak_force_n.max(held_n.abs().f64());
        self.rough_sum += (rough_n * rough_n).f64();
    }

    /// Adds the motion to `x_mm` in a period with the force `held_n`.
    pub(super) fn add_motion(&mut self, held_n: R, x_mm: R, range_mm: [R; 2]) {
        if let Some(last) = self.last_x_mm {
            self.energy_j += (held_n * (x_mm - last) * R::of(1e-3)).f64();
            self.least_energy_j = self.least_energy_j.min(self.energy_j);
        }
        self.last_x_mm = Some(x_mm);

        let [low, high] = range_mm;
        let zone = R::of(END_FRACTION) * (high - low);
        let end = if x_mm <= low + zone {
            End::Low
        } else if x_mm >= high - zone {
            End::High
        } else {
            return;
        };
        if self.last_end.is_some_and(|last| last != end) {
            self.strokes += 1;
        }
        self.last_end = Some(end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Full strokes of four seconds of 15 mm ± `amplitude` at 1 Hz over 0 … 30 mm.
    fn strokes(center_mm: f64, amplitude_mm: f64) -> u32 {
        let mut tally = Tally::new();
        for i in 0..16_000 {
            let phase = core::f64::consts::TAU * f64::from(i) / 4000.0;
            let x_mm = center_mm + amplitude_mm * libm::sin(phase);
            tally.add_motion(0.0, x_mm, [0.0, 30.0]);
        }
        tally.strokes
    }

    /// From the middle up, then down and up three times and down once more.
    #[test]
    fn only_full_strokes_are_counted() {
        assert_eq!(strokes(15.0, 14.0), 7);
        assert_eq!(strokes(8.0, 8.0), 0);
        assert_eq!(strokes(15.0, 8.0), 0);
    }

    /// 2 N over 10 mm, 3 N over the same distance back, 3 N forwards again.
    #[test]
    fn energy_counts_from_the_hand_and_its_smallest_value_is_kept() {
        let mut tally = Tally::new();
        for (held_n, x_mm) in [(0.0, 10.0), (2.0, 20.0), (3.0, 10.0), (3.0, 20.0)] {
            tally.add_motion(held_n, x_mm, [0.0, 30.0]);
        }
        assert!((tally.energy_j - 0.020).abs() < 1e-12);
        assert!((tally.least_energy_j + 0.010).abs() < 1e-12);
    }
}
