//! Whether the force was recorded later than the motion.
//!
//! A channel with a filter or a buffer of its own is late by some milliseconds, which identification takes for
//! damping of either sign, by position. With the force moved back the reference model fits better. Friction, play and mass
//! do not have this effect, because the model has them; a viscoelastic target may have.

use super::equations::{BORDER, Equations, PER_NODE, Row, rows};
use super::instruments::Instruments;
use super::{DELTAS, nodes};
use crate::recording::Recording;
use study_wire::predict::Direction;

/// Longest lag that is tried, s.
const MOST_S: f64 = 0.03;
/// Steps in which lags are tried at first, s, and at last.
const STEP_S: [f64; 2] = [5e-3, 1e-3];
/// Longest sampling interval of a recording that shows a lag, s.
const INTERVAL_S: f64 = 5e-3;
/// Samples of the comparison.
const SAMPLES: usize = 8000;
/// Samples that are enough to see a lag.
const ENOUGH: usize = 200_000;
/// The squared error without the lag is at least so many times that with it.
const LEAST_GAIN: f64 = 1.5;
/// A shorter lag is not worth a word, s, nor one below this many samples.
const LEAST_S: f64 = 2e-3;
const LEAST_SAMPLES: f64 = 1.5;
/// Time over which velocity and acceleration are taken, s.
const DERIVATIVES_S: f64 = 0.01;

/// The time by which the force is later than the motion.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the force seems to be {:.1} ms {} than the position: moved by that, the squared error of a model of position, direction, mass and damping is {gain:.1} times less; look for a filter or a buffer in one of the channels, and move the column before identification", 1e3 * .lag_s.abs(), if *.lag_s > 0.0 { "later" } else { "earlier" })]
pub struct Lag {
    /// s; negative if the force is earlier.
    pub lag_s: f64,
    /// How many times the squared error is larger without it.
    pub gain: f64,
}

/// The lag of the force in some recordings of one target; `None` if there is none, or if they cannot show it.
pub fn of(recordings: &[&Recording], range_mm: [f64; 2]) -> Option<Lag> {
    let recordings = &beginnings(recordings);
    let recordings: Vec<&Recording> = recordings.iter().collect();
    let recordings = recordings.as_slice();
    let samples: usize = recordings.iter().map(|r| r.len()).sum();
    let seconds: f64 = recordings.iter().map(|r| r.duration_s()).sum();
    let interval_s = seconds / samples as f64;
    let nodes = nodes(recordings, range_mm);
    if interval_s > INTERVAL_S || samples < 10 * PER_NODE * nodes.len() {
        return None;
    }
    let width = ((DERIVATIVES_S / interval_s / 8.0) as usize / 2 * 2) + 1;
    let instruments: Vec<Instruments> = (recordings.iter())
        .map(|r| Instruments::new(r, width))
        .collect();
    let travel_mm = range_mm[1] - range_mm[0];
    let rules = DELTAS.iter().flat_map(|share| {
        let delta_mm = share * travel_mm;
        [Direction::Play { delta_mm }, Direction::Dahl { delta_mm }]
    });
    let margin_s = MOST_S + DERIVATIVES_S;
    let every = samples.div_ceil(SAMPLES);
    let models: Vec<Model<'_>> = rules
        .chain([Direction::Sign])
        .filter_map(|rule| Model::new(recordings, &nodes, rule, &instruments, (every, margin_s)))
        .collect();
    let error = |lag_s: f64| {
        let of = models.iter().filter_map(|model| model.error(lag_s));
        of.fold(f64::INFINITY, f64::min)
    };
    let least = |lags: &mut dyn Iterator<Item = f64>| {
        lags.map(|lag_s| (error(lag_s), lag_s))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let steps = (MOST_S / STEP_S[0]) as i32;
    let (_, coarse_s) = least(&mut (-steps..=steps).map(|k| f64::from(k) * STEP_S[0]))?;
    let (lowest, lag_s) = least(&mut (-4..=4).map(|k| coarse_s + f64::from(k) * STEP_S[1]))?;
    let [before, after] = [-1.0, 1.0].map(|side| error(lag_s + side * STEP_S[1]));
    let curvature = before - 2.0 * lowest + after;
    let fraction = match curvature > 0.0 {
        true => (0.5 * (before - after) / curvature).clamp(-1.0, 1.0),
        false => 0.0,
    };
    let lag_s = lag_s + fraction * STEP_S[1];
    let gain = error(0.0) / lowest;
    let inside = lag_s.abs() < MOST_S - STEP_S[1];
    let long = lag_s.abs() >= LEAST_S.max(LEAST_SAMPLES * interval_s);
    (inside && long && gain >= LEAST_GAIN).then_some(Lag { lag_s, gain })
}

/// The first [`ENOUGH`] samples.
fn beginnings(recordings: &[&Recording]) -> Vec<Recording> {
    let mut left = ENOUGH;
    let mut part = |recording: &&Recording| {
        let count = recording.len().min(left);
        left -= count;
        recording.select(&(0..count).collect::<Vec<_>>())
    };
    let parts = recordings.iter().map(&mut part);
    parts.filter(|part| part.len() > 3).collect()
}

/// The reference model with one rule, at some of the samples.
struct Model<'r> {
    equations: Equations,
    rows: Vec<Row>,
    /// The recording and the sample of each row.
    places: Vec<(&'r Recording, usize)>,
    free: Vec<bool>,
}

impl<'r> Model<'r> {
    fn new(
        recordings: &[&'r Recording],
        nodes: &[f64],
        rule: Direction,
        instruments: &[Instruments],
        (every, margin_s): (usize, f64),
    ) -> Option<Self> {
        let all = rows(recordings, nodes, rule, instruments);
        let places = recordings
            .iter()
            .flat_map(|r| (0..r.len()).map(move |i| (*r, i)));
        let inside = |(r, i): &(&Recording, usize)| {
            let last = r.t_s[r.len() - 1] - margin_s;
            (r.t_s[0] + margin_s..=last).contains(&r.t_s[*i])
        };
        let (rows, places): (Vec<_>, Vec<_>) = (all.into_iter().zip(places))
            .filter(|(_, place)| place.1 % every == 0 && inside(place))
            .unzip();
        if rows.len() < 10 * (PER_NODE * nodes.len() + BORDER) {
            return None;
        }
        let equations = Equations::of(&rows, nodes.len());
        Some(Self {
            free: equations.free([true; 2], [true; 2]),
            equations,
            rows,
            places,
        })
    }

    /// The squared error of the force that is recorded `lag_s` later.
    fn error(&self, lag_s: f64) -> Option<f64> {
        let mut total = self.equations.total.clone();
        total.right[0].fill(0.0);
        total.square[0] = 0.0;
        for (row, (recording, i)) in self.rows.iter().zip(&self.places) {
            let force_n = at(recording, *i, lag_s);
            row.add_times(force_n, &mut total.right[0]);
            total.square[0] += force_n * force_n;
        }
        let x = total.normal.solve(&total.right[0], &self.free)?;
        Some(total.error(&x))
    }
}

/// The force `later_s` after a sample, on the line between its neighbors.
fn at(recording: &Recording, i: usize, later_s: f64) -> f64 {
    let (t, f) = (&recording.t_s, &recording.f_n);
    let wanted = t[i] + later_s;
    let mut left = i;
    while left > 0 && t[left] > wanted {
        left -= 1;
    }
    while left + 2 < t.len() && t[left + 1] < wanted {
        left += 1;
    }
    let share = (wanted - t[left]) / (t[left + 1] - t[left]);
    f[left] + share.clamp(0.0, 1.0) * (f[left + 1] - f[left])
}
