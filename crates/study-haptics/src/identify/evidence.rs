//! Which terms a recording carries: whether mass and damping predict force on data left out.
//!
//! The question is asked of a reference model with one mass and one damping,
//!
//! ```text
//! F = Σ_j h_j(x) (C_j + z D_j) + b v + m a + s z exp(−(5 v / v_rms)²)
//! ```
//!
//! with the hat functions h_j, the direction state z that fits best (the sign of v, or play or Dahl of several lengths)
//! and a ridge on the second differences of C and D. It is linear, and its normal equations are sums over blocks of consecutive samples, so that leaving a
//! block out is a subtraction. A term is carried if
//!
//! * its regressor, after everything that the other terms explain is removed, varies by more than
//!   its own noise: the reliability κ = 1 − n σ² / S is at least [`LEAST_RELIABILITY`], with S the
//!   remaining sum of squares and σ² the noise of single samples, from third differences;
//! * its estimate is above [`LEAST_RATIO`] standard errors, which come from the sums over the
//!   blocks and therefore allow for errors that are correlated within a block;
//! * the blocks are predicted better with it than without it when they are left out.
//!
//! The last column of the model takes what friction does at low speed, and what an encoder makes of
//! the sign of v there: without it dry friction appears as damping. How much is not known, so that
//! the difference between the estimates with and without the column counts as an error in the bound.
//!
//! Quantization is well conditioned noise: a condition number does not see it, these do. A term that
//! is not carried has the upper bound (max(θ, 0) + 2.33 s) / κ, which the truth stays below with a
//! confidence of 99 %, and of which twice is found in 90 % of repetitions. It is computed from
//! averages of 1, 2, 4, … consecutive samples, the fewest whose κ suffices: slow motions that single
//! samples drown in noise still bound a term.
//!
//! Reference for κ: Fuller, Measurement Error Models, 1987, section 1.1; for the standard
//! errors: Liang & Zeger 1986, Biometrika 73:13.

pub mod lag;

use super::banded::Banded;
use super::vaf::motion;
use crate::recording::{Recording, acceleration, velocity};
use std::fmt;
use study_wire::predict::{Direction, DirectionState, Lookup, locate};

/// Least reliability of a regressor.
pub const LEAST_RELIABILITY: f64 = 0.8;
/// Least ratio of an estimate to its standard error.
pub const LEAST_RATIO: f64 = 3.0;
/// Blocks of consecutive samples that are left out in turn, over all recordings.
const BLOCKS: usize = 20;
/// Lengths of the play that are tried, as shares of the travel.
const DELTAS: [f64; 6] = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
/// Weight of the squared second differences, in units of a node's mean information.
const RIDGE: f64 = 3e-3;
/// Share of a node's information that keeps unknowns at 0 where they are not excited.
const FLOOR: f64 = 1e-9;
/// Quantile of the normal distribution of the one-sided bound of 99 %.
const ONE_SIDED: f64 = 2.326;
/// Fewest samples per unknown of averages that bound a term.
const SAMPLES_PER_UNKNOWN: usize = 3;
/// Most nodes of the reference model.
const MOST_NODES: usize = 200;
/// Speeds below this share of the rms speed are low.
const LOW_SPEED: f64 = 0.2;
/// White noise has at most this ratio of variances over two samples and over one.
const WHITE: f64 = 1.5;
/// Unknowns beside the nodes: m, b, s.
const BORDER: usize = 3;
/// Unknowns per node: C and D.
const PER_NODE: usize = 2;
/// Half-bandwidth: second differences reach two nodes.
const HALF: usize = 2 * PER_NODE;

study_base::named! {
    /// A term of a realization that a recording may not carry.
    Term {
        /// The mass, kg.
        Mass = "mass",
        /// The damping, N·s/mm.
        Damping = "damping",
    }
}

impl Term {
    /// Mass and damping, in the order of the unknowns.
    const BOTH: [Self; 2] = [Self::Mass, Self::Damping];

    /// The unit of its values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Mass => "kg",
            Self::Damping => "N·s/mm",
        }
    }

    /// What it is multiplied by.
    pub fn regressor(self) -> &'static str {
        match self {
            Self::Mass => "acceleration",
            Self::Damping => "velocity",
        }
    }

    /// `value` in kg or N·s/mm, as a person would write it.
    pub fn shown(self, value: f64) -> String {
        match self {
            Self::Mass if value < 1.0 => format!("{:.2} g", 1e3 * value),
            Self::Mass => format!("{value:.2} kg"),
            Self::Damping => format!("{value:.2e} N·s/mm"),
        }
    }
}

/// What recordings say about one term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// The term.
    pub term: Term,
    /// Its estimate in the reference model, kg or N·s/mm.
    pub value: f64,
    /// The standard error of the estimate, under errors correlated within blocks.
    pub standard_error: f64,
    /// By how much the estimate differs if friction does not depend on the speed.
    pub model_error: f64,
    /// The share of the regressor's variance, beside the other terms, that is not its noise: 0
    /// to 1.
    pub reliability: f64,
    /// By which share the squared error on blocks left out is larger without the term.
    pub gain: f64,
    /// What the term is at most, with a confidence of 99 %; `None` if its regressor stays below its
    /// noise on every scale of time.
    pub upper_bound: Option<f64>,
}

impl Evidence {
    /// Whether the recordings carry the term.
    pub fn is_carried(&self) -> bool {
        self.reliability >= LEAST_RELIABILITY
            && self.value > LEAST_RATIO * self.standard_error
            && self.gain > 0.0
    }

    fn bound(&self) -> f64 {
        let error = self.standard_error.hypot(self.model_error);
        (self.value.max(0.0) + ONE_SIDED * error) / self.reliability
    }
}

/// `mass: not identified by the recordings, at most 12.00 g (99 %)`.
impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let term = self.term.as_str();
        match self.upper_bound {
            Some(bound) => {
                let bound = self.term.shown(bound);
                write!(
                    f,
                    "{term}: not identified by the recordings, at most {bound} (99 %)"
                )
            }
            None => write!(
                f,
                "{term}: not identified by the recordings, which do not show the {} above its noise",
                self.term.regressor()
            ),
        }
    }
}

/// What the recordings say about mass and damping, each beside the other if that one is carried.
/// `range_mm` is where the nodes are. `None` if there are too few samples for blocks.
pub fn of(recordings: &[&Recording], range_mm: [f64; 2]) -> Option<[Evidence; 2]> {
    let mut found = at_scale(recordings, range_mm)?;
    let mut averages: Vec<Recording> = recordings.iter().map(|r| (*r).clone()).collect();
    let unbounded = |found: &[Evidence; 2]| found.iter().any(|e| e.upper_bound.is_none());
    while unbounded(&found) {
        averages = averages.iter().map(pairs_averaged).collect();
        let shorter: Vec<&Recording> = averages.iter().filter(|r| r.len() > 3).collect();
        let samples: usize = shorter.iter().map(|r| r.len()).sum();
        let unknowns = PER_NODE * nodes(recordings, range_mm).len();
        if samples < SAMPLES_PER_UNKNOWN * unknowns {
            break;
        }
        let coarse = at_scale(&shorter, range_mm)?;
        for (evidence, coarse) in found.iter_mut().zip(coarse) {
            evidence.upper_bound = evidence.upper_bound.or(coarse.upper_bound);
        }
    }
    Some(found)
}

/// The means of every two consecutive samples, with velocity and acceleration from those of the
/// position.
fn pairs_averaged(recording: &Recording) -> Recording {
    let means = |column: &[f64]| -> Vec<f64> {
        let pairs = column.chunks_exact(2);
        pairs.map(|pair| 0.5 * (pair[0] + pair[1])).collect()
    };
    let (t_s, x_mm) = (means(&recording.t_s), means(&recording.x_mm));
    let differences = |of: fn(&[f64], &[f64], usize) -> f64| match t_s.len() {
        0..3 => Vec::new(),
        n => (0..n).map(|i| of(&t_s, &x_mm, i)).collect(),
    };
    Recording {
        v_mm_s: differences(velocity),
        a_m_s2: differences(acceleration),
        f_n: means(&recording.f_n),
        t_s,
        x_mm,
        header: Vec::new(),
        warnings: Vec::new(),
        name: recording.name.clone(),
        sha256: String::new(),
    }
}

/// The evidence of the samples as they are.
fn at_scale(recordings: &[&Recording], range_mm: [f64; 2]) -> Option<[Evidence; 2]> {
    let samples: usize = recordings.iter().map(|r| r.len()).sum();
    let nodes = nodes(recordings, range_mm);
    if samples < BLOCKS * (PER_NODE + 2) {
        return None;
    }
    let reference = rules(range_mm)
        .filter_map(|rule| {
            let equations = Equations::of(recordings, &nodes, rule);
            let error = equations.squared_error([true; 2])?;
            Some((error, equations))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?
        .1;
    let noise = [
        noise(recordings, |r| &r.a_m_s2),
        noise(recordings, |r| &r.v_mm_s),
    ];
    let with = |kept: [bool; 2], term: usize| reference.evidence(kept, term, noise[term]);
    let alone = |term: usize| with([term == 0, term == 1], term);
    let both = [with([true; 2], 0)?, with([true; 2], 1)?];
    // a term that is not carried must not take the place of the other
    match both.map(|evidence| evidence.is_carried()) {
        [true, true] => Some(both),
        [true, false] => Some([alone(0)?, both[1]]),
        [false, true] => Some([both[0], alone(1)?]),
        [false, false] => {
            let ratio = |e: &Evidence| e.reliability * e.value / e.standard_error;
            let stronger = usize::from(ratio(&both[1]) > ratio(&both[0]));
            let mut found = both;
            found[stronger] = alone(stronger)?;
            Some(found)
        }
    }
}

/// The rules for the direction state that are tried.
fn rules([low, high]: [f64; 2]) -> impl Iterator<Item = Direction> {
    let of = move |share: &f64| {
        let delta_mm = share * (high - low);
        [Direction::Play { delta_mm }, Direction::Dahl { delta_mm }]
    };
    DELTAS.iter().flat_map(of).chain([Direction::Sign])
}

/// Equally spaced nodes at the scale on which detents are looked for.
fn nodes(recordings: &[&Recording], [low, high]: [f64; 2]) -> Vec<f64> {
    let scale_mm = recordings[0].scale_mm();
    let count = ((high - low) / scale_mm)
        .ceil()
        .clamp(2.0, MOST_NODES as f64);
    (0..=count as usize)
        .map(|i| low + (high - low) * i as f64 / count)
        .collect()
}

/// The standard deviation of the noise of single samples of the force, N. `None` if it is not
/// white, as after a low-pass: noise has the same differences over two samples as over one.
pub(super) fn white_noise_n(recordings: &[&Recording]) -> Option<f64> {
    let thinned: Vec<Recording> = (recordings.iter())
        .map(|r| r.select(&(0..r.len()).step_by(2).collect::<Vec<_>>()))
        .collect();
    let single = noise(recordings, |r| &r.f_n);
    let double = noise(&thinned.iter().collect::<Vec<_>>(), |r| &r.f_n);
    (single > 0.0 && double < WHITE * single).then(|| single.sqrt())
}

/// The variance of the noise of single samples of a column: that of its third differences over
/// 1 + 9 + 9 + 1. The signal hardly contributes where it is sampled several times in its fastest
/// change, and where it is not, its derivatives cannot be trusted either.
fn noise(recordings: &[&Recording], column: impl Fn(&Recording) -> &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for recording in recordings {
        for w in column(recording).windows(4) {
            let difference = w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0];
            sum += difference * difference;
            count += 1;
        }
    }
    sum / (20.0 * count.max(1) as f64)
}

/// The normal equations of one block of samples.
#[derive(Debug, Clone)]
struct Block {
    normal: Banded,
    right: Vec<f64>,
    /// Σ F².
    square: f64,
}

impl Block {
    fn empty(nodes: usize) -> Self {
        let n = nodes * PER_NODE;
        Self {
            normal: Banded::bordered(n, HALF, BORDER),
            right: vec![0.0; n + BORDER],
            square: 0.0,
        }
    }

    /// The squared error of parameters on the block.
    fn error(&self, x: &[f64]) -> f64 {
        let product = self.normal.times(x);
        let mixed = product.iter().zip(&self.right).zip(x);
        self.square + mixed.map(|((p, r), x)| x * (p - 2.0 * r)).sum::<f64>()
    }
}

/// The normal equations, by blocks and in total with the ridges.
#[derive(Debug)]
struct Equations {
    blocks: Vec<Block>,
    total: Block,
    samples: usize,
}

impl Equations {
    fn of(recordings: &[&Recording], nodes: &[f64], rule: Direction) -> Self {
        let samples: usize = recordings.iter().map(|r| r.len()).sum();
        let squares = recordings.iter().flat_map(|r| &r.v_mm_s).map(|v| v * v);
        let low_mm_s = LOW_SPEED * (squares.sum::<f64>() / samples as f64).sqrt();
        let mut blocks = vec![Block::empty(nodes.len()); BLOCKS];
        let mut seen = 0;
        for recording in recordings {
            let mut state = DirectionState::default();
            for i in 0..recording.len() {
                let motion = motion(recording, i);
                let z = state.step(rule, motion);
                let (left, share) = locate(nodes, Lookup::Linear, motion.x_mm);
                let low = (-(motion.v_mm_s / low_mm_s).powi(2)).exp();
                let block = &mut blocks[seen * BLOCKS / samples];
                let unknowns = nodes.len() * PER_NODE;
                let entries = [
                    (left * PER_NODE, 1.0 - share),
                    (left * PER_NODE + 1, z * (1.0 - share)),
                    ((left + 1) * PER_NODE, share),
                    ((left + 1) * PER_NODE + 1, z * share),
                    (unknowns, motion.a_m_s2),
                    (unknowns + 1, motion.v_mm_s),
                    (unknowns + 2, low * z),
                ];
                let force_n = recording.f_n[i];
                for (k, (row, one)) in entries.iter().enumerate() {
                    if *one == 0.0 {
                        continue;
                    }
                    block.right[*row] += one * force_n;
                    for (column, other) in &entries[..=k] {
                        block.normal.add(*row, *column, one * other);
                    }
                }
                block.square += force_n * force_n;
                seen += 1;
            }
        }
        let mut total = Block::empty(nodes.len());
        for block in &blocks {
            total.normal.add_scaled(&block.normal, 1.0);
            for (sum, one) in total.right.iter_mut().zip(&block.right) {
                *sum += one;
            }
            total.square += block.square;
        }
        add_ridges(&mut total.normal, nodes.len(), samples);
        Self {
            blocks,
            total,
            samples,
        }
    }

    /// Which unknowns are free, with the kept ones of mass and damping.
    fn free(&self, kept: [bool; 2]) -> Vec<bool> {
        let mut free = vec![true; self.total.right.len()];
        let first = free.len() - BORDER;
        free[first..first + 2].copy_from_slice(&kept);
        free
    }

    fn squared_error(&self, kept: [bool; 2]) -> Option<f64> {
        let x = (self.total.normal).solve(&self.total.right, &self.free(kept))?;
        Some(self.total.error(&x))
    }

    /// The sum of the squared errors of every block, predicted by the others.
    fn error_left_out(&self, kept: [bool; 2]) -> Option<f64> {
        let free = self.free(kept);
        (self.blocks.iter())
            .map(|block| {
                let mut normal = self.total.normal.clone();
                normal.add_scaled(&block.normal, -1.0);
                let right: Vec<f64> = (self.total.right.iter().zip(&block.right))
                    .map(|(all, one)| all - one)
                    .collect();
                Some(block.error(&normal.solve(&right, &free)?))
            })
            .sum()
    }

    /// The evidence for a term (0: mass, 1: damping) in a model with the kept ones.
    fn evidence(&self, kept: [bool; 2], term: usize, noise: f64) -> Option<Evidence> {
        let free = self.free(kept);
        let x = self.total.normal.solve(&self.total.right, &free)?;
        let at = x.len() - BORDER + term;
        let mut unit = vec![0.0; x.len()];
        unit[at] = 1.0;
        let column = self.total.normal.solve(&unit, &free)?;
        // the contribution of each block to the estimate
        let shifts = self.blocks.iter().map(|block| {
            let product = block.normal.times(&x);
            let gradient = block.right.iter().zip(&product).map(|(r, p)| r - p);
            column.iter().zip(gradient).map(|(c, g)| c * g).sum::<f64>()
        });
        let variance: f64 = shifts.map(|shift| shift * shift).sum();
        let blocks = BLOCKS as f64;
        // what friction does at low speed is not known: its column may be there or not
        let mut constant_friction = free.clone();
        constant_friction[x.len() - 1] = false;
        let without_column = (self.total.normal).solve(&self.total.right, &constant_friction)?;
        let remaining = 1.0 / column[at];
        let mut without = kept;
        without[term] = false;
        let (with, without) = (self.error_left_out(kept)?, self.error_left_out(without)?);
        let mut evidence = Evidence {
            term: Term::BOTH[term],
            value: x[at],
            standard_error: (variance * blocks / (blocks - 1.0)).sqrt(),
            model_error: (x[at] - without_column[at]).abs(),
            reliability: (1.0 - self.samples as f64 * noise / remaining).clamp(0.0, 1.0),
            gain: without / with - 1.0,
            upper_bound: None,
        };
        if evidence.reliability >= LEAST_RELIABILITY {
            evidence.upper_bound = Some(evidence.bound());
        }
        Some(evidence)
    }
}

fn add_ridges(normal: &mut Banded, nodes: usize, samples: usize) {
    let information = samples as f64 / nodes as f64;
    let low_speed = nodes * PER_NODE + BORDER - 1;
    normal.add(low_speed, low_speed, FLOOR * samples as f64);
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
