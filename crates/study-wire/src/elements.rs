//! A realization made of passive elements: a free potential, and in parallel with it
//! dampers and springs that slip, relax or break, each weighted by the position.
//!
//! ```text
//! F = m a + C(x) + b±(x) v + Σ D_i(x) z_i,   m, b±, D_i ≥ 0
//! stop      z ← clip(z + Δx/r, −1, 1)                       an elastoplastic spring
//! Maxwell   z ← clip(e z + g Δx/r, −1, 1), e = exp(−T/τ),   a spring behind a damper
//!           g = (1 − e) τ/T
//! latch     z ← 0 where x exceeds x_b, 1 where it is below x_a   a spring that breaks
//! ```
//!
//! All profiles are linear between common nodes. Each element stores or dissipates the energy
//! of its own force whatever its profile is, as long as that is not negative: `docs/estimators.md`
//! derives it, for the steps of [`State::step`] at any rate.

mod certifier;

use crate::certificate::Certificate;
use crate::predict::{Lookup, Motion, between, locate};
use crate::real::Real;
use crate::sum::Sum;
pub use certifier::{Certifier, SLOWEST_S};

/// Most springs of a realization: with C and b± the eight values of a node.
pub const MAX_SPRINGS: usize = 5;

/// What the force D of a spring is multiplied by, z, and how that follows the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spring {
    /// Slips when it is deflected by `slip_mm`: the stop operator of Prandtl and Ishlinskii.
    Stop {
        /// The deflection at which it slips, r, mm.
        slip_mm: f64,
    },
    /// The same with a force that relaxes: a Maxwell branch.
    Maxwell {
        /// The deflection at which it slips, r, mm.
        slip_mm: f64,
        /// Time constant of the relaxation, τ, s.
        relaxation_s: f64,
    },
    /// Holds until the handle passes `break_mm`, and again below `rearm_mm`.
    Latch {
        /// Below this position it holds again, x_a, mm.
        rearm_mm: f64,
        /// Above this position it does not hold, x_b, mm.
        break_mm: f64,
    },
}

impl Default for Spring {
    /// A stop of no length, which is not valid.
    fn default() -> Self {
        Self::Stop { slip_mm: 0.0 }
    }
}

impl Spring {
    /// Whether its lengths and times are possible.
    pub fn is_valid(&self) -> bool {
        let above = |value: f64| value.is_finite() && value > 0.0;
        match *self {
            Self::Stop { slip_mm } => above(slip_mm),
            Self::Maxwell {
                slip_mm,
                relaxation_s,
            } => above(slip_mm) && above(relaxation_s),
            Self::Latch { rearm_mm, break_mm } => {
                rearm_mm.is_finite() && break_mm.is_finite() && rearm_mm < break_mm
            }
        }
    }

    /// Deflection at which it slips, mm; `None` for a latch.
    pub fn slip_mm(&self) -> Option<f64> {
        match *self {
            Self::Stop { slip_mm } | Self::Maxwell { slip_mm, .. } => Some(slip_mm),
            Self::Latch { .. } => None,
        }
    }
}

/// A realization as borrowed slices; all profiles are as long as `x_mm`.
#[derive(Debug, Clone, Copy)]
pub struct ElementsView<'a, R = f64> {
    /// Positions of the nodes, mm, strictly ascending, at least two.
    pub x_mm: &'a [R],
    /// Mass, kg.
    pub mass_kg: R,
    /// The force of the potential, C, N.
    pub force_n: &'a [R],
    /// Damping for v > 0 and v < 0, N·s/mm.
    pub damping_n_s_per_mm: [&'a [R]; 2],
    /// The springs, at most [`MAX_SPRINGS`].
    pub springs: &'a [Spring],
    /// The force of each spring, D, N; of the others nothing is read.
    pub spring_n: [&'a [R]; MAX_SPRINGS],
}

impl<R: Real> ElementsView<'_, R> {
    fn profiles(&self) -> impl Iterator<Item = &[R]> {
        let used = self.springs.len().min(MAX_SPRINGS);
        self.spring_n[..used].iter().copied()
    }

    /// By how much the force may fall per mm of a motion between two nodes, N/mm.
    fn falling_n_per_mm(&self, left: usize) -> R {
        let rise = |of: &[R]| of[left + 1] - of[left];
        let mut falls = -rise(self.force_n);
        for profile in self.profiles() {
            falls += rise(profile).abs();
        }
        (falls / (self.x_mm[left + 1] - self.x_mm[left])).max(R::ZERO)
    }

    /// The same, the most on the way from one interval to another one.
    fn most_falling_n_per_mm(&self, from: usize, to: usize) -> R {
        let last = self.x_mm.len() - 2;
        let mut most = R::ZERO;
        for left in from.min(to).min(last)..=from.max(to).min(last) {
            most = most.max(self.falling_n_per_mm(left));
        }
        most
    }
}

impl ElementsView<'_> {
    /// The certificate: passive by structure if nothing is negative and every latch releases
    /// what it is counted to. `trained_mm_s` is the trained speed; the handle may be twice as
    /// fast.
    pub fn certificate(&self, trained_mm_s: f64) -> Certificate {
        let mut certifier = Certifier::new();
        for at in 0..self.x_mm.len() {
            certifier.step(self, at);
        }
        certifier.finish(self, trained_mm_s)
    }

    /// The force after a long and slow motion in one direction, N: springs that slip are
    /// deflected, those that relax are not.
    pub fn static_n(&self, x_mm: f64, forwards: bool) -> f64 {
        let (left, share) = locate(self.x_mm, Lookup::Linear, x_mm);
        let springs = (self.springs.iter().zip(self.profiles())).map(|(spring, profile)| {
            let z = match *spring {
                Spring::Stop { .. } if forwards => 1.0,
                Spring::Stop { .. } => -1.0,
                Spring::Maxwell { .. } => 0.0,
                Spring::Latch { rearm_mm, break_mm } => {
                    let until_mm = if forwards { break_mm } else { rearm_mm };
                    if x_mm <= until_mm { 1.0 } else { 0.0 }
                }
            };
            z * between(profile, left, share)
        });
        springs.fold(between(self.force_n, left, share), |sum, n| sum + n)
    }
}

/// The state of a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringState<R = f64> {
    /// What its force D is multiplied by, in [−1, 1].
    z: Sum<R>,
    /// Share of z that relaxes in a step.
    lost: R,
    /// Rise of z per mm.
    per_mm: R,
}

impl<R: Real> SpringState<R> {
    const ZERO: Self = Self {
        z: Sum::of(R::ZERO),
        lost: R::ZERO,
        per_mm: R::ZERO,
    };

    /// Without force at a position; a latch holds there unless it lies above its break.
    pub fn at_rest(spring: &Spring, x_mm: f64) -> Self {
        let holds = matches!(spring, Spring::Latch { break_mm, .. } if x_mm <= *break_mm);
        Self {
            z: Sum::of(if holds { R::ONE } else { R::ZERO }),
            ..Self::ZERO
        }
    }

    /// As after a long motion at a speed; at rest as after one in the positive direction.
    pub fn settled(spring: &Spring, x_mm: f64, v_mm_s: f64) -> Self {
        let z = match *spring {
            Spring::Stop { .. } if v_mm_s < 0.0 => -1.0,
            Spring::Stop { .. } => 1.0,
            Spring::Maxwell {
                slip_mm,
                relaxation_s,
            } => (v_mm_s * relaxation_s / slip_mm).clamp(-1.0, 1.0),
            Spring::Latch { .. } => return Self::at_rest(spring, x_mm),
        };
        Self {
            z: Sum::of(R::of(z)),
            ..Self::ZERO
        }
    }

    /// With z.
    pub fn deflected(z: R) -> Self {
        Self {
            z: Sum::of(z),
            ..Self::ZERO
        }
    }

    /// What the force of the spring is multiplied by.
    pub fn z(&self) -> R {
        self.z.value
    }

    /// For steps of `dt_s` seconds.
    pub fn tune(&mut self, spring: &Spring, dt_s: f64) {
        let (lost, gain) = match *spring {
            Spring::Maxwell { relaxation_s, .. } => {
                let share = dt_s / relaxation_s;
                let lost = -libm::expm1(-share);
                (lost, lost / share)
            }
            _ => (0.0, 1.0),
        };
        self.lost = R::of(lost);
        self.per_mm = R::of(spring.slip_mm().map_or(0.0, |slip_mm| gain / slip_mm));
    }

    /// A step in which the handle moved by `moved_mm` to `x_mm`; z at its end.
    pub fn step(&mut self, spring: &Spring, x_mm: R, moved_mm: R) -> R {
        if let Spring::Latch { rearm_mm, break_mm } = *spring {
            if x_mm > R::of(break_mm) {
                self.z = Sum::of(R::ZERO);
            } else if x_mm < R::of(rearm_mm) {
                self.z = Sum::of(R::ONE);
            }
        } else {
            let relaxed = -self.lost * self.z.value;
            self.z = self.z.plus(relaxed + self.per_mm * moved_mm);
            if self.z.value > R::ONE {
                self.z = Sum::of(R::ONE);
            } else if self.z.value < -R::ONE {
                self.z = Sum::of(-R::ONE);
            }
        }
        self.z.value
    }
}

/// The state of a realization.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<R = f64> {
    x_mm: R,
    dt_s: R,
    springs: [SpringState<R>; MAX_SPRINGS],
}

impl<R: Real> State<R> {
    /// At rest, without force of the springs that slip or relax.
    pub fn at_rest(of: &ElementsView<'_, R>, x_mm: R) -> Self {
        Self::with(of, x_mm, |spring| SpringState::at_rest(spring, x_mm.f64()))
    }

    /// As after a long motion at a speed: see [`SpringState::settled`].
    pub fn settled(of: &ElementsView<'_, R>, motion: Motion<R>) -> Self {
        let Motion { x_mm, v_mm_s, .. } = motion.f64();
        Self::with(of, motion.x_mm, |spring| {
            SpringState::settled(spring, x_mm, v_mm_s)
        })
    }

    /// With z of each spring.
    pub fn deflected(x_mm: R, z: [R; MAX_SPRINGS]) -> Self {
        Self {
            x_mm,
            dt_s: R::ZERO,
            springs: z.map(SpringState::deflected),
        }
    }

    fn with(of: &ElementsView<'_, R>, x_mm: R, spring: impl Fn(&Spring) -> SpringState<R>) -> Self {
        let mut springs = [SpringState::ZERO; MAX_SPRINGS];
        for (state, of) in springs.iter_mut().zip(of.springs) {
            *state = spring(of);
        }
        Self {
            x_mm,
            dt_s: R::ZERO,
            springs,
        }
    }

    /// z of each spring.
    pub fn z(&self) -> [R; MAX_SPRINGS] {
        self.springs.map(|state| state.z.value)
    }

    /// The direction in which the first spring that slips or relaxes is deflected, of a sign
    /// as z of a table; 1 without one.
    pub fn direction(&self, of: &ElementsView<'_, R>) -> R {
        let deflected = |(spring, _): &(&Spring, _)| spring.slip_mm().is_some();
        let mut springs = of.springs.iter().zip(&self.springs).filter(deflected);
        springs.next().map_or(R::ONE, |(_, state)| state.z.value)
    }

    /// The next `dt_s` seconds, at the end of which the handle is at `motion`. Returns the
    /// force that the hand has to apply without m·a, N.
    pub fn step(&mut self, of: &ElementsView<'_, R>, motion: Motion<R>, dt_s: R) -> R {
        if dt_s != self.dt_s {
            self.dt_s = dt_s;
            for (state, spring) in self.springs.iter_mut().zip(of.springs) {
                state.tune(spring, dt_s.f64());
            }
        }
        let Motion { x_mm, v_mm_s, .. } = motion;
        let moved_mm = x_mm - self.x_mm;
        let (before, _) = locate(of.x_mm, Lookup::Linear, self.x_mm);
        let (left, share) = locate(of.x_mm, Lookup::Linear, x_mm);
        let mut force_n = between(of.force_n, left, share);
        for (i, profile) in of.profiles().enumerate() {
            let z = self.springs[i].step(&of.springs[i], x_mm, moved_mm);
            force_n += between(profile, left, share) * z;
        }
        // What a falling force adds by being taken at the end of the step.
        let least_n = R::HALF * of.most_falling_n_per_mm(before, left) * moved_mm;
        let [forwards, backwards] = of.damping_n_s_per_mm;
        let drag_n = if v_mm_s >= R::ZERO {
            between(forwards, left, share) * v_mm_s
        } else {
            between(backwards, left, share) * v_mm_s
        };
        self.x_mm = x_mm;
        force_n
            + if moved_mm > R::ZERO {
                drag_n.max(least_n)
            } else if moved_mm < R::ZERO {
                drag_n.min(least_n)
            } else {
                drag_n
            }
    }
}

#[cfg(test)]
mod tests;
