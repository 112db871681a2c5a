//! The turn-signal switch under a probe that imposes its motion.

use super::cam::Cam;
use super::friction::{Contact, Dahl, LuGre};
use super::parameters::{BadPlant, Parameters};
use crate::model::predict::Motion;

/// Time step of the simulation, s. The stiffest contact is stable with it.
pub const DT_S: f64 = 25e-6;

/// A target, with whatever moves and stores in it.
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
    /// [`BadPlant`] if the parameters describe none.
    pub fn new(parameters: Parameters, x_mm: f64) -> Result<Self, BadPlant> {
        parameters.check()?;
        Ok(Self {
            cam: Cam::new(&parameters),
            bristle_n_per_mm: parameters.friction * parameters.preload_n
                / parameters.presliding_mm,
            parameters,
            y_mm: x_mm,
            y_mm_s: 0.0,
            follower: LuGre::default(),
            pivot: Dahl::default(),
        })
    }

    /// Moves the handle to `motion` and lets [`DT_S`] pass; the force that the
    /// probe applies, N.
    pub fn step(&mut self, motion: Motion) -> f64 {
        let p = &self.parameters;
        let contact = self.contact_n(motion);
        let press = self.cam.press(self.y_mm);
        let friction = self.follower.step(
            &Contact {
                coulomb_n: p.friction * press.normal_n,
                bristle_n_per_mm: self.bristle_n_per_mm,
                bristle_n_s_per_mm: p.bristle_n_s_per_m * 1e-3,
                stribeck: p.stribeck,
                stribeck_mm_s: p.stribeck_mm_s,
            },
            self.y_mm_s,
            DT_S,
        );
        let viscous = p.follower_n_s_per_m * 1e-3 * self.y_mm_s;
        let net_n = contact - press.force_n - friction - viscous;
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

    /// What the handle presses on the follower through the backlash, N.
    fn contact_n(&self, motion: Motion) -> f64 {
        let p = &self.parameters;
        let apart = motion.x_mm - self.y_mm;
        let closing = motion.v_mm_s - self.y_mm_s;
        let half = 0.5 * p.backlash_mm;
        let damping = p.contact_n_s_per_m * 1e-3;
        if apart > half {
            (p.contact_n_per_mm * (apart - half) + damping * closing).max(0.0)
        } else if apart < -half {
            (p.contact_n_per_mm * (apart + half) + damping * closing).min(0.0)
        } else {
            0.0
        }
    }

    /// What it takes to press the handle into an end stop, N.
    fn stop_n(&self, motion: Motion) -> f64 {
        let p = &self.parameters;
        let [low, high] = p.stops_mm;
        let damping = p.stop_n_s_per_m * 1e-3;
        if motion.x_mm > high {
            (p.stop_n_per_mm * (motion.x_mm - high) + damping * motion.v_mm_s).max(0.0)
        } else if motion.x_mm < low {
            (p.stop_n_per_mm * (motion.x_mm - low) + damping * motion.v_mm_s).min(0.0)
        } else {
            0.0
        }
    }
}
