//! The force of a realization: F = m·a + b·v + k·x + F0 with interpolated parameters.
//!
//! Nothing panics on a valid table: all slices have the same length of at least two, and
//! `x_mm` is strictly ascending.
//!
//! A direction state z in [−1, 1] combines the branches for the two directions:
//! F = (1+z)/2 · F⁺ + (1−z)/2 · F⁻. With [`Direction::Sign`] z is the sign of v, as
//! in Colton & Hollerbach (2007).

use crate::real::Real;

/// A table as borrowed slices.
#[derive(Debug, Clone, Copy)]
pub struct TableView<'a, R = f64> {
    /// Positions of the nodes, mm, strictly ascending.
    pub x_mm: &'a [R],
    /// Parameters for v > 0.
    pub positive: BranchView<'a, R>,
    /// Parameters for v < 0.
    pub negative: BranchView<'a, R>,
    /// Interpolation between nodes.
    pub lookup: Lookup,
}

/// The parameters of one direction as borrowed slices.
#[derive(Debug, Clone, Copy)]
pub struct BranchView<'a, R = f64> {
    /// Mass, kg.
    pub m_kg: &'a [R],
    /// Damping, N·s/mm.
    pub b_n_s_per_mm: &'a [R],
    /// Stiffness, N/mm.
    pub k_n_per_mm: &'a [R],
    /// Offset force, N.
    pub f0_n: &'a [R],
}

/// Interpolation of parameters between nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lookup {
    /// Linear interpolation.
    Linear,
    /// The values of the node to the left.
    Floor,
    /// The values of the nearest node, of the left one at the midpoint.
    Nearest,
}

impl Lookup {
    /// The node to use, and the weight of the next one, for a position between `left`
    /// and the next node; `weight` is the fraction of the way, in [0, 1).
    #[inline]
    pub fn between<R: Real>(self, left: usize, weight: R) -> (usize, R) {
        match self {
            Self::Linear => (left, weight),
            Self::Floor => (left, R::ZERO),
            Self::Nearest => (left + usize::from(weight > R::HALF), R::ZERO),
        }
    }

    /// Each look-up with its name in files, in the order of the codes on the wire.
    pub const NAMES: [(&'static str, Self); 3] = [
        ("linear", Self::Linear),
        ("floor", Self::Floor),
        ("nearest", Self::Nearest),
    ];

    /// The name in files.
    pub fn as_str(self) -> &'static str {
        Self::NAMES[self as usize].0
    }
}

/// Rule that gives the direction state z from the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Direction {
    /// The sign of v; at v = 0 the previous sign.
    Sign,
    /// z ← clip(z + 2Δx/δ, −1, 1).
    Play {
        /// δ, mm.
        delta_mm: f64,
    },
    /// z ← s + (z − s)·e^(−|Δx|/δ), s = sign(Δx).
    Dahl {
        /// δ, mm.
        delta_mm: f64,
    },
}

impl Direction {
    /// The name in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Sign => "sign",
            Self::Play { .. } => "play",
            Self::Dahl { .. } => "dahl",
        }
    }

    /// The rule with δ in another unit of length.
    pub fn scaled(self, by: f64) -> Self {
        match self {
            Self::Sign => Self::Sign,
            Self::Play { delta_mm } => Self::Play {
                delta_mm: delta_mm * by,
            },
            Self::Dahl { delta_mm } => Self::Dahl {
                delta_mm: delta_mm * by,
            },
        }
    }

    /// δ, mm, if the rule has one.
    pub fn delta_mm(self) -> Option<f64> {
        match self {
            Self::Sign => None,
            Self::Play { delta_mm } | Self::Dahl { delta_mm } => Some(delta_mm),
        }
    }
}

/// Position, velocity and acceleration at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion<R = f64> {
    /// Position, mm.
    pub x_mm: R,
    /// Velocity, mm/s.
    pub v_mm_s: R,
    /// Acceleration, m/s².
    pub a_m_s2: R,
}

impl<R: Real> Motion<R> {
    /// At rest at a position, mm.
    pub fn at_rest(x_mm: R) -> Self {
        Self {
            x_mm,
            v_mm_s: R::ZERO,
            a_m_s2: R::ZERO,
        }
    }

    /// In double precision.
    pub fn f64(&self) -> Motion {
        Motion {
            x_mm: self.x_mm.f64(),
            v_mm_s: self.v_mm_s.f64(),
            a_m_s2: self.a_m_s2.f64(),
        }
    }

    /// Whether all three are finite.
    pub fn is_finite(&self) -> bool {
        self.x_mm.is_finite() && self.v_mm_s.is_finite() && self.a_m_s2.is_finite()
    }
}

/// The direction state z with its memory of the last position.
///
/// ```
/// # use study_wire::predict::{Direction, DirectionState, Motion};
/// let mut state = DirectionState::new();
/// let rule = Direction::Play { delta_mm: 0.5 };
/// state.step(rule, Motion::at_rest(1.0));
/// // Half of δ back: between both directions.
/// assert_eq!(state.step(rule, Motion::at_rest(0.75)), 0.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionState<R = f64> {
    z: R,
    last_x_mm: Option<R>,
}

impl<R: Real> Default for DirectionState<R> {
    fn default() -> Self {
        Self::new()
    }
}

impl<R: Real> DirectionState<R> {
    /// z = 1, the positive direction, before any motion.
    pub const fn new() -> Self {
        Self {
            z: R::ONE,
            last_x_mm: None,
        }
    }

    /// Updates the state with the next motion and returns z in [−1, 1].
    pub fn step(&mut self, rule: Direction, motion: Motion<R>) -> R {
        let dx = self.last_x_mm.map_or(R::ZERO, |last| motion.x_mm - last);
        self.last_x_mm = Some(motion.x_mm);
        match rule {
            Direction::Sign => {
                if motion.v_mm_s > R::ZERO {
                    self.z = R::ONE;
                } else if motion.v_mm_s < R::ZERO {
                    self.z = -R::ONE;
                }
            }
            Direction::Play { delta_mm } => {
                let z = self.z + (dx + dx) / R::of(delta_mm);
                self.z = clamp(z, R::ONE);
            }
            Direction::Dahl { delta_mm } => {
                let s = if dx > R::ZERO {
                    R::ONE
                } else if dx < R::ZERO {
                    -R::ONE
                } else {
                    return self.z;
                };
                self.z = s + (self.z - s) * (-dx.abs() / R::of(delta_mm)).exp();
            }
        }
        self.z
    }
}

/// `value` limited to [−limit, limit]; a NaN is kept.
pub(crate) fn clamp<R: Real>(value: R, limit: R) -> R {
    if value > limit {
        limit
    } else if value < -limit {
        -limit
    } else {
        value
    }
}

/// The force of the table for direction z, N. Outside the nodes the parameters of the
/// first or last node apply at the actual position.
///
/// ```
/// # use study_wire::predict::{BranchView, Lookup, Motion, TableView, force_n};
/// // A spring of 0.2 N/mm about 15 mm, with 0.5 N of friction.
/// let none = &[0.0; 2][..];
/// let branch = |f0_n| BranchView { m_kg: none, b_n_s_per_mm: none, k_n_per_mm: &[0.2; 2], f0_n };
/// let (positive, negative) = (branch(&[-2.5; 2]), branch(&[-3.5; 2]));
/// let table = TableView { x_mm: &[0.0, 30.0], positive, negative, lookup: Lookup::Linear };
/// assert_eq!(force_n(&table, 1.0, Motion::at_rest(20.0)), 1.5);
/// assert_eq!(force_n(&table, -1.0, Motion::at_rest(20.0)), 0.5);
/// ```
pub fn force_n<R: Real>(table: &TableView<'_, R>, z: R, motion: Motion<R>) -> R {
    let (left, weight) = locate(table.x_mm, table.lookup, motion.x_mm);
    let plus = R::HALF * (R::ONE + z);
    let minus = R::HALF * (R::ONE - z);
    let mut force = R::ZERO;
    if plus > R::ZERO {
        force += plus * branch_force_n(&table.positive, left, weight, motion);
    }
    if minus > R::ZERO {
        force += minus * branch_force_n(&table.negative, left, weight, motion);
    }
    force
}

/// The table's mass, kg, and the force without it, N, for direction z: the force is
/// linear in the acceleration.
pub fn mass_and_force<R: Real>(table: &TableView<'_, R>, z: R, x_mm: R, v_mm_s: R) -> (R, R) {
    let (left, weight) = locate(table.x_mm, table.lookup, x_mm);
    let (mut mass_kg, mut force_n) = (R::ZERO, R::ZERO);
    for (branch, z) in [(&table.positive, z), (&table.negative, -z)] {
        let share = R::HALF * (R::ONE + z);
        if share > R::ZERO {
            let motion = Motion {
                x_mm,
                v_mm_s,
                a_m_s2: R::ZERO,
            };
            mass_kg += share * between(branch.m_kg, left, weight);
            force_n += share * branch_force_n(branch, left, weight, motion);
        }
    }
    (mass_kg, force_n)
}

/// A parameter at `weight` of the way from node `left` to the next.
#[inline]
pub(crate) fn between<R: Real>(parameter: &[R], left: usize, weight: R) -> R {
    if weight == R::ZERO {
        parameter[left]
    } else {
        parameter[left] + weight * (parameter[left + 1] - parameter[left])
    }
}

/// m a + b v + k x + F0 with each parameter interpolated separately.
fn branch_force_n<R: Real>(
    branch: &BranchView<'_, R>,
    left: usize,
    weight: R,
    motion: Motion<R>,
) -> R {
    let at = |parameter| between(parameter, left, weight);
    at(branch.m_kg) * motion.a_m_s2
        + at(branch.b_n_s_per_mm) * motion.v_mm_s
        + at(branch.k_n_per_mm) * motion.x_mm
        + at(branch.f0_n)
}

/// Index of the node to the left of x and the weight of the next node, in [0, 1).
/// Beyond the ends the parameters are constant.
///
/// ```
/// # use study_wire::predict::{Lookup, locate};
/// let nodes = [0.0, 2.0, 4.0];
/// assert_eq!(locate(&nodes, Lookup::Linear, 2.5), (1, 0.25));
/// assert_eq!(locate(&nodes, Lookup::Nearest, 3.5), (2, 0.0));
/// ```
pub fn locate<R: Real>(nodes: &[R], lookup: Lookup, x_mm: R) -> (usize, R) {
    let last = nodes.len() - 1;
    // `>` is false for NaN, which uses the first node.
    let inside = x_mm > nodes[0];
    if !inside {
        return (0, R::ZERO);
    }
    if x_mm >= nodes[last] {
        return (last, R::ZERO);
    }
    let left = nodes.partition_point(|node| *node <= x_mm) - 1;
    let weight = (x_mm - nodes[left]) / (nodes[left + 1] - nodes[left]);
    lookup.between(left, weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_node_changes_at_the_midpoint() {
        let at = |x_mm| locate(&[0.0, 1.0, 2.0], Lookup::Nearest, x_mm);
        assert_eq!([0.5, 0.51, 1.49].map(at), [(0, 0.0), (1, 0.0), (1, 0.0)]);
    }

    fn table(lookup: Lookup) -> ([f64; 3], [f64; 3], [f64; 3], Lookup) {
        ([0.0, 1.0, 2.0], [0.0, 2.0, 0.0], [0.0; 3], lookup)
    }

    fn force(lookup: Lookup, z: f64, x_mm: f64) -> f64 {
        let (x, f0, zero, lookup) = table(lookup);
        let negative = [10.0; 3];
        let branch = |f0_n| BranchView {
            m_kg: &zero,
            b_n_s_per_mm: &zero,
            k_n_per_mm: &zero,
            f0_n,
        };
        let view = TableView {
            x_mm: &x,
            positive: branch(&f0),
            negative: branch(&negative),
            lookup,
        };
        force_n(
            &view,
            z,
            Motion {
                x_mm,
                v_mm_s: 0.0,
                a_m_s2: 0.0,
            },
        )
    }

    #[test]
    fn look_ups_differ_only_between_nodes() {
        for lookup in [Lookup::Linear, Lookup::Floor, Lookup::Nearest] {
            assert_eq!(force(lookup, 1.0, 1.0), 2.0);
            assert_eq!(force(lookup, 1.0, -5.0), 0.0);
            assert_eq!(force(lookup, 1.0, 9.0), 0.0);
        }
        assert_eq!(force(Lookup::Linear, 1.0, 0.75), 1.5);
        assert_eq!(force(Lookup::Floor, 1.0, 0.75), 0.0);
        assert_eq!(force(Lookup::Nearest, 1.0, 0.75), 2.0);
    }

    #[test]
    fn the_direction_blends_the_branches() {
        assert_eq!(force(Lookup::Linear, 0.0, 1.0), 6.0);
        assert_eq!(force(Lookup::Linear, -1.0, 1.0), 10.0);
    }

    /// The masses of both directions are blended; the servo limits the result.
    #[test]
    fn mass_and_force_are_the_parts_of_the_force() {
        let (x, f0, zero, lookup) = table(Lookup::Linear);
        let (light, heavy, negative) = ([-0.2, -0.2, 0.1], [0.4; 3], [10.0; 3]);
        let branch = |m_kg, f0_n| BranchView {
            m_kg,
            b_n_s_per_mm: &f0,
            k_n_per_mm: &zero,
            f0_n,
        };
        let view = TableView {
            x_mm: &x,
            positive: branch(&light, &f0),
            negative: branch(&heavy, &negative),
            lookup,
        };
        for z in [-1.0, -0.3, 0.0, 0.4, 1.0] {
            let (mass_kg, rest_n) = mass_and_force(&view, z, 0.75, 20.0);
            let motion = Motion {
                x_mm: 0.75,
                v_mm_s: 20.0,
                a_m_s2: -3.0,
            };
            let whole_n = force_n(&view, z, motion);
            assert!((mass_kg * -3.0 + rest_n - whole_n).abs() < 1e-12, "{z}");
            let blended_kg = 0.5 * (1.0 + z) * -0.2 + 0.5 * (1.0 - z) * 0.4;
            assert!((mass_kg - blended_kg).abs() < 1e-12, "{z}");
        }
    }

    #[test]
    fn at_rest_the_sign_is_kept_and_play_follows_the_distance() {
        let motion = |x_mm, v_mm_s| Motion {
            x_mm,
            v_mm_s,
            a_m_s2: 0.0,
        };
        let mut state = DirectionState::default();
        assert_eq!(state.step(Direction::Sign, motion(0.0, 0.0)), 1.0);
        assert_eq!(state.step(Direction::Sign, motion(0.0, -1.0)), -1.0);
        assert_eq!(state.step(Direction::Sign, motion(0.0, 0.0)), -1.0);

        let play = Direction::Play { delta_mm: 0.5 };
        let mut state = DirectionState::default();
        state.step(play, motion(1.0, 0.0));
        assert!((state.step(play, motion(0.75, 0.0)) - 0.0).abs() < 1e-12);
        assert_eq!(state.step(play, motion(0.0, 0.0)), -1.0);
    }

    #[test]
    fn a_position_that_is_not_finite_uses_the_edge() {
        let (x, ..) = table(Lookup::Linear);
        for lookup in [Lookup::Linear, Lookup::Floor, Lookup::Nearest] {
            assert_eq!(locate(&x, lookup, f64::NAN), (0, 0.0));
            assert_eq!(locate(&x, lookup, f64::NEG_INFINITY), (0, 0.0));
            assert_eq!(locate(&x, lookup, f64::INFINITY), (2, 0.0));
        }
        // The force is NaN as well, and the servo trips.
        assert!(force(Lookup::Linear, 1.0, f64::NAN).is_nan());
    }
}
