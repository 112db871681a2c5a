//! The reference model with instruments: mass and damping, their errors, and their bounds.

use super::Term;
use super::alike::are_alike;
use super::dissipation::Dissipation;
use super::equations::{BORDER, EVERYWHERE, Equations, Row, Rule, directions, nodes, rows};
use super::instruments::{self, Instruments};
use super::spread::{ONE_SIDED, Spread};
use crate::recording::Recording;
use study_base::sort::SmallSort as _;
use study_wire::predict::Direction;

/// Steps, as factors, in which the length of the play is refined.
const REFINED: [f64; 3] = [1.414, 1.189, 1.091];
/// Samples over which the direction state is averaged, as a low-pass of the force does.
const SMOOTH: [usize; 6] = [1, 3, 7, 15, 31, 63];
/// The length of the play with which the scales of the instruments are chosen, as a share of the travel.
const USUAL_PLAY: f64 = 0.02;
/// Rules whose squared error exceeds the least one by at most this factor fit nearly as well.
const NEARLY: f64 = 1.1;
/// Least ratio of an estimate to its error: a search over many terms and recordings meets three by chance.
pub(super) const LEAST_RATIO: f64 = 4.0;
/// What is below so many of the errors that the output has is not called found, in whichever way it is shown.
const LEAST_RATIO_OF_FOUND: f64 = 2.0;
/// Least ratio (99 %) where the squared error on blocks left out is larger without the term by at least [`MUCH`].
const LEAST_RATIO_OF_MUCH: f64 = 2.326;
/// A share of the squared error on blocks left out that is much.
const MUCH: f64 = 0.2;
/// A share of the squared error on blocks left out that is little.
const LITTLE: f64 = 0.01;
/// The residual is taken to be at least this share of its rms everywhere.
const LEAST_SCALE: f64 = 0.25;

/// What the reference model says of a term.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    /// kg or N·s/mm.
    pub(super) value: f64,
    /// The standard error, with that of the model.
    pub(super) standard_error: f64,
    /// The largest difference between models that fit nearly as well.
    pub(super) model_error: f64,
    /// By which share the squared error on blocks left out is larger without the term.
    pub(super) gain: f64,
    /// Whether the estimate has a bound of its own: see [`Spread::upper_bound`].
    is_determined: bool,
    /// What would be found, kg or N·s/mm; `None` if nothing would.
    pub(super) shown_from: Option<f64>,
    /// Whether that is twice the bound.
    pub(super) shows: bool,
    /// kg or N·s/mm.
    pub(super) upper_bound: Option<f64>,
}

impl Found {
    /// Whether the recordings show the term, and its estimate exceeds two of the errors that are printed beside it.
    pub(super) fn is_found(self) -> bool {
        self.is_shown() && self.value >= LEAST_RATIO_OF_FOUND * self.standard_error
    }

    /// Whether the recordings show the term, however large it is: a model that fits nearly as well may have half of it or twice as much.
    pub(super) fn is_shown(self) -> bool {
        let statistical = (self.standard_error.powi(2) - self.model_error.powi(2)).sqrt();
        let ratio = self.value / self.standard_error;
        let in_all_models = self.value > self.model_error.max(LEAST_RATIO * statistical);
        let predicts_much = ratio > LEAST_RATIO_OF_MUCH && self.gain > MUCH;
        let shown = ratio > LEAST_RATIO || self.shows && (in_all_models || predicts_much);
        self.is_determined && self.gain > 0.0 && shown
    }

    /// Whether a table may take the term up: the recordings show it, or it predicts more than [`LITTLE`].
    pub(super) fn may_be_carried(self) -> bool {
        self.is_shown() || self.gain > LITTLE
    }
}

/// What is known of the force by position.
#[derive(Debug, Clone, Copy)]
pub(super) enum Force<'r> {
    /// Nothing.
    Unknown,
    /// It is subtracted from these recordings, and only a constant and a friction are left.
    Held(&'r [&'r Recording]),
}

/// The reference model with the scales of the instruments and the direction state that suit the recordings.
#[derive(Debug)]
pub(super) struct Reference {
    rows: Vec<Row>,
    equations: Equations,
    /// Whether there are strokes enough to tell a term from what depends on position and direction.
    enough_strokes: bool,
    /// Whether these are alike, so that the acceleration depends on position and direction as well.
    alike: bool,
    /// Mass and damping with the best rule and with others that fit nearly as well, the best first.
    by_rule: Vec<[f64; 2]>,
    dissipation: Dissipation,
}

impl Reference {
    /// `None` if a term is not determined at all, by rounding.
    pub(super) fn new(
        recordings: &[&Recording],
        force: Force<'_>,
        range_mm: [f64; 2],
        enough_strokes: bool,
    ) -> Option<Self> {
        let nodes = nodes(recordings, range_mm);
        let unknown = match force {
            Force::Held(_) => 1,
            Force::Unknown => nodes.len(),
        };
        let within_mm = match force {
            Force::Unknown => EVERYWHERE,
            Force::Held(_) => range_mm,
        };
        let places = (&nodes[..], within_mm);
        let instruments = instruments_of(recordings, places, unknown)?;
        let with = |rule: Rule| {
            let rows = rows(recordings, places, rule, &instruments);
            let samples = rows.len();
            let equations = Equations::of(rows.into_iter(), samples, unknown);
            let free = equations.free([true; 2], [true; 2]);
            let error = equations.total.error(&equations.solve(0, &free)?);
            Some((error, rule, estimates(&equations, &free)?))
        };
        let mut tried: Vec<(f64, Rule, [f64; 2])> = Vec::new();
        for direction in directions(range_mm) {
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
        tried.small_sort_by(|a, b| a.0.total_cmp(&b.0));
        for factor in REFINED {
            let best = tried.first()?.1;
            let beside = [factor, 1.0 / factor];
            tried.extend((beside.iter()).filter_map(|f| with(best.scaled(*f)?)));
            tried.small_sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let (least, rule, _) = *tried.first()?;
        let rows = rows(recordings, places, rule, &instruments);
        let equations = Equations::of(rows.iter().copied(), rows.len(), unknown);
        // friction does not push, but there may be less of it than in slow motion
        let dissipation = match force {
            Force::Unknown => Dissipation::of(&rows, nodes.len()),
            Force::Held(whole) => {
                let whole = self::rows(whole, places, rule, &instruments);
                Dissipation::of(&whole, nodes.len())
            }
        };
        Some(Self {
            by_rule: (tried.iter())
                .filter(|(error, ..)| *error <= NEARLY * least)
                .map(|(.., estimates)| *estimates)
                .collect(),
            dissipation,
            enough_strokes,
            alike: matches!(force, Force::Unknown) && are_alike(recordings, range_mm),
            rows,
            equations,
        })
    }

    /// What it says of a term (0: mass, 1: damping) in a model with the kept ones.
    pub(super) fn evidence(&self, kept: [bool; 2], term: usize) -> Option<Found> {
        let (rows, equations) = (&self.rows, &self.equations);
        let free = equations.free(kept, [true; 2]);
        let weights = weights(equations, &free, term)?;
        let sum_with_force = weights.iter().zip(&equations.total.right[0]);
        let value: f64 = sum_with_force.map(|(w, r)| w * r).sum();
        let other = match kept {
            [true, true] => estimates(equations, &free)?[1 - term],
            _ => 0.0,
        };
        // what the model without m and b leaves of force and regressors
        let factors = [
            equations.solve(0, &free)?,
            equations.solve(1, &free)?,
            equations.solve(2, &free)?,
        ];
        let left = |row: &Row, signal: usize| row.signals[signal] - row.times(&factors[signal]);
        let of_force: Vec<f64> = (rows.iter())
            .map(|row| left(row, 0) - other * left(row, 2 - term))
            .collect();
        let of_regressor: Vec<f64> = rows.iter().map(|row| left(row, 1 + term)).collect();
        let instrument: Vec<f64> = rows.iter().map(|row| row.times(&weights)).collect();
        let residual: Vec<f64> = (of_force.iter().zip(&of_regressor))
            .map(|(f, r)| f - value * r)
            .collect();
        let scales = local_scales(rows, &residual);
        let unknowns = (weights.len() as f64).min(0.5 * rows.len() as f64);
        let inflated = rows.len() as f64 / (rows.len() as f64 - unknowns);
        let spread = Spread::of(&instrument, [&of_force, &of_regressor], &scales, inflated);
        // neither term is negative: an estimate that is shows an error of the model
        let model_error = self.model_error(&free, term, value)?.max(-value);
        let mut without = free.clone();
        without[free.len() - BORDER + term] = false;
        let [with, without] = [
            equations.error_left_out(&free)?,
            equations.error_left_out(&without)?,
        ];
        let own_bound = (spread.upper_bound(value.max(0.0), model_error, LEAST_RATIO))
            .filter(|_| self.enough_strokes && !(self.alike && Term::BOTH[term] == Term::Mass));
        let dissipated = match Term::BOTH[term] {
            Term::Mass => None,
            Term::Damping => self.dissipated(&residual, &scales, inflated),
        };
        let bound = match (own_bound, dissipated) {
            (Some(own), Some(dissipated)) if dissipated < own.value => Some(dissipated),
            (own, dissipated) => own.map(|own| own.value).or(dissipated),
        };
        Some(Found {
            value,
            standard_error: spread.variance(value).sqrt().hypot(model_error),
            model_error,
            gain: without / with - 1.0,
            is_determined: own_bound.is_some(),
            shown_from: (own_bound.filter(|own| own.shows)).map(|own| 2.0 * own.value),
            shows: own_bound.is_some_and(|own| own.shows && bound == Some(own.value)),
            upper_bound: bound,
        })
    }

    /// What the damping is at most because friction does not push, with the error of the forces.
    fn dissipated(&self, residual: &[f64], scales: &[f64], inflated: f64) -> Option<f64> {
        let Dissipation { damping, weights } = &self.dissipation;
        // no damping is beside the residual
        let none = vec![0.0; residual.len()];
        let error = Spread::of(weights, [residual, &none], scales, inflated);
        Some(damping.as_ref()?.max(0.0) + ONE_SIDED * error.variance(0.0).sqrt())
    }

    /// The largest difference from the estimate that models have which fit nearly as well.
    fn model_error(&self, free: &[bool], term: usize, value: f64) -> Option<f64> {
        // what friction does at low speed is not known: its column may be there or not
        let mut constant_friction = free.to_vec();
        constant_friction[free.len() - BORDER + 2] = false;
        let without_column = estimates(&self.equations, &constant_friction)?[term];
        let best = self.by_rule.first()?[term];
        let rules = (self.by_rule.iter()).map(|rule| (rule[term] - best).abs());
        Some(rules.fold((without_column - value).abs(), f64::max))
    }
}

/// The instruments at the scales that show most of acceleration and velocity.
fn instruments_of(
    recordings: &[&Recording],
    places: (&[f64], [f64; 2]),
    unknown: usize,
) -> Option<Vec<Instruments>> {
    let (low, high) = (places.0.first()?, places.0.last()?);
    let delta_mm = USUAL_PLAY * (high - low);
    let rule = Rule {
        direction: Direction::Play { delta_mm },
        smooth: 1,
    };
    // for acceleration and velocity: how much is shown, and the width
    let mut best = [(f64::NEG_INFINITY, 1); 2];
    for width in instruments::widths(recordings) {
        let of: Vec<Instruments> = (recordings.iter())
            .map(|r| Instruments::new(r, width))
            .collect();
        let rows = rows(recordings, places, rule, &of);
        let samples = rows.len();
        let equations = Equations::of(rows.into_iter(), samples, unknown);
        let free = equations.free([true; 2], [true; 2]);
        for (term, best) in best.iter_mut().enumerate() {
            let shown = shown_by(&equations, &free, term).unwrap_or(0.0);
            if shown > best.0 {
                *best = (shown, width);
            }
        }
    }
    let [(_, for_a), (_, for_v)] = best;
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
    let at = free.len() - BORDER;
    let force = equations.solve(0, free)?;
    let shares = shares(equations, free)?;
    Some(shares.map(|of| of[0] * force[at] + of[1] * force[at + 1]))
}

/// Which multiples of what a signal has of the two instruments are mass and damping: the inverse of what
/// acceleration and velocity have of them, 0 for a term that is not free.
fn shares(equations: &Equations, free: &[bool]) -> Option<[[f64; 2]; 2]> {
    let at = free.len() - BORDER;
    let a = equations.solve(1, free)?;
    let v = equations.solve(2, free)?;
    Some(match [free[at], free[at + 1]] {
        [true, true] => {
            let determinant = a[at] * v[at + 1] - v[at] * a[at + 1];
            [
                [v[at + 1] / determinant, -v[at] / determinant],
                [-a[at + 1] / determinant, a[at] / determinant],
            ]
        }
        [true, false] => [[1.0 / a[at], 0.0], [0.0; 2]],
        [false, true] => [[0.0; 2], [0.0, 1.0 / v[at + 1]]],
        [false, false] => [[0.0; 2]; 2],
    })
}

/// The factors of the instrument that is free of everything that the model explains beside the term, and
/// whose sum with the regressor is 1.
fn weights(equations: &Equations, free: &[bool], term: usize) -> Option<Vec<f64>> {
    let at = free.len() - BORDER;
    let column = |k: usize| {
        let mut unit = vec![0.0; free.len()];
        unit[at + k] = 1.0;
        equations.total.normal.solve(&unit, free)
    };
    let (of_a, of_v) = (column(0)?, column(1)?);
    let [for_a, for_v] = shares(equations, free)?[term];
    let both = of_a.iter().zip(&of_v);
    Some(both.map(|(a, v)| for_a * a + for_v * v).collect())
}

/// The rms residual around the node of each sample, and at its speed, low or not.
fn local_scales(rows: &[Row], residual: &[f64]) -> Vec<f64> {
    let nodes = rows.iter().map(Row::node).max().unwrap_or(0) + 1;
    // sums of squares and counts
    let mut of_node = vec![(0.0, 0.0); nodes];
    let mut of_speed = [(0.0, 0.0); 2];
    for (row, residual) in rows.iter().zip(residual) {
        let kinds = [
            &mut of_node[row.node()],
            &mut of_speed[usize::from(row.slow)],
        ];
        for (square, count) in kinds {
            *square += residual * residual;
            *count += 1.0;
        }
    }
    let all: f64 = of_speed.iter().map(|(square, _)| square).sum();
    let mean = (all / rows.len() as f64).max(f64::MIN_POSITIVE);
    let ratio = |(square, count): (f64, f64)| square / count / mean;
    let scale = |row: &Row| {
        let square = ratio(of_node[row.node()]) * ratio(of_speed[usize::from(row.slow)]);
        (mean * square.max(LEAST_SCALE * LEAST_SCALE)).sqrt()
    };
    rows.iter().map(scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All models that fit nearly as well have the term, but one has hardly any of it.
    #[test]
    fn what_is_below_two_of_its_printed_errors_is_not_found() {
        let of = |value: f64, standard_error: f64, model_error: f64, gain: f64| Found {
            value,
            standard_error,
            model_error,
            gain,
            is_determined: true,
            shown_from: Some(2.0),
            shows: true,
            upper_bound: Some(1.0),
        };
        for (value, found) in [(1.4, false), (1.9, false), (2.0, true), (3.9, true)] {
            let term = of(value, 1.0, 0.97, 0.005);
            assert_eq!((term.is_shown(), term.is_found()), (true, found), "{value}");
            // a table takes up what is shown, as before
            assert!(term.may_be_carried(), "{value}");
        }
        // by what it predicts, above 2.33
        assert!(of(2.4, 1.0, 0.5, 0.3).is_found());
        assert!(!of(2.2, 1.0, 0.5, 0.3).is_shown());
    }
}
