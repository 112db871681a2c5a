//! How weak a force and how short a motion may be and still be judged: in proportion to the
//! realization, so that a key of 4 mm and 0.6 N is judged as well as a lever of 35 mm and 9 N,
//! down to what the device resolves.

use super::moments::Moments;
use super::predicted::Predicted;
use super::{Played, is_inside};
use crate::outcome::Sample;
use study_base::perception::force_jnd_n;
use study_wire::elements;
use study_wire::predict::{self, Motion};
use study_wire::servo::Law;

/// The least force of a lever, N: that of every realization whose forces range over 1 N or more.
const LEAST_N: f64 = 0.1;
/// The least force as a share of the range of forces.
const OF_RANGE: f64 = 0.1;
/// The least force of a device as a share of the force limit of the playback.
const RESOLVED: f64 = 1e-3;
/// The least travel of a lever, mm, and as a share of the range.
const LEAST_TRAVEL_MM: f64 = 5.0;
const OF_TRAVEL: f64 = 0.5;
/// Positions at which the forces are evaluated.
const PLACES: u32 = 100;

/// What a playback of a realization has to have to be judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// Least standard deviation of the force; a weaker force counts as this one, rms, and
    /// tables that differ by less, rms, are not told apart, N.
    pub(super) force_n: f64,
    /// Least distance, mm.
    pub(super) travel_mm: f64,
    /// Range of the forces of the realization, N: at its trained speed, but no less than twice
    /// the standard deviation in this playback, so that a mass alone has one, and half of the
    /// greatest force, so that a constant force has one. Within the limit of the playback.
    pub(super) range_n: f64,
    /// What the device resolves, N.
    pub(super) resolved_n: f64,
    /// Just noticeable difference in force, N.
    pub(super) jnd_n: f64,
}

impl Scale {
    /// What the realization of a playback asks for; `forces` are those expected in it.
    pub(super) fn of(played: &Played<'_>, samples: &[Sample], forces: &[Predicted]) -> Self {
        let [low, high] = played.what.range_mm;
        let limit_n = played.servo.force_n;
        let resolved_n = RESOLVED * limit_n;
        let [least_n, most_n] = forces_n(played);
        // The wall beyond the range is not of the realization.
        let own_n = || {
            (samples.iter().zip(forces))
                .filter(|(s, _)| is_inside(played, s))
                .map(|(_, p)| p.force_n)
        };
        let greatest_n = own_n().fold(least_n.abs().max(most_n.abs()), |most, n| most.max(n.abs()));
        let varying = Moments::of(own_n().map(|n| (n, 0.0)));
        let twice_sd_n = 2.0 * varying.var_x().unwrap_or(0.0).sqrt();
        let within_n = |force_n: f64| force_n.min(limit_n).max(-limit_n);
        Self {
            force_n: (OF_RANGE * (most_n - least_n)).clamp(resolved_n.min(LEAST_N), LEAST_N),
            travel_mm: LEAST_TRAVEL_MM.min(OF_TRAVEL * (high - low)),
            range_n: (within_n(most_n) - within_n(least_n))
                .max(twice_sd_n)
                .max(0.5 * greatest_n.min(limit_n)),
            resolved_n,
            jnd_n: force_jnd_n(greatest_n).max(resolved_n),
        }
    }
}

/// The least and the largest force at the trained speed in both directions, N.
fn forces_n(played: &Played<'_>) -> [f64; 2] {
    let [low, high] = played.what.range_mm;
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for place in 0..=PLACES {
        let x_mm = low + (high - low) * f64::from(place) / f64::from(PLACES);
        for sign in [1.0, -1.0] {
            let v_mm_s = sign * played.what.trained_mm_s;
            let force_n = match &played.what.law {
                Law::Table { table, .. } => predict::force_n(
                    table,
                    sign,
                    Motion {
                        v_mm_s,
                        ..Motion::at_rest(x_mm)
                    },
                ),
                Law::Mechanism(what) => {
                    let damping = what.scalars.follower_n_s_per_mm + what.scalars.handle_n_s_per_mm;
                    what.static_n(x_mm, sign > 0.0) + damping * v_mm_s
                }
                Law::Elements(what) => {
                    let handle = Motion {
                        v_mm_s,
                        ..Motion::at_rest(x_mm)
                    };
                    let mut state = elements::State::settled(what, handle);
                    state.step(what, handle, 1.0 / played.servo.servo_hz)
                }
            };
            (least, most) = (least.min(force_n), most.max(force_n));
        }
    }
    [least, most]
}
