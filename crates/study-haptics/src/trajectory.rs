//! Trajectories: the motion of a probe that excites the target.
//!
//! A [`Trajectory`] is an offset plus a sum of [`Part`]s (sine, swept sine, PRBS, steps
//! at constant speed), faded in and out by a ramp. [`Trajectory::at`] gives position,
//! velocity and acceleration at any instant in closed form, so a trajectory has no
//! sampling rate and is never differentiated numerically. [`check`] compares it with
//! the limits of probe and target before anything moves; [`mod@file`] reads and writes
//! it as TOML.
//!
//! Units: s, Hz, mm, mm/s, m/s². Time starts at 0 with the first ramp:
//!
//! ```text
//! 0 ──ramp_s── recording starts ──duration_s── recording ends ──ramp_s── total_s
//! ```
//!
//! Outside [0, total_s] the trajectory rests at its offset.
//! Reference for the kinds: Colton & Hollerbach, World Haptics 2007, section 3.

pub mod check;
pub mod file;
pub mod parts;
pub mod spectrum;

pub use check::{Envelope, Violation};
pub use parts::{Part, Prbs, Shape, Sine, Steps, Sweep};

use study_wire::predict::Motion;

/// The `format` of a trajectory file.
pub const FORMAT: &str = "study-trajectory/1";
/// Longest duration between the ramps, s.
pub const MAX_DURATION_S: f64 = 3600.0;
/// Longest ramp, s.
pub const MAX_RAMP_S: f64 = 60.0;
/// Most parts of a trajectory.
pub const MAX_PARTS: usize = 32;

/// The motion of a probe.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// A title for people.
    pub title: Option<String>,
    /// The position at rest, to which the parts are added, mm.
    pub offset_mm: f64,
    /// Time between the ramps, which is recorded, s.
    pub duration_s: f64,
    /// Time of each ramp, s.
    pub ramp_s: f64,
    /// The terms of the sum.
    pub parts: Vec<Part>,
    /// Limits in addition to those of probe and target.
    pub limits: Option<Envelope>,
}

impl Trajectory {
    /// Total time from rest to rest, s.
    pub fn total_s(&self) -> f64 {
        self.duration_s + 2.0 * self.ramp_s
    }

    /// Start and end of the recorded time, s.
    pub fn recorded_s(&self) -> [f64; 2] {
        [self.ramp_s, self.ramp_s + self.duration_s]
    }

    /// The motion at time `t_s`, s.
    pub fn at(&self, t_s: f64) -> Motion {
        if !(t_s > 0.0 && t_s < self.total_s()) {
            return Motion::at_rest(self.offset_mm);
        }
        // deviation from the offset and its derivatives, in mm and s throughout
        let mut deviation = [0.0; 3];
        for part in &self.parts {
            let one = part.at(t_s);
            for (sum, term) in deviation.iter_mut().zip(one) {
                *sum += term;
            }
        }
        let [d, d1, d2] = deviation;
        let [w, w1, w2] = self.weight(t_s);
        Motion {
            x_mm: self.offset_mm + w * d,
            v_mm_s: w1 * d + w * d1,
            a_m_s2: 1e-3 * (w2 * d + 2.0 * w1 * d1 + w * d2),
        }
    }

    /// The weight of the ramps and its first two derivatives.
    fn weight(&self, t_s: f64) -> [f64; 3] {
        let left_s = self.total_s() - t_s;
        if t_s < self.ramp_s {
            minimum_jerk(t_s, self.ramp_s)
        } else if left_s < self.ramp_s {
            let [w, w1, w2] = minimum_jerk(left_s, self.ramp_s);
            [w, -w1, w2]
        } else {
            [1.0, 0.0, 0.0]
        }
    }

    /// The highest frequency of any part, Hz; for PRBS and steps that of their fastest
    /// change.
    pub fn top_hz(&self) -> f64 {
        self.parts.iter().map(Part::top_hz).fold(0.0, f64::max)
    }
}

/// The minimum-jerk polynomial, which rises from 0 to 1 in `over_s` with zero velocity
/// and acceleration at both ends, and its first two derivatives. `t_s` lies in
/// [0, over_s].
pub(crate) fn minimum_jerk(t_s: f64, over_s: f64) -> [f64; 3] {
    let u = t_s / over_s;
    [
        u * u * u * (10.0 + u * (-15.0 + 6.0 * u)),
        30.0 * u * u * (1.0 - u) * (1.0 - u) / over_s,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (over_s * over_s),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sine(amplitude_mm: f64, frequency_hz: f64) -> Part {
        Part::Sine(Sine {
            amplitude_mm,
            frequency_hz,
            phase_deg: 0.0,
        })
    }

    /// A trajectory with all kinds of parts.
    fn everything() -> Trajectory {
        Trajectory {
            title: None,
            offset_mm: 17.5,
            duration_s: 6.0,
            ramp_s: 0.5,
            parts: vec![
                sine(3.0, 0.7),
                Part::Sweep(Sweep {
                    shape: Shape::Triangular,
                    amplitude_mm: 2.0,
                    from_hz: 1.0,
                    to_hz: 4.0,
                    period_s: 2.5,
                    phase_deg: 30.0,
                }),
                Part::Sweep(Sweep {
                    shape: Shape::Linear,
                    amplitude_mm: 1.0,
                    from_hz: 0.5,
                    to_hz: 3.0,
                    period_s: 6.0,
                    phase_deg: 0.0,
                }),
                Part::Prbs(Prbs::new(1.0, 5, 0.2, 0.1).unwrap()),
                Part::Steps(Steps {
                    levels_mm: vec![-2.0, 2.0, 0.5],
                    speed_mm_s: 20.0,
                    acceleration_m_s2: 1.0,
                    hold_s: 0.3,
                }),
            ],
            limits: None,
        }
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_the_position() {
        let trajectory = everything();
        let h = 1e-5;
        let mut t = 0.0017;
        while t < trajectory.total_s() {
            let [before, now, after] = [t - h, t, t + h].map(|t| trajectory.at(t));
            let v = (after.x_mm - before.x_mm) / (2.0 * h);
            assert!((v - now.v_mm_s).abs() < 2e-3, "{t}: {v} {now:?}");
            let a = 1e-3 * (after.v_mm_s - before.v_mm_s) / (2.0 * h);
            assert!((a - now.a_m_s2).abs() < 6e-3, "{t}: {a} {now:?}");
            t += 0.00173;
        }
    }

    #[test]
    fn it_rests_at_its_offset_before_and_after() {
        let trajectory = everything();
        for t in [-1.0, 0.0, trajectory.total_s(), 1e9, f64::NAN] {
            let rest = trajectory.at(t);
            assert_eq!((rest.x_mm, rest.v_mm_s, rest.a_m_s2), (17.5, 0.0, 0.0));
        }
        for t in [1e-6, trajectory.total_s() - 1e-6] {
            let near = trajectory.at(t);
            assert!((near.x_mm - 17.5).abs() < 1e-9, "{near:?}");
            assert!(
                near.v_mm_s.abs() < 1e-6 && near.a_m_s2.abs() < 0.05,
                "{near:?}"
            );
        }
    }

    #[test]
    fn between_the_ramps_nothing_is_weighted() {
        let trajectory = Trajectory {
            parts: vec![sine(12.0, 0.5)],
            ..everything()
        };
        let t = 1.3;
        assert_eq!(
            trajectory.at(t).x_mm,
            17.5 + 12.0 * libm::sin(TAU * 0.5 * t)
        );
    }

    /// Reference: the first row of the shipped recordings of these trajectories by
    /// another implementation (t = 0.5 s; 28.56638 and 2.50051 mm). They are filtered,
    /// hence the tolerance of 0.01 mm.
    #[test]
    fn the_papers_trajectories_agree_with_the_recordings() {
        let training = Trajectory {
            parts: vec![
                sine(12.0, 0.5),
                Part::Sweep(Sweep {
                    shape: Shape::Triangular,
                    amplitude_mm: 4.0,
                    from_hz: 1.0,
                    to_hz: 4.0,
                    period_s: 20.0,
                    phase_deg: 0.0,
                }),
            ],
            ..everything()
        };
        assert!((training.at(0.5).x_mm - 28.56638).abs() < 0.01);
        let validation = Trajectory {
            parts: vec![sine(15.0, 1.5)],
            ..everything()
        };
        assert!((validation.at(0.5).x_mm - 2.50051).abs() < 0.01);
    }
}
