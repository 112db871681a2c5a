//! The normal equations of the reference model, by blocks of consecutive samples.

use super::instruments::Instruments;
use crate::identify::banded::Banded;
use crate::identify::vaf::motion;
use crate::recording::Recording;
use study_wire::predict::{Direction, DirectionState, Lookup, locate};

/// Blocks of consecutive samples that are left out in turn, over all recordings.
pub(super) const BLOCKS: usize = 20;
/// Weight of the squared second differences, in units of a node's mean information.
const RIDGE: f64 = 3e-3;
/// Share of a node's information that keeps unknowns at 0 where they are not excited.
const FLOOR: f64 = 1e-9;
/// Speeds below this share of the rms speed are low.
const LOW_SPEED: f64 = 0.2;
/// The weight of low speed above which a sample is slow: below √(ln 2) of the low speed.
const LOW: f64 = 0.5;
/// Unknowns beside the nodes: of acceleration, velocity, friction at low speed, and reversals.
pub(super) const BORDER: usize = 4;
/// Unknowns per node: C and D.
pub(super) const PER_NODE: usize = 2;
/// Half-bandwidth: second differences reach two nodes.
const HALF: usize = 2 * PER_NODE;
/// What is explained: force, acceleration, velocity.
pub(super) const SIGNALS: usize = 3;

/// One sample: the functions that explain, and what they explain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    left: usize,
    share: f64,
    z: f64,
    border: [f64; BORDER],
    /// Whether its speed is low.
    pub(super) slow: bool,
    /// Force, N, acceleration, m/s², velocity, mm/s.
    pub(super) signals: [f64; SIGNALS],
}

impl Row {
    fn entries(&self, nodes: usize) -> [(usize, f64); 2 * PER_NODE + BORDER] {
        let Self { share, z, .. } = *self;
        let (left, right, border) = (
            self.left * PER_NODE,
            (self.left + 1) * PER_NODE,
            nodes * PER_NODE,
        );
        [
            (left, 1.0 - share),
            (left + 1, z * (1.0 - share)),
            (right, share),
            (right + 1, z * share),
            (border, self.border[0]),
            (border + 1, self.border[1]),
            (border + 2, self.border[2]),
            (border + 3, self.border[3]),
        ]
    }

    /// The node that is nearest.
    pub(super) fn node(&self) -> usize {
        self.left + usize::from(self.share >= 0.5)
    }

    /// The value of the explaining functions with these factors.
    pub(super) fn times(&self, x: &[f64]) -> f64 {
        let nodes = (x.len() - BORDER) / PER_NODE;
        self.entries(nodes)
            .iter()
            .map(|(at, one)| one * x[*at])
            .sum()
    }
}

fn sign(a: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a.signum() }
}

/// How the direction state follows the motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    pub(super) direction: Direction,
    /// Samples, an odd number, over which it is averaged, as a low-pass of the force does.
    pub(super) smooth: usize,
}

impl Rule {
    /// With another length of the play; `None` for the sign.
    pub(super) fn scaled(self, factor: f64) -> Option<Self> {
        let direction = match self.direction {
            Direction::Play { delta_mm } => Direction::Play {
                delta_mm: factor * delta_mm,
            },
            Direction::Dahl { delta_mm } => Direction::Dahl {
                delta_mm: factor * delta_mm,
            },
            _ => return None,
        };
        Some(Self { direction, ..self })
    }
}

impl From<Direction> for Rule {
    fn from(direction: Direction) -> Self {
        Self {
            direction,
            smooth: 1,
        }
    }
}

/// Means of `width` samples, of fewer at the ends.
fn smoothed(values: &[f64], width: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    for value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    let mean = |i: usize| {
        let (from, to) = (
            i.saturating_sub(width / 2),
            (i + width / 2 + 1).min(values.len()),
        );
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Every sample of some recordings with a rule for the direction state, and with instruments.
pub(super) fn rows(
    recordings: &[&Recording],
    nodes: &[f64],
    rule: impl Into<Rule>,
    instruments: &[Instruments],
) -> Vec<Row> {
    let Rule { direction, smooth } = rule.into();
    let samples: usize = recordings.iter().map(|r| r.len()).sum();
    let squares = instruments.iter().flat_map(|of| &of.v).map(|v| v * v);
    let low_mm_s = LOW_SPEED * (squares.sum::<f64>() / samples as f64).sqrt();
    let mut rows = Vec::with_capacity(samples);
    for (recording, of) in recordings.iter().zip(instruments) {
        let mut state = DirectionState::default();
        let of_motion = |i: usize| state.step(direction, motion(recording, i));
        let states: Vec<f64> = (0..recording.len()).map(of_motion).collect();
        for (i, z) in smoothed(&states, smooth).into_iter().enumerate() {
            let motion = motion(recording, i);
            let (left, share) = locate(nodes, Lookup::Linear, motion.x_mm);
            let low = (-(of.v[i] / low_mm_s).powi(2)).exp();
            rows.push(Row {
                left,
                share,
                z,
                border: [of.a[i], of.v[i], low * z, low * sign(of.a[i])],
                slow: low > LOW,
                signals: [recording.f_n[i], motion.a_m_s2, motion.v_mm_s],
            });
        }
    }
    rows
}

/// The normal equations of some samples.
#[derive(Debug, Clone)]
pub(super) struct Block {
    pub(super) normal: Banded,
    /// For each signal.
    pub(super) right: [Vec<f64>; SIGNALS],
    /// Sums of squares of the signals.
    pub(super) square: [f64; SIGNALS],
}

impl Block {
    fn empty(nodes: usize) -> Self {
        let n = nodes * PER_NODE;
        Self {
            normal: Banded::bordered(n, HALF, BORDER),
            right: std::array::from_fn(|_| vec![0.0; n + BORDER]),
            square: [0.0; SIGNALS],
        }
    }

    fn add(&mut self, row: &Row, nodes: usize) {
        let entries = row.entries(nodes);
        for (k, (at, one)) in entries.iter().enumerate() {
            if *one == 0.0 {
                continue;
            }
            for (right, signal) in self.right.iter_mut().zip(row.signals) {
                right[*at] += one * signal;
            }
            for (column, other) in &entries[..=k] {
                self.normal.add(*at, *column, one * other);
            }
        }
        for (square, signal) in self.square.iter_mut().zip(row.signals) {
            *square += signal * signal;
        }
    }

    /// Adds `scale` times another block.
    fn add_scaled(&mut self, other: &Self, scale: f64) {
        self.normal.add_scaled(&other.normal, scale);
        for (sums, others) in self.right.iter_mut().zip(&other.right) {
            for (sum, one) in sums.iter_mut().zip(others) {
                *sum += scale * one;
            }
        }
        for (sum, one) in self.square.iter_mut().zip(other.square) {
            *sum += scale * one;
        }
    }

    /// The squared error of the force with these factors.
    pub(super) fn error(&self, x: &[f64]) -> f64 {
        let product = self.normal.times(x);
        let mixed = product.iter().zip(&self.right[0]).zip(x);
        self.square[0] + mixed.map(|((p, r), x)| x * (p - 2.0 * r)).sum::<f64>()
    }
}

/// The normal equations, by blocks and in total with the ridges.
#[derive(Debug)]
pub(super) struct Equations {
    blocks: Vec<Block>,
    pub(super) total: Block,
}

impl Equations {
    pub(super) fn of(rows: &[Row], nodes: usize) -> Self {
        let mut blocks = vec![Block::empty(nodes); BLOCKS];
        for (i, row) in rows.iter().enumerate() {
            blocks[i * BLOCKS / rows.len()].add(row, nodes);
        }
        let mut total = Block::empty(nodes);
        for block in &blocks {
            total.add_scaled(block, 1.0);
        }
        add_ridges(&mut total.normal, nodes, rows.len());
        Self { blocks, total }
    }

    /// Which unknowns are free: the kept ones of acceleration and velocity, and whether friction may
    /// be another one at low speed and at reversals.
    pub(super) fn free(&self, kept: [bool; 2], friction: [bool; 2]) -> Vec<bool> {
        let mut free = vec![true; self.total.right[0].len()];
        let first = free.len() - BORDER;
        free[first..first + 2].copy_from_slice(&kept);
        free[first + 2..].copy_from_slice(&friction);
        free
    }

    /// The factors of a signal (0: force, 1: acceleration, 2: velocity).
    pub(super) fn solve(&self, signal: usize, free: &[bool]) -> Option<Vec<f64>> {
        self.total.normal.solve(&self.total.right[signal], free)
    }

    /// The sum of the squared errors of the force in every block, predicted by the others.
    pub(super) fn error_left_out(&self, free: &[bool]) -> Option<f64> {
        (self.blocks.iter())
            .map(|block| {
                let mut rest = self.total.clone();
                rest.add_scaled(block, -1.0);
                Some(block.error(&rest.normal.solve(&rest.right[0], free)?))
            })
            .sum()
    }
}

fn add_ridges(normal: &mut Banded, nodes: usize, samples: usize) {
    let information = samples as f64 / nodes as f64;
    for friction in [2, 3] {
        let at = nodes * PER_NODE + friction;
        normal.add(at, at, FLOOR * samples as f64);
    }
    for node in 0..nodes {
        for p in 0..PER_NODE {
            let unknown = |back: usize| (node - back) * PER_NODE + p;
            normal.add(unknown(0), unknown(0), FLOOR * information);
            if node < 2 {
                continue;
            }
            let second = [(unknown(2), 1.0), (unknown(1), -2.0), (unknown(0), 1.0)];
            for (k, (row, one)) in second.iter().enumerate() {
                for (column, other) in &second[..=k] {
                    normal.add(*row, *column, RIDGE * information * one * other);
                }
            }
        }
    }
}
