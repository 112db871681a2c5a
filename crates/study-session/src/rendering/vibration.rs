//! Vibration and ticks that are not of the table, against what a hand feels.
//!
//! A hand that holds an object detects vibration of less than 0.01 µm at 150 to 200 Hz in the
//! most sensitive persons, with a threshold that rises on both sides (Brisben, Hsiao & Johnson
//! 1999, J. Neurophysiol. 81, 1548–1558, 19 persons, cylinder of 32 mm; Israr, Choi & Tan 2006,
//! IROS, 3642–3647, for a stylus). [`FELT_M_S2`] is 0.09 µm at 200 Hz: nine times as much, so
//! that nothing is called vibration that might not be felt. Energy is integrated over some
//! tenths of a second (Verrillo 1965, J. Acoust. Soc. Am. 37, 843–846), so that a tick counts by
//! its root mean square over [`WINDOW_S`]. What a table vibrates by itself, at its steps, masks a
//! change of less than a fifth (Craig 1972, Percept. Psychophys. 11, 150–152).

use super::Played;
use super::lasting::levels;
use super::scale::Scale;
use crate::outcome::Sample;

/// Acceleration of the handle that is felt as vibration, m/s², root mean square.
const FELT_M_S2: f64 = 0.1;
/// Mass of a handle that the device does not tell, kg.
const HANDLE_KG: f64 = 0.2;
/// Share of its own vibration by which a force changes without being noticed.
const MASKED: f64 = 0.2;
/// Time in which the hand sums vibration, s.
const WINDOW_S: f64 = 0.1;
/// Least share of that time that has to be known: a step that is missing in one of two forces
/// would be a vibration of the other.
const KNOWN: f64 = 0.95;
/// What the middle of the values over twice this time follows is no vibration, s: what is slower than about
/// 30 Hz, and the steps of a force.
const HALF_S: f64 = 0.01;

/// The slow part of a series, as [`smoothed`](super::lasting::smoothed).
type Slow = fn(&[Sample], f64, f64, &[Option<f64>]) -> Vec<Option<f64>>;

/// The force of a vibration of the handle that is felt, N, root mean square, and no less than half
/// of a just noticeable difference of a force.
pub(super) fn felt_n(played: &Played<'_>, scale: Scale) -> f64 {
    let least_kg = -played.servo.least_mass_kg;
    let told = least_kg.is_finite() && least_kg > 0.0;
    let handle_kg = if told { least_kg } else { HANDLE_KG };
    (FELT_M_S2 * handle_kg).max(0.5 * scale.jnd_n)
}

/// The largest vibration of a force beyond that which is right, N, root mean square over
/// [`WINDOW_S`]; `None` where too little is known. `slow` is what of a force is no vibration; `pair`
/// is the right force at a sample and the force that is judged, N. Their powers are compared: what comes a little later is no vibration.
pub(super) fn largest_n(
    samples: &[Sample],
    interval_s: f64,
    slow: Slow,
    pair: impl Fn(usize) -> Option<[f64; 2]>,
) -> Option<f64> {
    let pairs: Vec<Option<[f64; 2]>> = (0..samples.len()).map(pair).collect();
    let [right, judged] = [0, 1].map(|which| {
        let forces: Vec<Option<f64>> = pairs.iter().map(|p| p.map(|p| p[which])).collect();
        let slow = slow(samples, interval_s, HALF_S, &forces);
        let fast = forces.iter().zip(slow);
        let squares = fast.map(|(force, slow)| Some((force.as_ref()? - slow?).powi(2)));
        let squares: Vec<Option<f64>> = squares.collect();
        levels(samples, interval_s, WINDOW_S, KNOWN, &squares)
    });
    let beyond = right.into_iter().zip(judged);
    let beyond = beyond.filter_map(|(right, judged)| {
        Some((judged?.sqrt() - (1.0 + MASKED) * right?.sqrt()).max(0.0))
    });
    beyond.reduce(f64::max)
}
