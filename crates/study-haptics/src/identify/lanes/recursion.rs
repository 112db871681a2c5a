//! The recursion of [`ewls`](crate::identify::ewls) for several λ at once, giving
//! sums of θ over runs of samples instead of one θ per sample.
//!
//! It is the same recursion in scaled form: with w = λⁿ and Q = w P,
//!
//! ```text
//! g = Q φ,  k = g / (w λ + φᵀ g),  θ ← θ + k e,  Q ← Q − g kᵀ,  w ← w λ
//! ```
//!
//! which saves ten divisions by λ. Every 64 samples Q is divided by w, before w
//! becomes too small. In exact arithmetic θ is that of `ewls`; in double precision
//! the two agree to 1e-8 for λ ≥ 0.998 (less below, where the estimates themselves
//! are ill-conditioned). Only the sums are stored.

use super::{Lane, Processor, WIDTH};
use crate::identify::method::Terms;
use crate::identify::samples::{Samples, Theta, initial_covariance};

/// Number of samples between rescalings of Q.
const RESCALE: usize = 64;

/// The smallest λ of this recursion: λ^64 has to stay far above the smallest
/// positive number.
pub const MIN_LAMBDA: f64 = 0.01;

/// A run of samples [`from`, `to`) whose estimates are summed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// First sample.
    pub from: usize,
    /// One past the last sample.
    pub to: usize,
    /// The origin of the first moment, mm.
    pub origin_mm: f64,
}

/// Sums of the estimates over a run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sums {
    /// Σ θ.
    pub theta: Theta,
    /// Σ (x − origin) θ.
    pub moment: Theta,
}

/// The sums over each run, for each λ.
///
/// `samples` are in the order of the recursion; `runs` ascend and do not overlap. The
/// recursion first passes back over the first `warm(λ)` samples. Without `moments`
/// the moments are 0. `None` for a λ whose estimates are not finite. λ has to be at
/// least [`MIN_LAMBDA`].
pub fn sums(
    processor: Processor,
    samples: &Samples,
    (lambdas, terms): (&[f64], Terms),
    warm: impl Fn(f64) -> usize,
    runs: &[Run],
    moments: bool,
) -> Vec<Option<Vec<Sums>>> {
    let cold = |lambdas| State::cold(lambdas, terms);
    let mut states: Vec<State> = lambdas.chunks(WIDTH).map(cold).collect();
    let mut sums = vec![LaneSums::ZERO; states.len() * runs.len()];
    // each λ has its own number of samples to go back over: one at a time
    for (i, lambda) in lambdas.iter().enumerate() {
        let first = warm(*lambda).min(samples.len());
        if first > 0 {
            let mut alone = State::cold(&[*lambda], terms);
            back(processor, samples, first, &mut alone);
            states[i / WIDTH].copy_lane(i % WIDTH, &alone);
        }
    }
    dispatch(processor, samples, &mut states, runs, &mut sums, moments);
    (0..lambdas.len())
        .map(|i| {
            let (state, lane) = (i / WIDTH, i % WIDTH);
            let pick = |of: &[Lane; 4]| of.map(|p| p.0[lane]);
            let all: Vec<Sums> = sums
                .chunks(states.len())
                .map(|run| Sums {
                    theta: pick(&run[state].theta),
                    moment: pick(&run[state].moment),
                })
                .collect();
            // a θ that is not finite stays so
            let last = pick(&states[state].theta);
            let finite = last.iter().all(|p| p.is_finite())
                && all
                    .iter()
                    .all(|s| s.theta.iter().chain(&s.moment).all(|p| p.is_finite()));
            finite.then_some(all)
        })
        .collect()
}

/// Indices of the entries of the upper triangle.
const UPPER: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];

/// The recursion of four λ between two samples.
#[derive(Debug, Clone, Copy)]
struct State {
    /// Q.
    q: [Lane; 10],
    theta: [Lane; 4],
    /// w λ.
    scale: Lane,
    lambda: Lane,
}

/// [`Sums`] over one run for four λ.
#[derive(Debug, Clone, Copy)]
struct LaneSums {
    theta: [Lane; 4],
    moment: [Lane; 4],
}

impl LaneSums {
    const ZERO: Self = Self {
        theta: [Lane::ZERO; 4],
        moment: [Lane::ZERO; 4],
    };

    #[inline(always)]
    fn add<const MOMENTS: bool>(&mut self, theta: &[Lane; 4], arm: Lane) {
        let sums = self.theta.iter_mut().zip(&mut self.moment);
        for ((sum, moment), theta) in sums.zip(theta) {
            *sum = *sum + *theta;
            if MOMENTS {
                *moment = arm.mul_add(*theta, *moment);
            }
        }
    }
}

impl State {
    /// From at most four λ; the last one fills unused lanes.
    fn cold(lambdas: &[f64], terms: Terms) -> Self {
        let lambda = Lane(std::array::from_fn(|i| lambdas[i.min(lambdas.len() - 1)]));
        let mut q = [Lane::ZERO; 10];
        for (i, prior) in initial_covariance(terms.kept()).into_iter().enumerate() {
            q[UPPER[i][i]] = Lane::all(prior);
        }
        Self {
            q,
            theta: [Lane::ZERO; 4],
            scale: lambda,
            lambda,
        }
    }

    /// Copies the first lane of another state into lane `lane`.
    fn copy_lane(&mut self, lane: usize, other: &Self) {
        let own = self
            .q
            .iter_mut()
            .chain(&mut self.theta)
            .chain([&mut self.scale]);
        let others = other.q.iter().chain(&other.theta).chain([&other.scale]);
        for (to, from) in own.zip(others) {
            to.0[lane] = from.0[0];
        }
    }

    #[inline(always)]
    fn step(&mut self, phi: [Lane; 3], force: Lane) {
        let [a, v, x] = phi;
        let (q, theta) = (&self.q, &self.theta);
        let mut g = [Lane::ZERO; 4];
        for i in 0..4 {
            let row = UPPER[i];
            let x_term = q[row[2]].mul_add(x, q[row[3]]);
            g[i] = q[row[0]].mul_add(a, q[row[1]].mul_add(v, x_term));
        }
        let spread = a.mul_add(g[0], v.mul_add(g[1], x.mul_add(g[2], g[3])));
        let d = Lane::all(1.0) / (self.scale + spread);
        let e = force - theta[3];
        let e = a.negated_mul_add(
            theta[0],
            v.negated_mul_add(theta[1], x.negated_mul_add(theta[2], e)),
        );
        // Read Q again: it does not fit into the registers, and spilling a copy would cost
        // more stores than the recursion itself has
        let q = std::hint::black_box(&mut self.q);
        for j in 0..4 {
            let k = g[j] * d;
            self.theta[j] = k.mul_add(e, self.theta[j]);
            for i in 0..=j {
                let at = UPPER[i][j];
                q[at] = g[i].negated_mul_add(k, q[at]);
            }
        }
        self.scale = self.scale * self.lambda;
    }

    #[inline(always)]
    fn rescale(&mut self) {
        let to_one = self.lambda / self.scale;
        for q in &mut self.q {
            *q = *q * to_one;
        }
        self.scale = self.lambda;
    }
}

fn dispatch(
    processor: Processor,
    samples: &Samples,
    states: &mut [State],
    runs: &[Run],
    sums: &mut [LaneSums],
    moments: bool,
) {
    match processor {
        #[cfg(target_arch = "x86_64")]
        Processor::Avx2 => {
            assert_eq!(Processor::best(), processor, "this machine has AVX2");
            // SAFETY: the assertion above shows that the machine has AVX2 and FMA.
            #[allow(unsafe_code, reason = "the same loop, compiled for AVX2")]
            unsafe {
                avx2(samples, states, runs, sums, moments);
            }
        }
        _ => either(samples, states, runs, sums, moments),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(
    samples: &Samples,
    states: &mut [State],
    runs: &[Run],
    sums: &mut [LaneSums],
    moments: bool,
) {
    either(samples, states, runs, sums, moments);
}

#[inline(always)]
fn either(
    samples: &Samples,
    states: &mut [State],
    runs: &[Run],
    sums: &mut [LaneSums],
    moments: bool,
) {
    if moments {
        pass::<true>(samples, states, runs, sums);
    } else {
        pass::<false>(samples, states, runs, sums);
    }
}

/// `sums` has one entry per state for the first run, then for the second, …
///
/// This function and its callees avoid closures: only inlined code is compiled for
/// AVX2, and a closure need not be inlined.
#[inline(always)]
fn pass<const MOMENTS: bool>(
    samples: &Samples,
    states: &mut [State],
    runs: &[Run],
    sums: &mut [LaneSums],
) {
    let mut next = 0;
    for (run, sums) in runs.iter().zip(sums.chunks_mut(states.len())) {
        stretch::<false, false>(samples, next, run.from, states, 0.0, &mut []);
        stretch::<true, MOMENTS>(samples, run.from, run.to, states, run.origin_mm, sums);
        next = run.to;
    }
    stretch::<false, false>(samples, next, samples.len(), states, 0.0, &mut []);
}

/// Passes over the samples [`from`, `to`); with `SUM` adds θ, and with `MOMENTS` also
/// its moment, to `sums`, which has one entry per state.
#[inline(always)]
fn stretch<const SUM: bool, const MOMENTS: bool>(
    samples: &Samples,
    from: usize,
    to: usize,
    states: &mut [State],
    origin_mm: f64,
    sums: &mut [LaneSums],
) {
    let (x, v) = (&samples.x_mm[from..to], &samples.v_mm_s[from..to]);
    let (a, f) = (&samples.a_m_s2[from..to], &samples.f_n[from..to]);
    for i in 0..to - from {
        let phi = [Lane::all(a[i]), Lane::all(v[i]), Lane::all(x[i])];
        let force = Lane::all(f[i]);
        if SUM {
            let arm = Lane::all(x[i] - origin_mm);
            for (state, sums) in states.iter_mut().zip(sums.iter_mut()) {
                state.step(phi, force);
                sums.add::<MOMENTS>(&state.theta, arm);
            }
        } else {
            for state in states.iter_mut() {
                state.step(phi, force);
            }
        }
        // at indices that depend only on the sample, so that lanes stay independent
        if (from + i) % RESCALE == RESCALE - 1 {
            for state in states.iter_mut() {
                state.rescale();
            }
        }
    }
}

/// Passes one state back over the first samples.
fn back(processor: Processor, samples: &Samples, first: usize, state: &mut State) {
    let samples = samples.reordered(&(0..first).rev().collect::<Vec<_>>());
    let states = std::slice::from_mut(state);
    dispatch(processor, &samples, states, &[], &mut [], false);
    state.rescale();
}
