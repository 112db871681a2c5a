//! Whether the force was recorded later than the motion.
//!
//! A channel with a filter or a buffer of its own is late by some milliseconds, which identification takes for
//! damping of either sign, by position. With the force moved back the reference model fits better. Friction, play and mass
//! do not have this effect, because the model has them; a viscoelastic target may have.

use super::equations::{EVERYWHERE, Equations, PER_NODE, Rule, directions, nodes, rows};
use super::instruments::Instruments;
use super::noise::pairs_averaged;
use crate::recording::Recording;

/// Longest lag that is tried, s.
const MOST_S: f64 = 0.03;
/// Steps in which lags are tried at first, s, and at last.
const STEP_S: [f64; 2] = [5e-3, 1e-3];
/// Longest sampling interval of a recording that shows a lag, s.
const INTERVAL_S: f64 = 5e-3;
/// Samples, at most.
const ENOUGH: usize = 20_000;
/// The squared error without the lag is at least so many times that with it.
const LEAST_GAIN: f64 = 1.5;
/// A shorter lag is not worth a word, s, nor one below this many samples.
const LEAST_S: f64 = 2e-3;
const LEAST_SAMPLES: f64 = 1.5;

/// The time by which the force is later than the motion.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the force seems to be {:.1} ms {} than the position: moved by that, the squared error of a model of position, direction, mass and damping is {gain:.1} times less; look for a filter or a buffer in one of the channels, and move the column before identification", 1e3 * .lag_s.abs(), if *.lag_s > 0.0 { "later" } else { "earlier" })]
pub struct Lag {
    /// s; negative if the force is earlier.
    pub lag_s: f64,
    /// How many times the squared error is larger without it.
    pub gain: f64,
}

/// The lag of the force in a recording; `None` if there is none, or if the recording cannot show it.
pub fn of(recording: &Recording) -> Option<Lag> {
    let count = recording.len().min(ENOUGH);
    let recording = recording.select(&(0..count).collect::<Vec<_>>());
    let interval_s = recording.duration_s() / (count - 1) as f64;
    let range_mm = recording.range_mm();
    let nodes = nodes(&[&recording], range_mm);
    if interval_s > INTERVAL_S || count < 10 * PER_NODE * nodes.len() {
        return None;
    }
    let error = |lag_s: f64| {
        let mut moved = later(&recording, lag_s);
        // the noise of differences of single samples would hide what damping explains
        while moved.duration_s() / (moved.len() as f64) < 0.5 * INTERVAL_S {
            moved = pairs_averaged(&moved);
        }
        let instruments = [Instruments::new(&moved, 1)];
        let of = |direction| {
            let rule = Rule {
                direction,
                smooth: 1,
                other_lengths: false,
            };
            let rows = rows(&[&moved], (&nodes, EVERYWHERE), rule, &instruments);
            let equations = Equations::of(rows.into_iter(), moved.len(), nodes.len());
            let x = equations.solve(0, &equations.free([true; 2], [true, false]))?;
            Some(equations.total.error(&x))
        };
        directions(range_mm)
            .filter_map(of)
            .fold(f64::INFINITY, f64::min)
    };
    let least = |lags: &mut dyn Iterator<Item = f64>| {
        lags.map(|lag_s| (error(lag_s), lag_s))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let steps = (MOST_S / STEP_S[0]) as i32;
    let (_, coarse_s) = least(&mut (-steps..=steps).map(|k| f64::from(k) * STEP_S[0]))?;
    let (lowest, lag_s) = least(&mut (-4..=4).map(|k| coarse_s + f64::from(k) * STEP_S[1]))?;
    let gain = error(0.0) / lowest;
    let inside = lag_s.abs() < MOST_S - STEP_S[1];
    let long = lag_s.abs() >= LEAST_S.max(LEAST_SAMPLES * interval_s);
    (inside && long && gain >= LEAST_GAIN).then_some(Lag { lag_s, gain })
}

/// The recording with the force from `lag_s` later, on the line between neighbors, without the ends, where no lag that
/// is tried has a force.
fn later(recording: &Recording, lag_s: f64) -> Recording {
    let (t, f) = (&recording.t_s, &recording.f_n);
    let (first_s, last_s) = (t[0] + MOST_S, t[t.len() - 1] - MOST_S);
    let inside: Vec<usize> = (0..t.len())
        .filter(|i| (first_s..=last_s).contains(&t[*i]))
        .collect();
    let mut moved = recording.select(&inside);
    for (force_n, at_s) in moved.f_n.iter_mut().zip(&moved.t_s) {
        let wanted = at_s + lag_s;
        let right = t.partition_point(|t| *t < wanted).clamp(1, t.len() - 1);
        let share = (wanted - t[right - 1]) / (t[right] - t[right - 1]);
        *force_n = f[right - 1] + share.clamp(0.0, 1.0) * (f[right] - f[right - 1]);
    }
    moved
}
