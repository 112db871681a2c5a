//! Levenberg–Marquardt within bounds.
//!
//! A step solves (JᵀJ + R + λ diag(JᵀJ + R)) δ = −(Jᵀe + R p) over the parameters that are
//! not held at a bound, and is clipped to the bounds and to a factor of [`FACTOR`] of a
//! positive scalar. R are ridges on the second differences of D and the first ones of F_c,
//! which matter where the target was not moved.

use super::super::banded::{Banded, Bound};
use super::objective::{Compared, Sum};
use super::sensitivity::{STRIBECK, STRIBECK_MM_S};
use super::{Layout, sensitivity};
use crate::model::{Mechanism, Profile};
use study_wire::mechanism::{SCALARS, SLOWEST_S, Scalars};

/// A positive scalar changes by at most this factor in one step.
const FACTOR: f64 = 2.0;
/// Weight of a squared second difference of D and first difference of F_c, in units of a
/// node's share of the errors.
const RIDGE: [f64; 2] = [1e-5, 1e-4];
/// The fit ends when a step reduces the squared error by less than this share, this often
/// in a row.
const SMALL: f64 = 2e-4;
const SMALL_STEPS: usize = 3;
/// Standard errors of fewer stretches than this are not worth printing.
const LEAST_STRETCHES: f64 = 10.0;
/// A standard error this many times a value leaves nothing of it.
const HOPELESS: f64 = 3.0;
/// λ at the start and beyond which no step helps.
const LAMBDA: [f64; 2] = [1e-2, 1e8];

/// A fitted mechanism.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) mechanism: Mechanism,
    /// rms error of the low-passed force, N.
    pub(super) rms_n: f64,
    pub(super) iterations: usize,
    pub(super) standard_errors: [Option<f64>; SCALARS],
}

impl Fit {
    /// The scalars that the recordings leave so uncertain that they only take part in what others
    /// determine: those of the friction's dependence on the speed, if their standard errors are
    /// many times their values.
    pub(super) fn hopeless(&self) -> Option<[bool; SCALARS]> {
        let values = self.mechanism.scalars.to_array();
        let hopeless =
            |i: usize| self.standard_errors[i].is_some_and(|error| error > HOPELESS * values[i]);
        let mut set = [false; SCALARS];
        set[STRIBECK] = hopeless(STRIBECK);
        // the speed is that of the excess, and nothing without it
        set[STRIBECK_MM_S] = set[STRIBECK] || hopeless(STRIBECK_MM_S);
        set[STRIBECK_MM_S].then_some(set)
    }
}

/// The parameters as one list.
fn pack(of: &Mechanism) -> Vec<f64> {
    let scalars = of.scalars.to_array();
    (scalars.iter().chain(&of.detent.n).chain(&of.friction.n))
        .copied()
        .collect()
}

fn unpack(parameters: &[f64], like: &Mechanism) -> Mechanism {
    let mut scalars = [0.0; SCALARS];
    scalars.copy_from_slice(&parameters[..SCALARS]);
    let (detent, friction) = parameters[SCALARS..].split_at(like.detent.n.len());
    let profile = |n: &[f64], of: &Profile| Profile {
        n: n.to_vec(),
        ..of.clone()
    };
    Mechanism {
        scalars: Scalars::from_array(scalars),
        detent: profile(detent, &like.detent),
        friction: profile(friction, &like.friction),
        recorded_hz: like.recorded_hz,
    }
}

impl Sum {
    /// As if nothing were known about the scalars that are `set`, so that they stay.
    fn forget(&mut self, set: &[bool; SCALARS]) {
        let all = self.gradient.len();
        for i in (0..SCALARS).filter(|i| set[*i]) {
            self.gradient[i] = 0.0;
            self.scores.iter_mut().for_each(|score| score[i] = 0.0);
            for j in 0..all {
                self.normal[i * all + j] = 0.0;
                self.normal[j * all + i] = 0.0;
            }
        }
    }
}

/// The ridges: adds their part of the cost, normal matrix and gradient.
fn add_ridges(sum: &mut Sum, parameters: &[f64], layout: Layout) {
    let all = parameters.len();
    let mut add = |at: &[(usize, f64)], weight: f64| {
        let value: f64 = at.iter().map(|(i, one)| one * parameters[*i]).sum();
        sum.square += weight * value * value;
        for (i, one) in at {
            sum.gradient[*i] += weight * one * value;
            for (j, other) in at {
                sum.normal[i * all + j] += weight * one * other;
            }
        }
    };
    let share = sum.errors as f64 / layout.detents as f64;
    for i in SCALARS..SCALARS + layout.detents - 2 {
        add(&[(i, 1.0), (i + 1, -2.0), (i + 2, 1.0)], share * RIDGE[0]);
    }
    let share = sum.errors as f64 / layout.frictions as f64;
    let first = SCALARS + layout.detents;
    for i in first..first + layout.frictions - 1 {
        add(&[(i, -1.0), (i + 1, 1.0)], share * RIDGE[1]);
    }
}

/// The cost without derivatives.
fn cost(mechanism: &Mechanism, on: &[Compared<'_>], hz: f64, layout: Layout) -> f64 {
    let view = mechanism.view();
    let (mut square, mut errors) = (0.0, 0);
    for compared in on {
        let (one, n) = compared.square(&compared.predict(&view, hz));
        square += one;
        errors += n;
    }
    let parameters = pack(mechanism);
    let mut sum = Sum {
        square,
        errors,
        normal: vec![0.0; parameters.len() * parameters.len()],
        gradient: vec![0.0; parameters.len()],
        scores: Vec::new(),
    };
    add_ridges(&mut sum, &parameters, layout);
    sum.square
}

/// Fits a mechanism; `None` if its force is not finite at the start.
pub(super) fn fit(
    from: &Mechanism,
    on: &[Compared<'_>],
    hz: f64,
    iterations: usize,
    top_mm_s: f64,
    step_done: &(impl Fn() + Sync),
) -> Option<Fit> {
    let set = [false; SCALARS];
    fit_with(from, &set, on, hz, iterations, top_mm_s, step_done)
}

/// The same; scalars that are `set` keep their values.
pub(super) fn fit_with(
    from: &Mechanism,
    set: &[bool; SCALARS],
    on: &[Compared<'_>],
    hz: f64,
    iterations: usize,
    top_mm_s: f64,
    step_done: &(impl Fn() + Sync),
) -> Option<Fit> {
    let layout = Layout {
        detents: from.detent.n.len(),
        frictions: from.friction.n.len(),
    };
    let start = from.scalars.to_array();
    // what divides, and the stiffness, must stay away from 0
    let least: [f64; SCALARS] = std::array::from_fn(|i| match i {
        1 | 2 | 6 | 8 | 10 => 0.02 * start[i],
        sensitivity::OFFSET_N => f64::NEG_INFINITY,
        _ => 0.0,
    });
    let bound = |i: usize| {
        if i < SCALARS {
            least[i]
        } else if i < SCALARS + layout.detents {
            f64::NEG_INFINITY
        } else {
            0.0
        }
    };
    let evaluate = |mechanism: &Mechanism| {
        let view = mechanism.view();
        let mut sums = on.iter().map(|c| c.sum(&view, &layout, hz));
        let mut sum = sums.next()?;
        for other in sums {
            sum.add(&other);
        }
        let data = (sum.square, sum.errors);
        sum.forget(set);
        add_ridges(&mut sum, &pack(mechanism), layout);
        sum.square.is_finite().then_some((sum, data))
    };
    let mut best = from.clone();
    let (mut sum, mut data) = evaluate(&best)?;
    let (mut lambda, mut small, mut done) = (LAMBDA[0], 0, 0);
    'steps: while done < iterations && small < SMALL_STEPS {
        let parameters = pack(&best);
        loop {
            let Some(step) = solve(&sum, &parameters, bound, lambda) else {
                break 'steps;
            };
            let mut next = parameters.clone();
            for (i, (p, step)) in next.iter_mut().zip(&step).enumerate() {
                let mut to = (*p + step).max(bound(i));
                if i < SCALARS && i != sensitivity::OFFSET_N && *p > 0.0 {
                    to = to.clamp(*p / FACTOR, *p * FACTOR).max(bound(i));
                }
                *p = to;
            }
            let mut next = unpack(&next, &best);
            lift(&mut next, top_mm_s);
            let square = cost(&next, on, hz, layout);
            if square < sum.square {
                small = if square > (1.0 - SMALL) * sum.square {
                    small + 1
                } else {
                    0
                };
                lambda = (0.2 * lambda).max(1e-9);
                best = next;
                (sum, data) = evaluate(&best)?;
                break;
            }
            lambda *= 5.0;
            if lambda > LAMBDA[1] {
                break 'steps;
            }
        }
        done += 1;
        step_done();
    }
    Some(Fit {
        standard_errors: standard_errors(&sum, &pack(&best), bound),
        mechanism: best,
        rms_n: (data.0 / data.1 as f64).sqrt(),
        iterations: done,
    })
}

/// Raises values of F_c to what its slopes require for passivity.
fn lift(mechanism: &mut Mechanism, top_mm_s: f64) {
    let p = &mechanism.scalars;
    let reach = p.slip_mm * (1.0 + p.stribeck) + 2.0 * SLOWEST_S * top_mm_s;
    let share = (0.5 * reach / mechanism.friction.step_mm).min(1.0);
    // F_i ≥ share·(F_j − F_i), so that F_i ≥ share/(1 + share)·F_j suffices
    let part = share / (1.0 + share) * (1.0 + 1e-9);
    let n = &mut mechanism.friction.n;
    for i in 1..n.len() {
        n[i] = n[i].max(part * n[i - 1]);
    }
    for i in (1..n.len()).rev() {
        n[i - 1] = n[i - 1].max(part * n[i]);
    }
}

/// The quadratic model of the cost in u = p + δ − bound, as a system with u ≥ 0 or free.
fn model(
    sum: &Sum,
    parameters: &[f64],
    bound: impl Fn(usize) -> f64,
    lambda: f64,
) -> (Banded, Vec<f64>, Vec<Bound>, Vec<f64>) {
    let n = parameters.len();
    let floor: Vec<f64> = (0..n)
        .map(|i| Some(bound(i)).filter(|b| b.is_finite()).unwrap_or(0.0))
        .collect();
    let bounds = (0..n)
        .map(|i| match bound(i).is_finite() {
            true => Bound::NotNegative,
            false => Bound::Free,
        })
        .collect();
    let mut a = Banded::bordered(0, 0, n);
    for i in 0..n {
        for j in 0..=i {
            let value = sum.normal[i * n + j];
            a.add(
                i,
                j,
                if i == j {
                    value * (1.0 + lambda)
                } else {
                    value
                },
            );
        }
        if sum.normal[i * n + i] <= 0.0 {
            // nothing is known about it: it stays
            a.add(i, i, 1.0);
        }
    }
    let from: Vec<f64> = parameters.iter().zip(&floor).map(|(p, f)| p - f).collect();
    let right = (a.times(&from).iter().zip(&sum.gradient))
        .map(|(product, gradient)| product - gradient)
        .collect();
    (a, right, bounds, from)
}

/// The step that minimizes the model within the bounds; `None` if it is singular.
fn solve(
    sum: &Sum,
    parameters: &[f64],
    bound: impl Fn(usize) -> f64,
    lambda: f64,
) -> Option<Vec<f64>> {
    let (a, right, bounds, from) = model(sum, parameters, bound, lambda);
    let to = a.solve_bounded(&right, &bounds)?;
    let step: Vec<f64> = to.iter().zip(&from).map(|(to, from)| to - from).collect();
    step.iter().all(|v| v.is_finite()).then_some(step)
}

/// Standard errors of the scalars that are not at a bound: A⁻¹ (Σ g gᵀ) A⁻¹ with the normal
/// matrix A and the gradients g of stretches of the recordings, within which errors may be
/// correlated and differ in size (White 1980; Liang & Zeger 1986). Errors of a fit are smaller
/// than those around the truth, so that the sum is multiplied by n/(n − 1) for the stretches
/// and by N/(N − p) for the samples. Added is the square of the step that is left, because a fit ends
/// before it has reached its minimum.
fn standard_errors(
    sum: &Sum,
    parameters: &[f64],
    bound: impl Fn(usize) -> f64,
) -> [Option<f64>; SCALARS] {
    let all = parameters.len();
    // a trace of damping, so that one flat direction leaves the others an inverse
    let (a, ..) = model(sum, parameters, &bound, 1e-10);
    let free: Vec<bool> = (0..all).map(|i| parameters[i] > bound(i)).collect();
    let used = free.iter().filter(|free| **free).count() as f64;
    // of the samples that count, four per period of the corner, about half are independent
    let (stretches, samples) = (sum.scores.len() as f64, 0.5 * sum.errors as f64);
    let known = stretches >= LEAST_STRETCHES && samples > used;
    let left = solve(sum, parameters, &bound, 1e-10);
    let spread = stretches / (stretches - 1.0) * samples / (samples - used);
    std::array::from_fn(|i| {
        if !(known && free[i]) || sum.normal[i * all + i] <= 0.0 {
            return None;
        }
        let mut unit = vec![0.0; all];
        unit[i] = 1.0;
        let row = a.solve(&unit, &free)?;
        let moved = |score: &Vec<f64>| -> f64 { row.iter().zip(score).map(|(r, g)| r * g).sum() };
        let square: f64 = sum.scores.iter().map(|g| moved(g).powi(2)).sum();
        let left = left.as_ref()?[i];
        let error = (spread * square + left * left).sqrt();
        error.is_finite().then_some(error)
    })
}
