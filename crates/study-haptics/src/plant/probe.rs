//! The simulated probe: moves the target along a trajectory and records the response.
//!
//! The servo is ideal: the handle follows the trajectory exactly, at every step of the
//! simulation. Measured are the position by an encoder, the force by an impedance head
//! and the acceleration by an accelerometer, the latter two with white noise whose rms
//! does not depend on the sampling rate. Each sensor has its own random stream, so its
//! noise does not depend on the others. The signals are not filtered, see
//! [`crate::identify::signal`].
//!
//! Reference: Colton & Hollerbach 2007, section 2 (direct-drive motor, incremental
//! encoder, impedance head).

use super::parameters::{Parameters, PlantError};
use super::target::{DT_S, Target};
use crate::trajectory::{Envelope, Trajectory, Violation, check};
use study_base::limits::Limit;
use study_base::rng::Stream;
use study_wire::predict::Motion;

/// Highest sampling rate: one sample per step of the simulation, Hz.
pub const MAX_RATE_HZ: f64 = 40_000.0;
/// Lowest sampling rate, Hz.
pub const MIN_RATE_HZ: f64 = 10.0;

/// The sensors of the probe and the limits of its motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// Resolution of the encoder, mm; 0 is continuous.
    pub encoder_mm: f64,
    /// Noise of the force sensor, N rms.
    pub force_noise_n: f64,
    /// Noise of the accelerometer, m/s² rms.
    pub acceleration_noise_m_s2: f64,
    /// Limits of its motion.
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
    /// The target cannot be simulated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The trajectory exceeds limits of the probe or the target.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Trajectory(Vec<Violation>),
    /// The sampling rate is out of range.
    #[error("a sampling rate has to be from {MIN_RATE_HZ} to {MAX_RATE_HZ} Hz, not {0}")]
    Rate(f64),
}

/// The signals of the sensors over a whole trajectory, ramps included. All columns are
/// equally long.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Position by the encoder, mm.
    pub x_mm: Vec<f64>,
    /// Acceleration by the accelerometer, m/s².
    pub a_m_s2: Vec<f64>,
    /// Force by the impedance head, N.
    pub f_n: Vec<f64>,
}

impl Probe {
    /// Compares a trajectory with the limits of this probe and of the target.
    ///
    /// # Errors
    /// Every limit that is exceeded.
    pub fn check(
        &self,
        trajectory: &Trajectory,
        target: &Parameters,
    ) -> Result<(), Vec<Violation>> {
        let stops = Envelope {
            travel_mm: target.stops_mm,
            velocity_mm_s: None,
            acceleration_m_s2: None,
        };
        let envelopes = [("the probe", self.envelope), ("the target", stops)];
        check::check(trajectory, &envelopes)
    }

    /// Moves a target at rest along the trajectory and samples at `rate_hz`, from t = 0
    /// to the end of the last ramp. `seed` determines the noise.
    ///
    /// # Errors
    /// [`ProbeError`] before anything moves.
    pub fn record(
        &self,
        trajectory: &Trajectory,
        target: &Parameters,
        rate_hz: f64,
        seed: u64,
    ) -> Result<Measurement, ProbeError> {
        if !(MIN_RATE_HZ..=MAX_RATE_HZ).contains(&rate_hz) {
            return Err(ProbeError::Rate(rate_hz));
        }
        let mut moved = Target::new(target.clone(), trajectory.offset_mm)?;
        self.check(trajectory, target)
            .map_err(ProbeError::Trajectory)?;
        // both are bounded by MAX_DURATION_S and MAX_RATE_HZ, so the casts are exact
        let samples = (trajectory.total_s() * rate_hz + 1e-6).floor() as usize + 1;
        let mut measured = Measurement {
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
                force = [force[1], moved.step(trajectory.at(step as f64 * DT_S))];
                step += 1;
            }
            let weight = (at - before).clamp(0.0, 1.0);
            let f_n = force[0] + weight * (force[1] - force[0]);
            let Motion { x_mm, a_m_s2, .. } = trajectory.at(t_s);
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

    /// A position rounded to the resolution of the encoder.
    fn count(&self, x_mm: f64) -> f64 {
        if self.encoder_mm > 0.0 {
            libm::rint(x_mm / self.encoder_mm) * self.encoder_mm
        } else {
            x_mm
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

    fn record(rate_hz: f64, seed: u64) -> Measurement {
        Probe::default()
            .record(&trajectory(15.0), &Parameters::a(), rate_hz, seed)
            .unwrap()
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
        (sum / n).sqrt()
    }

    #[test]
    fn the_sensors_have_their_resolution_and_noise() {
        let noisy = record(1000.0, 1);
        let quiet = Probe {
            encoder_mm: 0.0,
            force_noise_n: 0.0,
            acceleration_noise_m_s2: 0.0,
            ..Probe::default()
        };
        let truth = quiet
            .record(&trajectory(15.0), &Parameters::a(), 1000.0, 1)
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
                .record(&trajectory(15.0), &Parameters::a(), rate_hz, 1)
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
    fn a_trajectory_beyond_a_stop_and_an_impossible_rate_are_refused() {
        let probe = Probe::default();
        let refused = probe.record(&trajectory(18.0), &Parameters::a(), 1000.0, 1);
        let message = refused.unwrap_err().to_string();
        assert!(
            message.contains("the limit of the target, from "),
            "{message}"
        );
        for rate in [0.0, f64::NAN, 1e6] {
            let refused = probe.record(&trajectory(15.0), &Parameters::a(), rate, 1);
            assert!(matches!(refused, Err(ProbeError::Rate(_))), "{rate}");
        }
    }
}
