//! The force of the table during a playback, beside that of the device.

use super::Played;
use super::comparable::{SLOW_S, comparable, direction_known, with_doubt};
use super::motion::{in_order, interval};
use crate::outcome::Sample;

/// A playback, and what its table gives for the same motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// The finite samples in the order of time.
    pub samples: Vec<Sample>,
    /// The force of the table at each of them, N.
    pub force_n: Vec<f64>,
    /// Rms difference between the commanded force and that of the table, N, over the samples
    /// at which they can be compared; `None` if there are none, or fewer than 400 a second.
    pub rms_difference_n: Option<f64>,
}

/// The force of the table at each sample, by the servo of `played`.
pub fn expected(played: &Played<'_>) -> Expected {
    let samples = in_order(played.samples);
    let forces = with_doubt(played, &samples);
    let interval_s = interval(&samples).filter(|interval_s| *interval_s <= SLOW_S);
    let keep = interval_s.map_or(Vec::new(), |interval_s| {
        let known = direction_known(played, &samples, &forces, interval_s);
        comparable(played, &samples, &forces, &known)
    });
    let squares: Vec<f64> = (samples.iter().zip(&forces).zip(&keep))
        .filter(|(_, keep)| **keep)
        .map(|((sample, force), _)| (sample.force_command_n - force.force_n).powi(2))
        .collect();
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    Expected {
        force_n: forces.iter().map(|force| force.force_n).collect(),
        rms_difference_n: (!squares.is_empty()).then(|| mean.sqrt()),
        samples,
    }
}
