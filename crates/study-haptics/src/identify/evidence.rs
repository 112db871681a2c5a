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
//! motion with fewer than three reversals, or where mass and r cannot be told apart (r is left out then), the error of the force counts twice.
//!
//! *Found.* The recordings show a term if blocks of samples that are left out are predicted better with it, and θ exceeds four errors (a search over two terms and many
//! recordings meets three by chance). In a motion that can show the term, it is enough that θ exceeds four errors without that of the model, and is above 0 in
//! all models that fit nearly as well; or that it exceeds 2.326 errors (99 %), and the squared error on the blocks is a fifth larger without it. A table takes it up
//! if its regressor is no noise either ([`Evidence::is_carried`]).
//!
//! *Bound.* The upper bound is the largest m that a test does not reject, (m − θ)² ≤ 2.576² V(m) (Fieller's limit), or half the mass that
//! exceeds (4 + 1.881) √V(m), and is therefore found with a probability of 97 %, if that is larger; the error of the model counts twice there, because a term changes
//! it. Fieller's limit does not exist if Σ w a is not 2.7 times what the noise of a makes of it; the recording then shows no acceleration.
//! Nor is there a bound of the mass where reversals are few and the acceleration is mostly noise: a slow loop by an encoder.
//! If it is not 5.9 times as much, or if reversals are few, no mass could be found, and the message says so beside the bound ([`Evidence::shows`]).
//!
//! References for the instruments: Fuller, Measurement Error Models, 1987, section 1.4; for the bound: Fieller 1954, J. R. Stat. Soc. B
//! 16:175; for the shifts: Chatfield, The Analysis of Time Series, 2004, section 8.1 (cross-correlations of shifted series).

mod equations;
mod instruments;
pub mod lag;
mod noise;
mod spread;

use crate::recording::{Recording, acceleration, velocity};
use equations::{BORDER, Equations, PER_NODE, Row, Rule, rows};
use instruments::Instruments;
pub(in crate::identify) use noise::white_noise_n;
use spread::Spread;
use std::cell::OnceCell;
use std::fmt;
use study_wire::predict::Direction;

/// Least reliability of a regressor with which a table takes up its term: below, it would find too little of it.
pub const LEAST_RELIABILITY: f64 = 0.8;
/// Least ratio of an estimate to its error: a search over many terms and recordings meets three by chance.
pub const LEAST_RATIO: f64 = 4.0;
/// Least ratio where the force of blocks that are left out is predicted so much better, as a share of the squared error.
pub const LEAST_RATIO_OF_GAIN: (f64, f64) = (2.326, 0.2);
/// With fewer reversals, what friction does at one may be taken for the term.
const ENOUGH_REVERSALS: usize = 3;
/// Of the travel: a shorter way is no stroke.
const A_STROKE: f64 = 0.05;
/// So many times the error of the force counts where hardly anything tells the term from what happens at reversals.
const UNCHECKED: f64 = 2.0;
/// Steps, as factors, in which the length of the play is refined.
const REFINED: [f64; 3] = [1.414, 1.189, 1.091];
/// Samples over which the direction state is averaged, as a low-pass of the force does.
const SMOOTH: [usize; 6] = [1, 3, 7, 15, 31, 63];
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
    /// Whether twice the bound would be found in 97 % of repetitions.
    pub shows: bool,
    /// What the term is at most, with a confidence of 99 %; `None` if its regressor stays below its
    /// noise on every scale of time.
    pub upper_bound: Option<f64>,
}

impl Evidence {
    /// Whether the recordings show the term.
    pub fn is_found(&self) -> bool {
        let statistical = (self.standard_error.powi(2) - self.model_error.powi(2)).sqrt();
        let ratio = self.value / self.standard_error;
        let (least, gain) = LEAST_RATIO_OF_GAIN;
        // whichever model it is that fits nearly as well, the term is there
        let in_all_models = self.value > self.model_error.max(LEAST_RATIO * statistical);
        let shown = self.shows && (in_all_models || ratio > least && self.gain > gain);
        self.upper_bound.is_some() && self.gain > 0.0 && (ratio > LEAST_RATIO || shown)
    }

    /// Whether a table takes the term up: the recordings show it, and its regressor is not mostly noise, by which least
    /// squares would find too little of it.
    pub fn is_carried(&self) -> bool {
        self.is_found() && self.reliability >= LEAST_RELIABILITY
    }

    /// What recording would show the term.
    fn advice(&self) -> &'static str {
        match self.term {
            Term::Mass => {
                "strokes with many reversals and at several speeds, some of them fast, would show one"
            }
            Term::Damping => "several strokes at different speeds would show one",
        }
    }
}

/// `mass: not identified by the recordings, at most 12.00 g (99 %)`.
impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (term, of) = (self.term.as_str(), self.term.regressor());
        if self.is_found() {
            let [value, error] = [self.value, self.standard_error].map(|v| self.term.shown(v));
            return write!(
                f,
                "{term}: {value} ± {error}, left out, because a table would find too little of it: only {:.0} % of the variance of the {of} \
                 is not noise; a filter or a sensor of the {of} would help",
                100.0 * self.reliability
            );
        }
        match self.upper_bound.map(|bound| self.term.shown(bound)) {
            Some(bound) => {
                write!(
                    f,
                    "{term}: not identified by the recordings, at most {bound} (99 %)"
                )?;
                match self.shows {
                    true => Ok(()),
                    false => write!(
                        f,
                        "; no {term} can be told from friction by this motion; {}",
                        self.advice()
                    ),
                }
            }
            None => write!(
                f,
                "{term}: not identified by the recordings and not bounded, because their {of} is explained by position and direction or \
                 stays below its noise; {}",
                self.advice()
            ),
        }
    }
}

/// What the recordings say about mass and damping, each beside the other if that one is found.
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
    // a term that is not found must not take the place of the other
    match both.map(|evidence| evidence.is_found()) {
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
    /// Whether there are fewer than [`ENOUGH_REVERSALS`].
    few_reversals: bool,
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
        let with = |rule: Rule| {
            let rows = rows(recordings, &nodes, rule, &instruments);
            let equations = Equations::of(&rows, nodes.len());
            let free = equations.free([true; 2], [true, reversals]);
            let error = (equations.total).error(&equations.solve(0, &free)?);
            Some((error, rule, estimates(&equations, &free)?))
        };
        let mut tried: Vec<(f64, Rule, [f64; 2])> = Vec::new();
        for direction in rules(range_mm) {
            let mut last = f64::INFINITY;
            for smooth in SMOOTH {
                let found = with(Rule { direction, smooth });
                let error = found.map_or(f64::INFINITY, |(error, ..)| error);
                tried.extend(found);
                // a longer mean is worse still
                if error > last {
                    break;
                }
                last = error;
            }
        }
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        for factor in REFINED {
            let best = tried.first()?.1;
            tried.extend(
                [factor, 1.0 / factor]
                    .iter()
                    .filter_map(|f| with(best.scaled(*f)?)),
            );
            tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
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
            few_reversals: reversals_in(recordings, travel_mm) < ENOUGH_REVERSALS,
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
        let doubtful = !self.reversals || self.few_reversals;
        if doubtful {
            // what happens at a reversal looks like the term, and hardly anything in the recording contradicts it
            spread = spread.with_force_times(UNCHECKED);
            model_error *= UNCHECKED;
        }
        // neither term is negative: an estimate that is shows an error of the model
        model_error = model_error.max(-value);
        let mut without = free.clone();
        without[free.len() - BORDER + term] = false;
        let (with, without) = (
            equations.error_left_out(&free)?,
            equations.error_left_out(&without)?,
        );
        // the few samples of a reversal and the instrument share the pattern of the encoder's steps: the product of both says nothing
        let pattern = doubtful && term == 0 && self.reliability[term] < LEAST_RELIABILITY;
        let bound = spread.upper_bound(value.max(0.0), model_error);
        let bound = bound.filter(|_| !pattern);
        Some(Evidence {
            term: Term::BOTH[term],
            value,
            standard_error: spread.variance(value).sqrt().hypot(model_error),
            model_error,
            reliability: self.reliability[term],
            gain: without / with - 1.0,
            shows: !doubtful && bound.is_some_and(|bound| bound.shows),
            upper_bound: bound.map(|bound| bound.value),
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

/// How often the motion turns by more than [`A_STROKE`] of the travel.
fn reversals_in(recordings: &[&Recording], travel_mm: f64) -> usize {
    let least_mm = A_STROKE * travel_mm;
    let of = |recording: &&Recording| {
        let (mut low, mut high) = (recording.x_mm[0], recording.x_mm[0]);
        let (mut direction, mut count) = (0.0, 0);
        for x in &recording.x_mm {
            (low, high) = (low.min(*x), high.max(*x));
            let [rises, falls] = [x - low >= least_mm, high - x >= least_mm];
            if rises && direction <= 0.0 || falls && direction >= 0.0 {
                count += usize::from(direction != 0.0);
                direction = if rises { 1.0 } else { -1.0 };
                (low, high) = (*x, *x);
            } else if direction > 0.0 {
                low = high;
            } else if direction < 0.0 {
                high = low;
            }
        }
        count
    };
    recordings.iter().map(of).sum()
}

/// The rules for the direction state that are tried at first.
fn rules([low, high]: [f64; 2]) -> impl Iterator<Item = Direction> {
    let of = move |share: &f64| {
        let delta_mm = share * (high - low);
        [Direction::Play { delta_mm }, Direction::Dahl { delta_mm }]
    };
    DELTAS.iter().flat_map(of).chain([Direction::Sign])
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
