//! One step of a mechanism with the derivatives of its state by every parameter (forward
//! mode): the formulas of [`study_wire::mechanism::State::step`], differentiated.
//!
//! A parameter is one of the scalars, a value of D or a value of F_c, in this order. At the
//! edges between the cases of the contact the derivative is that of the case that holds.

use study_wire::mechanism::{MechanismView, SCALARS};
use study_wire::predict::Motion;

// places of the scalars in `Scalars::to_array`
pub(super) const HANDLE_KG: usize = 0;
const FOLLOWER_KG: usize = 1;
const CONTACT_N: usize = 2;
const CONTACT_NS: usize = 3;
pub(super) const GAP: usize = 4;
const FOLLOWER_NS: usize = 5;
const SLIP: usize = 6;
pub(super) const STRIBECK: usize = 7;
pub(super) const STRIBECK_MM_S: usize = 8;
const HANDLE_N: usize = 9;
const HANDLE_SLIP: usize = 10;
const HANDLE_NS: usize = 11;
pub(super) const OFFSET_N: usize = 12;

/// Steps after which derivatives that have decayed are set to 0: numbers below 1e-308 are
/// slow.
const FLUSH: u32 = 200;
/// What counts as decayed.
const DECAYED: f64 = 1e-40;

/// The state of a mechanism and its derivatives by every parameter.
#[derive(Debug, Clone)]
pub(super) struct Sensitive {
    x_mm: f64,
    y_mm: f64,
    w_mm_s: f64,
    z: f64,
    z_handle: f64,
    by_y: Vec<f64>,
    by_w: Vec<f64>,
    by_z: Vec<f64>,
    /// The derivative of `z_handle` by its presliding length.
    z_handle_by_slip: f64,
    next_w: Vec<f64>,
    steps: u32,
}

impl Sensitive {
    /// From a state whose derivatives are 0.
    pub(super) fn new(state: &study_wire::mechanism::State, parameters: usize) -> Self {
        let none = || vec![0.0; parameters];
        Self {
            x_mm: state.x_mm(),
            y_mm: state.y_mm(),
            w_mm_s: state.w_mm_s(),
            z: state.z,
            z_handle: state.z_handle,
            by_y: none(),
            by_w: none(),
            by_z: none(),
            z_handle_by_slip: 0.0,
            next_w: none(),
            steps: 0,
        }
    }

    /// The next `dt_s` seconds. Returns the force without m·a, N, and writes its
    /// derivatives into `by`.
    pub(super) fn step(
        &mut self,
        mechanism: &MechanismView<'_>,
        motion: Motion,
        dt_s: f64,
        by: Option<&mut [f64]>,
    ) -> f64 {
        let p = &mechanism.scalars;
        let (w, z) = (self.w_mm_s, self.z);
        let e = (-(w / p.stribeck_mm_s) * (w / p.stribeck_mm_s)).exp();
        let g = 1.0 + p.stribeck * e;
        let loading = dt_s / p.slip_mm;
        let wear = loading * w.abs() / g;
        let kept = 1.0 / (1.0 + wear);
        let around = mechanism.detent.spline(self.y_mm);
        let (mut detent_n, mut detent_slope) = (0.0, 0.0);
        for k in 0..4 {
            let n = mechanism.detent.n[around.at[k]];
            detent_n += around.weight[k] * n;
            detent_slope += around.slope[k] * n;
        }
        let (left, share, per_mm) = mechanism.friction.linear(self.y_mm);
        let rise = mechanism.friction.n[left + 1] - mechanism.friction.n[left];
        let friction_n = mechanism.friction.n[left] + share * rise;
        let friction_slope = rise * per_mm;
        let inertia = 1e-3 * p.follower_kg / dt_s;
        let least = 0.5 * mechanism.steepest_n_per_mm() * dt_s;
        let damping = p.follower_n_s_per_mm.max(least);
        let drag = inertia + damping + friction_n * loading * kept;
        let push = inertia * w - detent_n - friction_n * z * kept;
        let apart = motion.x_mm - self.y_mm;
        let v = motion.v_mm_s;

        // which case of the contact
        let half = 0.5 * p.gap_mm;
        let (k, c) = (p.contact_n_per_mm, p.contact_n_s_per_mm);
        let free = push / drag;
        let after = apart - dt_s * free;
        let side = if after > 0.0 { 1.0 } else { -1.0 };
        let edge = apart - side * half;
        let held = (push + k * edge + c * v) / (drag + k * dt_s + c);
        let deep = edge - dt_s * held;
        let force = k * deep + c * (v - held);
        let case = if after.abs() <= half || side * force <= 0.0 {
            Case::Free
        } else if side * deep < 0.0 {
            Case::Edge
        } else {
            Case::Held
        };
        let (next, contact_n, denominator) = match case {
            Case::Free => (free, 0.0, drag),
            Case::Held => (held, force, drag + k * dt_s + c),
            Case::Edge => {
                let at_edge = edge / dt_s;
                (at_edge, drag * at_edge - push, drag)
            }
        };

        // d(push − drag·w') by the state, and sparsely by the parameters
        let slid = z + loading * next;
        let kept_by_wear = -kept * kept;
        let wear_by_w = loading * w.signum() / g
            + wear / g * p.stribeck * e * 2.0 * w / (p.stribeck_mm_s * p.stribeck_mm_s);
        let kept_by_w = if w == 0.0 {
            0.0
        } else {
            kept_by_wear * wear_by_w
        };
        let mut of_y = -detent_slope - friction_slope * slid * kept;
        let of_w = inertia - friction_n * slid * kept_by_w;
        let of_z = -friction_n * kept;
        let kept_by_slip = kept_by_wear * (-wear / p.slip_mm);
        let kept_by_g = kept_by_wear * (-wear / g);
        let g_by_speed =
            p.stribeck * e * 2.0 * w * w / (p.stribeck_mm_s * p.stribeck_mm_s * p.stribeck_mm_s);
        let slip_loading = -loading / p.slip_mm;
        // derivatives of `kept` and `loading` by the scalars of the friction
        let of_friction = [
            (SLIP, kept_by_slip, slip_loading),
            (STRIBECK, kept_by_g * e, 0.0),
            (STRIBECK_MM_S, kept_by_g * g_by_speed, 0.0),
        ];
        let mut sparse = [(0_usize, 0.0_f64); 14];
        sparse[0] = (FOLLOWER_KG, (w - next) * 1e-3 / dt_s);
        sparse[1] = (
            FOLLOWER_NS,
            if p.follower_n_s_per_mm > least {
                -next
            } else {
                0.0
            },
        );
        for (n, (at, kept_by, loading_by)) in of_friction.into_iter().enumerate() {
            let value = -friction_n * (slid * kept_by + next * kept * loading_by);
            sparse[2 + n] = (at, value);
        }
        for n in 0..4 {
            sparse[5 + n] = (SCALARS + around.at[n], -around.weight[n]);
        }
        let first_friction = SCALARS + mechanism.detent.n.len();
        let slid_kept = slid * kept;
        sparse[9] = (first_friction + left, -(1.0 - share) * slid_kept);
        sparse[10] = (first_friction + left + 1, -share * slid_kept);

        if case == Case::Edge {
            // w' = (x − y − side·gap/2)/T, whatever the forces are
            if let Some(by) = by {
                // f = drag·w' − push
                for (((by, y), w), z) in (by.iter_mut().zip(&self.by_y))
                    .zip(&self.by_w)
                    .zip(&self.by_z)
                {
                    *by = -drag * y / dt_s - (of_y * y + of_w * w + of_z * z);
                }
                for (at, value) in &sparse[..11] {
                    by[*at] -= value;
                }
                by[GAP] -= drag * side * 0.5 / dt_s;
                self.of_handle(p, motion, by);
            }
            for (next, y) in self.next_w.iter_mut().zip(&self.by_y) {
                *next = -y / dt_s;
            }
            self.next_w[GAP] -= side * 0.5 / dt_s;
        } else {
            if case == Case::Held {
                of_y -= k;
                sparse[11] = (CONTACT_N, edge - dt_s * next);
                sparse[12] = (GAP, -0.5 * side * k);
                sparse[13] = (CONTACT_NS, v - next);
            }
            let scale = 1.0 / denominator;
            let (a, b, d) = (of_y * scale, of_w * scale, of_z * scale);
            for (((next, y), w), z) in (self.next_w.iter_mut())
                .zip(&self.by_y)
                .zip(&self.by_w)
                .zip(&self.by_z)
            {
                *next = a * y + b * w + d * z;
            }
            for (at, value) in sparse {
                self.next_w[at] += value * scale;
            }
            if let Some(by) = by {
                if case == Case::Held {
                    let by_next = -(k * dt_s + c);
                    for ((by, y), next) in by.iter_mut().zip(&self.by_y).zip(&self.next_w) {
                        *by = by_next * next - k * y;
                    }
                    for (at, value) in &sparse[11..] {
                        by[*at] += value;
                    }
                } else {
                    by.fill(0.0);
                }
                self.of_handle(p, motion, by);
            }
        }

        let z_by_old_w = slid * kept_by_w;
        let z_by_w = loading * kept;
        for (((y, w), z), next) in (self.by_y.iter_mut().zip(&mut self.by_w))
            .zip(&mut self.by_z)
            .zip(&self.next_w)
        {
            *z = kept * *z + z_by_w * next + z_by_old_w * *w;
            *y += dt_s * next;
            *w = *next;
        }
        for (at, kept_by, loading_by) in of_friction {
            self.by_z[at] += slid * kept_by + next * kept * loading_by;
        }

        self.z = slid * kept;
        self.w_mm_s = next;
        self.y_mm += dt_s * next;
        let moved = (motion.x_mm - self.x_mm) / p.handle_slip_mm;
        let shrink = 1.0 / (1.0 + moved.abs());
        let before = self.z_handle;
        self.z_handle = (before + moved) * shrink;
        let moved_by_slip = -moved / p.handle_slip_mm;
        self.z_handle_by_slip = (self.z_handle_by_slip + moved_by_slip) * shrink
            - self.z_handle * shrink * moved.signum() * moved_by_slip;
        self.x_mm = motion.x_mm;
        self.steps += 1;
        if self.steps.is_multiple_of(FLUSH) {
            for by in [&mut self.by_y, &mut self.by_w, &mut self.by_z] {
                for value in by {
                    if value.abs() < DECAYED {
                        *value = 0.0;
                    }
                }
            }
        }
        contact_n + p.handle_n * self.z_handle + p.handle_n_s_per_mm * motion.v_mm_s + p.offset_n
    }

    /// Adds the derivatives of the handle's own forces, with its bristle after this step.
    fn of_handle(&self, p: &study_wire::mechanism::Scalars, motion: Motion, by: &mut [f64]) {
        let moved = (motion.x_mm - self.x_mm) / p.handle_slip_mm;
        let shrink = 1.0 / (1.0 + moved.abs());
        let after = (self.z_handle + moved) * shrink;
        let moved_by_slip = -moved / p.handle_slip_mm;
        let by_slip = (self.z_handle_by_slip + moved_by_slip) * shrink
            - after * shrink * moved.signum() * moved_by_slip;
        by[HANDLE_N] += after;
        by[HANDLE_SLIP] += p.handle_n * by_slip;
        by[HANDLE_NS] += motion.v_mm_s;
        by[OFFSET_N] += 1.0;
    }
}

/// The cases of the contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Case {
    /// No contact, or one whose damper would pull.
    Free,
    /// Contact.
    Held,
    /// Contact that begins or ends at the edge of the gap.
    Edge,
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_wire::mechanism::{Profile, Scalars, State};

    fn scalars() -> [f64; SCALARS] {
        [
            0.1, 0.14, 15.0, 0.012, 0.8, 0.006, 0.06, 0.35, 8.0, 0.25, 0.07, 0.001, 0.1,
        ]
    }

    fn motion(i: usize) -> Motion {
        let t = i as f64 * 1e-4;
        let w = 9.0;
        Motion {
            x_mm: 8.0 + 6.0 * (w * t).sin() + 0.5 * (70.0 * t).sin(),
            v_mm_s: 6.0 * w * (w * t).cos() + 35.0 * (70.0 * t).cos(),
            a_m_s2: 0.0,
        }
    }

    /// The mechanism with these parameters: scalars, 17 values of D, the rest of F_c.
    fn mechanism(p: &[f64]) -> MechanismView<'_> {
        let mut scalars = [0.0; SCALARS];
        scalars.copy_from_slice(&p[..SCALARS]);
        let profile = |n, step_mm| Profile {
            first_mm: 0.0,
            step_mm,
            n,
        };
        let (detent, friction) = p[SCALARS..].split_at(17);
        MechanismView::new(
            Scalars::from_array(scalars),
            profile(detent, 1.0),
            profile(friction, 8.0),
        )
    }

    /// The forces of a motion over many detents and reversals.
    fn forces(p: &[f64]) -> Vec<f64> {
        let of = mechanism(p);
        let mut state = State::settled(&of, motion(0));
        (0..9000)
            .map(|i| state.step(&of, motion(i), 1e-4))
            .collect()
    }

    /// The derivatives agree with central differences; at the few samples where the case
    /// of the contact changes between both differences they need not.
    #[test]
    fn derivatives_are_those_of_the_step() {
        let mut p: Vec<f64> = scalars().to_vec();
        p.extend((0..17).map(|i| 4.0 * (f64::from(i) * 1.1).sin()));
        p.extend([1.2, 0.9, 1.4]);
        let parameters = p.len();
        let of = mechanism(&p);
        let start = State::settled(&of, motion(0));
        let mut state = Sensitive::new(&start, parameters);
        let mut by = vec![0.0; parameters];
        let plain = forces(&p);
        let rows: Vec<Vec<f64>> = (0..plain.len())
            .map(|i| {
                let force = state.step(&of, motion(i), 1e-4, Some(&mut by));
                assert!((force - plain[i]).abs() < 1e-9, "{i}: {force} {}", plain[i]);
                by.clone()
            })
            .collect();
        for at in 0..parameters {
            let h = 1e-6 * p[at].abs().max(1e-2);
            let moved = |by: f64| {
                let mut p = p.clone();
                p[at] += by;
                forces(&p)
            };
            let (up, down) = (moved(h), moved(-h));
            // after the transient of the start, which depends on the parameters as well
            let errors: Vec<f64> = (3000..plain.len())
                .map(|i| ((up[i] - down[i]) / (2.0 * h) - rows[i][at]).abs())
                .collect();
            let size = rows[3000..].iter().map(|r| r[at].abs()).fold(0.0, f64::max);
            if at == HANDLE_KG {
                assert_eq!(size, 0.0);
                continue;
            }
            let bad = errors.iter().filter(|e| **e > 1e-3 * size + 1e-9).count();
            assert!(
                (size > 0.0 || at >= SCALARS) && bad < errors.len() / 50,
                "parameter {at}: {bad} of {} off, size {size}",
                errors.len()
            );
        }
    }
}
