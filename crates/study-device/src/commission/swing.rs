//! The swing of a free handle by which a motor weighs itself.
//!
//! The rest of a weak spring lies beside the handle, and the handle swings to it by itself: no hand
//! has to let it go, so every swing begins in the same way, from rest and within the ramp of the
//! device, and nothing pushes harder than the spring at its first place. Two springs, one
//! stiffer than the other, tell a lag of the motor from damping; each is swung on twice, there and back.
//!
//! The damping of a spring is its stiffness times [`LONGEST_LAG_S`]: a motor that is late by less
//! takes no more energy out of the spring than the damping takes from the swing, so that the swing
//! decays; beyond the first place the damping is four times that.

use super::NoRoom;
use super::spring::table_of;
use serde::{Deserialize, Serialize};
use study_base::limits::{BadLimit, Limits};
use study_haptics::model::Realization;
use study_haptics::swing::{NoSwing, Point, apparent_kg, estimate};
use study_session::outcome::Sample;
use study_wire::servo::ServoSettings;

/// A swing decays with any lag up to this, s.
pub const LONGEST_LAG_S: f64 = 0.025;
/// From where a swing begins to its rest, mm, and as a share of the stroke.
const TRAVEL_MM: f64 = 10.0;
const TRAVEL: f64 = 0.12;
/// How far from its rest a handle may come, in travels.
const REACH: f64 = 1.3;
/// Beyond this it is braked, in travels, and how much more.
const BRAKED: f64 = 1.08;
const BRAKES: f64 = 4.0;
/// Least distance from a stop, mm, and as a share of the stroke.
const CLEAR_MM: f64 = 2.0;
const CLEAR: f64 = 0.02;
/// Angular frequency of the stiffer swing, rad/s: least and most.
const OMEGA_RAD_S: [f64; 2] = [14.0, 40.0];
/// Stiffness of the stiffer over that of the softer spring.
const STIFFER: f64 = 2.5;
/// At its first place the stiffer spring pulls with this many times the friction.
const OVER_FRICTION: f64 = 16.0;
/// Periods of a swing that are recorded, after a ramp, s.
const PERIODS: f64 = 2.5;
const RAMP_S: f64 = 0.4;
/// Force limit over the force at the first place.
const FORCE: f64 = 1.4;
/// Velocity limit over the speed of a swing without losses, and the least one, mm/s.
const SPEED: f64 = 1.8;
const LEAST_SPEED_MM_S: f64 = 150.0;
/// Samples on each side of one from which its speed is taken.
const APART_SAMPLES: usize = 4;
/// Largest residual of a clean swing, as a share of its travel.
const RESIDUAL: f64 = 0.03;
/// Largest difference of the masses that each spring alone tells, as a share.
const APART: f64 = 0.06;

/// A spring to swing on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SwingSpring {
    /// Where the handle is when it begins, mm.
    pub from_mm: f64,
    /// Its rest, mm.
    pub rest_mm: f64,
    /// From the first place to the rest, mm.
    pub travel_mm: f64,
    /// Stiffness, N/mm.
    pub stiffness_n_per_mm: f64,
    /// Duration of the playback, s.
    pub seconds: f64,
    /// Velocity limit, mm/s.
    pub velocity_mm_s: f64,
}

/// Why a motor cannot weigh itself.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum NoSelfWeighing {
    #[error(transparent)]
    NoRoom(#[from] NoRoom),
    #[error("the friction of {friction_n:.2} N is too much for a swing of {mass_kg:.2} kg")]
    Friction { friction_n: f64, mass_kg: f64 },
    #[error("its force limit is below the {0:.1} N of a swing")]
    Force(f64),
    #[error("{0}")]
    Moved(String),
    #[error(transparent)]
    NoSwing(#[from] NoSwing),
    #[error(
        "a hand or a cable touched the handle: the two springs show {0:.2} and {1:.2} kg, and {2:.2} mm are left"
    )]
    Touched(f64, f64, f64),
}

/// Springs for a handle of about this mass and friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SwingPlan {
    /// About the mass of the handle over the gain of the motor, kg.
    pub mass_kg: f64,
    /// About its friction, N.
    pub friction_n: f64,
}

/// The number of swings: twice on the softer and on the stiffer spring.
pub const SWINGS: usize = 4;

/// Above this mass no handle is searched for, kg.
const MOST_KG: f64 = 1.5;

fn travel_mm([low, high]: [f64; 2]) -> f64 {
    TRAVEL_MM.min(TRAVEL * (high - low))
}

impl SwingPlan {
    /// With what the mass of a handle is searched for, from a guess: springs that pull hard enough
    /// against its friction, if a handle that is not too heavy would swing on them.
    pub fn first(guess_kg: f64, friction_n: f64, stroke_mm: [f64; 2]) -> Self {
        let [_, most] = OMEGA_RAD_S;
        let least_kg =
            1.01 * OVER_FRICTION * friction_n / (1e-3 * travel_mm(stroke_mm) * most * most);
        Self {
            mass_kg: match least_kg <= MOST_KG {
                true => guess_kg.max(least_kg),
                false => guess_kg,
            },
            friction_n,
        }
    }

    /// The spring of the nth swing, for a handle that rests at `at_mm` between the stops.
    ///
    /// # Errors
    /// [`NoSelfWeighing`] if there is no room, or friction is too much.
    pub fn spring(
        &self,
        nth: usize,
        at_mm: f64,
        stroke_mm: [f64; 2],
        device: Limits,
    ) -> Result<SwingSpring, NoSelfWeighing> {
        let Self {
            mass_kg,
            friction_n,
        } = *self;
        let [low, high] = stroke_mm;
        let travel_mm = travel_mm(stroke_mm);
        // the table ends within the stroke
        let clear_mm = CLEAR_MM.min(CLEAR * (high - low)) + (REACH - 1.0) * travel_mm;
        let [from_mm, to_mm] = [low + clear_mm, high - clear_mm];
        if !(from_mm..=to_mm).contains(&at_mm) {
            return Err(NoRoom {
                at_mm,
                from_mm,
                to_mm,
            }
            .into());
        }
        let needed = (OVER_FRICTION * friction_n / (1e-3 * travel_mm * mass_kg)).sqrt();
        let [least, most] = OMEGA_RAD_S;
        if needed.is_nan() || needed > most {
            return Err(NoSelfWeighing::Friction {
                friction_n,
                mass_kg,
            });
        }
        let softer = if nth.is_multiple_of(2) { STIFFER } else { 1.0 };
        let omega = needed.max(least) / softer.sqrt();
        let stiffness_n_per_mm = 1e-3 * mass_kg * omega * omega;
        let largest_n = FORCE * stiffness_n_per_mm * travel_mm;
        if largest_n > device.force_n.get() {
            return Err(NoSelfWeighing::Force(largest_n));
        }
        // towards the middle
        let side = if at_mm < 0.5 * (low + high) {
            1.0
        } else {
            -1.0
        };
        Ok(SwingSpring {
            from_mm: at_mm,
            rest_mm: at_mm + side * travel_mm,
            travel_mm,
            stiffness_n_per_mm,
            seconds: RAMP_S + PERIODS * std::f64::consts::TAU / omega,
            velocity_mm_s: (SPEED * omega * travel_mm)
                .max(LEAST_SPEED_MM_S)
                .min(device.velocity_mm_s.get()),
        })
    }
}

impl SwingSpring {
    /// The limits of its playback.
    ///
    /// # Errors
    /// [`BadLimit`] for a force or a speed that is none.
    pub fn limits(&self) -> Result<Limits, BadLimit> {
        let force_n = FORCE * self.stiffness_n_per_mm * self.travel_mm;
        Limits::new(force_n, self.velocity_mm_s)
    }

    /// How far from the rest the handle may come, mm.
    pub fn reach_mm(&self) -> f64 {
        REACH * self.travel_mm
    }

    /// How much more than within the travel it damps at a distance from the rest.
    fn braking(&self, from_rest_mm: f64) -> f64 {
        let braked = 0.5 * (BRAKED + REACH);
        let share = (from_rest_mm.abs() / self.travel_mm - BRAKED) / (braked - BRAKED);
        1.0 + (BRAKES - 1.0) * share.clamp(0.0, 1.0)
    }

    /// The samples for the estimate. A coarse encoder makes the speed of the servo, and with it the
    /// damping force, jump between the samples: here that force is one of a speed that is not
    /// rough, and has the same integral.
    fn points(&self, samples: &[Sample], servo: ServoSettings) -> Vec<Point> {
        let damping = LONGEST_LAG_S * self.stiffness_n_per_mm;
        let speed = |i: usize| {
            let (before, after) = (i.checked_sub(APART_SAMPLES)?, i + APART_SAMPLES);
            let (before, after) = (samples.get(before)?, samples.get(after)?);
            Some((after.x_mm - before.x_mm) / (after.t_s - before.t_s))
        };
        let point = |(i, sample): (usize, &Sample)| {
            let ramp = (sample.t_s / servo.ramp_s.max(1e-3)).clamp(0.0, 1.0);
            let ramp = 0.5 - 0.5 * (std::f64::consts::PI * ramp).cos();
            let braking = self.braking(sample.x_mm - self.rest_mm);
            let all = ramp * (damping * braking + servo.damping_n_s_per_mm);
            let smoother = speed(i).map_or(0.0, |v_mm_s| v_mm_s - sample.v_mm_s);
            Point {
                t_s: sample.t_s,
                x_mm: sample.x_mm,
                command_n: sample.force_command_n + all * smoother,
            }
        };
        samples.iter().enumerate().map(point).collect()
    }

    /// The table.
    pub fn table(&self) -> Realization {
        let damping = LONGEST_LAG_S * self.stiffness_n_per_mm;
        let braked = 0.5 * (BRAKED + REACH);
        let nodes = [
            (-REACH, BRAKES),
            (-braked, BRAKES),
            (-BRAKED, 1.0),
            (BRAKED, 1.0),
            (braked, BRAKES),
            (REACH, BRAKES),
        ];
        let place = |(at, _): &(f64, f64)| self.rest_mm + at * self.travel_mm;
        let force_n = |(at, _): &(f64, f64)| self.stiffness_n_per_mm * at * self.travel_mm;
        let reach_mm = self.reach_mm();
        table_of(
            "swing",
            nodes.iter().map(place).collect(),
            nodes.iter().map(force_n).collect(),
            nodes.iter().map(|(_, by)| by * damping).collect(),
            [self.rest_mm - reach_mm, self.rest_mm + reach_mm],
        )
    }
}

/// What a motor told of itself, in the keys of the record of a commissioning. They are those of
/// `study_haptics::swing::Swing`, which no file has: its travel only judges what is left of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SelfWeighing {
    /// Mass of the handle over the gain of the motor, kg.
    pub apparent_kg: f64,
    /// Damping of the handle over the gain, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Friction over the gain, N.
    pub friction_n: f64,
    /// Constant force over the gain, N.
    pub offset_n: f64,
    /// Lag of the force, s.
    pub lag_s: f64,
    /// What is left of the motion, root mean square, mm.
    pub residual_mm: f64,
    /// The masses that each spring alone tells with that lag, kg.
    pub alone_kg: [f64; 2],
}

/// A weighing with its plan, so that it can be repeated on the same springs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SwingNumbers {
    /// The plan.
    pub plan: SwingPlan,
    /// What was found.
    pub found: SelfWeighing,
}

impl SelfWeighing {
    /// From the samples of all swings, with the constants of the servo if the device tells them.
    ///
    /// # Errors
    /// [`NoSelfWeighing`] if there was no swing, or something else than the motor moved the handle.
    pub fn of(
        swings: &[(SwingSpring, Vec<Sample>)],
        servo: Option<ServoSettings>,
    ) -> Result<Self, NoSelfWeighing> {
        let points: Vec<Vec<Point>> = (swings.iter())
            .map(|(spring, samples)| spring.points(samples, servo.unwrap_or_default()))
            .collect();
        let points: Vec<&[Point]> = points.iter().map(Vec::as_slice).collect();
        let all = estimate(&points)?;
        let alone = |first: usize| {
            let own: Vec<&[Point]> = points.iter().skip(first).step_by(2).copied().collect();
            apparent_kg(&own, all.lag_s)
        };
        let alone_kg = [alone(0)?, alone(1)?];
        let differ = (alone_kg[0] / alone_kg[1] - 1.0).abs() > APART;
        if differ || all.residual_mm > RESIDUAL * all.travel_mm {
            return Err(NoSelfWeighing::Touched(
                alone_kg[0],
                alone_kg[1],
                all.residual_mm,
            ));
        }
        Ok(Self {
            apparent_kg: all.apparent_kg,
            damping_n_s_per_mm: all.damping_n_s_per_mm,
            friction_n: all.friction_n,
            offset_n: all.offset_n,
            lag_s: all.lag_s,
            residual_mm: all.residual_mm,
            alone_kg,
        })
    }

    /// How the motor has changed since an earlier weighing: its gain now over that one, and by how
    /// much later its force comes, ms.
    pub fn since(&self, earlier: &Self) -> [f64; 2] {
        [
            earlier.apparent_kg / self.apparent_kg,
            1e3 * (self.lag_s - earlier.lag_s),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table;

    #[test]
    fn every_swing_is_a_certified_table_with_a_low_force() {
        let device = Limits::new(15.0, 1000.0).unwrap();
        for mass_kg in [0.05, 0.2, 0.6, 1.5] {
            for friction_n in [0.0, 0.05, 0.1] {
                for (at_mm, stroke_mm) in [(17.5, [-20.0, 60.0]), (3.0, [0.0, 12.0])] {
                    for nth in 0..SWINGS {
                        let plan = SwingPlan {
                            mass_kg,
                            friction_n,
                        };
                        let spring = match plan.spring(nth, at_mm, stroke_mm, device) {
                            Ok(spring) => spring,
                            Err(NoSelfWeighing::Friction { .. }) => continue,
                            Err(why) => panic!("{plan:?}: {why}"),
                        };
                        let made = spring.table();
                        table::check(&made).unwrap();
                        assert!(made.certificate().passes(), "{spring:?}");
                        let limits = spring.limits().unwrap();
                        assert!(limits.force_n.get() < 12.0, "{plan:?}: {limits:?}");
                        let [low, high] = stroke_mm;
                        let ends = made.trained.x_mm;
                        let inside = ends[0] > low && ends[1] < high;
                        assert!(inside, "{spring:?}: {ends:?}");
                    }
                }
            }
        }
    }

    /// A guess that is too light for its friction is no reason not to search.
    #[test]
    fn a_search_begins_with_springs_that_are_stiff_enough() {
        let device = Limits::new(15.0, 1000.0).unwrap();
        let stroke_mm = [-20.0, 60.0];
        let guess = SwingPlan {
            mass_kg: 0.3,
            friction_n: 0.4,
        };
        assert!(guess.spring(1, 17.5, stroke_mm, device).is_err());
        let first = SwingPlan::first(0.3, 0.4, stroke_mm);
        assert!(
            first.spring(1, 17.5, stroke_mm, device).is_ok(),
            "{first:?}"
        );
        assert_eq!(SwingPlan::first(0.3, 0.1, stroke_mm).mass_kg, 0.3);
        assert_eq!(SwingPlan::first(0.3, 3.0, stroke_mm).mass_kg, 0.3);
    }

    #[test]
    fn there_is_none_at_a_stop_with_much_friction_or_a_weak_device() {
        let device = Limits::new(15.0, 1000.0).unwrap();
        let plan = SwingPlan {
            mass_kg: 0.3,
            friction_n: 3.0,
        };
        let stroke_mm = [-20.0, 60.0];
        assert!(matches!(
            plan.spring(0, 17.5, stroke_mm, device),
            Err(NoSelfWeighing::Friction { .. })
        ));
        let easy = SwingPlan {
            friction_n: 0.0,
            ..plan
        };
        assert!(matches!(
            easy.spring(0, 59.9, stroke_mm, device),
            Err(NoSelfWeighing::NoRoom(_))
        ));
        let weak = Limits::new(0.1, 1000.0).unwrap();
        assert!(matches!(
            easy.spring(0, 17.5, stroke_mm, weak),
            Err(NoSelfWeighing::Force(_))
        ));
    }
}
