//! The parts of a trajectory: deviations from its offset, in closed form.
//!
//! Each part gives position (mm), velocity (mm/s) and acceleration (mm/s²) at an
//! instant. The acceleration is continuous except for steps, where it jumps between 0
//! and ± its limit, and where a linear sweep restarts.

use super::minimum_jerk;
use std::f64::consts::TAU;

/// The supported lengths of shift registers, bits.
pub const PRBS_ORDERS: std::ops::RangeInclusive<u32> = 3..=16;

/// Feedback taps (bits from 1) of maximal-length shift registers of 3 to 16 bits.
/// Ward & Molteno, "Table of linear feedback shift registers", 2007.
const TAPS: [&[u32]; 14] = [
    &[3, 2],
    &[4, 3],
    &[5, 3],
    &[6, 5],
    &[7, 6],
    &[8, 6, 5, 4],
    &[9, 5],
    &[10, 7],
    &[11, 9],
    &[12, 11, 8, 6],
    &[13, 12, 10, 9],
    &[14, 13, 11, 9],
    &[15, 14],
    &[16, 14, 13, 11],
];

/// One term of a trajectory.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// A sine.
    Sine(Sine),
    /// A swept sine.
    Sweep(Sweep),
    /// A pseudo-random binary sequence.
    Prbs(Prbs),
    /// Moves between levels at constant speed.
    Steps(Steps),
}

/// A sine, A·sin(2πft + φ).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sine {
    /// Amplitude A, mm.
    pub amplitude_mm: f64,
    /// Frequency f, Hz.
    pub frequency_hz: f64,
    /// Phase φ at t = 0, degrees.
    pub phase_deg: f64,
}

/// The frequency of a sweep over a period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Up from the first frequency to the second and back.
    Triangular,
    /// From the first frequency to the second, then again from the first.
    Linear,
}

/// A swept sine, A·sin(2π∫f dt + φ) with f piecewise linear in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// Course of the frequency.
    pub shape: Shape,
    /// Amplitude A, mm.
    pub amplitude_mm: f64,
    /// Frequency at the beginning of a period, Hz.
    pub from_hz: f64,
    /// Frequency at the middle (triangular) or end (linear) of a period, Hz.
    pub to_hz: f64,
    /// Period of the sweep, s.
    pub period_s: f64,
    /// Phase φ at t = 0, degrees.
    pub phase_deg: f64,
}

/// A pseudo-random binary sequence: ±A in the order of a maximal-length shift register
/// that starts with all ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Prbs {
    /// Amplitude A, mm.
    pub amplitude_mm: f64,
    /// Duration of a bit, s.
    pub bit_s: f64,
    /// Duration of a change at the beginning of a bit, s; at most `bit_s`.
    pub rise_s: f64,
    /// The 2^order − 1 bits, `true` for +.
    bits: Vec<bool>,
}

/// Periodic moves from level to level at constant speed, with a rest at each level.
#[derive(Debug, Clone, PartialEq)]
pub struct Steps {
    /// Deviations from the offset, mm; at least two, neighbors differ.
    pub levels_mm: Vec<f64>,
    /// Speed of the moves, mm/s.
    pub speed_mm_s: f64,
    /// Acceleration and deceleration of the moves, m/s².
    pub acceleration_m_s2: f64,
    /// Rest at each level, s.
    pub hold_s: f64,
}

impl Part {
    /// Position, velocity and acceleration (mm, mm/s, mm/s²) at `t_s` ≥ 0.
    pub fn at(&self, t_s: f64) -> [f64; 3] {
        match self {
            Self::Sine(sine) => sine.at(t_s),
            Self::Sweep(sweep) => sweep.at(t_s),
            Self::Prbs(prbs) => prbs.at(t_s),
            Self::Steps(steps) => steps.at(t_s),
        }
    }

    /// The highest frequency, Hz; for a change within s seconds it is 1/(2s).
    pub fn top_hz(&self) -> f64 {
        match self {
            Self::Sine(s) => s.frequency_hz,
            Self::Sweep(s) => s.from_hz.max(s.to_hz),
            Self::Prbs(p) => 0.5 / p.rise_s,
            Self::Steps(s) => {
                let ramp_s = s.speed_mm_s * 1e-3 / s.acceleration_m_s2;
                let least_mm = s
                    .moves()
                    .map(|(from, to)| (to - from).abs())
                    .fold(f64::INFINITY, f64::min);
                let least_s = least_mm / s.speed_mm_s;
                0.5 / ramp_s.min(least_s).max(1e-4)
            }
        }
    }
}

impl Sine {
    fn at(&self, t_s: f64) -> [f64; 3] {
        let w = TAU * self.frequency_hz;
        let phase = w * t_s + self.phase_deg.to_radians();
        sinusoid(self.amplitude_mm, [phase, w, 0.0])
    }
}

/// A·sin(phase) and its first two derivatives, from the phase and its own.
fn sinusoid(amplitude: f64, [phase, rate, change]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = libm::sincos(phase);
    [
        amplitude * sin,
        amplitude * rate * cos,
        amplitude * (change * cos - rate * rate * sin),
    ]
}

impl Sweep {
    fn at(&self, t_s: f64) -> [f64; 3] {
        let periods = libm::floor(t_s / self.period_s);
        let into_s = t_s - periods * self.period_s;
        // for both shapes the mean frequency over a period is that of its ends
        let before = periods * 0.5 * (self.from_hz + self.to_hz) * self.period_s;
        let (cycles, hz, slope) = match self.shape {
            Shape::Linear => self.rising(into_s, self.period_s),
            Shape::Triangular => {
                let half_s = 0.5 * self.period_s;
                if into_s < half_s {
                    self.rising(into_s, half_s)
                } else {
                    let (all, _, _) = self.rising(half_s, half_s);
                    let s = into_s - half_s;
                    let slope = (self.from_hz - self.to_hz) / half_s;
                    let hz = self.to_hz + slope * s;
                    (all + (self.to_hz + 0.5 * slope * s) * s, hz, slope)
                }
            }
        };
        let phase = TAU * (before + cycles) + self.phase_deg.to_radians();
        sinusoid(self.amplitude_mm, [phase, TAU * hz, TAU * slope])
    }

    /// Number of cycles, frequency and its slope `s` seconds into a rise of `over_s`.
    fn rising(&self, s: f64, over_s: f64) -> (f64, f64, f64) {
        let slope = (self.to_hz - self.from_hz) / over_s;
        let cycles = (self.from_hz + 0.5 * slope * s) * s;
        (cycles, self.from_hz + slope * s, slope)
    }
}

impl Prbs {
    /// The sequence of a register of `order` bits; `None` unless `order` is in
    /// [`PRBS_ORDERS`].
    pub fn new(amplitude_mm: f64, order: u32, bit_s: f64, rise_s: f64) -> Option<Self> {
        let taps = TAPS.get(order.checked_sub(*PRBS_ORDERS.start())? as usize)?;
        let all = (1u32 << order) - 1;
        let mut register = all;
        let bits = (0..all)
            .map(|_| {
                let out = register >> (order - 1) & 1 == 1;
                let fed = taps
                    .iter()
                    .fold(0, |bit, tap| bit ^ (register >> (tap - 1)));
                register = (register << 1 | fed & 1) & all;
                out
            })
            .collect();
        Some(Self {
            amplitude_mm,
            bit_s,
            rise_s,
            bits,
        })
    }

    /// Length of the shift register, bits.
    pub fn order(&self) -> u32 {
        (self.bits.len() + 1).ilog2()
    }

    /// The bits of one period, `true` for +.
    pub fn bits(&self) -> &[bool] {
        &self.bits
    }

    fn at(&self, t_s: f64) -> [f64; 3] {
        let bit = libm::floor(t_s / self.bit_s);
        let into_s = t_s - bit * self.bit_s;
        // not negative and far below 2^53, so the cast is exact
        let index = bit as usize;
        let level = |index: usize| {
            let positive = self.bits[index % self.bits.len()];
            self.amplitude_mm * if positive { 1.0 } else { -1.0 }
        };
        let to = level(index);
        let from = level(index.saturating_sub(1));
        if from == to || into_s >= self.rise_s {
            return [to, 0.0, 0.0];
        }
        let [w, w1, w2] = minimum_jerk(into_s.max(0.0), self.rise_s);
        [from + (to - from) * w, (to - from) * w1, (to - from) * w2]
    }
}

impl Steps {
    /// Start and end of each move of one period, mm.
    fn moves(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let next = self.levels_mm.iter().cycle().skip(1);
        self.levels_mm.iter().copied().zip(next.copied())
    }

    /// Time at constant speed, s, time of acceleration, s, and the speed, mm/s, of a move
    /// over `distance_mm`.
    fn profile(&self, distance_mm: f64) -> (f64, f64, f64) {
        let a = 1e3 * self.acceleration_m_s2;
        let reached = libm::sqrt(a * distance_mm);
        let speed = self.speed_mm_s.min(reached);
        let ramp_s = speed / a;
        ((distance_mm / speed - ramp_s).max(0.0), ramp_s, speed)
    }

    fn move_s(&self, distance_mm: f64) -> f64 {
        let (constant_s, ramp_s, _) = self.profile(distance_mm);
        constant_s + 2.0 * ramp_s
    }

    fn at(&self, t_s: f64) -> [f64; 3] {
        let period_s: f64 = self
            .moves()
            .map(|(from, to)| self.hold_s + self.move_s((to - from).abs()))
            .sum();
        let mut s = t_s - libm::floor(t_s / period_s) * period_s;
        for (from, to) in self.moves() {
            if s < self.hold_s {
                return [from, 0.0, 0.0];
            }
            s -= self.hold_s;
            let distance = (to - from).abs();
            let (constant_s, ramp_s, speed) = self.profile(distance);
            let total_s = constant_s + 2.0 * ramp_s;
            if s < total_s {
                let a = speed / ramp_s;
                let [d, v, a] = if s < ramp_s {
                    [0.5 * a * s * s, a * s, a]
                } else if s < ramp_s + constant_s {
                    [speed * (s - 0.5 * ramp_s), speed, 0.0]
                } else {
                    let left = total_s - s;
                    [distance - 0.5 * a * left * left, a * left, -a]
                };
                let sign = (to - from).signum();
                return [from + sign * d, sign * v, sign * a];
            }
            s -= total_s;
        }
        // rounding at the very end of a period
        [self.levels_mm[0], 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shift_register_is_of_maximal_length() {
        assert!(
            [0, 2, 17, 99]
                .iter()
                .all(|n| Prbs::new(1.0, *n, 0.1, 0.01).is_none())
        );
        for order in PRBS_ORDERS {
            let prbs = Prbs::new(1.0, order, 0.1, 0.01).unwrap();
            assert_eq!(prbs.order(), order);
            let bits = prbs.bits();
            let ones = bits.iter().filter(|b| **b).count();
            assert_eq!(bits.len(), (1 << order) - 1);
            assert_eq!(ones, 1 << (order - 1), "{order}");
            // two-valued autocorrelation: −1 at every shift other than 0
            for shift in [1, 2, bits.len() / 2, bits.len() - 1] {
                let same = (0..bits.len())
                    .filter(|i| bits[*i] == bits[(i + shift) % bits.len()])
                    .count() as i64;
                assert_eq!(2 * same - bits.len() as i64, -1, "{order} {shift}");
            }
        }
    }

    #[test]
    fn a_triangular_sweep_is_at_its_highest_frequency_in_the_middle() {
        let sweep = Sweep {
            shape: Shape::Triangular,
            amplitude_mm: 1.0,
            from_hz: 1.0,
            to_hz: 4.0,
            period_s: 20.0,
            phase_deg: 0.0,
        };
        // zero crossings of the second before and after the middle
        let crossings = (1..20_000)
            .map(|i| 9.0 + f64::from(i) * 1e-4)
            .filter(|t| sweep.at(*t - 1e-4)[0] < 0.0 && sweep.at(*t)[0] >= 0.0)
            .count();
        assert!((7..=8).contains(&crossings), "{crossings}");
        // periods of 50 whole cycles: it is periodic
        for t in [0.3, 7.7, 13.1] {
            assert!((sweep.at(t)[0] - sweep.at(t + 20.0)[0]).abs() < 1e-9);
        }
    }

    #[test]
    fn steps_move_at_constant_speed_between_their_levels() {
        let steps = Steps {
            levels_mm: vec![-10.0, 10.0],
            speed_mm_s: 40.0,
            acceleration_m_s2: 2.0,
            hold_s: 0.5,
        };
        assert_eq!(steps.at(0.4), [-10.0, 0.0, 0.0]);
        let [x, v, a] = steps.at(0.5 + 0.02 + 0.24);
        assert!(x.abs() < 1e-9 && v == 40.0 && a == 0.0, "{x} {v} {a}");
        assert_eq!(steps.at(0.5 + 0.52 + 0.3)[0], 10.0);
        // a short move does not reach its speed and does not overshoot
        let short = Steps {
            levels_mm: vec![0.0, 0.1],
            ..steps
        };
        let most = (0..20_000)
            .map(|i| short.at(f64::from(i) * 1e-4))
            .fold([0.0f64; 2], |m, [x, v, _]| [m[0].max(x), m[1].max(v)]);
        assert!((most[0] - 0.1).abs() < 1e-9 && most[1] < 15.0, "{most:?}");
    }
}
