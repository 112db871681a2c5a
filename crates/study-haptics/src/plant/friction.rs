//! Friction with memory: LuGre between follower and cam, Dahl in the pivot.

/// LuGre friction (Canudas de Wit et al. 1995): a bristle of deflection z.
///
/// g = F_C·(1 + stribeck·e^(−(v/vs)²)), ż = v − σ0·|v|·z/g, F = σ0·z + σ1·ż.
/// z is stepped semi-implicitly, which keeps |σ0·z| ≤ g at any speed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LuGre {
    z_mm: f64,
}

/// The parameters of LuGre friction at the present normal force.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    /// Coulomb friction at the present normal force, N.
    pub(super) coulomb_n: f64,
    /// σ0, N/mm.
    pub(super) bristle_n_per_mm: f64,
    /// σ1, N·s/mm.
    pub(super) bristle_n_s_per_mm: f64,
    /// Breakaway friction in excess of Coulomb friction, as a share of it.
    pub(super) stribeck: f64,
    /// Stribeck speed, mm/s.
    pub(super) stribeck_mm_s: f64,
}

impl LuGre {
    /// The friction force over the next `dt_s` at speed `v_mm_s`, N.
    pub(super) fn step(&mut self, contact: &Contact, v_mm_s: f64, dt_s: f64) -> f64 {
        let ratio = v_mm_s / contact.stribeck_mm_s;
        let g = contact.coulomb_n * (1.0 + contact.stribeck * libm::exp(-ratio * ratio));
        if g <= 0.0 {
            self.z_mm = 0.0;
            return 0.0;
        }
        let before = self.z_mm;
        let wear = dt_s * contact.bristle_n_per_mm * libm::fabs(v_mm_s) / g;
        self.z_mm = (before + dt_s * v_mm_s) / (1.0 + wear);
        let rate = (self.z_mm - before) / dt_s;
        contact.bristle_n_per_mm * self.z_mm + contact.bristle_n_s_per_mm * rate
    }
}

/// Dahl friction: F relaxes towards ±F_C over the distance `slip_mm`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Dahl {
    z_mm: f64,
}

impl Dahl {
    /// The friction force over the next `dt_s` at speed `v_mm_s`, N.
    pub(super) fn step(&mut self, coulomb_n: f64, slip_mm: f64, v_mm_s: f64, dt_s: f64) -> f64 {
        let wear = dt_s * libm::fabs(v_mm_s) / slip_mm;
        self.z_mm = (self.z_mm + dt_s * v_mm_s) / (1.0 + wear);
        coulomb_n * self.z_mm / slip_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steady_sliding_has_coulomb_friction_against_the_motion() {
        let contact = Contact {
            coulomb_n: 1.2,
            bristle_n_per_mm: 20.0,
            bristle_n_s_per_mm: 0.004,
            stribeck: 0.35,
            stribeck_mm_s: 8.0,
        };
        let mut friction = LuGre::default();
        let mut force = 0.0;
        for _ in 0..40_000 {
            force = friction.step(&contact, 80.0, 25e-6);
        }
        assert!((force - 1.2).abs() < 1e-6, "{force}");
        for _ in 0..40_000 {
            force = friction.step(&contact, -0.5, 25e-6);
        }
        let breakaway = -1.2 * (1.0 + 0.35 * libm::exp(-(0.5f64 / 8.0).powi(2)));
        assert!((force - breakaway).abs() < 0.01, "{force} {breakaway}");
    }

    #[test]
    fn the_friction_of_the_pivot_never_exceeds_its_coulomb_friction() {
        let mut pivot = Dahl::default();
        let mut largest = 0.0f64;
        for i in 0..10_000 {
            let v = 300.0 * libm::sin(f64::from(i) * 0.01);
            largest = largest.max(pivot.step(0.25, 0.06, v, 25e-6).abs());
        }
        assert!(largest <= 0.25 && largest > 0.24, "{largest}");
    }
}
