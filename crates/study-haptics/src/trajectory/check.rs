//! Whether a trajectory respects the limits of probe and target.
//!
//! A trajectory is sampled at steps of at most 1/200 of its shortest period, so a peak
//! is missed by less than 0.02 %.

use super::Trajectory;
use std::fmt;
use study_base::limits::Limit;
use study_wire::predict::Motion;

/// Steps per period of the highest frequency.
const STEPS_PER_PERIOD: f64 = 200.0;
/// Most steps.
const MAX_STEPS: f64 = 2e7;
/// Longest step, s.
const MAX_STEP_S: f64 = 1e-3;

/// Limits on a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope {
    /// Lowest and highest position, mm.
    pub travel_mm: [f64; 2],
    /// Highest speed, mm/s; `None`: unlimited.
    pub velocity_mm_s: Option<Limit>,
    /// Highest acceleration, m/s²; `None`: unlimited.
    pub acceleration_m_s2: Option<Limit>,
}

/// The quantity that exceeds a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Position.
    Travel,
    /// Speed.
    Velocity,
    /// Acceleration.
    Acceleration,
}

/// A limit that a trajectory exceeds.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct Violation {
    /// Owner of the limit, such as `the target`.
    pub owner: String,
    /// The quantity that exceeds it.
    pub quantity: Quantity,
    /// The limit, mm, mm/s or m/s².
    pub limit: f64,
    /// The first instant beyond the limit, s.
    pub first_s: f64,
    /// The instant furthest beyond the limit, s.
    pub worst_s: f64,
    /// The value at that instant: the position, or the magnitude of speed or acceleration.
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
            "the {what} exceeds {} {unit}, the limit of {}, from {:.4} s on and reaches {:.2} {unit} at {:.4} s",
            self.limit, self.owner, self.first_s, self.worst, self.worst_s
        )
    }
}

/// The extremes of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// Lowest and highest position, mm.
    pub x_mm: [f64; 2],
    /// Highest speed, mm/s.
    pub v_mm_s: f64,
    /// Highest acceleration, m/s².
    pub a_m_s2: f64,
}

/// The sampled instants, s, and the motion at each.
fn instants(trajectory: &Trajectory) -> impl Iterator<Item = (f64, Motion)> + '_ {
    let total_s = trajectory.total_s();
    let top_hz = trajectory.top_hz().max(0.5 / trajectory.ramp_s.max(1e-4));
    let step_s = (1.0 / (STEPS_PER_PERIOD * top_hz))
        .min(MAX_STEP_S)
        .max(total_s / MAX_STEPS);
    // at most MAX_STEPS, so the cast is exact
    let steps = (total_s / step_s).ceil().max(1.0) as u64;
    (0..=steps).map(move |i| {
        let t_s = total_s * i as f64 / steps as f64;
        (t_s, trajectory.at(t_s))
    })
}

/// The extremes of position, speed and acceleration.
pub fn extremes(trajectory: &Trajectory) -> Extremes {
    let none = Extremes {
        x_mm: [f64::INFINITY, f64::NEG_INFINITY],
        v_mm_s: 0.0,
        a_m_s2: 0.0,
    };
    instants(trajectory).fold(none, |e, (_, motion)| Extremes {
        x_mm: [e.x_mm[0].min(motion.x_mm), e.x_mm[1].max(motion.x_mm)],
        v_mm_s: e.v_mm_s.max(motion.v_mm_s.abs()),
        a_m_s2: e.a_m_s2.max(motion.a_m_s2.abs()),
    })
}

/// Compares a trajectory, including its ramps, with its own limits and with
/// `envelopes`, each given with the name of its owner.
///
/// # Errors
/// All violations, at most one for each limit.
pub fn check(
    trajectory: &Trajectory,
    envelopes: &[(&str, Envelope)],
) -> Result<(), Vec<Violation>> {
    let own = trajectory.limits.map(|own| ("the trajectory file", own));
    let mut monitors: Vec<Monitor> = own
        .iter()
        .chain(envelopes)
        .flat_map(|(owner, envelope)| Monitor::all_of(owner, envelope))
        .collect();
    for (t_s, motion) in instants(trajectory) {
        for monitor in &mut monitors {
            monitor.observe(t_s, motion);
        }
    }
    let found: Vec<Violation> = monitors.into_iter().filter_map(|m| m.violation).collect();
    if found.is_empty() { Ok(()) } else { Err(found) }
}

/// Observes one limit along a trajectory.
struct Monitor {
    owner: String,
    quantity: Quantity,
    /// 1 for an upper limit, −1 for a lower one.
    sign: f64,
    limit: f64,
    violation: Option<Violation>,
}

impl Monitor {
    fn all_of(owner: &str, envelope: &Envelope) -> Vec<Self> {
        let one = |quantity, sign, limit| Self {
            owner: owner.to_owned(),
            quantity,
            sign,
            limit,
            violation: None,
        };
        let [low, high] = envelope.travel_mm;
        let travel = [(-1.0, low), (1.0, high)];
        let travel = travel.map(|(sign, limit)| one(Quantity::Travel, sign, limit));
        let upper = |quantity, limit: Option<Limit>| limit.map(|l| one(quantity, 1.0, l.get()));
        let velocity = upper(Quantity::Velocity, envelope.velocity_mm_s);
        let acceleration = upper(Quantity::Acceleration, envelope.acceleration_m_s2);
        travel
            .into_iter()
            .chain(velocity)
            .chain(acceleration)
            .collect()
    }

    fn observe(&mut self, t_s: f64, motion: Motion) {
        let value = match self.quantity {
            Quantity::Travel => motion.x_mm,
            Quantity::Velocity => motion.v_mm_s.abs(),
            Quantity::Acceleration => motion.a_m_s2.abs(),
        };
        if self.sign * (value - self.limit) <= 0.0 {
            return;
        }
        match &mut self.violation {
            // keep the first of peaks that differ only by rounding
            Some(found) if self.sign * (value - found.worst) > 1e-9 * value.abs() => {
                found.worst = value;
                found.worst_s = t_s;
            }
            Some(_) => {}
            None => {
                self.violation = Some(Violation {
                    owner: self.owner.clone(),
                    quantity: self.quantity,
                    limit: self.limit,
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
    fn a_trajectory_within_limits_passes_and_its_extremes_are_those_of_the_formula() {
        assert_eq!(
            check(&trajectory(15.0), &[("the probe", envelope(200.0, 10.0))]),
            Ok(())
        );
        let e = extremes(&trajectory(15.0));
        assert!(
            (e.x_mm[1] - 32.5).abs() < 1e-3 && (e.x_mm[0] - 2.5).abs() < 1e-3,
            "{e:?}"
        );
        // during the ramps it is slightly faster than 15·2π
        assert!((94.2..99.0).contains(&e.v_mm_s), "{e:?}");
    }

    #[test]
    fn every_exceeded_limit_is_named_with_its_instant() {
        let found = check(
            &trajectory(18.0),
            &[("the target", envelope(100.0, 1000.0))],
        )
        .unwrap_err();
        let messages: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(found.len(), 3, "{messages:?}");
        assert_eq!(found[0].quantity, Quantity::Travel);
        assert!((found[0].worst + 0.5).abs() < 1e-3 && (found[0].worst_s - 0.75).abs() < 1e-2);
        assert!(
            messages[1]
                .starts_with("the position exceeds 35 mm, the limit of the target, from 1.2"),
            "{messages:?}"
        );
        assert!(
            messages[2].contains("speed exceeds 100 mm/s"),
            "{messages:?}"
        );
    }

    #[test]
    fn the_limits_of_the_trajectory_file_apply_too() {
        let mut own = trajectory(15.0);
        own.limits = Some(envelope(200.0, 0.1));
        let found = check(&own, &[]).unwrap_err();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].quantity, Quantity::Acceleration);
    }

    #[test]
    fn a_limit_that_is_reached_is_not_exceeded() {
        let mut flat = trajectory(0.0);
        flat.offset_mm = 35.0;
        assert_eq!(check(&flat, &[("the target", envelope(1.0, 1.0))]), Ok(()));
    }
}
