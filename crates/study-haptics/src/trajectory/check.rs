//! Whether probe and target can follow a trajectory, before anything moves.
//!
//! A trajectory is looked at in steps of at most a two-hundredth of its fastest
//! period, so a peak is missed by less than 0.02 %.

use super::{Point, Trajectory};
use std::fmt;
use study_base::limits::Limit;

/// Steps of one period of the highest frequency.
const STEPS_PER_PERIOD: f64 = 200.0;
/// No more steps than this are looked at, whatever the frequencies; longest step s.
const MOST_STEPS: f64 = 2e7;
const LONGEST_STEP_S: f64 = 1e-3;

/// What something can follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope {
    /// Lowest and highest position, mm.
    pub travel_mm: [f64; 2],
    /// Largest speed, mm/s; `None`: unlimited.
    pub velocity_mm_s: Option<Limit>,
    /// Largest acceleration, m/s²; `None`: unlimited.
    pub acceleration_m_s2: Option<Limit>,
}

/// What goes beyond an envelope.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Position.
    Travel,
    /// Speed.
    Velocity,
    /// Acceleration.
    Acceleration,
}

/// Where a trajectory leaves an envelope.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct Violation {
    /// Whose bound it is, such as `the target`.
    pub whose: String,
    /// What is too large.
    pub quantity: Quantity,
    /// The bound; of the position the one that is passed.
    pub bound: f64,
    /// The first instant beyond it, s.
    pub first_s: f64,
    /// The instant furthest beyond it, s.
    pub worst_s: f64,
    /// The value there; the position itself, of the others the magnitude.
    pub worst: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, unit) = match self.quantity {
            Quantity::Travel => ("position", "mm"),
            Quantity::Velocity => ("speed", "mm/s"),
            Quantity::Acceleration => ("acceleration", "m/s²"),
        };
        write!(
            f,
            "the {what} passes {} {unit}, the limit of {}, at {:.4} s and is {:.2} {unit} at {:.4} s",
            self.bound, self.whose, self.first_s, self.worst, self.worst_s
        )
    }
}

/// The extremes of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// Lowest and highest position, mm.
    pub x_mm: [f64; 2],
    /// Largest speed, mm/s.
    pub v_mm_s: f64,
    /// Largest acceleration, m/s².
    pub a_m_s2: f64,
}

/// Every instant that is looked at, with the motion there.
fn instants(trajectory: &Trajectory) -> impl Iterator<Item = (f64, Point)> + '_ {
    let total_s = trajectory.total_s();
    let top_hz = trajectory.top_hz().max(0.5 / trajectory.ramp_s.max(1e-4));
    let step_s = (1.0 / (STEPS_PER_PERIOD * top_hz))
        .min(LONGEST_STEP_S)
        .max(total_s / MOST_STEPS);
    // at most MOST_STEPS, so the cast is exact
    let steps = (total_s / step_s).ceil().max(1.0) as u64;
    (0..=steps).map(move |i| {
        let t_s = total_s * i as f64 / steps as f64;
        (t_s, trajectory.at(t_s))
    })
}

/// How far, how fast, how sharply it goes.
pub fn extremes(trajectory: &Trajectory) -> Extremes {
    let none = Extremes {
        x_mm: [f64::INFINITY, f64::NEG_INFINITY],
        v_mm_s: 0.0,
        a_m_s2: 0.0,
    };
    instants(trajectory).fold(none, |e, (_, point)| Extremes {
        x_mm: [e.x_mm[0].min(point.x_mm), e.x_mm[1].max(point.x_mm)],
        v_mm_s: e.v_mm_s.max(point.v_mm_s.abs()),
        a_m_s2: e.a_m_s2.max(point.a_m_s2.abs()),
    })
}

/// Compares a trajectory, ramps included, with every envelope, each under the
/// name of whose it is; its own limits are the first.
///
/// # Errors
/// All violations, at most one for each bound.
pub fn check(
    trajectory: &Trajectory,
    envelopes: &[(&str, Envelope)],
) -> Result<(), Vec<Violation>> {
    let own = trajectory
        .limits
        .map(|own| ("the trajectory's own file", own));
    let mut bounds: Vec<Bound> = own
        .iter()
        .chain(envelopes)
        .flat_map(|(whose, envelope)| Bound::all_of(whose, envelope))
        .collect();
    for (t_s, point) in instants(trajectory) {
        for bound in &mut bounds {
            bound.look(t_s, point);
        }
    }
    let found: Vec<Violation> = bounds.into_iter().filter_map(|b| b.found).collect();
    if found.is_empty() { Ok(()) } else { Err(found) }
}

/// One bound and what has been found beyond it.
struct Bound {
    whose: String,
    quantity: Quantity,
    /// −1: a lower bound.
    sign: f64,
    bound: f64,
    found: Option<Violation>,
}

impl Bound {
    fn all_of(whose: &str, envelope: &Envelope) -> Vec<Self> {
        let one = |quantity, sign, bound| Self {
            whose: whose.to_owned(),
            quantity,
            sign,
            bound,
            found: None,
        };
        let [low, high] = envelope.travel_mm;
        let mut all = vec![
            one(Quantity::Travel, -1.0, low),
            one(Quantity::Travel, 1.0, high),
        ];
        all.extend(
            envelope
                .velocity_mm_s
                .map(|v| one(Quantity::Velocity, 1.0, v.get())),
        );
        all.extend(
            envelope
                .acceleration_m_s2
                .map(|a| one(Quantity::Acceleration, 1.0, a.get())),
        );
        all
    }

    fn look(&mut self, t_s: f64, point: Point) {
        let value = match self.quantity {
            Quantity::Travel => point.x_mm,
            Quantity::Velocity => point.v_mm_s.abs(),
            Quantity::Acceleration => point.a_m_s2.abs(),
        };
        if self.sign * (value - self.bound) <= 0.0 {
            return;
        }
        match &mut self.found {
            // the first of peaks that differ by rounding
            Some(found) if self.sign * (value - found.worst) > 1e-9 * value.abs() => {
                found.worst = value;
                found.worst_s = t_s;
            }
            Some(_) => {}
            None => {
                self.found = Some(Violation {
                    whose: self.whose.clone(),
                    quantity: self.quantity,
                    bound: self.bound,
                    first_s: t_s,
                    worst_s: t_s,
                    worst: value,
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Part, Sine};

    fn trajectory(amplitude_mm: f64) -> Trajectory {
        Trajectory {
            title: None,
            offset_mm: 17.5,
            duration_s: 2.0,
            ramp_s: 0.5,
            parts: vec![Part::Sine(Sine {
                amplitude_mm,
                frequency_hz: 1.0,
                phase_deg: 0.0,
            })],
            limits: None,
        }
    }

    fn envelope(velocity: f64, acceleration: f64) -> Envelope {
        Envelope {
            travel_mm: [0.0, 35.0],
            velocity_mm_s: Some(Limit::new(velocity).unwrap()),
            acceleration_m_s2: Some(Limit::new(acceleration).unwrap()),
        }
    }

    #[test]
    fn what_fits_passes_and_its_extremes_are_those_of_the_formula() {
        assert_eq!(
            check(&trajectory(15.0), &[("the probe", envelope(200.0, 10.0))]),
            Ok(())
        );
        let e = extremes(&trajectory(15.0));
        assert!(
            (e.x_mm[1] - 32.5).abs() < 1e-3 && (e.x_mm[0] - 2.5).abs() < 1e-3,
            "{e:?}"
        );
        // within the ramps it is a little faster than 15·2π
        assert!((94.2..99.0).contains(&e.v_mm_s), "{e:?}");
    }

    #[test]
    fn every_bound_that_is_passed_is_named_with_its_instant() {
        let found = check(
            &trajectory(18.0),
            &[("the target", envelope(100.0, 1000.0))],
        )
        .unwrap_err();
        let said: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(found.len(), 3, "{said:?}");
        assert_eq!(found[0].quantity, Quantity::Travel);
        assert!((found[0].worst + 0.5).abs() < 1e-3 && (found[0].worst_s - 0.75).abs() < 1e-2);
        assert!(
            said[1].starts_with("the position passes 35 mm, the limit of the target, at 1.2"),
            "{said:?}"
        );
        assert!(said[2].contains("speed passes 100 mm/s"), "{said:?}");
    }

    #[test]
    fn the_limits_of_its_own_file_count_too() {
        let mut own = trajectory(15.0);
        own.limits = Some(envelope(200.0, 0.1));
        let found = check(&own, &[]).unwrap_err();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].quantity, Quantity::Acceleration);
    }

    #[test]
    fn a_bound_that_is_touched_is_not_passed() {
        let mut flat = trajectory(0.0);
        flat.offset_mm = 35.0;
        assert_eq!(check(&flat, &[("the target", envelope(1.0, 1.0))]), Ok(()));
    }
}
