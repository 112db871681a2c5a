//! The turn-signal switch, moved by a probe.

use super::cam::Cam;
use super::friction::{Contact, Dahl, LuGre};
use super::parameters::{Parameters, PlantError};
use study_wire::predict::Motion;

/// Time step of the simulation, s; stable for the stiffest contact.
pub const DT_S: f64 = 25e-6;

/// A target with its state.
#[derive(Debug, Clone)]
pub struct Target {
    parameters: Parameters,
    cam: Cam,
    bristle_n_per_mm: f64,
    y_mm: f64,
    y_mm_s: f64,
    follower: LuGre,
    pivot: Dahl,
}

impl Target {
    /// A target at rest with its follower under the handle at `x_mm`.
    ///
    /// # Errors
    /// [`PlantError`] if the target cannot be simulated.
    pub fn new(parameters: Parameters, x_mm: f64) -> Result<Self, PlantError> {
        parameters.check()?;
        Ok(Self {
            cam: Cam::new(&parameters),
            bristle_n_per_mm: parameters.friction * parameters.preload_n / parameters.presliding_mm,
            parameters,
            y_mm: x_mm,
            y_mm_s: 0.0,
            follower: LuGre::default(),
            pivot: Dahl::default(),
        })
    }

    /// Simulates [`DT_S`] seconds with the handle at `motion`. Returns the force that the
    /// probe applies, N.
    pub fn step(&mut self, motion: Motion) -> f64 {
        let p = &self.parameters;
        let contact = self.contact_n(motion);
        let cam = self.cam.forces(self.y_mm);
        let friction = self.follower.step(
            &Contact {
                coulomb_n: p.friction * cam.normal_n,
                bristle_n_per_mm: self.bristle_n_per_mm,
                bristle_n_s_per_mm: p.bristle_n_s_per_m * 1e-3,
                stribeck: p.stribeck,
                stribeck_mm_s: p.stribeck_mm_s,
            },
            self.y_mm_s,
            DT_S,
        );
        let viscous = p.follower_n_s_per_m * 1e-3 * self.y_mm_s;
        let net_n = contact - cam.force_n - friction - viscous;
        // semi-implicit Euler: the speed first; N/kg is m/s², so 1000 mm/s²
        self.y_mm_s += DT_S * 1e3 * net_n / p.follower_kg;
        self.y_mm += DT_S * self.y_mm_s;

        let pivot = self
            .pivot
            .step(p.pivot_n, p.presliding_mm, motion.v_mm_s, DT_S);
        p.handle_kg * motion.a_m_s2
            + contact
            + pivot
            + p.pivot_n_s_per_m * 1e-3 * motion.v_mm_s
            + self.stop_n(motion)
    }

    /// The force of the handle on the follower through the backlash, N.
    fn contact_n(&self, motion: Motion) -> f64 {
        let p = &self.parameters;
        let apart = motion.x_mm - self.y_mm;
        let closing = motion.v_mm_s - self.y_mm_s;
        let half = 0.5 * p.backlash_mm;
        let damping_n = p.contact_n_s_per_m * 1e-3 * closing;
        pushed_back_n(apart, [-half, half], p.contact_n_per_mm, damping_n)
    }

    /// The force of the probe against an end stop, N.
    fn stop_n(&self, motion: Motion) -> f64 {
        let p = &self.parameters;
        let damping_n = p.stop_n_s_per_m * 1e-3 * motion.v_mm_s;
        pushed_back_n(motion.x_mm, p.stops_mm, p.stop_n_per_mm, damping_n)
    }
}

/// The force of a spring and a damper beyond either end of a range; it never pulls.
fn pushed_back_n(x_mm: f64, [low, high]: [f64; 2], n_per_mm: f64, damping_n: f64) -> f64 {
    if x_mm > high {
        (n_per_mm * (x_mm - high) + damping_n).max(0.0)
    } else if x_mm < low {
        (n_per_mm * (x_mm - low) + damping_n).min(0.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves from `from` to `to` at `speed`, both mm and mm/s; position and force.
    fn sweep(target: &mut Target, from: f64, to: f64, speed: f64) -> Vec<(f64, f64)> {
        let v_mm_s = speed * (to - from).signum();
        let steps = ((to - from).abs() / speed / DT_S) as usize;
        (0..steps)
            .map(|i| {
                let x_mm = from + v_mm_s * i as f64 * DT_S;
                let motion = Motion {
                    x_mm,
                    v_mm_s,
                    a_m_s2: 0.0,
                };
                (x_mm, target.step(motion))
            })
            .collect()
    }

    /// The largest force during a slow stroke from stop to stop, N.
    fn largest_static_n(parameters: Parameters) -> f64 {
        let mut target = Target::new(parameters, 0.0).unwrap();
        sweep(&mut target, 0.0, 35.0, 2.0)
            .iter()
            .map(|(_, force)| *force)
            .fold(f64::MIN, f64::max)
    }

    /// Reference: the description of the two switches, 8.86 N (A), 9.08 N (B). The
    /// simulated B is 4 % lower, see `docs/simulation.md`.
    #[test]
    fn the_largest_static_force_is_that_of_the_description() {
        let a = largest_static_n(Parameters::a());
        assert!((a / 8.86 - 1.0).abs() < 0.01, "{a}");
        let b = largest_static_n(Parameters::b());
        assert!((b / 9.08 - 1.0).abs() < 0.05, "{b}");
    }

    #[test]
    fn the_force_has_hysteresis_and_dissipates_energy() {
        let mut target = Target::new(Parameters::a(), 3.0).unwrap();
        let up = sweep(&mut target, 3.0, 32.0, 20.0);
        let down = sweep(&mut target, 32.0, 3.0, 20.0);
        let work = |path: &[(f64, f64)]| -> f64 {
            path.windows(2).map(|w| w[0].1 * (w[1].0 - w[0].0)).sum()
        };
        let lost_n_mm = work(&up) + work(&down);
        // at least 2 × 29 mm against 1 N of friction
        assert!(lost_n_mm > 58.0, "{lost_n_mm}");
    }

    /// Where the mean of both directions crosses zero upwards.
    #[test]
    fn the_force_has_its_detents_near_5_17_and_30_mm() {
        let mut target = Target::new(Parameters::a(), 3.0).unwrap();
        let up = sweep(&mut target, 3.0, 33.0, 20.0);
        let mut down = sweep(&mut target, 33.0, 3.0, 20.0);
        down.reverse();
        let mean: Vec<(f64, f64)> = up
            .iter()
            .zip(&down)
            .step_by(200)
            .map(|((x, one), (_, other))| (*x, 0.5 * (one + other)))
            .collect();
        for expected in [5.0, 17.5, 30.0] {
            let slope_at = |mm: f64| {
                mean.iter()
                    .filter(|(x, _)| (x - expected - mm).abs() < 0.3)
                    .map(|(_, force)| *force)
                    .sum::<f64>()
            };
            assert!(slope_at(-1.5) < 0.0 && slope_at(1.5) > 0.0, "{expected}");
        }
    }

    #[test]
    fn within_the_backlash_there_is_only_the_friction_of_the_pivot() {
        let mut target = Target::new(Parameters::a(), 17.5).unwrap();
        let small = sweep(&mut target, 17.5, 17.7, 5.0);
        let most = small.iter().map(|(_, f)| f.abs()).fold(0.0, f64::max);
        assert!((0.2..0.3).contains(&most), "{most}");
    }

    #[test]
    fn an_end_stop_is_stiff() {
        let mut target = Target::new(Parameters::a(), 34.0).unwrap();
        let (_, force) = *sweep(&mut target, 34.0, 36.0, 20.0).last().unwrap();
        assert!(force > 60.0, "{force}");
    }

    #[test]
    fn the_same_motion_gives_bit_identical_forces() {
        let run = || {
            let mut target = Target::new(Parameters::b(), 3.0).unwrap();
            sweep(&mut target, 3.0, 32.0, 100.0)
        };
        assert_eq!(run(), run());
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let mut parameters = Parameters::a();
        parameters.follower_kg = 0.0;
        assert!(Target::new(parameters, 17.5).is_err());
    }
}
