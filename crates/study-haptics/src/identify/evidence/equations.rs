//! The normal equations of the reference model, by blocks of consecutive samples.

use super::instruments::Instruments;
use crate::identify::banded::Banded;
use crate::identify::vaf::motion;
use crate::recording::{Recording, range};
use study_wire::predict::{Direction, DirectionState, Lookup, locate};

/// Blocks of consecutive samples that are left out in turn, over all recordings.
pub(super) const BLOCKS: usize = 20;
/// Lengths of the play that are tried, as shares of the travel.
const DELTAS: [f64; 6] = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
/// Most nodes of the reference model.
const MOST_NODES: usize = 200;
/// Weight of the squared second differences, in units of a node's mean information.
const RIDGE: f64 = 3e-3;
/// Share of a node's information that keeps unknowns at 0 where they are not excited.
const FLOOR: f64 = 1e-9;
/// Speeds below this share of the rms speed are low.
const LOW_SPEED: f64 = 0.2;
/// The weight of low speed above which a sample is slow: below √(ln 2) of the low speed.
const LOW: f64 = 0.5;
/// The first of the unknowns beside the nodes that belong to plays of other lengths.
pub(super) const OTHER_LENGTHS: usize = 4;
/// Unknowns beside the nodes: of acceleration, velocity, friction at low speed, reversals, and plays of [`DELTAS`].
pub(super) const BORDER: usize = OTHER_LENGTHS + DELTAS.len();
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
    /// What stands for acceleration and velocity, friction at low speed, what happens at reversals there, and plays of other lengths.
    pub(super) border: [f64; BORDER],
    /// Whether its speed is low.
    pub(super) slow: bool,
    /// Force, N, acceleration, m/s², velocity, mm/s.
    pub(super) signals: [f64; SIGNALS],
}

impl Row {
    /// The sample `i` with its direction state and what is low speed, with what stands for acceleration and velocity, and with plays
    /// of other lengths.
    fn new(
        recording: &Recording,
        i: usize,
        nodes: &[f64],
        (z, low_mm_s): (f64, f64),
        [a, v]: [f64; 2],
        plays: [f64; DELTAS.len()],
    ) -> Self {
        let (left, share) = locate(nodes, Lookup::Linear, recording.x_mm[i]);
        let low = (-(v / low_mm_s).powi(2)).exp();
        let sign = if a == 0.0 { 0.0 } else { a.signum() };
        let mut border = [0.0; BORDER];
        border[..OTHER_LENGTHS].copy_from_slice(&[a, v, low * z, low * sign]);
        border[OTHER_LENGTHS..].copy_from_slice(&plays);
        Self {
            left,
            share,
            z,
            border,
            slow: low > LOW,
            signals: [recording.f_n[i], recording.a_m_s2[i], recording.v_mm_s[i]],
        }
    }

    /// With one node C and D are the same everywhere.
    fn entries(&self, nodes: usize) -> [(usize, f64); 2 * PER_NODE + BORDER] {
        let z = self.z;
        let border = nodes * PER_NODE;
        let (left, right, share) = match nodes {
            1 => (0, 0, 0.0),
            _ => (self.left * PER_NODE, (self.left + 1) * PER_NODE, self.share),
        };
        let mut entries = [(0, 0.0); 2 * PER_NODE + BORDER];
        let (of_nodes, beside) = entries.split_at_mut(2 * PER_NODE);
        of_nodes.copy_from_slice(&[
            (left, 1.0 - share),
            (left + 1, z * (1.0 - share)),
            (right, share),
            (right + 1, z * share),
        ]);
        for (k, (entry, one)) in beside.iter_mut().zip(self.border).enumerate() {
            *entry = (border + k, one);
        }
        entries
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

/// How the direction state follows the motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    pub(super) direction: Direction,
    /// Samples, an odd number, over which it is averaged, as a low-pass of the force does.
    pub(super) smooth: usize,
    /// Whether plays of other lengths, whose force is the same everywhere, are beside it.
    pub(super) other_lengths: bool,
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

/// All positions.
pub(super) const EVERYWHERE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Every sample of some recordings with a rule for the direction state, and with functions of time in the place of acceleration and
/// velocity, one for each recording: instruments, or acceleration and velocity themselves. Only samples `within_mm` count, but the state follows the motion beyond.
pub(super) fn rows(
    recordings: &[&Recording],
    (nodes, within_mm): (&[f64], [f64; 2]),
    rule: Rule,
    instruments: &[Instruments],
) -> Vec<Row> {
    let low_mm_s = low_speed(instruments.iter().flat_map(|of| &of.v));
    let mut rows = Vec::new();
    for (recording, of) in recordings.iter().zip(instruments) {
        let states = |direction: Direction| {
            let mut state = DirectionState::default();
            let of_motion = |i: usize| state.step(direction, motion(recording, i));
            let states: Vec<f64> = (0..recording.len()).map(of_motion).collect();
            smoothed(&states, rule.smooth)
        };
        let smoothed = states(rule.direction);
        let plays = match rule.other_lengths {
            true => plays(range(nodes)).map(states).to_vec(),
            false => Vec::new(),
        };
        let row = |(i, z)| {
            let mut at = [0.0; DELTAS.len()];
            for (at, states) in at.iter_mut().zip(&plays) {
                *at = states[i];
            }
            let derivatives = [of.a[i], of.v[i]];
            Row::new(recording, i, nodes, (z, low_mm_s), derivatives, at)
        };
        let counts = |(i, _): &(usize, f64)| {
            let x_mm = recording.x_mm[*i];
            within_mm[0] <= x_mm && x_mm <= within_mm[1]
        };
        rows.extend(smoothed.into_iter().enumerate().filter(counts).map(row));
    }
    rows
}

/// The rows of [`rows`] with acceleration and velocity themselves, one after the other: recordings may be long.
pub(super) fn plain_rows(
    recordings: &[&Recording],
    nodes: &[f64],
    rule: Direction,
) -> impl Iterator<Item = Row> {
    let low_mm_s = low_speed(recordings.iter().flat_map(|r| &r.v_mm_s));
    recordings.iter().flat_map(move |recording| {
        let mut state = DirectionState::default();
        (0..recording.len()).map(move |i| {
            let motion = motion(recording, i);
            let z = state.step(rule, motion);
            let derivatives = [motion.a_m_s2, motion.v_mm_s];
            let none = [0.0; DELTAS.len()];
            Row::new(recording, i, nodes, (z, low_mm_s), derivatives, none)
        })
    })
}

/// Speeds below this are low, mm/s.
fn low_speed<'v>(speeds: impl Iterator<Item = &'v f64>) -> f64 {
    let (sum, count) = speeds.fold((0.0, 0_usize), |(sum, n), v| (sum + v * v, n + 1));
    LOW_SPEED * (sum / count as f64).sqrt()
}

/// Plays of all lengths.
fn plays([low, high]: [f64; 2]) -> [Direction; DELTAS.len()] {
    DELTAS.map(|share| Direction::Play {
        delta_mm: share * (high - low),
    })
}

/// The rules for the direction state that are tried at first.
pub(super) fn directions([low, high]: [f64; 2]) -> impl Iterator<Item = Direction> {
    let of = move |share: &f64| {
        let delta_mm = share * (high - low);
        [Direction::Play { delta_mm }, Direction::Dahl { delta_mm }]
    };
    DELTAS.iter().flat_map(of).chain([Direction::Sign])
}

/// Equally spaced nodes, at most as far apart as the scale on which detents are looked for.
pub(super) fn nodes(recordings: &[&Recording], [low, high]: [f64; 2]) -> Vec<f64> {
    let scale_mm = recordings[0].scale_mm();
    let count = ((high - low) / scale_mm)
        .ceil()
        .clamp(2.0, MOST_NODES as f64);
    (0..=count as usize)
        .map(|i| low + (high - low) * i as f64 / count)
        .collect()
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
    pub(super) blocks: Vec<Block>,
    pub(super) total: Block,
}

impl Equations {
    /// Of `samples` rows.
    pub(super) fn of(rows: impl Iterator<Item = Row>, samples: usize, nodes: usize) -> Self {
        let mut blocks = vec![Block::empty(nodes); BLOCKS];
        for (i, row) in rows.enumerate() {
            blocks[i * BLOCKS / samples].add(&row, nodes);
        }
        let mut total = Block::empty(nodes);
        for block in &blocks {
            total.add_scaled(block, 1.0);
        }
        add_ridges(&mut total.normal, nodes, samples);
        Self { blocks, total }
    }

    /// Which unknowns are free: the kept ones of acceleration and velocity, and whether friction may
    /// be another one at low speed and at reversals. Plays of other lengths are, if there are any.
    pub(super) fn free(&self, kept: [bool; 2], friction: [bool; 2]) -> Vec<bool> {
        let mut free = vec![true; self.total.right[0].len()];
        let first = free.len() - BORDER;
        free[first..first + 2].copy_from_slice(&kept);
        free[first + 2..first + OTHER_LENGTHS].copy_from_slice(&friction);
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
    for friction in 2..BORDER {
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
