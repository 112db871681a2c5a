//! Passivity certificate: whether a table can supply energy to the hand.
//!
//! A device checks a table with the same code before it accepts it.
//!
//! A table with parameters interpolated in x is passive in continuous time if
//!
//! 1. m±(x) ≥ 0, so the kinetic energy is not negative;
//! 2. b±(x) ≥ ½ max(0, ±dm±/dx) v up to the largest v, so the damping dissipates the
//!    energy that a mass growing along the motion would supply. With a direction
//!    state both branches contribute in either direction of motion, so the larger
//!    slope of both signs counts, and the change of m with the state, |m⁺ − m⁻|/δ per
//!    mm, is added;
//! 3. S⁺(x) ≥ S⁻(x) with S = k x + F0, so a closed stroke does not gain energy. With the direction
//!    rule play it is enough that this holds in the mean over its width: [`windows`].
//!
//! A negative k is allowed; it is the detent itself. Since m and b are linear between
//! nodes, conditions 1 and 2 hold there if they hold at the nodes with the slopes on
//! both sides. S is quadratic between nodes because k and F0 are interpolated
//! separately: its minimum is at a node or at the vertex, which is computed, as is the
//! largest |dS/dx|, K.
//!
//! While a direction state changes from one branch to the other, the force changes by
//! S⁺ − S⁻ over δ: a device renders this stiffness in addition to K.
//!
//! Without a direction state the force turns later than the hand, so that a reversal may draw
//! energy: [`reversal`] bounds it.
//!
//! A sampled device needs additional damping: b_device > K T/2 + |B| (Colgate &
//! Schenkel 1997), with n periods of delay K T (½ + n) + |B|, and 2 m/T for a mass
//! unless the acceleration is low-pass filtered.
//!
//! Where parameters jump at nodes (look-ups `floor` and `nearest`), no damping can
//! compensate a mass that grows along the motion: condition 2 then has the margin −∞,
//! and K is infinite.

pub mod reversal;
pub mod windows;

use super::predict::{BranchView, Direction, Lookup, TableView};
use core::fmt;

/// Margins down to minus this value count as rounding errors.
const ROUNDING: f64 = 1e-9;

/// Servo rates for which reports state the required device damping, Hz.
pub const SERVO_RATES_HZ: [f64; 3] = [1000.0, 4000.0, 10_000.0];

/// The conditions of the certificate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// m ≥ 0; the margin is in kg.
    Mass,
    /// b dissipates what a growing mass supplies; the margin is in N·s/mm.
    Damping,
    /// S⁺ ≥ S⁻; the margin is in N.
    Hysteresis,
}

impl Condition {
    /// Unit of the margin.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Mass => "kg",
            Self::Damping => "N·s/mm",
            Self::Hysteresis => "N",
        }
    }

    /// Identifier in JSON documents.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::Damping => "damping",
            Self::Hysteresis => "hysteresis",
        }
    }
}

/// Smallest margin of a condition over the table, and its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margin {
    /// Negative if the condition is violated; −∞ at a jump of the mass.
    pub value: f64,
    /// Position of the smallest margin, mm.
    pub at_mm: f64,
}

impl Margin {
    /// No value so far.
    const fn at(at_mm: f64) -> Self {
        Self {
            value: f64::INFINITY,
            at_mm,
        }
    }

    pub(crate) fn include(&mut self, value: f64, at_mm: f64) {
        // A NaN is kept, so that the condition fails.
        if value < self.value || value.is_nan() {
            *self = Self { value, at_mm };
        }
    }

    /// Whether the condition holds.
    pub fn holds(self) -> bool {
        self.value >= -ROUNDING
    }
}

/// Passivity margins and bounds of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// Margin of [`Condition::Mass`].
    pub mass: Margin,
    /// Margin of [`Condition::Damping`].
    pub damping: Margin,
    /// Margin of [`Condition::Hysteresis`].
    pub hysteresis: Margin,
    /// Fraction of the nodes of both directions with m < 0, 0 to 1.
    pub negative_mass: f64,
    /// Fraction of the nodes of both directions with b < 0, 0 to 1.
    pub negative_damping: f64,
    /// K = max |dS/dx|, N/mm; infinite where S jumps.
    pub stiffness_n_per_mm: f64,
    /// max |S⁺ − S⁻|, N.
    pub gap_n: f64,
    /// max |S⁺ − S⁻|/δ, N/mm, by which a direction state changes the force in addition to
    /// K. `None` without a state: the force then jumps with the sign of v.
    pub state_n_per_mm: Option<f64>,
    /// B = max |b|, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// max |m|, kg.
    pub mass_kg: f64,
}

/// Range of motion for which a table is certified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Lowest and highest position, mm. Outside the nodes the edge parameters apply.
    pub x_mm: [f64; 2],
    /// Largest speed, mm/s.
    pub v_mm_s: f64,
}

/// Computes the certificate of a valid table.
pub fn certify(table: &TableView<'_>, direction: Direction, range: Range) -> Certificate {
    let mut certifier = Certifier::new();
    let nodes = table.x_mm.len();
    for at in 0..nodes {
        certifier.step(table, at, nodes, direction, range);
    }
    certifier.finish()
}

/// A certificate in progress, one node at a time, so that a device can judge a table
/// between servo periods while it arrives.
#[derive(Debug, Clone, Copy)]
pub struct Certifier {
    so_far: Certificate,
    /// Margins of mass and damping for v > 0 and v < 0.
    branches: [[Margin; 2]; 2],
    judged: usize,
}

impl Certifier {
    /// Before the first node.
    pub const fn new() -> Self {
        let margin = Margin::at(0.0);
        Self {
            so_far: Certificate {
                mass: margin,
                damping: margin,
                hysteresis: margin,
                negative_mass: 0.0,
                negative_damping: 0.0,
                stiffness_n_per_mm: 0.0,
                gap_n: 0.0,
                state_n_per_mm: None,
                damping_n_s_per_mm: 0.0,
                mass_kg: 0.0,
            },
            branches: [[margin; 2]; 2],
            judged: 0,
        }
    }

    /// Nodes judged so far.
    pub fn judged(&self) -> usize {
        self.judged
    }

    /// Judges the next node of a table of `nodes`. `table` is a part of the table with this
    /// node at index `at` and the nodes before and after it.
    pub fn step(
        &mut self,
        table: &TableView<'_>,
        at: usize,
        nodes: usize,
        direction: Direction,
        range: Range,
    ) {
        let (i, c) = (at, &mut self.so_far);
        let (first, last) = (self.judged == 0, self.judged + 1 == nodes);
        let (x_mm, delta_mm) = (table.x_mm[i], direction.delta_mm());
        if first {
            self.branches = [[Margin::at(x_mm); 2]; 2];
            c.hysteresis = Margin::at(x_mm);
            c.state_n_per_mm = delta_mm.map(|_| 0.0);
            edge(table, i, range.x_mm[0].min(x_mm), delta_mm, c);
        }
        let directions = [(&table.positive, 1.0), (&table.negative, -1.0)];
        for ((branch, sign), [mass, damping]) in directions.into_iter().zip(&mut self.branches) {
            let (m, b) = (branch.m_kg[i], branch.b_n_s_per_mm[i]);
            mass.include(m, x_mm);
            c.negative_mass += node_fraction(m < 0.0, nodes);
            c.negative_damping += node_fraction(b < 0.0, nodes);
            c.mass_kg = c.mass_kg.max(libm::fabs(m));
            c.damping_n_s_per_mm = c.damping_n_s_per_mm.max(libm::fabs(b));
            let growth = growth(table, branch, i, sign, delta_mm);
            // kg/mm · mm/s = N·s/m
            let required = if growth > 0.0 {
                0.5 * growth * range.v_mm_s / 1000.0
            } else {
                0.0
            };
            damping.include(b - required, x_mm);
        }
        if !first {
            between(table, i - 1, delta_mm, c);
        }
        if last {
            edge(table, i, range.x_mm[1].max(x_mm), delta_mm, c);
        }
        self.judged += 1;
    }

    /// The certificate, after the last node.
    pub fn finish(&self) -> Certificate {
        let mut c = self.so_far;
        let [positive, negative] = self.branches;
        [c.mass, c.damping] = positive;
        c.mass.include(negative[0].value, negative[0].at_mm);
        c.damping.include(negative[1].value, negative[1].at_mm);
        c
    }
}

impl Default for Certifier {
    fn default() -> Self {
        Self::new()
    }
}

/// Includes the range beyond the first or last node, up to `end`.
fn edge(table: &TableView<'_>, i: usize, end: f64, delta_mm: Option<f64>, c: &mut Certificate) {
    let gap = |x: f64| spring(&table.positive, i, x) - spring(&table.negative, i, x);
    c.include_gap(gap(table.x_mm[i]), table.x_mm[i], delta_mm);
    if end != table.x_mm[i] {
        c.include_gap(gap(end), end, delta_mm);
        for branch in [&table.positive, &table.negative] {
            c.include_stiffness(libm::fabs(branch.k_n_per_mm[i]));
        }
    }
}

fn node_fraction(counts: bool, nodes: usize) -> f64 {
    if counts { 0.5 / nodes as f64 } else { 0.0 }
}

fn spring(branch: &BranchView<'_>, i: usize, x: f64) -> f64 {
    branch.k_n_per_mm[i] * x + branch.f0_n[i]
}

/// Largest growth of m along the motion around node `i`, kg/mm.
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
            // With a direction state both branches contribute in either direction.
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

/// Includes S⁺ − S⁻ and |dS/dx| between node `i` and the next.
fn between(table: &TableView<'_>, i: usize, delta_mm: Option<f64>, c: &mut Certificate) {
    let (x, h) = (table.x_mm[i], table.x_mm[i + 1] - table.x_mm[i]);
    if table.lookup != Lookup::Linear {
        // S is linear between jumps; each node's line is evaluated at both ends.
        let reach = |x: f64, c: &mut Certificate| {
            for node in [i, i + 1] {
                let gap = spring(&table.positive, node, x) - spring(&table.negative, node, x);
                c.include_gap(gap, x, delta_mm);
            }
        };
        reach(x, c);
        reach(x + h, c);
        for branch in [&table.positive, &table.negative] {
            let line = |node: usize| spring(branch, node, x + h);
            if line(i) != line(i + 1) {
                c.include_stiffness(f64::INFINITY);
            }
            c.include_stiffness(libm::fabs(branch.k_n_per_mm[i]));
            c.include_stiffness(libm::fabs(branch.k_n_per_mm[i + 1]));
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
        c.include_stiffness(libm::fabs(p) / h);
        c.include_stiffness(libm::fabs(p + 2.0 * q) / h);
    }
    let [s, p, q] = [plus[0] - minus[0], plus[1] - minus[1], plus[2] - minus[2]];
    let gap = |t: f64| s + (p + q * t) * t;
    c.include_gap(gap(0.0), x, delta_mm);
    c.include_gap(gap(1.0), x + h, delta_mm);
    let vertex = -p / (2.0 * q);
    // false for NaN, the vertex of a constant
    if vertex > 0.0 && vertex < 1.0 {
        c.include_gap(gap(vertex), x + vertex * h, delta_mm);
    }
}

impl Certificate {
    /// Includes S⁺ − S⁻ at a position. From z = −1 to 1 the force changes by it, over δ.
    fn include_gap(&mut self, gap_n: f64, at_mm: f64, delta_mm: Option<f64>) {
        self.hysteresis.include(gap_n, at_mm);
        self.gap_n = self.gap_n.max(libm::fabs(gap_n));
        if let (Some(most), Some(delta_mm)) = (&mut self.state_n_per_mm, delta_mm) {
            let n_per_mm = libm::fabs(gap_n) / delta_mm;
            if n_per_mm > *most || n_per_mm.is_nan() {
                *most = n_per_mm;
            }
        }
    }

    /// The stiffness that a device has to render, N/mm: K and the change of the force
    /// over the direction state.
    pub fn rendered_n_per_mm(&self) -> f64 {
        self.stiffness_n_per_mm + self.state_n_per_mm.unwrap_or(0.0)
    }

    fn include_stiffness(&mut self, n_per_mm: f64) {
        if n_per_mm > self.stiffness_n_per_mm || n_per_mm.is_nan() {
            self.stiffness_n_per_mm = n_per_mm;
        }
    }

    /// Whether all three conditions hold.
    pub fn passes(&self) -> bool {
        self.conditions().iter().all(|(_, margin)| margin.holds())
    }

    /// Each condition with its margin.
    pub fn conditions(&self) -> [(Condition, Margin); 3] {
        [
            (Condition::Mass, self.mass),
            (Condition::Damping, self.damping),
            (Condition::Hysteresis, self.hysteresis),
        ]
    }

    /// Damping that the device itself needs to render the springs and dampers of this
    /// table at `rate_hz` with `delay` periods of delay, N·s/m.
    pub fn device_damping_n_s_per_m(&self, rate_hz: f64, delay: f64) -> f64 {
        spring_damping_n_s_per_m(self.rendered_n_per_mm(), rate_hz, delay)
            + 1000.0 * self.damping_n_s_per_mm
    }
}

/// Damping that the device itself needs to render a spring, K T (½ + n), N·s/m.
///
/// ```
/// # use study_wire::certificate::spring_damping_n_s_per_m;
/// // 2 N/mm at 4 kHz without delay: K T/2.
/// assert_eq!(spring_damping_n_s_per_m(2.0, 4000.0, 0.0), 0.25);
/// ```
pub fn spring_damping_n_s_per_m(stiffness_n_per_mm: f64, rate_hz: f64, delay: f64) -> f64 {
    1000.0 * stiffness_n_per_mm * (0.5 + delay) / rate_hz
}

impl fmt::Display for Certificate {
    /// `PASS` with all margins, or `FAIL` with the negative ones.
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
            let (value, unit, at_mm) = (margin.value, condition.unit(), margin.at_mm);
            match value.is_finite() {
                true => write!(f, "{before}{name} {value:.digits$} {unit} at {at_mm:.2} mm")?,
                false => write!(f, "{before}{name} has no bound at {at_mm:.2} mm")?,
            }
            before = ", ";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
