//! A virtual mechanism: a handle, backlash, and a follower that slides over detents with
//! friction. It has the four states that a table lacks: position and speed of the
//! follower and the deflection of two bristles.
//!
//! ```text
//! contact   e = x − y;  f = k (|e| − gap/2) sign(e) + c (v − w) beyond the gap, never pulling
//! follower  M dw/dt = f − D(y) − F_c(y) z − b w,  dy/dt = w
//! bristle   dz/dt = w/s − |w| z/(s g),  g = 1 + σ exp(−(w/w_s)²)
//! handle    F = m a + f + F_h z_h + b_h v + F_0,  dz_h/dx = 1/s_h − sign(v) z_h/s_h
//! ```
//!
//! [`State::step`] is implicit in w, with one division and no iteration: f, the bristle
//! and the damping take the speed at the end of the step, D and F_c the position at its
//! beginning. What an explicit D could add, ½ max(D') T² w² per step, the follower's
//! damping takes away, because it is at least ½ max(D') T. `docs/estimators.md` derives
//! that no motion of the handle can then draw more energy than is stored
//! ([`State::stored_n_mm`]), at any rate.
//!
//! Slices and scalars are those of a valid mechanism: see [`MechanismView::check`].

mod profile;
mod state;

use crate::certificate::{Certificate, Margin};
use crate::real::Real;
pub use profile::{Around, Profile};
pub use state::State;

/// Number of scalar parameters, in the order of [`Scalars::to_array`].
pub const SCALARS: usize = 13;

/// The parameters that do not depend on the position.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scalars<R = f64> {
    /// Mass of the handle, m, kg.
    pub handle_kg: R,
    /// Mass of the follower, M, kg.
    pub follower_kg: R,
    /// Stiffness of the contact, k, N/mm.
    pub contact_n_per_mm: R,
    /// Damping of the contact, c, N·s/mm.
    pub contact_n_s_per_mm: R,
    /// Backlash, mm.
    pub gap_mm: R,
    /// Damping of the follower, b, N·s/mm.
    pub follower_n_s_per_mm: R,
    /// Presliding length of the follower's friction, s, mm.
    pub slip_mm: R,
    /// Breakaway friction in excess of Coulomb friction, σ, as a share of it.
    pub stribeck: R,
    /// Stribeck speed, w_s, mm/s.
    pub stribeck_mm_s: R,
    /// Coulomb friction of the handle, F_h, N.
    pub handle_n: R,
    /// Presliding length of the handle's friction, s_h, mm.
    pub handle_slip_mm: R,
    /// Damping of the handle, b_h, N·s/mm.
    pub handle_n_s_per_mm: R,
    /// Constant force, F_0, N.
    pub offset_n: R,
}

impl<R: Real> Scalars<R> {
    /// The parameters in a fixed order.
    pub fn to_array(&self) -> [R; SCALARS] {
        [
            self.handle_kg,
            self.follower_kg,
            self.contact_n_per_mm,
            self.contact_n_s_per_mm,
            self.gap_mm,
            self.follower_n_s_per_mm,
            self.slip_mm,
            self.stribeck,
            self.stribeck_mm_s,
            self.handle_n,
            self.handle_slip_mm,
            self.handle_n_s_per_mm,
            self.offset_n,
        ]
    }

    /// The inverse of [`Self::to_array`].
    pub fn from_array(p: [R; SCALARS]) -> Self {
        Self {
            handle_kg: p[0],
            follower_kg: p[1],
            contact_n_per_mm: p[2],
            contact_n_s_per_mm: p[3],
            gap_mm: p[4],
            follower_n_s_per_mm: p[5],
            slip_mm: p[6],
            stribeck: p[7],
            stribeck_mm_s: p[8],
            handle_n: p[9],
            handle_slip_mm: p[10],
            handle_n_s_per_mm: p[11],
            offset_n: p[12],
        }
    }
}

/// A mechanism as borrowed slices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MechanismView<'a, R = f64> {
    /// The parameters that do not depend on the position.
    pub scalars: Scalars<R>,
    /// The detent force D on the follower, interpolated by a spline.
    pub detent: Profile<'a, R>,
    /// The Coulomb friction F_c of the follower, interpolated linearly.
    pub friction: Profile<'a, R>,
    /// max(D'), N/mm: see [`Self::new`].
    steepest_n_per_mm: R,
}

/// Why parameters are no passive mechanism.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flaw {
    /// A parameter is not finite, is below its least value, or the scalar with this index
    /// is.
    Scalar(usize),
    /// A profile has fewer than two values, or its spacing is no length.
    Profile,
    /// A value of a profile is not finite, or a friction is negative.
    Value,
    /// The friction F_c rises too steeply from too small a value for the energy of the
    /// bristle: see [`MechanismView::friction_margin_n`].
    Friction,
}

impl<'a> MechanismView<'a> {
    /// A mechanism; computes the steepest slope of the detents, which
    /// [`State::step`] needs.
    pub fn new(scalars: Scalars, detent: Profile<'a>, friction: Profile<'a>) -> Self {
        let slopes = (0..detent.n.len().saturating_sub(1)).map(|i| detent.slopes_n_per_mm(i)[1]);
        let steepest_n_per_mm = slopes.fold(0.0, f64::max);
        Self {
            scalars,
            detent,
            friction,
            steepest_n_per_mm,
        }
    }

    /// The same with a slope computed before.
    pub fn with_slope(
        scalars: Scalars,
        detent: Profile<'a>,
        friction: Profile<'a>,
        steepest_n_per_mm: f64,
    ) -> Self {
        Self {
            scalars,
            detent,
            friction,
            steepest_n_per_mm,
        }
    }

    /// In the precision of a servo.
    pub fn of<R: Real>(&self) -> MechanismView<'a, R> {
        let profile = |of: Profile<'a>| Profile {
            first_mm: R::of(of.first_mm),
            step_mm: R::of(of.step_mm),
            n: of.n,
        };
        MechanismView {
            scalars: Scalars::from_array(self.scalars.to_array().map(R::of)),
            detent: profile(self.detent),
            friction: profile(self.friction),
            steepest_n_per_mm: R::of(self.steepest_n_per_mm),
        }
    }

    /// max(D'), N/mm.
    pub fn steepest_n_per_mm(&self) -> f64 {
        self.steepest_n_per_mm
    }

    /// Checks the conditions under which the mechanism is passive: see the certificate in
    /// `docs/estimators.md`. `top_mm_s` is the highest speed of the follower.
    ///
    /// # Errors
    /// The first [`Flaw`].
    pub fn check(&self, top_mm_s: f64) -> Result<(), Flaw> {
        self.scalars.check()?;
        for profile in [&self.detent, &self.friction] {
            let spaced = profile.step_mm > 0.0 && profile.step_mm.is_finite();
            if profile.n.len() < 2 || !spaced || !profile.first_mm.is_finite() {
                return Err(Flaw::Profile);
            }
            if profile.n.iter().any(|n| !n.is_finite()) {
                return Err(Flaw::Value);
            }
        }
        if self.friction.n.iter().any(|n| *n < 0.0) {
            return Err(Flaw::Value);
        }
        let (margin, _) = self.friction_margin_n(top_mm_s);
        if margin >= -1e-12 {
            Ok(())
        } else {
            Err(Flaw::Friction)
        }
    }

    /// By how much F_c at least exceeds what its rise ahead requires, and where, mm:
    /// F_c ≥ ½ r s (1 + σ) + a T w in either direction, with the slope r ahead, the slope a behind
    /// (0 if it does not rise), T = [`SLOWEST_S`] and the speed w. Not negative if the bristle
    /// takes more than a rising friction adds to its energy.
    pub fn friction_margin_n(&self, top_mm_s: f64) -> (f64, f64) {
        let mut certifier = Certifier::new();
        while certifier.step(self, top_mm_s) {}
        (certifier.friction.value, certifier.friction.at_mm)
    }

    /// The certificate: passive by structure if [`Self::check`] finds no flaw. The margins are
    /// those of the masses, of the dampings and of F_c, each with its worst position.
    /// `top_mm_s` is the trained speed; the follower may be twice as fast.
    pub fn certificate(&self, top_mm_s: f64) -> Certificate {
        let mut certifier = Certifier::new();
        while certifier.step(self, FASTER_THAN_TRAINED * top_mm_s) {}
        let mut certificate = certifier.finish(self);
        // a flaw that no margin shows has no number
        let flaw = self.check(FASTER_THAN_TRAINED * top_mm_s).err();
        if certificate.passes() && flaw.is_some_and(|flaw| flaw != Flaw::Friction) {
            certificate.hysteresis.value = f64::NEG_INFINITY;
        }
        certificate
    }

    /// The stiffness that a device renders: contact, and the friction of the handle over its
    /// presliding length, N/mm.
    pub fn stiffness_n_per_mm(&self) -> f64 {
        let p = &self.scalars;
        p.contact_n_per_mm + p.handle_n / p.handle_slip_mm
    }

    /// The damping that a device renders, N·s/mm.
    pub fn damping_n_s_per_mm(&self) -> f64 {
        self.scalars.contact_n_s_per_mm + self.scalars.handle_n_s_per_mm
    }

    /// The force at rest at a position after a long motion in one direction: D ± F_c and
    /// the friction of the handle, N.
    pub fn static_n(&self, x_mm: f64, forwards: bool) -> f64 {
        let sign = if forwards { 1.0 } else { -1.0 };
        let p = &self.scalars;
        // the contact holds the follower half a gap and its own deflection behind
        let y_mm = x_mm - sign * 0.5 * p.gap_mm;
        self.detent.spline_n(y_mm) + sign * (self.friction.linear_n(y_mm) + p.handle_n) + p.offset_n
    }
}

/// The longest step for which the condition on F_c is checked, s.
pub const SLOWEST_S: f64 = 1e-3;
/// The certificate holds up to this multiple of the trained speed.
pub const FASTER_THAN_TRAINED: f64 = 2.0;

impl Scalars {
    /// Checks that nothing is divided by zero and nothing is negative that would supply
    /// energy.
    ///
    /// # Errors
    /// [`Flaw::Scalar`] with the first one.
    pub fn check(&self) -> Result<(), Flaw> {
        for (i, value) in self.to_array().into_iter().enumerate() {
            // a length, speed or mass by which is divided; F_0 has any sign
            let above = matches!(i, 1 | 6 | 8 | 10);
            let ok = value.is_finite() && (i == 12 || value > 0.0 || (!above && value >= 0.0));
            if !ok {
                return Err(Flaw::Scalar(i));
            }
        }
        Ok(())
    }
}

/// A certificate in progress, one interval of a profile at a time, so that a device can
/// judge a mechanism between servo periods while it arrives.
#[derive(Debug, Clone, Copy)]
pub struct Certifier {
    slopes_n_per_mm: [f64; 2],
    friction: Margin,
    judged: usize,
}

impl Certifier {
    /// Before the first interval.
    pub const fn new() -> Self {
        Self {
            slopes_n_per_mm: [0.0; 2],
            friction: Margin {
                value: f64::INFINITY,
                at_mm: 0.0,
            },
            judged: 0,
        }
    }

    /// Intervals judged so far: those of D, then those of F_c.
    pub fn judged(&self) -> usize {
        self.judged
    }

    /// max(D') so far, N/mm.
    pub fn steepest_n_per_mm(&self) -> f64 {
        self.slopes_n_per_mm[1]
    }

    /// Judges the next interval, for speeds up to `top_mm_s`; false if there is none.
    pub fn step(&mut self, of: &MechanismView<'_>, top_mm_s: f64) -> bool {
        let detents = of.detent.n.len().saturating_sub(1);
        if self.judged < detents {
            let [low, high] = of.detent.slopes_n_per_mm(self.judged);
            let [least, most] = self.slopes_n_per_mm;
            self.slopes_n_per_mm = [least.min(low), most.max(high)];
        } else {
            let left = self.judged - detents;
            if left + 1 >= of.friction.n.len() {
                return false;
            }
            self.judge_friction(of, left, top_mm_s);
            if left + 2 == of.friction.n.len() {
                self.judge_friction(of, left + 1, top_mm_s);
            }
        }
        self.judged += 1;
        true
    }

    fn judge_friction(&mut self, of: &MechanismView<'_>, node: usize, top_mm_s: f64) {
        let (n, step_mm) = (of.friction.n, of.friction.step_mm);
        let slope_to = |right: usize| match n.get(right) {
            Some(to) if right > 0 => (to - n[right - 1]) / step_mm,
            _ => 0.0,
        };
        let (behind, ahead) = (slope_to(node), slope_to(node + 1));
        let bristle_mm = 0.5 * of.scalars.slip_mm * (1.0 + of.scalars.stribeck);
        let way_mm = SLOWEST_S * top_mm_s;
        let needed = if step_mm < way_mm {
            // a step passes more than one value
            (bristle_mm + way_mm) * libm::fabs(behind).max(libm::fabs(ahead))
        } else {
            let of = |ahead: f64, behind: f64| match ahead > 0.0 {
                true => bristle_mm * ahead + way_mm * behind.max(0.0),
                false => 0.0,
            };
            of(ahead, behind).max(of(-behind, -ahead))
        };
        let at_mm = of.friction.first_mm + node as f64 * step_mm;
        self.friction.include(n[node] - needed, at_mm);
    }

    /// The certificate, after the last interval.
    pub fn finish(&self, of: &MechanismView<'_>) -> Certificate {
        let p = &of.scalars;
        let margin = |value: f64| Margin {
            value,
            at_mm: of.detent.first_mm,
        };
        let mass_kg = p.handle_kg.min(p.follower_kg);
        let damping = p.contact_n_s_per_mm.min(p.follower_n_s_per_mm);
        let damping = damping.min(p.handle_n_s_per_mm);
        let negative = |value: f64| if value < 0.0 { 1.0 } else { 0.0 };
        let [low, high] = self.slopes_n_per_mm;
        // detents in series with the contact are softer than either
        let static_n_per_mm = high.max(-low).min(p.contact_n_per_mm);
        Certificate {
            mass: margin(mass_kg),
            damping: margin(damping),
            hysteresis: self.friction,
            negative_mass: negative(mass_kg),
            negative_damping: negative(damping),
            gap_n: 0.0,
            stiffness_n_per_mm: static_n_per_mm,
            state_n_per_mm: Some(of.stiffness_n_per_mm() - static_n_per_mm),
            damping_n_s_per_mm: of.damping_n_s_per_mm(),
            mass_kg: p.handle_kg + p.follower_kg,
        }
    }
}

impl Default for Certifier {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
