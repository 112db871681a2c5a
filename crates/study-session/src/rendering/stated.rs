//! What the constants that a device states change in the force of a table.
//!
//! A device may need another slew limit, damping, filter, ramp or wall than docs/wire.md, and the
//! host predicts with what it states. That explains its force; it does not make it that of the
//! table: the commanded force is compared a second time, with the constants of docs/wire.md.

use super::band::bands;
use super::comparable::{AFTER_RAMP_S, comparable, direction_known, with_doubt};
use super::lasting::{largest_level, largest_mean};
use super::scale::Scale;
use super::shares::largest_share;
use super::{LASTING_S, Played, WINDOW_S, is_inside, larger};
use crate::outcome::Sample;
use study_wire::servo::ServoSettings;

/// The longest ramp that a device may state, s (docs/wire.md): later forces are compared.
const LONGEST_RAMP_S: f64 = 1.0;

/// How far the commanded force is from that of the table with the constants of docs/wire.md.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stated {
    /// Largest rms difference over rms force, as of the first verdict.
    pub(super) share: Option<f64>,
    /// Largest difference that lasted 20 ms, N.
    pub(super) lasting_n: Option<f64>,
    /// Largest mean size of the difference over 50 ms, N.
    pub(super) level_n: Option<f64>,
}

/// The servo of docs/wire.md at the rate and with the mass of the handle that the device states.
fn of_the_wire(servo: ServoSettings) -> ServoSettings {
    ServoSettings {
        servo_hz: servo.servo_hz,
        force_n: servo.force_n,
        velocity_mm_s: servo.velocity_mm_s,
        least_mass_kg: servo.least_mass_kg,
        overtravel_mm: servo.overtravel_mm,
        jump_mm: servo.jump_mm,
        ..ServoSettings::default()
    }
}

/// Compares with the constants of docs/wire.md; `None` if the device states the same.
pub(super) fn stated(
    played: &Played<'_>,
    samples: &[Sample],
    interval_s: f64,
    scale: Scale,
) -> Option<Stated> {
    let servo = of_the_wire(played.servo);
    if servo == played.servo || !played.servo_told {
        return None;
    }
    let played = &Played {
        servo,
        ..played.clone()
    };
    let forces = with_doubt(played, samples);
    let known = direction_known(played, samples, &forces, interval_s);
    let keep = comparable(played, samples, &forces, &known);
    let bands = bands(played, samples, &forces, &known, interval_s);
    let from_s = played.servo.ramp_s.max(LONGEST_RAMP_S) + AFTER_RAMP_S;
    let beyond: Vec<Option<f64>> = (samples.iter().zip(&bands))
        .map(|(s, band)| {
            let counts = band.judged && s.t_s >= from_s && played.is_whole(s);
            counts.then(|| band.beyond_n(s.force_command_n))
        })
        .collect();
    let sizes: Vec<Option<f64>> = (beyond.iter().zip(samples))
        .map(|(n, s)| n.filter(|_| is_inside(played, s)).map(f64::abs))
        .collect();
    let share = |compared: &dyn Fn(usize) -> bool| {
        largest_share(samples, interval_s, scale.force_n, |i| {
            let apart_n = beyond[i].filter(|_| compared(i))?;
            Some([forces[i].force_n, apart_n])
        })
    };
    Some(Stated {
        share: larger([share(&|i| keep[i]), share(&|_| true)]),
        lasting_n: largest_mean(samples, WINDOW_S, |i| beyond[i]),
        level_n: largest_level(samples, interval_s, LASTING_S, &sizes),
    })
}
