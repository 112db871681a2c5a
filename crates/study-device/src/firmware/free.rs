//! A handle that nobody holds, or at which a weight or a scale pulls.

use study_wire::predict::Motion;

/// How fast somebody lets a weight down or pulls at a scale, N/s.
const PULL_N_S: f64 = 8.0;
/// Slower arrivals at a stop are none, mm/s.
const TOUCH_MM_S: f64 = 1.0;

/// The mechanics of a free handle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bearing {
    pub(super) mass_kg: f64,
    /// Damping, N·s/mm.
    pub(super) damping_n_s_per_mm: f64,
    /// Coulomb friction, N.
    pub(super) friction_n: f64,
    /// The stops, mm.
    pub(super) stops_mm: [f64; 2],
}

/// Where a free handle is and has been.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Position, mm.
    pub x_mm: f64,
    /// Lowest and highest position so far, mm.
    pub range_mm: [f64; 2],
    /// How often it ran into a stop.
    pub stops: u32,
    /// Force of the motor, N.
    pub force_n: f64,
}

/// A free handle.
#[derive(Debug)]
pub(super) struct Free {
    bearing: Bearing,
    pub(super) motion: Motion,
    /// The pull that is wanted and that there is, N, positive towards +x.
    wanted_n: f64,
    pull_n: f64,
    range_mm: [f64; 2],
    stops: u32,
}

impl Free {
    pub(super) fn new(bearing: Bearing, x_mm: f64) -> Self {
        Self {
            bearing,
            motion: Motion::at_rest(x_mm),
            wanted_n: 0.0,
            pull_n: 0.0,
            range_mm: [x_mm; 2],
            stops: 0,
        }
    }

    /// Pulls with this force from now on, N.
    pub(super) fn pull(&mut self, force_n: f64) {
        self.wanted_n = force_n;
    }

    pub(super) fn moving(&self) -> bool {
        self.motion.v_mm_s != 0.0 || self.wanted_n != 0.0 || self.pull_n != 0.0
    }

    pub(super) fn place(&self, force_n: f64) -> Place {
        Place {
            x_mm: self.motion.x_mm,
            range_mm: self.range_mm,
            stops: self.stops,
            force_n,
        }
    }

    /// Simulates `dt_s` seconds with the constant force `force_n`, which a hand would have to apply.
    pub(super) fn step(&mut self, force_n: f64, dt_s: f64) {
        let Bearing {
            mass_kg,
            damping_n_s_per_mm,
            friction_n,
            stops_mm: [low, high],
        } = self.bearing;
        let most_n = PULL_N_S * dt_s;
        self.pull_n += (self.wanted_n - self.pull_n).clamp(-most_n, most_n);
        let v_mm_s = self.motion.v_mm_s;
        let driven_n = self.pull_n - force_n - damping_n_s_per_mm * v_mm_s;
        // friction stops the handle and does not turn it
        let free_mm_s = v_mm_s + dt_s * 1e3 * driven_n / mass_kg;
        let rubbed_mm_s = dt_s * 1e3 * friction_n / mass_kg;
        let mut v_new = free_mm_s.signum() * (free_mm_s.abs() - rubbed_mm_s).max(0.0);
        let mut x_mm = self.motion.x_mm + dt_s * v_new;
        if x_mm < low || x_mm > high {
            self.stops += u32::from(v_new.abs() > TOUCH_MM_S);
            x_mm = x_mm.clamp(low, high);
            v_new = 0.0;
        }
        self.motion = Motion {
            x_mm,
            v_mm_s: v_new,
            a_m_s2: 1e-3 * (v_new - v_mm_s) / dt_s,
        };
        self.range_mm = [self.range_mm[0].min(x_mm), self.range_mm[1].max(x_mm)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bearing() -> Bearing {
        Bearing {
            mass_kg: 0.5,
            damping_n_s_per_mm: 0.0,
            friction_n: 0.1,
            stops_mm: [-20.0, 20.0],
        }
    }

    #[test]
    fn friction_holds_what_pulls_less_and_stops_what_coasts() {
        let mut free = Free::new(bearing(), 0.0);
        free.pull(0.09);
        (0..4000).for_each(|_| free.step(0.0, 250e-6));
        assert_eq!(free.motion.x_mm, 0.0);
        // v² / 2μ with μ = 0.2 m/s²: 4 mm from 40 mm/s
        free.pull(0.0);
        (0..4000).for_each(|_| free.step(0.0, 250e-6));
        free.motion.v_mm_s = 40.0;
        (0..4000).for_each(|_| free.step(0.0, 250e-6));
        assert!((free.motion.x_mm - 4.0).abs() < 0.01, "{free:?}");
        assert!(!free.moving() && free.stops == 0);
    }

    #[test]
    fn a_stop_is_counted_once() {
        let mut free = Free::new(bearing(), 10.0);
        (0..8000).for_each(|_| free.step(-1.0, 250e-6));
        assert_eq!((free.motion.x_mm, free.stops), (20.0, 1));
    }
}
