//! How weak a force and how short a motion may be and still be judged: in proportion to the
//! realization, so that a key of 4 mm and 0.6 N is judged as well as a lever of 35 mm and 9 N,
//! down to what the device resolves.

use super::Played;
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
}

impl Scale {
    pub(super) fn of(played: &Played<'_>) -> Self {
        let [low, high] = played.what.range_mm;
        let floor_n = RESOLVED * played.servo.force_n;
        Self {
            force_n: (OF_RANGE * range_n(played)).clamp(floor_n.min(LEAST_N), LEAST_N),
            travel_mm: LEAST_TRAVEL_MM.min(OF_TRAVEL * (high - low)),
        }
    }
}

/// The range of the forces at the trained speed in both directions, N.
fn range_n(played: &Played<'_>) -> f64 {
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
    most - least
}
