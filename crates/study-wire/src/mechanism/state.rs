//! The state of a mechanism and its step.

use super::{MechanismView, Scalars};
use crate::predict::Motion;
use crate::real::Real;
use crate::sum::Sum;

/// The state of a mechanism. The follower's position is stored as its distance from the
/// handle, which single precision resolves as well in the slowest motion; this distance and
/// the speed change by small amounts, whose roundings are kept: a contact after a flight of
/// the follower multiplies them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<R = f64> {
    /// The last position of the handle, mm.
    x_mm: R,
    /// How far the follower is behind the handle, x − y, mm.
    apart_mm: Sum<R>,
    /// Speed of the follower, mm/s.
    pub(super) w_mm_s: Sum<R>,
    /// Deflection of the follower's bristle, in presliding lengths.
    pub z: R,
    /// Deflection of the handle's bristle, in presliding lengths.
    pub z_handle: R,
}

impl<R: Real> State<R> {
    /// At rest with the follower under the handle.
    pub fn at_rest(x_mm: R) -> Self {
        Self {
            x_mm,
            apart_mm: Sum::of(R::ZERO),
            w_mm_s: Sum::of(R::ZERO),
            z: R::ZERO,
            z_handle: R::ZERO,
        }
    }

    /// The last position of the handle, mm.
    pub fn x_mm(&self) -> R {
        self.x_mm
    }

    /// Position of the follower, mm.
    pub fn y_mm(&self) -> R {
        self.x_mm - self.apart_mm.value
    }

    /// Speed of the follower, mm/s.
    pub fn w_mm_s(&self) -> R {
        self.w_mm_s.value
    }

    /// The next `dt_s` seconds, at the end of which the handle is at `motion`. Returns the
    /// force that the hand has to apply without m·a, N.
    pub fn step(&mut self, mechanism: &MechanismView<'_, R>, motion: Motion<R>, dt_s: R) -> R {
        let p = &mechanism.scalars;
        let w_mm_s = self.w_mm_s.value;
        let ratio = w_mm_s / p.stribeck_mm_s;
        let g = R::ONE + p.stribeck * (-ratio * ratio).exp();
        let loading = dt_s / p.slip_mm;
        let kept = R::ONE / (R::ONE + loading * w_mm_s.abs() / g);
        let friction_n = mechanism.friction.linear_n(self.y_mm());
        let detent_n = (mechanism.detent).spline_behind_n(self.x_mm, self.apart_mm.value);
        // kg·mm/s² are mN
        let inertia = R::of(1e-3) * p.follower_kg / dt_s;
        let least = R::HALF * mechanism.steepest_n_per_mm * dt_s;
        let damping = p.follower_n_s_per_mm.max(least) + friction_n * loading * kept;
        let moved_mm = motion.x_mm - self.x_mm;
        let apart = self.apart_mm.plus(moved_mm);
        let (faster_mm_s, contact_n) = Follower {
            apart,
            w_mm_s: self.w_mm_s,
            drag: inertia + damping,
            push: -detent_n - friction_n * self.z * kept - damping * w_mm_s,
        }
        .contact(p, motion.v_mm_s, dt_s);

        self.w_mm_s = self.w_mm_s.plus(faster_mm_s);
        self.z = (self.z + loading * self.w_mm_s.value) * kept;
        self.apart_mm = apart.plus(-dt_s * self.w_mm_s.value);
        let moved = moved_mm / p.handle_slip_mm;
        self.z_handle = (self.z_handle + moved) / (R::ONE + moved.abs());
        self.x_mm = motion.x_mm;
        contact_n + p.handle_n * self.z_handle + p.handle_n_s_per_mm * motion.v_mm_s + p.offset_n
    }
}

impl State {
    /// At rest in the middle of a motion: the bristles are deflected and the contact holds
    /// the force of the follower, as after a slow motion in the direction of the speed; at
    /// rest as after one in the positive direction.
    pub fn settled(mechanism: &MechanismView<'_>, motion: Motion) -> Self {
        let p = &mechanism.scalars;
        let sign = if motion.v_mm_s < 0.0 { -1.0 } else { 1.0 };
        let mut state = Self::at_rest(motion.x_mm);
        for _ in 0..3 {
            let y_mm = state.y_mm();
            let force_n =
                mechanism.detent.spline_n(y_mm) + sign * mechanism.friction.linear_n(y_mm);
            let behind = 0.5 * p.gap_mm + libm::fabs(force_n) / p.contact_n_per_mm;
            state.apart_mm = Sum::of(if force_n < 0.0 { -behind } else { behind });
        }
        Self {
            w_mm_s: Sum::of(motion.v_mm_s),
            z: sign,
            z_handle: sign,
            ..state
        }
    }

    /// The energy that is stored beside that of the detents and of F_0, N·mm (mJ), for steps of
    /// `dt_s`: of the bristle that which the next step leaves.
    pub fn stored_n_mm(&self, mechanism: &MechanismView<'_>, dt_s: f64) -> f64 {
        let p = &mechanism.scalars;
        let ratio = self.w_mm_s.value / p.stribeck_mm_s;
        let g = 1.0 + p.stribeck * Real::exp(-ratio * ratio);
        let slipping = dt_s * libm::fabs(self.w_mm_s.value) / (p.slip_mm * g);
        let bristle_n = mechanism.friction.linear_n(self.y_mm()) / (1.0 + 2.0 * slipping);
        let deep = (libm::fabs(self.apart_mm.value) - 0.5 * p.gap_mm).max(0.0);
        let w_mm_s = self.w_mm_s.value;
        0.5e-3 * p.follower_kg * w_mm_s * w_mm_s
            + 0.5 * p.contact_n_per_mm * deep * deep
            + 0.5 * bristle_n * p.slip_mm * self.z * self.z
            + 0.5 * p.handle_n * p.handle_slip_mm * self.z_handle * self.z_handle
    }
}

/// The follower before the contact of a step.
struct Follower<R> {
    /// How far it would be behind the handle without moving, mm.
    apart: Sum<R>,
    /// Its speed before the step, mm/s.
    w_mm_s: Sum<R>,
    /// N·s/mm, and the force at its speed, N: without contact it becomes faster by
    /// push / drag.
    drag: R,
    push: R,
}

impl<R: Real> Follower<R> {
    /// By how much it is faster at the end of the step, mm/s, and the force of the contact, N.
    ///
    /// The force falls with the speed of the follower, so exactly one of four cases holds: no
    /// contact, contact, contact whose damper would pull, and contact that begins or ends at
    /// the edge of the gap.
    fn contact(&self, p: &Scalars<R>, v_mm_s: R, dt_s: R) -> (R, R) {
        let (drag, push) = (self.drag, self.push);
        let free = push / drag;
        let half = R::HALF * p.gap_mm;
        let moved_mm = dt_s * self.w_mm_s.value;
        let after = self.apart.value - moved_mm - dt_s * free;
        if after.abs() <= half {
            return (free, R::ZERO);
        }
        let side = if after > R::ZERO { R::ONE } else { -R::ONE };
        // at the old speed
        let edge_mm = (self.apart.value - side * half) + self.apart.rest - moved_mm;
        let closing_mm_s = (v_mm_s - self.w_mm_s.value) - self.w_mm_s.rest;
        let (k, c) = (p.contact_n_per_mm, p.contact_n_s_per_mm);
        let held = (push + k * edge_mm + c * closing_mm_s) / (drag + k * dt_s + c);
        let deep = edge_mm - dt_s * held;
        let force = k * deep + c * (closing_mm_s - held);
        if side * force <= R::ZERO {
            (free, R::ZERO)
        } else if side * deep < R::ZERO {
            let at_edge = edge_mm / dt_s;
            (at_edge, drag * at_edge - push)
        } else {
            (held, force)
        }
    }
}
