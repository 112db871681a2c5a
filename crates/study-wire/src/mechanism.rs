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

use crate::certificate::{Certificate, Margin};
use crate::predict::Motion;

/// Names and meaning of the scalar parameters, in the order of [`Scalars::to_array`].
pub const SCALARS: usize = 13;

/// The parameters that do not depend on the position.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scalars {
    /// Mass of the handle, m, kg.
    pub handle_kg: f64,
    /// Mass of the follower, M, kg.
    pub follower_kg: f64,
    /// Stiffness of the contact, k, N/mm.
    pub contact_n_per_mm: f64,
    /// Damping of the contact, c, N·s/mm.
    pub contact_n_s_per_mm: f64,
    /// Backlash, mm.
    pub gap_mm: f64,
    /// Damping of the follower, b, N·s/mm.
    pub follower_n_s_per_mm: f64,
    /// Presliding length of the follower's friction, s, mm.
    pub slip_mm: f64,
    /// Breakaway friction in excess of Coulomb friction, σ, as a share of it.
    pub stribeck: f64,
    /// Stribeck speed, w_s, mm/s.
    pub stribeck_mm_s: f64,
    /// Coulomb friction of the handle, F_h, N.
    pub handle_n: f64,
    /// Presliding length of the handle's friction, s_h, mm.
    pub handle_slip_mm: f64,
    /// Damping of the handle, b_h, N·s/mm.
    pub handle_n_s_per_mm: f64,
    /// Constant force, F_0, N.
    pub offset_n: f64,
}

impl Scalars {
    /// The parameters in a fixed order.
    pub fn to_array(&self) -> [f64; SCALARS] {
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
    pub fn from_array(p: [f64; SCALARS]) -> Self {
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

/// Values at equally spaced positions, at least two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile<'a> {
    /// Position of the first value, mm.
    pub first_mm: f64,
    /// Distance of two values, mm, above 0.
    pub step_mm: f64,
    /// The values, N.
    pub n: &'a [f64],
}

/// The four values around a position, their weights and the derivatives of the weights.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    /// Indices; at the ends some are equal.
    pub at: [usize; 4],
    /// Weight of each.
    pub weight: [f64; 4],
    /// Derivative of each weight, 1/mm.
    pub slope: [f64; 4],
}

impl Profile<'_> {
    /// The interval of a position and the share of it, in [0, 1]; `None` beyond the ends,
    /// where the profile is constant, with the index of the end.
    fn interval(&self, x_mm: f64) -> Result<(usize, f64), usize> {
        let last = self.n.len() - 1;
        let place = (x_mm - self.first_mm) / self.step_mm;
        if place.is_nan() || place <= 0.0 {
            return Err(0);
        }
        if place >= last as f64 {
            return Err(last);
        }
        let left = place as usize;
        Ok((left, place - left as f64))
    }

    /// The weights of linear interpolation: index of the left value, weight of the right
    /// one, and its derivative, 1/mm.
    pub fn linear(&self, x_mm: f64) -> (usize, f64, f64) {
        match self.interval(x_mm) {
            Ok((left, t)) => (left, t, 1.0 / self.step_mm),
            Err(0) => (0, 0.0, 0.0),
            Err(last) => (last - 1, 1.0, 0.0),
        }
    }

    /// The weights of a Catmull–Rom spline: once continuously differentiable, so that it is
    /// the gradient of a potential, and each value reaches two intervals to either side.
    pub fn spline(&self, x_mm: f64) -> Around {
        match self.interval(x_mm) {
            Ok((left, t)) => {
                let last = self.n.len() - 1;
                let (t2, t3) = (t * t, t * t * t);
                let h = self.step_mm;
                Around {
                    at: [left.saturating_sub(1), left, left + 1, (left + 2).min(last)],
                    weight: [
                        0.5 * (-t + 2.0 * t2 - t3),
                        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
                        0.5 * (t + 4.0 * t2 - 3.0 * t3),
                        0.5 * (t3 - t2),
                    ],
                    slope: [
                        0.5 * (-1.0 + 4.0 * t - 3.0 * t2) / h,
                        0.5 * (-10.0 * t + 9.0 * t2) / h,
                        0.5 * (1.0 + 8.0 * t - 9.0 * t2) / h,
                        0.5 * (3.0 * t2 - 2.0 * t) / h,
                    ],
                }
            }
            Err(end) => Around {
                at: [end; 4],
                weight: [1.0, 0.0, 0.0, 0.0],
                slope: [0.0; 4],
            },
        }
    }

    /// The value of the spline.
    fn spline_n(&self, x_mm: f64) -> f64 {
        let around = self.spline(x_mm);
        let parts = around.at.iter().zip(around.weight);
        parts.map(|(i, weight)| weight * self.n[*i]).sum()
    }

    /// The value by linear interpolation.
    fn linear_n(&self, x_mm: f64) -> f64 {
        let (left, t, _) = self.linear(x_mm);
        self.n[left] + t * (self.n[left + 1] - self.n[left])
    }

    /// Least and largest slope of the spline, N/mm, beyond the ends 0.
    pub fn slopes_n_per_mm(&self) -> [f64; 2] {
        let last = self.n.len() - 1;
        let mut range = [0.0_f64; 2];
        for left in 0..last {
            let p = |i: usize| self.n[i.min(last)];
            let (a, b, c, d) = (p(left.saturating_sub(1)), p(left), p(left + 1), p(left + 2));
            // D'(t) = q0 + q1 t + q2 t²
            let q0 = 0.5 * (c - a);
            let q1 = 2.0 * a - 5.0 * b + 4.0 * c - d;
            let q2 = 1.5 * (-a + 3.0 * b - 3.0 * c + d);
            let vertex = (-q1 / (2.0 * q2)).clamp(0.0, 1.0);
            for t in [0.0, 1.0, if vertex.is_nan() { 0.0 } else { vertex }] {
                let slope = (q0 + (q1 + q2 * t) * t) / self.step_mm;
                range = [range[0].min(slope), range[1].max(slope)];
            }
        }
        range
    }
}

/// A mechanism as borrowed slices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MechanismView<'a> {
    /// The parameters that do not depend on the position.
    pub scalars: Scalars,
    /// The detent force D on the follower, interpolated by a spline.
    pub detent: Profile<'a>,
    /// The Coulomb friction F_c of the follower, interpolated linearly.
    pub friction: Profile<'a>,
    /// max(D'), N/mm: see [`Self::new`].
    steepest_n_per_mm: f64,
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
        let steepest_n_per_mm = if detent.n.len() < 2 {
            0.0
        } else {
            detent.slopes_n_per_mm()[1]
        };
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
        let scalars = self.scalars.to_array();
        for (i, value) in scalars.into_iter().enumerate() {
            // a length, speed or mass by which is divided; F_0 has any sign
            let above = matches!(i, 1 | 6 | 8 | 10);
            let ok = value.is_finite() && (i == 12 || value > 0.0 || (!above && value >= 0.0));
            if !ok {
                return Err(Flaw::Scalar(i));
            }
        }
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

    /// The least F_c − ½ |F_c'| (s (1 + σ) + 2 T w) and its position, mm, at [`SLOWEST_S`]
    /// and the speed w: not negative if the bristle takes more than a rising friction
    /// adds to its energy.
    pub fn friction_margin_n(&self, top_mm_s: f64) -> (f64, f64) {
        let p = &self.scalars;
        let reach_mm = p.slip_mm * (1.0 + p.stribeck) + 2.0 * SLOWEST_S * top_mm_s;
        let mut least = (f64::INFINITY, self.friction.first_mm);
        for (i, pair) in self.friction.n.windows(2).enumerate() {
            let slope = libm::fabs(pair[1] - pair[0]) / self.friction.step_mm;
            for (j, value) in pair.iter().enumerate() {
                let margin = value - 0.5 * slope * reach_mm;
                if margin < least.0 {
                    let at = (i + j) as f64;
                    least = (margin, self.friction.first_mm + at * self.friction.step_mm);
                }
            }
        }
        least
    }

    /// The certificate: passive by structure if [`Self::check`] finds no flaw. The margins are
    /// those of the masses, of the dampings and of F_c, each with its worst position.
    pub fn certificate(&self, top_mm_s: f64) -> Certificate {
        let p = &self.scalars;
        let at_mm = self.detent.first_mm;
        let (friction_n, worst_mm) = self.friction_margin_n(2.0 * top_mm_s);
        let sound = self.check(2.0 * top_mm_s).is_ok();
        let margin = |value: f64, at_mm: f64| Margin {
            // a flaw that has no margin of its own fails as well
            value: if sound { value } else { value.min(-1.0) },
            at_mm,
        };
        let [low, high] = self.detent.slopes_n_per_mm();
        let damping = p.contact_n_s_per_mm.min(p.follower_n_s_per_mm);
        let negative = |value: f64| if value < 0.0 { 1.0 } else { 0.0 };
        Certificate {
            mass: margin(p.handle_kg.min(p.follower_kg), at_mm),
            damping: margin(damping.min(p.handle_n_s_per_mm), at_mm),
            hysteresis: margin(friction_n, worst_mm),
            negative_mass: negative(p.handle_kg.min(p.follower_kg)),
            negative_damping: negative(damping.min(p.handle_n_s_per_mm)),
            // detents in series with the contact are softer than either
            stiffness_n_per_mm: high.max(-low).min(p.contact_n_per_mm),
            state_n_per_mm: Some(
                self.stiffness_n_per_mm() - high.max(-low).min(p.contact_n_per_mm),
            ),
            damping_n_s_per_mm: self.damping_n_s_per_mm(),
            mass_kg: p.handle_kg + p.follower_kg,
        }
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

/// The state of a mechanism.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// The last position of the handle, mm.
    x_mm: f64,
    /// Position of the follower, mm.
    pub y_mm: f64,
    /// Its speed, mm/s.
    pub w_mm_s: f64,
    /// Deflection of the follower's bristle, in presliding lengths.
    pub z: f64,
    /// Deflection of the handle's bristle, in presliding lengths.
    pub z_handle: f64,
    /// F_c where the last step began, N: the energy of the bristle refers to it.
    bristle_n: f64,
}

impl State {
    /// At rest with the follower under the handle.
    pub fn at_rest(x_mm: f64) -> Self {
        Self {
            x_mm,
            y_mm: x_mm,
            ..Self::default()
        }
    }

    /// At rest in the middle of a motion: the bristles are deflected and the contact holds
    /// the force of the follower, as after a slow motion in the direction of the speed; at
    /// rest as after one in the positive direction.
    pub fn settled(mechanism: &MechanismView<'_>, motion: Motion) -> Self {
        let p = &mechanism.scalars;
        let sign = if motion.v_mm_s < 0.0 { -1.0 } else { 1.0 };
        let mut state = Self::at_rest(motion.x_mm);
        for _ in 0..3 {
            let force_n = mechanism.detent.spline_n(state.y_mm)
                + sign * mechanism.friction.linear_n(state.y_mm);
            let behind = 0.5 * p.gap_mm + libm::fabs(force_n) / p.contact_n_per_mm;
            state.y_mm = motion.x_mm - if force_n < 0.0 { -behind } else { behind };
        }
        state.bristle_n = mechanism.friction.linear_n(state.y_mm);
        Self {
            w_mm_s: motion.v_mm_s,
            z: sign,
            z_handle: sign,
            ..state
        }
    }

    /// The last position of the handle, mm.
    pub fn x_mm(&self) -> f64 {
        self.x_mm
    }

    /// The next `dt_s` seconds, at the end of which the handle is at `motion`. Returns the
    /// force that the hand has to apply without m·a, N.
    pub fn step(&mut self, mechanism: &MechanismView<'_>, motion: Motion, dt_s: f64) -> f64 {
        let p = &mechanism.scalars;
        let ratio = self.w_mm_s / p.stribeck_mm_s;
        let g = 1.0 + p.stribeck * libm::exp(-ratio * ratio);
        let loading = dt_s / p.slip_mm;
        let kept = 1.0 / (1.0 + loading * libm::fabs(self.w_mm_s) / g);
        let friction_n = mechanism.friction.linear_n(self.y_mm);
        // kg·mm/s² are mN
        let inertia = 1e-3 * p.follower_kg / dt_s;
        let damping = p
            .follower_n_s_per_mm
            .max(0.5 * mechanism.steepest_n_per_mm * dt_s);
        // without contact: drag · w' = push
        let drag = inertia + damping + friction_n * loading * kept;
        let push = inertia * self.w_mm_s
            - mechanism.detent.spline_n(self.y_mm)
            - friction_n * self.z * kept;
        let apart_mm = motion.x_mm - self.y_mm;
        let (w_mm_s, contact_n) = contact(p, apart_mm, motion.v_mm_s, drag, push, dt_s);

        self.bristle_n = friction_n;
        self.z = (self.z + loading * w_mm_s) * kept;
        self.w_mm_s = w_mm_s;
        self.y_mm += dt_s * w_mm_s;
        let moved = (motion.x_mm - self.x_mm) / p.handle_slip_mm;
        self.z_handle = (self.z_handle + moved) / (1.0 + libm::fabs(moved));
        self.x_mm = motion.x_mm;
        contact_n + p.handle_n * self.z_handle + p.handle_n_s_per_mm * motion.v_mm_s + p.offset_n
    }

    /// The energy that is stored beside that of the detents and of F_0, N·mm (mJ).
    pub fn stored_n_mm(&self, mechanism: &MechanismView<'_>) -> f64 {
        let p = &mechanism.scalars;
        let deep = (libm::fabs(self.x_mm - self.y_mm) - 0.5 * p.gap_mm).max(0.0);
        0.5e-3 * p.follower_kg * self.w_mm_s * self.w_mm_s
            + 0.5 * p.contact_n_per_mm * deep * deep
            + 0.5 * self.bristle_n * p.slip_mm * self.z * self.z
            + 0.5 * p.handle_n * p.handle_slip_mm * self.z_handle * self.z_handle
    }
}

/// The speed of the follower at the end of a step, mm/s, and the force of the contact, N.
///
/// The force falls with the speed of the follower, so exactly one of four cases holds: no
/// contact, contact, contact whose damper would pull, and contact that begins or ends at the
/// edge of the gap.
fn contact(p: &Scalars, apart_mm: f64, v_mm_s: f64, drag: f64, push: f64, dt_s: f64) -> (f64, f64) {
    let free = push / drag;
    let half = 0.5 * p.gap_mm;
    let after = apart_mm - dt_s * free;
    if libm::fabs(after) <= half {
        return (free, 0.0);
    }
    let side = if after > 0.0 { 1.0 } else { -1.0 };
    let edge_mm = apart_mm - side * half;
    let (k, c) = (p.contact_n_per_mm, p.contact_n_s_per_mm);
    let held = (push + k * edge_mm + c * v_mm_s) / (drag + k * dt_s + c);
    let deep = edge_mm - dt_s * held;
    let force = k * deep + c * (v_mm_s - held);
    if side * force <= 0.0 {
        (free, 0.0)
    } else if side * deep < 0.0 {
        let at_edge = edge_mm / dt_s;
        (at_edge, drag * at_edge - push)
    } else {
        (held, force)
    }
}

#[cfg(test)]
mod tests;
