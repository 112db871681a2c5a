//! Sums over the samples of the recordings, from which every choice of springs is solved.

use super::Penalty;
use super::start::{Starts, entering, follow_one};
use crate::identify::Training;
use crate::identify::banded::{Banded, Bound};
use crate::identify::samples::weight_of;
use crate::model::Elements;
use study_wire::elements::Spring;
use study_wire::predict::{Lookup, locate};

/// Columns per node beside those of the springs: C, and the damping for v > 0 and v < 0.
const OWN: usize = 3;
/// Share of a node's information that keeps unknowns at 0 where they are not excited.
const FLOOR: f64 = 1e-9;
/// Share of a recording after which it does not matter how springs that relax entered it.
const FADED: f64 = 0.15;

/// The products of all columns and of the force with each other. A sample lies between two nodes,
/// so only neighbors have products.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    nodes: Vec<f64>,
    springs: Vec<Spring>,
    /// Products of the columns of a node, the later with the earlier, and with those of the next one.
    own: Vec<f64>,
    next: Vec<f64>,
    /// Products with the acceleration and with the force.
    mass: Vec<f64>,
    right: Vec<f64>,
    mass_mass: f64,
    mass_right: f64,
    force_force: f64,
    samples: f64,
    /// Σ of the squares of a column over all nodes.
    squares: Vec<f64>,
}

/// A solution with its squared error, N².
#[derive(Debug, Clone)]
pub(super) struct Solved {
    pub(super) elements: Elements,
    pub(super) square: f64,
}

/// Calls `visit` with recording, sample and z of all springs, of every sample whose weight
/// is not 0, with the weight. Without `starts` springs that relax enter without force, and the
/// first [`FADED`] of a recording is not visited.
pub(super) fn follow(
    training: &Training<'_>,
    springs: &[Spring],
    starts: Option<&Starts>,
    every: usize,
    mut visit: impl FnMut(usize, usize, &[f64], f64),
) {
    for (r, recording) in training.recordings.iter().enumerate() {
        let start = match starts {
            Some(starts) => starts[r].clone(),
            None => entering(springs, recording),
        };
        let unknown_s = match starts {
            Some(_) => 0.0,
            None => FADED * recording.duration_s(),
        };
        let first = (recording.t_s).partition_point(|t_s| *t_s < recording.t_s[0] + unknown_s);
        follow_one(recording, springs, &start, |i, z| {
            let weight = weight_of(training.weights.as_deref(), r, i);
            if i >= first && weight != 0.0 && i % every == 0 {
                visit(r, i, z, weight);
            }
        });
    }
}

impl Sums {
    pub(super) fn of(
        training: &Training<'_>,
        nodes: &[f64],
        springs: &[Spring],
        starts: Option<&Starts>,
        every: usize,
    ) -> Self {
        let p = OWN + springs.len();
        let mut sums = Self {
            nodes: nodes.to_vec(),
            springs: springs.to_vec(),
            own: vec![0.0; nodes.len() * p * p],
            next: vec![0.0; nodes.len() * p * p],
            mass: vec![0.0; nodes.len() * p],
            right: vec![0.0; nodes.len() * p],
            mass_mass: 0.0,
            mass_right: 0.0,
            force_force: 0.0,
            samples: 0.0,
            squares: vec![0.0; p],
        };
        let mut column = vec![0.0; p];
        follow(training, springs, starts, every, |r, i, z, weight| {
            let recording = training.recordings[r];
            let outside = !(nodes[0]..=nodes[nodes.len() - 1]).contains(&recording.x_mm[i]);
            if outside && starts.is_none() {
                return;
            }
            let (v, a, f) = (recording.v_mm_s[i], recording.a_m_s2[i], recording.f_n[i]);
            column[0] = 1.0;
            column[1] = v.max(0.0);
            column[2] = v.min(0.0);
            column[OWN..].copy_from_slice(z);
            let (left, share) = locate(nodes, Lookup::Linear, recording.x_mm[i]);
            sums.add(left, share, &column, [a, f], weight);
        });
        sums
    }

    fn add(&mut self, left: usize, share: f64, column: &[f64], [a, f]: [f64; 2], weight: f64) {
        let p = column.len();
        let hats = [1.0 - share, share];
        for (j, one) in column.iter().enumerate() {
            self.squares[j] += weight * one * one;
            for (k, other) in column.iter().enumerate() {
                let product = weight * one * other;
                let at = (left * p + j) * p + k;
                if k <= j {
                    self.own[at] += hats[0] * hats[0] * product;
                }
                if share > 0.0 {
                    if k <= j {
                        self.own[at + p * p] += hats[1] * hats[1] * product;
                    }
                    self.next[at] += hats[0] * hats[1] * product;
                }
            }
            for (node, hat) in [(left, hats[0]), (left + 1, hats[1])] {
                if hat > 0.0 {
                    self.mass[node * p + j] += weight * hat * one * a;
                    self.right[node * p + j] += weight * hat * one * f;
                }
            }
        }
        self.mass_mass += weight * a * a;
        self.mass_right += weight * a * f;
        self.force_force += weight * f * f;
        self.samples += weight;
    }

    /// The elements of least cost with some of the springs, by their ascending indices; `None` if recordings
    /// and ridges leave them undetermined.
    pub(super) fn solve(&self, kept: &[usize], penalty: Penalty) -> Option<Solved> {
        let (p, nodes) = (self.squares.len(), self.nodes.len());
        let columns: Vec<usize> = (0..OWN).chain(kept.iter().map(|k| OWN + k)).collect();
        let q = columns.len();
        let n = nodes * q;
        let mut normal = Banded::bordered(n, 2 * q, 1);
        let mut right = vec![0.0; n + 1];
        for node in 0..nodes {
            for (j, column) in columns.iter().enumerate() {
                let row = node * q + j;
                right[row] = self.right[node * p + column];
                normal.add(n, row, self.mass[node * p + column]);
                for (k, other) in columns.iter().enumerate() {
                    let at = (node * p + column) * p + other;
                    if k <= j {
                        normal.add(row, node * q + k, self.own[at]);
                    }
                    if node + 1 < nodes {
                        normal.add((node + 1) * q + k, row, self.next[at]);
                    }
                }
            }
        }
        normal.add(n, n, self.mass_mass);
        right[n] = self.mass_right;
        let plain = normal.clone();
        self.add_ridges(&mut normal, &columns, penalty);
        normal.add(n, n, FLOOR * self.mass_mass.max(f64::MIN_POSITIVE));
        let mut bounds = Vec::with_capacity(n + 1);
        for node in 0..nodes {
            let damping = Bound::of_term(penalty.terms.b);
            bounds.extend([Bound::Free, damping, damping]);
            bounds.extend(kept.iter().map(|k| self.reach(*k, node)));
        }
        bounds.push(Bound::of_term(penalty.terms.m));
        let x = normal.solve_bounded(&right, &bounds)?;
        if !x.iter().all(|value| value.is_finite()) {
            return None;
        }
        let product = plain.times(&x);
        let square = self.force_force
            + (x.iter().zip(&product).zip(&right))
                .map(|((x, product), right)| x * (product - 2.0 * right))
                .sum::<f64>();
        let profile = |j: usize| -> Vec<f64> {
            let not_negative = |value: f64| if j == 0 { value } else { value.max(0.0) };
            (0..nodes)
                .map(|node| not_negative(x[node * q + j]))
                .collect()
        };
        Some(Solved {
            elements: Elements {
                mass_kg: x[n].max(0.0),
                x_mm: self.nodes.clone(),
                force_n: profile(0),
                damping_n_s_per_mm: [profile(1), profile(2)],
                springs: kept.iter().map(|k| self.springs[*k]).collect(),
                spring_n: (0..kept.len()).map(|k| profile(OWN + k)).collect(),
            },
            square: square.max(0.0),
        })
    }

    /// A latch has no force where it cannot be told from the potential: below its lower end and
    /// above its upper one.
    fn reach(&self, spring: usize, node: usize) -> Bound {
        let Spring::Latch { rearm_mm, break_mm } = self.springs[spring] else {
            return Bound::NotNegative;
        };
        let x = |node: usize| self.nodes[node.min(self.nodes.len() - 1)];
        let inside = x(node + 1) > rearm_mm && x(node.saturating_sub(1)) < break_mm;
        Bound::of_term(inside)
    }

    /// On second differences of all forces and first differences of the damping. A column is
    /// weighted by its mean square, so that all ridges are on forces.
    fn add_ridges(&self, normal: &mut Banded, columns: &[usize], penalty: Penalty) {
        let q = columns.len();
        let information = self.samples / self.nodes.len() as f64;
        let mut add = |at: &[(usize, f64)], weight: f64| {
            for (k, (row, one)) in at.iter().enumerate() {
                for (column, other) in &at[..=k] {
                    normal.add(*row, *column, weight * one * other);
                }
            }
        };
        for (j, column) in columns.iter().enumerate() {
            let mean_square = (self.squares[*column] / self.samples).max(f64::MIN_POSITIVE);
            let damping = (1..OWN).contains(column);
            // both directions share the speed of all samples
            let scale = information * mean_square * if damping { 2.0 } else { 1.0 };
            for node in 0..self.nodes.len() {
                let unknown = |back: usize| (node - back) * q + j;
                add(&[(unknown(0), 1.0)], FLOOR * scale);
                if damping && node > 0 {
                    let first = [(unknown(1), -1.0), (unknown(0), 1.0)];
                    add(&first, scale * penalty.ridge_damping);
                } else if !damping && node > 1 {
                    let second = [(unknown(2), 1.0), (unknown(1), -2.0), (unknown(0), 1.0)];
                    add(&second, 2.0 * scale * penalty.ridge_force);
                }
            }
        }
    }
}
