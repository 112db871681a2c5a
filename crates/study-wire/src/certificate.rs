//! Whether a table can put energy into the hand that moves it.
//!
//! Only `core` and slices, so that a device can check a table before it takes it.
//! Nothing here allocates or fails on a valid table (see [`super::predict`]).
//!
//! A table with parameters interpolated in x is passive in continuous time if
//!
//! 1. m±(x) ≥ 0: kinetic energy is not negative;
//! 2. b±(x) ≥ ½ max(0, ±dm±/dx) v, up to the fastest v: what a growing mass takes
//!    from the motion, damping gives up. A direction state changes m as well, by
//!    |m⁺ − m⁻|/δ for each mm, and a blend has both branches whichever way it
//!    moves: then the larger of both signs counts, and that is added;
//! 3. S⁺(x) ≥ S⁻(x), S = k x + F0: a stroke there and back does not gain energy.
//!
//! A negative k is no fault: it is the detent itself. m and b are linear between
//! nodes, so 1 and 2 hold there if they hold at the nodes with the slopes on both
//! sides. S is quadratic between nodes, because k and F0 are interpolated each by
//! itself: its least is at a node or at the vertex, which is computed, and so is the
//! steepest |dS/dx|, K.
//!
//! A sampled device wants more: b_device > K T/2 + |B| (Colgate & Schenkel 1997),
//! with n periods of delay K T (½ + n) + |B|, and 2 m/T for a mass unless the
//! acceleration is low-passed.
//!
//! Where parameters jump at nodes (look-ups `floor` and `nearest`), a mass that
//! grows along the motion cannot be paid for by damping: condition 2 has no margin,
//! and K has no bound.

use super::predict::{BranchView, Direction, Lookup, TableView};
use core::fmt;

/// A margin below this much under zero is a failure; what is above it is rounding.
const ROUNDING: f64 = 1e-9;

/// The servo rates that are told, Hz.
pub const SERVO_RATES_HZ: [f64; 3] = [1000.0, 4000.0, 10_000.0];

/// The conditions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// m ≥ 0; the margin is in kg.
    Mass,
    /// b pays for a growing mass; the margin is in N·s/mm.
    Damping,
    /// S⁺ ≥ S⁻; the margin is in N.
    Hysteresis,
}

impl Condition {
    /// Unit of its margin.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Mass => "kg",
            Self::Damping => "N·s/mm",
            Self::Hysteresis => "N",
        }
    }

    /// As it stands in documents of `--json`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::Damping => "damping",
            Self::Hysteresis => "hysteresis",
        }
    }
}

/// How far a table is from breaking a condition, where it is nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margin {
    /// Below 0 the condition is broken; −∞ where nothing can mend it.
    pub value: f64,
    /// Where, mm.
    pub at_mm: f64,
}

impl Margin {
    const NONE: Self = Self {
        value: f64::INFINITY,
        at_mm: f64::NAN,
    };

    fn see(&mut self, value: f64, at_mm: f64) {
        // not `<` alone: a NaN has to show
        if value < self.value || value.is_nan() {
            *self = Self { value, at_mm };
        }
    }

    /// Whether the condition holds.
    pub fn holds(self) -> bool {
        self.value >= -ROUNDING
    }
}

/// What is known of a table's energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// m ≥ 0.
    pub mass: Margin,
    /// b pays for a growing mass.
    pub damping: Margin,
    /// S⁺ ≥ S⁻.
    pub hysteresis: Margin,
    /// Share of the nodes of both directions with m < 0, 0 to 1.
    pub negative_mass: f64,
    /// Share of the nodes of both directions with b < 0, 0 to 1.
    pub negative_damping: f64,
    /// K = max |dS/dx|, N/mm; infinite where S jumps.
    pub stiffness_n_per_mm: f64,
    /// B = max |b|, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// max |m|, kg.
    pub mass_kg: f64,
}

/// Where a table was identified, as far as it matters here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Lowest and highest position, mm: outside the nodes the edge parameters hold.
    pub x_mm: [f64; 2],
    /// Fastest motion, mm/s.
    pub v_mm_s: f64,
}

/// Examines a table.
pub fn certify(table: &TableView<'_>, direction: Direction, range: Range) -> Certificate {
    let mut c = Certificate {
        mass: Margin::NONE,
        damping: Margin::NONE,
        hysteresis: Margin::NONE,
        negative_mass: 0.0,
        negative_damping: 0.0,
        stiffness_n_per_mm: 0.0,
        damping_n_s_per_mm: 0.0,
        mass_kg: 0.0,
    };
    let nodes = table.x_mm.len();
    let delta_mm = match direction {
        Direction::Sign => None,
        Direction::Play { delta_mm } | Direction::Dahl { delta_mm } => Some(delta_mm),
    };
    for (branch, sign) in [(&table.positive, 1.0), (&table.negative, -1.0)] {
        for i in 0..nodes {
            let (m, b) = (branch.m_kg[i], branch.b_n_s_per_mm[i]);
            c.mass.see(m, table.x_mm[i]);
            c.negative_mass += share(m < 0.0, nodes);
            c.negative_damping += share(b < 0.0, nodes);
            c.mass_kg = c.mass_kg.max(libm::fabs(m));
            c.damping_n_s_per_mm = c.damping_n_s_per_mm.max(libm::fabs(b));
            let growth = growth(table, branch, i, sign, delta_mm);
            // kg/mm · mm/s = N·s/m
            let due = if growth > 0.0 {
                0.5 * growth * range.v_mm_s / 1000.0
            } else {
                0.0
            };
            c.damping.see(b - due, table.x_mm[i]);
        }
    }
    for i in 0..nodes - 1 {
        between(table, i, &mut c);
    }
    let ends = [(0, range.x_mm[0]), (nodes - 1, range.x_mm[1])];
    for (i, x) in ends {
        let outside = if i == 0 {
            x < table.x_mm[0]
        } else {
            x > table.x_mm[i]
        };
        let gap = |x: f64| spring(&table.positive, i, x) - spring(&table.negative, i, x);
        c.hysteresis.see(gap(table.x_mm[i]), table.x_mm[i]);
        if outside {
            c.hysteresis.see(gap(x), x);
            for branch in [&table.positive, &table.negative] {
                c.steep(libm::fabs(branch.k_n_per_mm[i]));
            }
        }
    }
    c
}

fn share(counts: bool, nodes: usize) -> f64 {
    if counts { 0.5 / nodes as f64 } else { 0.0 }
}

fn spring(branch: &BranchView<'_>, i: usize, x: f64) -> f64 {
    branch.k_n_per_mm[i] * x + branch.f0_n[i]
}

/// How fast m grows along the motion around node `i`, kg/mm, at worst.
fn growth(
    table: &TableView<'_>,
    branch: &BranchView<'_>,
    i: usize,
    sign: f64,
    delta_mm: Option<f64>,
) -> f64 {
    let steps = table.lookup != Lookup::Linear;
    let mut worst = 0.0_f64;
    for left in [i.wrapping_sub(1), i] {
        if left >= table.x_mm.len() - 1 {
            continue;
        }
        let rise = branch.m_kg[left + 1] - branch.m_kg[left];
        let slope = rise / (table.x_mm[left + 1] - table.x_mm[left]);
        let along = match delta_mm {
            // a blend uses both branches whichever way it moves
            Some(_) => libm::fabs(slope),
            None => sign * slope,
        };
        worst = worst.max(if steps && along > 0.0 {
            f64::INFINITY
        } else {
            along
        });
    }
    match delta_mm {
        Some(delta) => worst + libm::fabs(table.positive.m_kg[i] - table.negative.m_kg[i]) / delta,
        None => worst,
    }
}

/// S⁺ − S⁻ and |dS/dx| between node `i` and the next.
fn between(table: &TableView<'_>, i: usize, c: &mut Certificate) {
    let (x, h) = (table.x_mm[i], table.x_mm[i + 1] - table.x_mm[i]);
    if table.lookup != Lookup::Linear {
        // S is straight between jumps; each node's line is read on both sides of it
        let reach = |x: f64, c: &mut Certificate| {
            for node in [i, i + 1] {
                let gap = spring(&table.positive, node, x) - spring(&table.negative, node, x);
                c.hysteresis.see(gap, x);
            }
        };
        reach(x, c);
        reach(x + h, c);
        for branch in [&table.positive, &table.negative] {
            let line = |node: usize| spring(branch, node, x + h);
            if line(i) != line(i + 1) {
                c.steep(f64::INFINITY);
            }
            c.steep(libm::fabs(branch.k_n_per_mm[i]));
            c.steep(libm::fabs(branch.k_n_per_mm[i + 1]));
        }
        return;
    }
    // S(t) = s + p t + q t² with x + t h, t in [0, 1]
    let quadratic = |branch: &BranchView<'_>| {
        let (k, f0) = (branch.k_n_per_mm[i], branch.f0_n[i]);
        let (dk, df0) = (branch.k_n_per_mm[i + 1] - k, branch.f0_n[i + 1] - f0);
        [k * x + f0, k * h + dk * x + df0, dk * h]
    };
    let (plus, minus) = (quadratic(&table.positive), quadratic(&table.negative));
    for [_, p, q] in [plus, minus] {
        c.steep(libm::fabs(p) / h);
        c.steep(libm::fabs(p + 2.0 * q) / h);
    }
    let [s, p, q] = [plus[0] - minus[0], plus[1] - minus[1], plus[2] - minus[2]];
    let gap = |t: f64| s + (p + q * t) * t;
    c.hysteresis.see(gap(0.0), x);
    c.hysteresis.see(gap(1.0), x + h);
    let vertex = -p / (2.0 * q);
    if q > 0.0 && vertex > 0.0 && vertex < 1.0 {
        c.hysteresis.see(gap(vertex), x + vertex * h);
    }
}

impl Certificate {
    fn steep(&mut self, n_per_mm: f64) {
        if n_per_mm > self.stiffness_n_per_mm || n_per_mm.is_nan() {
            self.stiffness_n_per_mm = n_per_mm;
        }
    }

    /// Whether all three conditions hold.
    pub fn passes(&self) -> bool {
        self.conditions().iter().all(|(_, margin)| margin.holds())
    }

    /// The conditions and their margins.
    pub fn conditions(&self) -> [(Condition, Margin); 3] {
        [
            (Condition::Mass, self.mass),
            (Condition::Damping, self.damping),
            (Condition::Hysteresis, self.hysteresis),
        ]
    }

    /// Damping that a device needs of its own to render the springs and dampers of
    /// this table at `rate_hz` with `delay` periods of delay, N·s/m.
    pub fn device_damping_n_s_per_m(&self, rate_hz: f64, delay: f64) -> f64 {
        spring_damping_n_s_per_m(self.stiffness_n_per_mm, rate_hz, delay)
            + 1000.0 * self.damping_n_s_per_mm
    }
}

/// K T (½ + n) in N·s/m: what a device needs of its own to render a spring.
pub fn spring_damping_n_s_per_m(stiffness_n_per_mm: f64, rate_hz: f64, delay: f64) -> f64 {
    1000.0 * stiffness_n_per_mm * (0.5 + delay) / rate_hz
}

/// 2 m/T in N·s/m: what a device needs of its own to render a mass from an
/// acceleration that is not low-passed.
pub fn mass_damping_n_s_per_m(mass_kg: f64, rate_hz: f64) -> f64 {
    2.0 * mass_kg * rate_hz
}

/// The stiffest spring that encoder and friction leave quiet, N/mm:
/// min(2b/T, 2 f_c/Δ) (Abbott & Okamura 2005), with damping b in N·s/m, Coulomb
/// friction f_c in N and resolution Δ in mm.
pub fn stiffest_n_per_mm(
    damping_n_s_per_m: f64,
    rate_hz: f64,
    friction_n: f64,
    resolution_mm: f64,
) -> f64 {
    let by_damping = 2.0 * damping_n_s_per_m * rate_hz / 1000.0;
    by_damping.min(2.0 * friction_n / resolution_mm)
}

impl fmt::Display for Certificate {
    /// `PASS` or `FAIL` and every margin that is broken, or the nearest ones.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let passes = self.passes();
        f.write_str(if passes { "PASS" } else { "FAIL" })?;
        let mut before = ": ";
        for (condition, margin) in self.conditions() {
            if margin.holds() != passes {
                continue;
            }
            let (name, digits) = match condition {
                Condition::Mass => ("least m", 4),
                Condition::Damping => ("b less what m needs", 5),
                Condition::Hysteresis => ("least S+ - S-", 3),
            };
            write!(
                f,
                "{before}{name} {:.digits$} {} at {:.2} mm",
                margin.value,
                condition.unit(),
                margin.at_mm
            )?;
            before = ", ";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
