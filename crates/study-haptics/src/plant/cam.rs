//! The cam: height and slope along the path of the follower.
//!
//! h'(y) = S·[Σ tanh((y−v)/w) − Σ tanh((y−c)/w)] over valleys v and crests c, and
//! h its integral in closed form, w·ln cosh. The follower's spring presses with
//! N = max(0, N0 + ks·(h(y) − h(y0))), and the cam's force along the path is N·h'.

use super::parameters::{Extremum, Parameters};

/// The cam of a target.
#[derive(Debug, Clone)]
pub(super) struct Cam {
    /// Valleys and crests, with the sign of the curvature: + for valleys, − for crests.
    extrema: Vec<(Extremum, f64)>,
    slope: f64,
    preload_n: f64,
    spring_n_per_mm: f64,
    height_at_preload_mm: f64,
    ripple_n: f64,
    ripple_per_mm: f64,
}

/// The forces between follower and cam at one position.
#[derive(Debug, Clone, Copy)]
pub(super) struct CamForces {
    /// Normal force, N.
    pub(super) normal_n: f64,
    /// Force along the path needed to move on, N.
    pub(super) force_n: f64,
}

impl Cam {
    pub(super) fn new(p: &Parameters) -> Self {
        let up = p.valleys.iter().map(|w| (*w, 1.0));
        let down = p.crests.iter().map(|w| (*w, -1.0));
        let mut cam = Self {
            extrema: up.chain(down).collect(),
            slope: p.slope,
            preload_n: p.preload_n,
            spring_n_per_mm: p.spring_n_per_mm,
            height_at_preload_mm: 0.0,
            ripple_n: p.ripple_n,
            ripple_per_mm: std::f64::consts::TAU / p.ripple_mm,
        };
        cam.height_at_preload_mm = cam.height_and_slope(p.preload_at_mm).0;
        cam
    }

    /// The height h, mm, and its slope h' at `y_mm`.
    fn height_and_slope(&self, y_mm: f64) -> (f64, f64) {
        let mut height = 0.0;
        let mut slope = 0.0;
        for (extremum, sign) in &self.extrema {
            let u = (y_mm - extremum.at_mm) / extremum.width_mm;
            // tanh and ln cosh from one exponential, without overflow
            let e = libm::exp(-2.0 * libm::fabs(u));
            let log_cosh = libm::fabs(u) + libm::log1p(e) - std::f64::consts::LN_2;
            height += sign * extremum.width_mm * log_cosh;
            slope += sign * libm::copysign((1.0 - e) / (1.0 + e), u);
        }
        (self.slope * height, self.slope * slope)
    }

    /// The forces with the follower at `y_mm`.
    pub(super) fn forces(&self, y_mm: f64) -> CamForces {
        let (height, slope) = self.height_and_slope(y_mm);
        let compressed = height - self.height_at_preload_mm;
        let normal_n = (self.preload_n + self.spring_n_per_mm * compressed).max(0.0);
        let ripple = if self.ripple_n == 0.0 {
            0.0
        } else {
            self.ripple_n * libm::sin(self.ripple_per_mm * y_mm)
        };
        CamForces {
            normal_n,
            force_n: normal_n * slope + ripple,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_the_derivative_of_the_height() {
        for plant in [Parameters::a(), Parameters::b()] {
            let cam = Cam::new(&plant);
            for i in 0..350 {
                let y = f64::from(i) * 0.1;
                let step = 1e-5;
                let (above, _) = cam.height_and_slope(y + step);
                let (below, _) = cam.height_and_slope(y - step);
                let (_, slope) = cam.height_and_slope(y);
                let numeric = (above - below) / (2.0 * step);
                assert!((numeric - slope).abs() < 1e-8, "{y}: {numeric} {slope}");
            }
        }
    }

    #[test]
    fn far_away_nothing_overflows() {
        let cam = Cam::new(&Parameters::b());
        assert!(cam.forces(1e6).force_n.is_finite());
        assert!(cam.forces(-1e6).force_n.is_finite());
    }

    /// Detents are stable: the force crosses zero upwards.
    #[test]
    fn there_are_three_detents() {
        let cam = Cam::new(&Parameters::a());
        let force = |i: i32| cam.forces(f64::from(i) * 0.01).force_n;
        let stable: Vec<f64> = (1..3500)
            .filter(|i| force(i - 1) < 0.0 && force(*i) >= 0.0)
            .map(|i| f64::from(i) * 0.01)
            .collect();
        assert_eq!(stable.len(), 3, "{stable:?}");
        for (found, expected) in stable.iter().zip([5.0, 17.5, 30.0]) {
            assert!((found - expected).abs() < 0.5, "{stable:?}");
        }
    }
}
