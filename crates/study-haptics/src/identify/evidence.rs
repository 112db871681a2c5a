//! Which terms a recording carries: mass and damping with their errors, and with a bound if they are left out.
//!
//! The question is asked of a reference model with one mass and one damping,
//!
//! ```text
//! F = Σ_j h_j(x) (C_j + z D_j) + b v + m a + (s z + r sign(a)) exp(−(5 v / v_rms)²)
//! ```
//!
//! with the hat functions h_j, the direction state z that fits best (the sign of v, or play or Dahl of several lengths)
//! and a ridge on the second differences of C and D.
//!
//! *Estimate.* Velocity and acceleration are noisy where they are differences of encoder counts, and least squares then finds too little
//! of m and b. They are therefore estimated with instruments w (`instruments`): derivatives of the position over a scale of time
//! that do not share the noise of the differences. With the instrument free of everything that the rest of the model explains, and
//! scaled to Σ w a = 1, the estimate is θ = Σ w F. It is consistent at every scale; that of largest (Σ w a)²/Σ w² is used.
//!
//! *Error.* θ − m = Σ w (F − m a − …), and the residual in the bracket, its noise, its drift and what the model does not have, are
//! correlated in time in an unknown way. What such a residual does to a sum with w is seen by shifting the two against one
//! another in time: V(m) is the mean square of the sum over a hundred cyclic shifts, with both scaled by the residual's
//! local size. V(m) is a parabola, because the residual has −m times the noise of a.
//! What friction does at low speed and at a reversal is not known, and would be taken for damping and mass: the columns of s and r take it. The
//! largest difference of the estimates without s, and with rules of z that fit nearly as well, counts as an error, too. In a
//! motion that accelerates only at reversals, as a single slow loop, mass and r cannot be told apart; r is left out then, and the error of the
//! force counts twice.
//!
//! *Bound.* The upper bound is the largest m that a test does not reject, (m − θ)² ≤ 2.576² V(m) (Fieller's limit), or half the mass that is
//! found in 95 % of repetitions, if that is larger. It does
//! not exist if Σ w a is not five times what the noise of a makes of it; the recording then shows no acceleration.
//! A term is carried if θ exceeds [`LEAST_RATIO`] √V(θ), if the bound exists, and if blocks of samples that are left out are predicted better with it.
//! Twice the bound is therefore found in about 95 % of repetitions, and a term that is lacking in one of 700.
//!
//! References for the instruments: Fuller, Measurement Error Models, 1987, section 1.4; for the bound: Fieller 1954, J. R. Stat. Soc. B
//! 16:175; for the shifts: Chatfield, The Analysis of Time Series, 2004, section 8.1 (cross-correlations of shifted series).

mod equations;
mod instruments;
pub mod lag;
mod noise;

use crate::recording::{Recording, acceleration, velocity};
use equations::{BORDER, Equations, PER_NODE, Row, rows};
use instruments::Instruments;
pub(in crate::identify) use noise::white_noise_n;
use std::cell::OnceCell;
use std::fmt;
use study_wire::predict::Direction;

/// Least reliability of a regressor by which methods estimate its term: below, they would find too little of it.
pub const LEAST_RELIABILITY: f64 = 0.8;
/// Least ratio of an estimate to its error.
pub const LEAST_RATIO: f64 = 3.0;
/// The bound is so many errors above the estimate: a confidence of 99.5 % if errors are normal.
const ONE_SIDED: f64 = 2.576;
/// The product of a regressor with its instrument is at least so many times what its noise could make:
/// with less, no value would be found in 95 % of repetitions.
const LEAST_RELEVANCE: f64 = 5.0;
/// Quantile .95 of the normal distribution.
const NEARLY_ALWAYS: f64 = 1.645;
/// So many times the error counts where nothing tells the term from what happens at reversals.
const UNCHECKED: f64 = 2.0;
/// Cyclic shifts of the residual against the instrument.
const SHIFTS: usize = 100;
/// Lengths of the play that are tried, as shares of the travel.
const DELTAS: [f64; 6] = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
/// Rules whose squared error exceeds the least one by at most this factor fit nearly as well.
const NEARLY: f64 = 1.1;
/// Most nodes of the reference model.
const MOST_NODES: usize = 200;
/// The residual is taken to be at least this share of its rms everywhere.
const LEAST_SCALE: f64 = 0.25;

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
    /// The standard error of the estimate, with that of the model.
    pub standard_error: f64,
    /// By how much the estimate differs between models that fit nearly as well.
    pub model_error: f64,
    /// The share of the regressor's variance, beside what position and direction explain, that is not its noise: 0
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
        self.upper_bound.is_some()
            && self.value > LEAST_RATIO * self.standard_error
            && self.gain > 0.0
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
                "{term}: not identified by the recordings, whose {} is explained by position and direction or stays below its noise",
                self.term.regressor()
            ),
        }
    }
}

/// What the recordings say about mass and damping, each beside the other if that one is carried.
/// `range_mm` is where the nodes are. `None` if there are too few samples for blocks.
pub fn of(recordings: &[&Recording], range_mm: [f64; 2]) -> Option<[Evidence; 2]> {
    let averages = noise::averaged(recordings);
    let averages: Vec<&Recording> = averages.iter().filter(|r| r.len() > 3).collect();
    // what happens at reversals is told from mass if the motion allows it
    let reference = |reversals: bool| Reference::new(&averages, recordings, range_mm, reversals);
    let (apart, together) = (reference(true)?, OnceCell::new());
    let with = |kept: [bool; 2], term: usize| {
        let told_apart = apart.evidence(kept, term)?;
        if told_apart.upper_bound.is_some() {
            return Some(told_apart);
        }
        let together = together.get_or_init(|| reference(false)).as_ref()?;
        together.evidence(kept, term)
    };
    let alone = |term: usize| with([term == 0, term == 1], term);
    let both = [with([true; 2], 0)?, with([true; 2], 1)?];
    // a term that is not carried must not take the place of the other
    match both.map(|evidence| evidence.is_carried()) {
        [true, true] => Some(both),
        [true, false] => Some([alone(0)?, both[1]]),
        [false, true] => Some([both[0], alone(1)?]),
        [false, false] => {
            let ratio = |e: &Evidence| e.value / e.standard_error;
            let stronger = usize::from(ratio(&both[1]) > ratio(&both[0]));
            let mut found = both;
            found[stronger] = alone(stronger)?;
            Some(found)
        }
    }
}

/// The reference model with the scales of the instruments and the direction state that suit the
/// recordings.
#[derive(Debug)]
struct Reference {
    rows: Vec<Row>,
    equations: Equations,
    /// Whether reversals have a column of their own.
    reversals: bool,
    /// Mass and damping with the best rule and with others that fit nearly as well.
    by_rule: Vec<[f64; 2]>,
    /// The share of each regressor's variance that is not its noise.
    reliability: [f64; 2],
}

impl Reference {
    fn new(
        recordings: &[&Recording],
        unaveraged: &[&Recording],
        range_mm: [f64; 2],
        reversals: bool,
    ) -> Option<Self> {
        let samples: usize = recordings.iter().map(|r| r.len()).sum();
        let nodes = nodes(recordings, range_mm);
        if samples < equations::BLOCKS * (PER_NODE + 2) {
            return None;
        }
        let travel_mm = range_mm[1] - range_mm[0];
        let instruments = instruments_of(recordings, &nodes, travel_mm, reversals)?;
        let rules = DELTAS.iter().flat_map(|share| {
            let delta_mm = share * travel_mm;
            [Direction::Play { delta_mm }, Direction::Dahl { delta_mm }]
        });
        let mut tried: Vec<(f64, Direction, [f64; 2])> = rules
            .chain([Direction::Sign])
            .filter_map(|rule| {
                let rows = rows(recordings, &nodes, rule, &instruments);
                let equations = Equations::of(&rows, nodes.len());
                let free = equations.free([true; 2], [true, reversals]);
                let error = (equations.total).error(&equations.solve(0, &free)?);
                Some((error, rule, estimates(&equations, &free)?))
            })
            .collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (least, rule, _) = *tried.first()?;
        let rows = rows(recordings, &nodes, rule, &instruments);
        let equations = Equations::of(&rows, nodes.len());
        Some(Self {
            by_rule: (tried.iter())
                .filter(|(error, ..)| *error <= NEARLY * least)
                .map(|(.., estimates)| *estimates)
                .collect(),
            reliability: reliability(unaveraged, samples, &equations),
            reversals,
            rows,
            equations,
        })
    }

    /// The evidence for a term (0: mass, 1: damping) in a model with the kept ones.
    fn evidence(&self, kept: [bool; 2], term: usize) -> Option<Evidence> {
        let Self {
            rows, equations, ..
        } = self;
        let free = equations.free(kept, [true, self.reversals]);
        let weights = weights(equations, &free, term)?;
        // what the model without m and b leaves of force and regressors
        let solved = [0, 1, 2].map(|signal| equations.solve(signal, &free));
        let [force, acceleration, velocity] = solved;
        let factors = [force?, acceleration?, velocity?];
        let sum_with = |signal: usize| -> f64 {
            let right = &equations.total.right[signal];
            weights.iter().zip(right).map(|(w, r)| w * r).sum()
        };
        let value = sum_with(0);
        let other = match kept {
            [true, true] => estimates(equations, &free)?[1 - term],
            _ => 0.0,
        };
        let left = |row: &Row, signal: usize| row.signals[signal] - row.times(&factors[signal]);
        let of_force: Vec<f64> = (rows.iter())
            .map(|row| left(row, 0) - other * left(row, 2 - term))
            .collect();
        let of_regressor: Vec<f64> = rows.iter().map(|row| left(row, 1 + term)).collect();
        let instrument: Vec<f64> = rows.iter().map(|row| row.times(&weights)).collect();
        let final_residual: Vec<f64> = (of_force.iter().zip(&of_regressor))
            .map(|(f, r)| f - value * r)
            .collect();
        let scales = local_scales(rows, &final_residual);
        let unknowns = (weights.len() as f64).min(0.5 * rows.len() as f64);
        let inflated: f64 = rows.len() as f64 / (rows.len() as f64 - unknowns);
        let mut spread = Spread::of(&instrument, [&of_force, &of_regressor], &scales, inflated);
        let mut model_error = self.model_error(&free, term, value)?;
        if !self.reversals {
            // what happens at reversals looks like the term, and nothing in the recording contradicts it
            spread.moments[0] *= UNCHECKED.powi(2);
            spread.moments[1] *= UNCHECKED;
            model_error *= UNCHECKED;
        }
        let mut without = free.clone();
        without[free.len() - BORDER + term] = false;
        let (with, without) = (
            equations.error_left_out(&free)?,
            equations.error_left_out(&without)?,
        );
        Some(Evidence {
            term: Term::BOTH[term],
            value,
            standard_error: spread.variance(value).sqrt().hypot(model_error),
            model_error,
            reliability: self.reliability[term],
            gain: without / with - 1.0,
            upper_bound: spread.upper_bound(value.max(0.0), model_error),
        })
    }

    /// The largest difference from the estimate that models have which fit nearly as well.
    fn model_error(&self, free: &[bool], term: usize, value: f64) -> Option<f64> {
        // what friction does at low speed is not known: its column may be there or not
        let mut constant_friction = free.to_vec();
        constant_friction[free.len() - BORDER + 2] = false;
        let without_column = estimates(&self.equations, &constant_friction)?[term];
        // the rules are in the order of their errors
        let best = self.by_rule.first()?[term];
        let rules = (self.by_rule.iter()).map(|rule| (rule[term] - best).abs());
        Some(rules.fold((without_column - value).abs(), f64::max))
    }
}

/// The instruments at the scales that show most of acceleration and velocity.
fn instruments_of(
    recordings: &[&Recording],
    nodes: &[f64],
    travel_mm: f64,
    reversals: bool,
) -> Option<Vec<Instruments>> {
    let rule = Direction::Play {
        delta_mm: DELTAS[2] * travel_mm,
    };
    let mut best: [Option<(f64, usize)>; 2] = [None; 2];
    for width in instruments::widths(recordings) {
        let of: Vec<Instruments> = (recordings.iter())
            .map(|r| Instruments::new(r, width))
            .collect();
        let rows = rows(recordings, nodes, rule, &of);
        let equations = Equations::of(&rows, nodes.len());
        let free = equations.free([true; 2], [true, reversals]);
        for (term, best) in best.iter_mut().enumerate() {
            let shown = shown_by(&equations, &free, term).unwrap_or(0.0);
            if best.is_none_or(|(most, _)| shown > most) {
                *best = Some((shown, width));
            }
        }
    }
    let [(_, for_a), (_, for_v)] = [best[0]?, best[1]?];
    let of = |r: &&Recording| Instruments {
        a: Instruments::new(r, for_a).a,
        v: Instruments::new(r, for_v).v,
    };
    Some(recordings.iter().map(of).collect())
}

/// (Σ w a)²/Σ w², with the instrument w free of what the others explain.
fn shown_by(equations: &Equations, free: &[bool], term: usize) -> Option<f64> {
    let at = free.len() - BORDER + term;
    let mut unit = vec![0.0; free.len()];
    unit[at] = 1.0;
    let inverse = equations.total.normal.solve(&unit, free)?;
    let regressor = equations.solve(1 + term, free)?;
    Some(regressor[at].powi(2) / inverse[at])
}

/// Mass and damping, 0 if not free: the force over the instruments, divided by what the instruments
/// say of acceleration and velocity.
fn estimates(equations: &Equations, free: &[bool]) -> Option<[f64; 2]> {
    let force = equations.solve(0, free)?;
    let a = equations.solve(1, free)?;
    let v = equations.solve(2, free)?;
    let at = free.len() - BORDER;
    Some(match [free[at], free[at + 1]] {
        [true, true] => {
            let determinant = a[at] * v[at + 1] - v[at] * a[at + 1];
            [
                (force[at] * v[at + 1] - v[at] * force[at + 1]) / determinant,
                (a[at] * force[at + 1] - force[at] * a[at + 1]) / determinant,
            ]
        }
        [true, false] => [force[at] / a[at], 0.0],
        [false, true] => [0.0, force[at + 1] / v[at + 1]],
        [false, false] => [0.0; 2],
    })
}

/// The factors of the instrument that is free of everything that the model explains beside the term, and
/// whose sum with the regressor is 1.
fn weights(equations: &Equations, free: &[bool], term: usize) -> Option<Vec<f64>> {
    let at = free.len() - BORDER;
    let columns = [0, 1].map(|k| {
        let mut unit = vec![0.0; free.len()];
        unit[at + k] = 1.0;
        equations.total.normal.solve(&unit, free)
    });
    let [of_a, of_v] = columns;
    let columns = [of_a?, of_v?];
    let a = equations.solve(1, free)?;
    let v = equations.solve(2, free)?;
    let shares = match [free[at], free[at + 1]] {
        [true, true] => {
            let determinant = a[at] * v[at + 1] - v[at] * a[at + 1];
            match term {
                0 => [v[at + 1] / determinant, -v[at] / determinant],
                _ => [-a[at + 1] / determinant, a[at] / determinant],
            }
        }
        [true, false] => [1.0 / a[at], 0.0],
        _ => [0.0, 1.0 / v[at + 1]],
    };
    let weights = (columns[0].iter().zip(&columns[1]))
        .map(|(a, v)| shares[0] * a + shares[1] * v)
        .collect();
    Some(weights)
}

/// The rms residual around the node of each sample, and at its speed, low or not.
fn local_scales(rows: &[Row], residual: &[f64]) -> Vec<f64> {
    let nodes = rows.iter().map(Row::node).max().unwrap_or(0) + 1;
    let mut of_node = vec![(0.0, 0.0); nodes];
    let mut of_speed = [(0.0, 0.0); 2];
    for (row, residual) in rows.iter().zip(residual) {
        for (square, count) in [
            &mut of_node[row.node()],
            &mut of_speed[usize::from(row.slow)],
        ] {
            *square += residual * residual;
            *count += 1.0;
        }
    }
    let all: f64 = of_speed.iter().map(|(square, _)| square).sum();
    let mean = (all / rows.len() as f64).max(f64::MIN_POSITIVE);
    let scale = |row: &Row| {
        let ratio = |(square, count): (f64, f64)| square / count / mean;
        let square = ratio(of_node[row.node()]) * ratio(of_speed[usize::from(row.slow)]);
        (mean * square.max(LEAST_SCALE * LEAST_SCALE)).sqrt()
    };
    rows.iter().map(scale).collect()
}

/// The variance of Σ w (F − m a) as a function of m: [`Self::variance`].
#[derive(Debug, Clone, Copy)]
struct Spread {
    /// Of the force, of force and regressor, of the regressor.
    moments: [f64; 3],
}

impl Spread {
    /// From cyclic shifts of what is left of force and regressor, divided by the local scales.
    fn of(instrument: &[f64], left: [&[f64]; 2], scales: &[f64], inflated: f64) -> Self {
        let n = instrument.len();
        let scaled = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(scales).map(|(v, s)| v / s).collect()
        };
        let [force, regressor] = left.map(scaled);
        let weight: Vec<f64> = instrument.iter().zip(scales).map(|(w, s)| w * s).collect();
        let sum = |values: &[f64], shift: usize| -> f64 {
            let (head, tail) = values.split_at(shift);
            let shifted = tail.iter().chain(head);
            weight.iter().zip(shifted).map(|(w, v)| w * v).sum()
        };
        let mut moments = [0.0; 3];
        for k in 0..SHIFTS {
            let shift = (2 * k + 1) * n / (2 * SHIFTS);
            let (f, r) = (sum(&force, shift), sum(&regressor, shift));
            for (moment, product) in moments.iter_mut().zip([f * f, f * r, r * r]) {
                *moment += inflated * product / SHIFTS as f64;
            }
        }
        Self { moments }
    }

    /// If the term is `theta`.
    fn variance(&self, theta: f64) -> f64 {
        let [force, mixed, regressor] = self.moments;
        (force - 2.0 * theta * mixed + theta * theta * regressor).max(0.0)
    }

    /// The largest value that is not rejected beside the estimate, or half the value that is found in
    /// 95 % of repetitions, if that is larger.
    fn upper_bound(&self, estimate: f64, model_error: f64) -> Option<f64> {
        let [force, mixed, regressor] = self.moments;
        // false for NaN
        let relevant = regressor * LEAST_RELEVANCE.powi(2) < 1.0;
        if !relevant {
            return None;
        }
        let t = ONE_SIDED.powi(2);
        let square = 1.0 - t * regressor;
        let linear = estimate - t * mixed;
        let constant = estimate * estimate - t * (force + model_error * model_error);
        let not_rejected =
            (linear + (linear * linear - square * constant).max(0.0).sqrt()) / square;
        // found² = (LEAST_RATIO + NEARLY_ALWAYS)² (V(found) + model_error²)
        let t = (LEAST_RATIO + NEARLY_ALWAYS).powi(2);
        let square = 1.0 - t * regressor;
        let error = t * (force + model_error * model_error);
        let found = ((t * mixed).powi(2) + square * error).max(0.0).sqrt() - t * mixed;
        Some(not_rejected.max(0.5 * found / square))
    }
}

/// Equally spaced nodes, at most as far apart as the scale on which detents are looked for.
fn nodes(recordings: &[&Recording], [low, high]: [f64; 2]) -> Vec<f64> {
    let scale_mm = recordings[0].scale_mm();
    let count = ((high - low) / scale_mm)
        .ceil()
        .clamp(2.0, MOST_NODES as f64);
    (0..=count as usize)
        .map(|i| low + (high - low) * i as f64 / count)
        .collect()
}

/// The share of what position and direction leave of acceleration and velocity that is not their noise.
fn reliability(unaveraged: &[&Recording], samples: usize, equations: &Equations) -> [f64; 2] {
    let noise = [
        noise::of_derivative(
            unaveraged,
            |r| &r.a_m_s2,
            acceleration,
            1e-3 * 6.0_f64.sqrt(),
            2,
        ),
        noise::of_derivative(unaveraged, |r| &r.v_mm_s, velocity, 0.5_f64.sqrt(), 1),
    ];
    let raw: usize = unaveraged.iter().map(|r| r.len()).sum();
    let neither = equations.free([false; 2], [true; 2]);
    [0, 1].map(|term| {
        let total = &equations.total;
        let Some(factors) = equations.solve(1 + term, &neither) else {
            return 0.0;
        };
        let explained: f64 = (factors.iter().zip(&total.right[1 + term]))
            .map(|(f, r)| f * r)
            .sum();
        let remaining = total.square[1 + term] - explained;
        // means of samples have less noise than samples
        let of_means = noise[term] * samples as f64 / raw as f64;
        let signal = (remaining / samples as f64 - of_means).max(0.0);
        (signal / (signal + noise[term]).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    })
}
