//! The certificate of a realization of elements, one node at a time.

use super::{ElementsView, MAX_SPRINGS, Spring};
use crate::certificate::{Certificate, Margin};
use crate::mechanism::FASTER_THAN_TRAINED;

/// The longest servo period for which latches are judged, s: a device has 4 kHz or more.
pub const SLOWEST_S: f64 = 1.0 / 4000.0;

/// A certificate in progress, so that a device can judge a realization between servo
/// periods while it arrives.
#[derive(Debug, Clone, Copy)]
pub struct Certifier {
    damping: Margin,
    hysteresis: Margin,
    negative_damping: usize,
    stiffness_n_per_mm: f64,
    state_n_per_mm: f64,
    damping_n_s_per_mm: f64,
    /// Of each spring: the largest force, N, and of a latch the energy of a break, N·mm.
    springs: [[f64; 2]; MAX_SPRINGS],
    first_mm: f64,
    judged: usize,
}

impl Certifier {
    /// Before the first node.
    pub const fn new() -> Self {
        let margin = Margin {
            value: f64::INFINITY,
            at_mm: 0.0,
        };
        Self {
            damping: margin,
            hysteresis: margin,
            negative_damping: 0,
            stiffness_n_per_mm: 0.0,
            state_n_per_mm: 0.0,
            damping_n_s_per_mm: 0.0,
            springs: [[0.0; 2]; MAX_SPRINGS],
            first_mm: 0.0,
            judged: 0,
        }
    }

    /// Nodes judged so far.
    pub fn judged(&self) -> usize {
        self.judged
    }

    /// Judges the next node. `of` is a part of the realization with this node at index `at` and
    /// the one before it.
    pub fn step(&mut self, of: &ElementsView<'_>, at: usize) {
        let x_mm = of.x_mm[at];
        if self.judged == 0 {
            self.first_mm = x_mm;
        }
        for damping in of.damping_n_s_per_mm {
            self.damping.include(damping[at], x_mm);
            self.negative_damping += usize::from(damping[at] < 0.0);
            self.damping_n_s_per_mm = largest(self.damping_n_s_per_mm, damping[at]);
        }
        let before = (self.judged > 0).then(|| at - 1);
        let mut state_n_per_mm = 0.0;
        let mut slope_n = before.map_or(0.0, |b| libm::fabs(of.force_n[at] - of.force_n[b]));
        for (i, (spring, profile)) in of.springs.iter().zip(of.spring_n).enumerate() {
            self.hysteresis.include(profile[at], x_mm);
            self.springs[i][0] = largest(self.springs[i][0], profile[at]);
            state_n_per_mm += spring.slip_mm().map_or(0.0, |slip| profile[at] / slip);
            let Some(before) = before else {
                continue;
            };
            slope_n += libm::fabs(profile[at] - profile[before]);
            if let Spring::Latch { rearm_mm, break_mm } = *spring {
                let way = [of.x_mm[before], x_mm];
                let profile = [profile[before], profile[at]];
                self.springs[i][1] += work_n_mm(way, profile, [rearm_mm, break_mm]);
            }
        }
        if let Some(before) = before {
            let slope = slope_n / (x_mm - of.x_mm[before]);
            self.stiffness_n_per_mm = largest(self.stiffness_n_per_mm, slope);
        }
        self.state_n_per_mm = largest(self.state_n_per_mm, state_n_per_mm);
        self.judged += 1;
    }

    /// The certificate, after the last node. Of `of` only mass and springs are read.
    pub fn finish(&self, of: &ElementsView<'_>, trained_mm_s: f64) -> Certificate {
        let first_mm = self.first_mm;
        let mut hysteresis = self.hysteresis;
        if hysteresis.value == f64::INFINITY {
            hysteresis = Margin {
                value: 0.0,
                at_mm: first_mm,
            };
        }
        let step_mm = FASTER_THAN_TRAINED * trained_mm_s * SLOWEST_S;
        for (spring, [most_n, work_n_mm]) in of.springs.iter().zip(self.springs) {
            if let Spring::Latch { break_mm, .. } = *spring {
                // half of the energy is released at the break, half when it holds again
                hysteresis.include(0.5 * work_n_mm / step_mm - most_n, break_mm);
            }
        }
        let negative = |value: f64| if value < 0.0 { 1.0 } else { 0.0 };
        Certificate {
            mass: Margin {
                value: of.mass_kg,
                at_mm: first_mm,
            },
            damping: self.damping,
            hysteresis,
            negative_mass: negative(of.mass_kg),
            negative_damping: self.negative_damping as f64 / (2.0 * self.judged.max(1) as f64),
            stiffness_n_per_mm: self.stiffness_n_per_mm,
            gap_n: 0.0,
            state_n_per_mm: Some(self.state_n_per_mm),
            damping_n_s_per_mm: self.damping_n_s_per_mm,
            mass_kg: libm::fabs(of.mass_kg),
        }
    }
}

impl Default for Certifier {
    fn default() -> Self {
        Self::new()
    }
}

/// The larger size; a NaN is kept, so that no limit holds.
fn largest(so_far: f64, value: f64) -> f64 {
    let size = libm::fabs(value);
    if size > so_far || size.is_nan() {
        size
    } else {
        so_far
    }
}

/// The integral of a line between two nodes over the part of `within` that lies between
/// them, N·mm.
fn work_n_mm([from, to]: [f64; 2], [at_from, at_to]: [f64; 2], within: [f64; 2]) -> f64 {
    let [low, high] = [within[0].max(from), within[1].min(to)];
    if high <= low {
        return 0.0;
    }
    let middle = (0.5 * (low + high) - from) / (to - from);
    (high - low) * (at_from + middle * (at_to - at_from))
}
