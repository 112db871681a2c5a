//! The recursion of [`ewls`](crate::identify::ewls) for several λ, which leaves
//! sums of θ over runs of samples instead of one θ a sample.
//!
//! It is the same recursion with another scale: with w = λⁿ and Q = w P,
//!
//! ```text
//! g = Q φ,  k = g / (w λ + φᵀ g),  θ ← θ + k e,  Q ← Q − g kᵀ,  w ← w λ
//! ```
//!
//! which saves the ten divisions by λ. Every 64 samples Q is divided by w, before w
//! can become too small. In exact arithmetic θ is that of `ewls`; in double
//! precision the two agree to 1e-8 for λ of 0.998 and above (less below, where the
//! estimates themselves hang on the last digit).
//!
//! Memory is that of the sums: no estimate is kept.

use super::{Lane, Processor, WIDTH};
use crate::identify::ewls::{START, Sorted, Theta};

/// Samples after which the scale of Q is taken back to 1.
const RESCALE: usize = 64;

/// The smallest λ that this recursion is for: λ^64 has to stay far above the
/// smallest number.
pub const LEAST_LAMBDA: f64 = 0.01;

/// A run of samples [`from`, `to`) whose estimates are summed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// First sample.
    pub from: usize,
    /// One behind the last.
    pub to: usize,
    /// Where moments are counted from, mm.
    pub origin_mm: f64,
}

/// What is kept of the estimates over a run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sums {
    /// Σ θ.
    pub theta: Theta,
    /// Σ (x − origin) θ.
    pub moment: Theta,
}

/// The sums of each run, for each λ.
///
/// `samples` are in the order of the recursion, `runs` ascend and do not overlap.
/// Before it begins, the recursion passes back over the first `warm(λ)` samples.
/// Without `moments` those are 0. `None` for a λ whose estimates are no numbers. λ has to be at least
/// [`LEAST_LAMBDA`].
pub fn sums(
    processor: Processor,
    samples: &Sorted,
    lambdas: &[f64],
    warm: impl Fn(f64) -> usize,
    runs: &[Run],
    moments: bool,
) -> Vec<Option<Vec<Sums>>> {
    let mut states: Vec<State> = lambdas.chunks(WIDTH).map(State::cold).collect();
    let mut kept = vec![Kept::ZERO; states.len() * runs.len()];
    // each λ goes back over a stretch of its own: one at a time
    for (i, lambda) in lambdas.iter().enumerate() {
        let first = warm(*lambda).min(samples.len());
        if first > 0 {
            let mut alone = State::cold(&[*lambda]);
            back(processor, samples, first, &mut alone);
            states[i / WIDTH].take(i % WIDTH, &alone);
        }
    }
    dispatch(processor, samples, &mut states, runs, &mut kept, moments);
    (0..lambdas.len())
        .map(|i| {
            let (state, lane) = (i / WIDTH, i % WIDTH);
            let pick = |of: &[Lane; 4]| of.map(|p| p.0[lane]);
            let all: Vec<Sums> = kept
                .chunks(states.len())
                .map(|run| Sums {
                    theta: pick(&run[state].theta),
                    moment: pick(&run[state].moment),
                })
                .collect();
            // a θ that has left the range of numbers does not come back
            let last = pick(&states[state].theta);
            let finite = last.iter().all(|p| p.is_finite())
                && all
                    .iter()
                    .all(|s| s.theta.iter().chain(&s.moment).all(|p| p.is_finite()));
            finite.then_some(all)
        })
        .collect()
}

/// Where the entries of the upper triangle are kept.
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

/// The sums of four λ over one run.
#[derive(Debug, Clone, Copy)]
struct Kept {
    theta: [Lane; 4],
    moment: [Lane; 4],
}

impl Kept {
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
    /// At most four λ; the last fills lanes that are left.
    fn cold(lambdas: &[f64]) -> Self {
        let lambda = Lane(std::array::from_fn(|i| lambdas[i.min(lambdas.len() - 1)]));
        let mut q = [Lane::ZERO; 10];
        for i in 0..4 {
            q[UPPER[i][i]] = Lane::all(START);
        }
        Self {
            q,
            theta: [Lane::ZERO; 4],
            scale: lambda,
            lambda,
        }
    }

    /// Takes over one lane from the first of another.
    fn take(&mut self, lane: usize, other: &Self) {
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
        let e = a.take_from(theta[0], v.take_from(theta[1], x.take_from(theta[2], e)));
        // Q is read again: it does not fit into the registers, and to keep a copy of it
        // would cost more stores than the recursion itself has
        let q = std::hint::black_box(&mut self.q);
        for j in 0..4 {
            let k = g[j] * d;
            self.theta[j] = k.mul_add(e, self.theta[j]);
            for i in 0..=j {
                let at = UPPER[i][j];
                q[at] = g[i].take_from(k, q[at]);
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
    samples: &Sorted,
    states: &mut [State],
    runs: &[Run],
    kept: &mut [Kept],
    moments: bool,
) {
    match processor {
        #[cfg(target_arch = "x86_64")]
        Processor::Avx2 => {
            assert_eq!(Processor::best(), processor, "this machine has AVX2");
            // SAFETY: the line above has established that the machine has AVX2 and FMA.
            #[allow(unsafe_code, reason = "the same loop, compiled for AVX2")]
            unsafe {
                avx2(samples, states, runs, kept, moments);
            }
        }
        _ => either(samples, states, runs, kept, moments),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(samples: &Sorted, states: &mut [State], runs: &[Run], kept: &mut [Kept], moments: bool) {
    either(samples, states, runs, kept, moments);
}

#[inline(always)]
fn either(samples: &Sorted, states: &mut [State], runs: &[Run], kept: &mut [Kept], moments: bool) {
    if moments {
        pass::<true>(samples, states, runs, kept);
    } else {
        pass::<false>(samples, states, runs, kept);
    }
}

/// `kept` has one entry for each state of the first run, then of the second, …
///
/// Here and in what it calls there are functions where closures would do: only what
/// is inlined is compiled for AVX2, and a closure need not be.
#[inline(always)]
fn pass<const MOMENTS: bool>(
    samples: &Sorted,
    states: &mut [State],
    runs: &[Run],
    kept: &mut [Kept],
) {
    let mut at = 0;
    for (run, kept) in runs.iter().zip(kept.chunks_mut(states.len())) {
        stretch::<false, false>(samples, at, run.from, states, 0.0, &mut []);
        stretch::<true, MOMENTS>(samples, run.from, run.to, states, run.origin_mm, kept);
        at = run.to;
    }
    stretch::<false, false>(samples, at, samples.len(), states, 0.0, &mut []);
}

/// Passes over the samples [`from`, `to`); with `KEEP` adds θ, with
/// `MOMENTS` also its moment, to `kept`, one for each state.
#[inline(always)]
fn stretch<const KEEP: bool, const MOMENTS: bool>(
    samples: &Sorted,
    from: usize,
    to: usize,
    states: &mut [State],
    origin_mm: f64,
    kept: &mut [Kept],
) {
    let (x, v) = (&samples.x_mm[from..to], &samples.v_mm_s[from..to]);
    let (a, f) = (&samples.a_m_s2[from..to], &samples.f_n[from..to]);
    for i in 0..to - from {
        let phi = [Lane::all(a[i]), Lane::all(v[i]), Lane::all(x[i])];
        let force = Lane::all(f[i]);
        if KEEP {
            let arm = Lane::all(x[i] - origin_mm);
            for (state, kept) in states.iter_mut().zip(kept.iter_mut()) {
                state.step(phi, force);
                kept.add::<MOMENTS>(&state.theta, arm);
            }
        } else {
            for state in states.iter_mut() {
                state.step(phi, force);
            }
        }
        // at places that depend on nothing but the sample
        if (from + i) % RESCALE == RESCALE - 1 {
            for state in states.iter_mut() {
                state.rescale();
            }
        }
    }
}

/// One state back over the first samples.
fn back(processor: Processor, samples: &Sorted, first: usize, state: &mut State) {
    let reversed = |column: &[f64]| column[..first].iter().rev().copied().collect();
    let samples = Sorted {
        x_mm: reversed(&samples.x_mm),
        v_mm_s: reversed(&samples.v_mm_s),
        a_m_s2: reversed(&samples.a_m_s2),
        f_n: reversed(&samples.f_n),
    };
    dispatch(
        processor,
        &samples,
        std::slice::from_mut(state),
        &[],
        &mut [],
        false,
    );
    state.rescale();
}
