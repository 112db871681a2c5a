//! The passive table: a hat table that meets the certificate by construction.
//!
//! F = m a + Σ_j h_j(x) (b±_j v (1 ± z)/2 + C_j + z D_j) with one mass m ≥ 0, b±_j ≥ 0 and
//! D_j ≥ 0. A mass that changes neither with x nor with the direction needs no damping,
//! and S⁺ − S⁻ = 2 D: the three conditions of the certificate are the bounds. The derivation is
//! in `docs/estimators.md`.
//!
//! The cost is the squared error plus, in units of a node's mean information, ridges on
//! the second differences of C and D and on the first differences of b±, multiplied by
//! the rms speed, so that all of them are forces and no weight depends on a unit.

use super::banded::{Banded, Bound};
use super::hat::HatTable;
use super::method::Terms;
use super::samples::{Weights, weight_of};
use super::vaf::motion;
use crate::recording::Recording;
use study_wire::predict::{Direction, DirectionState, Lookup, locate};

/// Unknowns per node: C, D, b in + and in −.
const PER_NODE: usize = 4;
/// Half-bandwidth: second differences reach two nodes.
const HALF: usize = 2 * PER_NODE;
/// Share of a node's information that keeps unknowns at 0 where they are not excited.
const FLOOR: f64 = 1e-12;

/// Weights of the penalties, and the terms that the table has.
#[derive(Debug, Clone, Copy)]
pub(super) struct Penalty {
    pub(super) ridge_force: f64,
    pub(super) ridge_damping: f64,
    pub(super) terms: Terms,
}

/// The table of least cost; `None` if recordings and ridges leave it undetermined.
pub(super) fn table(
    recordings: &[&Recording],
    nodes: &[f64],
    lookup: Lookup,
    rule: Direction,
    penalty: Penalty,
    weights: Weights<'_>,
) -> Option<HatTable> {
    let n = nodes.len() * PER_NODE;
    let mass = n;
    let mut normal = Banded::bordered(n, HALF, 1);
    let mut right = vec![0.0; n + 1];
    let mut weight = vec![[0.0; 2]; nodes.len()];
    let (mut samples, mut speed) = (0.0, 0.0);
    for (r, recording) in recordings.iter().enumerate() {
        let mut state = DirectionState::default();
        for i in 0..recording.len() {
            let motion = motion(recording, i);
            let z = state.step(rule, motion);
            let trust = weight_of(weights, r, i);
            if trust == 0.0 {
                continue;
            }
            let sides = [0.5 * (1.0 + z), 0.5 * (1.0 - z)];
            let (left, share) = locate(nodes, lookup, motion.x_mm);
            let mut entries = [(0, 0.0); 2 * PER_NODE + 1];
            let mut used = 0;
            for (node, hat) in [(left, 1.0 - share), (left + 1, share)] {
                if hat == 0.0 {
                    continue;
                }
                let v = motion.v_mm_s;
                for (p, value) in [1.0, z, v * sides[0], v * sides[1]].into_iter().enumerate() {
                    entries[used] = (node * PER_NODE + p, hat * value);
                    used += 1;
                }
                for (of_side, part) in weight[node].iter_mut().zip(sides) {
                    *of_side += trust * hat * part;
                }
            }
            entries[used] = (mass, motion.a_m_s2);
            let entries = &entries[..=used];
            for (k, (row, one)) in entries.iter().enumerate() {
                right[*row] += trust * one * recording.f_n[i];
                for (column, other) in &entries[..=k] {
                    normal.add(*row, *column, trust * one * other);
                }
            }
            samples += trust;
            speed += trust * motion.v_mm_s * motion.v_mm_s;
        }
    }
    let information = samples / nodes.len() as f64;
    let mean_square = (speed / samples).max(f64::MIN_POSITIVE);
    add_ridges(&mut normal, nodes.len(), information, mean_square, penalty);
    let terms = penalty.terms;
    let of_node = [
        Bound::Free,
        Bound::NotNegative,
        Bound::of_term(terms.b),
        Bound::of_term(terms.b),
    ];
    let mut bounds = of_node.repeat(nodes.len());
    bounds.push(Bound::of_term(terms.m));
    normal.add(mass, mass, FLOOR * samples);
    let x = normal.solve_bounded(&right, &bounds)?;
    if !x.iter().all(|value| value.is_finite()) {
        return None;
    }
    let m = x[mass].max(0.0);
    let side = |sign: f64, b: usize| {
        let of = |node: &[f64]| [m, node[b].max(0.0), 0.0, node[0] + sign * node[1]];
        x[..n].chunks_exact(PER_NODE).map(of).collect()
    };
    Some(HatTable {
        positive: side(1.0, 2),
        negative: side(-1.0, 3),
        weight,
    })
}

fn add_ridges(
    normal: &mut Banded,
    nodes: usize,
    information: f64,
    speed_squared: f64,
    penalty: Penalty,
) {
    let mut add = |at: &[(usize, f64)], weight: f64| {
        for (k, (row, one)) in at.iter().enumerate() {
            for (column, other) in &at[..=k] {
                normal.add(*row, *column, weight * one * other);
            }
        }
    };
    // the squares of C + D and C − D sum to twice those of C and D
    let on_force = 2.0 * information * penalty.ridge_force;
    let on_damping = information * penalty.ridge_damping * speed_squared;
    for j in 0..nodes {
        for p in 0..PER_NODE {
            let unknown = |back: usize| (j - back) * PER_NODE + p;
            let scale = if p < 2 { 1.0 } else { speed_squared };
            add(&[(unknown(0), 1.0)], information * FLOOR * scale);
            if p < 2 && j > 1 {
                let second = [(unknown(2), 1.0), (unknown(1), -2.0), (unknown(0), 1.0)];
                add(&second, on_force);
            }
            if p >= 2 && j > 0 {
                add(&[(unknown(1), -1.0), (unknown(0), 1.0)], on_damping);
            }
        }
    }
}
