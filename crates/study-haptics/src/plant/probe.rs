//! The probe: imposes a trajectory on the target and measures what comes of it.
//!
//! Position-controlled: the handle is where the trajectory says, at every step of
//! the simulation; the servo is ideal. What is measured is the position as an
//! encoder counts it, the force of an impedance head and the acceleration of an
//! accelerometer, both with white noise that has the same rms at every sampling
//! rate. Each sensor draws from a stream of its own, so that the noise of one does
//! not depend on another.
//!
//! Not here: filtering (`identify::signal`), files, and a real probe.
//!
//! Reference: Colton & Hollerbach 2007, section 2 (direct-drive motor, incremental
//! encoder, impedance head).

use super::parameters::{BadPlant, Parameters};
use super::target::{DT_S, Target};
use crate::trajectory::{Envelope, Point, Trajectory, Violation, check};
use study_base::limits::Limit;
use study_base::rng::Stream;
use study_wire::predict::Motion;

/// Highest sampling rate: one sample a step of the simulation, Hz.
pub const MOST_RATE_HZ: f64 = 40_000.0;
/// Lowest sampling rate, Hz.
pub const LEAST_RATE_HZ: f64 = 10.0;

/// What the probe's sensors are like and what its motor can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// One count of the encoder, mm.
    pub encoder_mm: f64,
    /// Noise of the force, N rms.
    pub force_noise_n: f64,
    /// Noise of the acceleration, m/s² rms.
    pub acceleration_noise_m_s2: f64,
    /// What it can follow.
    pub envelope: Envelope,
}

impl Default for Probe {
    fn default() -> Self {
        let limit = |value| Limit::new(value).ok();
        Self {
            encoder_mm: 0.005,
            force_noise_n: 0.05,
            acceleration_noise_m_s2: 0.05,
            envelope: Envelope {
                travel_mm: [-5.0, 40.0],
                velocity_mm_s: limit(1000.0),
                acceleration_m_s2: limit(100.0),
            },
        }
    }
}

/// Why nothing was recorded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProbeError {
    /// The target is none.
    #[error(transparent)]
    Plant(#[from] BadPlant),
    /// The trajectory goes beyond what probe or target can follow.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Trajectory(Vec<Violation>),
    /// The sampling rate is out of range.
    #[error("a sampling rate has to be from {LEAST_RATE_HZ} to {MOST_RATE_HZ} Hz, not {0}")]
    Rate(f64),
}

/// What was measured, ramps included: columns of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Encoder, mm.
    pub x_mm: Vec<f64>,
    /// Accelerometer, m/s².
    pub a_m_s2: Vec<f64>,
    /// Impedance head, N.
    pub f_n: Vec<f64>,
}

/// The bounds of a target: its stops. It has no limits of its own on speed.
pub fn envelope_of(target: &Parameters) -> Envelope {
    Envelope {
        travel_mm: target.stops_mm,
        velocity_mm_s: None,
        acceleration_m_s2: None,
    }
}

impl Probe {
    /// Compares a trajectory with what this probe and the target can follow.
    ///
    /// # Errors
    /// Every bound that is passed, with the instant.
    pub fn check(
        &self,
        trajectory: &Trajectory,
        target: &Parameters,
    ) -> Result<(), Vec<Violation>> {
        let envelopes = [
            ("the probe", self.envelope),
            ("the target", envelope_of(target)),
        ];
        check::check(trajectory, &envelopes)
    }

    /// Imposes the trajectory on a target at rest and samples at `rate_hz`, from
    /// t = 0 to the end of the last ramp.
    ///
    /// # Errors
    /// [`ProbeError`] before anything moves.
    pub fn impose(
        &self,
        trajectory: &Trajectory,
        target: &Parameters,
        rate_hz: f64,
        seed: u64,
    ) -> Result<Measured, ProbeError> {
        if !(LEAST_RATE_HZ..=MOST_RATE_HZ).contains(&rate_hz) {
            return Err(ProbeError::Rate(rate_hz));
        }
        let mut moved = Target::new(target.clone(), trajectory.offset_mm)?;
        self.check(trajectory, target)
            .map_err(ProbeError::Trajectory)?;
        // both are bounded by LONGEST_S and MOST_RATE_HZ, so the casts are exact
        let samples = (trajectory.total_s() * rate_hz + 1e-6).floor() as usize + 1;
        let mut measured = Measured {
            t_s: Vec::with_capacity(samples),
            x_mm: Vec::with_capacity(samples),
            a_m_s2: Vec::with_capacity(samples),
            f_n: Vec::with_capacity(samples),
        };
        let [mut force_noise, mut acceleration_noise] =
            ["force", "acceleration"].map(|sensor| Stream::new(seed, &["probe", sensor]));
        let mut step = 0u64;
        let mut force = [0.0; 2];
        for i in 0..samples {
            let t_s = i as f64 / rate_hz;
            // the two steps of the simulation around the sample
            let at = t_s / DT_S;
            let before = (at + 1e-6).floor();
            while step < before as u64 + 2 {
                let motion = motion(trajectory.at(step as f64 * DT_S));
                force = [force[1], moved.step(motion)];
                step += 1;
            }
            let weight = (at - before).clamp(0.0, 1.0);
            let f_n = force[0] + weight * (force[1] - force[0]);
            let Point { x_mm, a_m_s2, .. } = trajectory.at(t_s);
            let a_m_s2 = a_m_s2 + self.acceleration_noise_m_s2 * acceleration_noise.normal();
            measured.t_s.push(t_s);
            measured.x_mm.push(self.count(x_mm));
            measured.a_m_s2.push(a_m_s2);
            measured
                .f_n
                .push(f_n + self.force_noise_n * force_noise.normal());
        }
        Ok(measured)
    }

    /// What the encoder says of a position.
    fn count(&self, x_mm: f64) -> f64 {
        if self.encoder_mm > 0.0 {
            libm::rint(x_mm / self.encoder_mm) * self.encoder_mm
        } else {
            x_mm
        }
    }
}

fn motion(point: Point) -> Motion {
    Motion {
        x_mm: point.x_mm,
        v_mm_s: point.v_mm_s,
        a_m_s2: point.a_m_s2,
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
            duration_s: 1.0,
            ramp_s: 0.5,
            parts: vec![Part::Sine(Sine {
                amplitude_mm,
                frequency_hz: 1.5,
                phase_deg: 0.0,
            })],
            limits: None,
        }
    }

    fn record(rate_hz: f64, seed: u64) -> Measured {
        Probe::default()
            .impose(&trajectory(15.0), &Parameters::a(), rate_hz, seed)
            .unwrap()
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
        (sum / n).sqrt()
    }

    #[test]
    fn the_sensors_have_the_resolution_and_the_noise_that_they_should() {
        let noisy = record(1000.0, 1);
        let quiet = Probe {
            encoder_mm: 0.0,
            force_noise_n: 0.0,
            acceleration_noise_m_s2: 0.0,
            ..Probe::default()
        };
        let truth = quiet
            .impose(&trajectory(15.0), &Parameters::a(), 1000.0, 1)
            .unwrap();
        assert_eq!(noisy.t_s.len(), 2001);
        let error = |a: &[f64], b: &[f64]| rms(a.iter().zip(b).map(|(a, b)| a - b));
        // uniform over ± 2.5 µm
        let x = error(&noisy.x_mm, &truth.x_mm);
        assert!((x / (0.005 / 12f64.sqrt()) - 1.0).abs() < 0.1, "{x}");
        // 2001 normal deviates: sd of the rms 1.6 %
        let f = error(&noisy.f_n, &truth.f_n);
        assert!((f / 0.05 - 1.0).abs() < 0.07, "{f}");
        let a = error(&noisy.a_m_s2, &truth.a_m_s2);
        assert!((a / 0.05 - 1.0).abs() < 0.07, "{a}");
    }

    #[test]
    fn a_seed_gives_the_same_recording_and_another_seed_another() {
        assert_eq!(record(1000.0, 7), record(1000.0, 7));
        assert_ne!(record(1000.0, 7).f_n, record(1000.0, 8).f_n);
    }

    #[test]
    fn every_rate_samples_the_same_force() {
        let quiet = Probe {
            force_noise_n: 0.0,
            ..Probe::default()
        };
        let at = |rate_hz| {
            quiet
                .impose(&trajectory(15.0), &Parameters::a(), rate_hz, 1)
                .unwrap()
                .f_n
        };
        let (fine, coarse, odd) = (at(10_000.0), at(1000.0), at(3000.0));
        for i in 0..coarse.len() {
            assert_eq!(fine[10 * i], coarse[i], "{i}");
            assert!((odd[3 * i] - coarse[i]).abs() < 1e-9, "{i}");
        }
    }

    #[test]
    fn nothing_moves_beyond_a_stop_or_at_an_impossible_rate() {
        let probe = Probe::default();
        let refused = probe.impose(&trajectory(18.0), &Parameters::a(), 1000.0, 1);
        let said = refused.unwrap_err().to_string();
        assert!(said.contains("the limit of the target, at "), "{said}");
        for rate in [0.0, f64::NAN, 1e6] {
            let refused = probe.impose(&trajectory(15.0), &Parameters::a(), rate, 1);
            assert!(matches!(refused, Err(ProbeError::Rate(_))), "{rate}");
        }
    }
}
