//! Exponentially weighted least squares along position, as the paper has it.
//!
//! The samples of one direction, sorted by x, are passed once through
//!
//! ```text
//! f = P φ,  d = 1 / (λ + φᵀ f),  e = F − φᵀ θ
//! θ ← θ + f e d,  P ← (P − f fᵀ d) / λ
//! ```
//!
//! with φ = [a v x 1] and θ = [m b k F0], from θ = 0 and P = 10⁶ I ("cold"). Each
//! sample leaves one θ. Only the upper triangle of P is computed, so P stays
//! symmetric. P(0) = I would bias the start, 10¹² loses six digits.
//!
//! Where it departs from the paper: a "warm" start takes θ and P from a pass back
//! over the first 3/(1 − λ) samples, so that the first nodes rest on as much as the
//! others; order "travel" passes the − direction from the highest x down, as it was
//! moved; bounds give each sample the estimate of least cost with m, b ≥ 0, without
//! touching the recursion.
//!
//! What the forgetting factor does depends on how densely x was sampled: λ
//! remembers L = 1 / ((1 − λ) ρ) mm, ρ samples per mm and direction.
//!
//! Not here: the order of the samples and the choice of nodes.

use super::constrained;
use super::lanes::recursion::{Run, Sums};
use super::method::{Ewls, Sort, Start};
use super::resample::Resample;

/// P(0) = START · I.
pub(super) const START: f64 = 1e6;

/// A parameter vector, in the order m (kg), b (N·s/mm), k (N/mm), F0 (N).
pub type Theta = [f64; 4];

/// The samples of one direction of travel, in ascending order of x; samples at
/// the same x keep their order in time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sorted {
    /// mm, ascending.
    pub x_mm: Vec<f64>,
    /// mm/s, all of one sign.
    pub v_mm_s: Vec<f64>,
    /// m/s².
    pub a_m_s2: Vec<f64>,
    /// N.
    pub f_n: Vec<f64>,
}

impl Sorted {
    /// How many samples.
    pub fn len(&self) -> usize {
        self.x_mm.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.x_mm.is_empty()
    }

    /// Lowest and highest position, mm; infinities the wrong way round if empty.
    pub fn range_mm(&self) -> [f64; 2] {
        match (self.x_mm.first(), self.x_mm.last()) {
            (Some(low), Some(high)) => [*low, *high],
            _ => [f64::INFINITY, f64::NEG_INFINITY],
        }
    }

    /// The same samples from the highest x down; those at the same x keep their
    /// order in time.
    pub(super) fn descending(&self) -> Self {
        let order = descending(&self.x_mm);
        let pick = |column: &[f64]| order.iter().map(|i| column[*i]).collect();
        Self {
            x_mm: pick(&self.x_mm),
            v_mm_s: pick(&self.v_mm_s),
            a_m_s2: pick(&self.a_m_s2),
            f_n: pick(&self.f_n),
        }
    }

    /// L = 1 / ((1 − λ) ρ), mm; infinite at λ = 1.
    pub fn memory_mm(&self, lambda: f64) -> f64 {
        let [low, high] = self.range_mm();
        let per_mm = self.len() as f64 / (high - low);
        1.0 / ((1.0 - lambda) * per_mm)
    }
}

/// One θ a sample of the paper's own recursion, in the order of `samples`. λ has
/// to be in (0, 1].
pub fn estimate(samples: &Sorted, lambda: f64) -> Vec<Theta> {
    estimate_with(samples, &Ewls::paper(lambda, Resample::Point), false)
}

/// One θ a sample, in the order of `samples` whatever the order of the recursion.
/// λ has to be in (0, 1]; `backward` says that these samples travelled down.
pub fn estimate_with(samples: &Sorted, options: &Ewls, backward: bool) -> Vec<Theta> {
    let order = match options.sort {
        Sort::Travel if backward => descending(&samples.x_mm),
        Sort::Travel | Sort::Ascending => (0..samples.len()).collect(),
    };
    let mut recursion = Recursion::cold(options.lambda);
    if options.start == Start::Warm {
        let first = warm_samples(options.lambda).min(order.len());
        for i in order[..first].iter().rev() {
            recursion.pass(samples, *i);
        }
    }
    let mut estimates = vec![[0.0; 4]; samples.len()];
    for i in order {
        recursion.pass(samples, i);
        estimates[i] = if options.bounded {
            recursion.bounded()
        } else {
            recursion.theta
        };
    }
    estimates
}

/// The sums over `runs` of the estimates with m, b ≥ 0, as [`super::lanes::recursion::sums`] has
/// them of the free ones: `samples` in the order of the recursion, which passes back
/// over the first `warm` of them before it begins. No estimate is kept. `None` if
/// they are no numbers.
pub(super) fn bounded_sums(
    samples: &Sorted,
    lambda: f64,
    warm: usize,
    runs: &[Run],
    moments: bool,
) -> Option<Vec<Sums>> {
    let mut recursion = Recursion::cold(lambda);
    for i in (0..warm.min(samples.len())).rev() {
        recursion.pass(samples, i);
    }
    let mut at = 0;
    runs.iter()
        .map(|run| {
            (at..run.from).for_each(|i| recursion.pass(samples, i));
            at = run.to;
            let mut sums = Sums::default();
            for i in run.from..run.to {
                recursion.pass(samples, i);
                let theta = recursion.bounded();
                let arm = if moments {
                    samples.x_mm[i] - run.origin_mm
                } else {
                    0.0
                };
                for (k, p) in theta.iter().enumerate() {
                    sums.theta[k] += p;
                    sums.moment[k] += arm * p;
                }
            }
            let finite = sums.theta.iter().chain(&sums.moment).all(|p| p.is_finite());
            finite.then_some(sums)
        })
        .collect()
}

/// Samples that a warm start goes back over, 3/(1 − λ); saturates at λ = 1.
pub(super) fn warm_samples(lambda: f64) -> usize {
    (3.0 / (1.0 - lambda)).ceil() as usize
}

/// Indices from the highest x down; samples at the same x keep their order in time.
fn descending(x_mm: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..x_mm.len()).collect();
    order.sort_by(|a, b| x_mm[*b].total_cmp(&x_mm[*a]));
    order
}

/// The state of the recursion between two samples.
struct Recursion {
    lambda: f64,
    theta: Theta,
    /// Upper triangle; below the diagonal nothing is read.
    p: [[f64; 4]; 4],
}

impl Recursion {
    fn cold(lambda: f64) -> Self {
        let mut p = [[0.0; 4]; 4];
        for (i, row) in p.iter_mut().enumerate() {
            row[i] = START;
        }
        Self {
            lambda,
            theta: [0.0; 4],
            p,
        }
    }

    fn pass(&mut self, samples: &Sorted, i: usize) {
        let phi = [samples.a_m_s2[i], samples.v_mm_s[i], samples.x_mm[i], 1.0];
        self.step(phi, samples.f_n[i]);
    }

    fn step(&mut self, phi: [f64; 4], force: f64) {
        let p = &mut self.p;
        let f = [
            p[0][0] * phi[0] + p[0][1] * phi[1] + p[0][2] * phi[2] + p[0][3] * phi[3],
            p[0][1] * phi[0] + p[1][1] * phi[1] + p[1][2] * phi[2] + p[1][3] * phi[3],
            p[0][2] * phi[0] + p[1][2] * phi[1] + p[2][2] * phi[2] + p[2][3] * phi[3],
            p[0][3] * phi[0] + p[1][3] * phi[1] + p[2][3] * phi[2] + p[3][3] * phi[3],
        ];
        let d = 1.0 / (self.lambda + dot(phi, f));
        let e = force - dot(phi, self.theta);
        let forget = 1.0 / self.lambda;
        for i in 0..4 {
            self.theta[i] += f[i] * e * d;
            for j in i..4 {
                p[i][j] = (p[i][j] - f[i] * f[j] * d) * forget;
            }
        }
    }
}

impl Recursion {
    /// The estimate of least cost with m, b ≥ 0.
    fn bounded(&self) -> Theta {
        let p = &self.p;
        constrained::bounded(self.theta, p[0], [p[0][1], p[1][1], p[1][2], p[1][3]])
    }
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of F = 0.2 a + 0.01 v + 1.5 x − 3 at 200 places.
    fn linear() -> Sorted {
        let mut s = Sorted::default();
        for i in 0..200 {
            let i = f64::from(i);
            let (x, v, a) = (0.1 * i, 20.0 + 7.0 * (1.3 * i).sin(), (0.7 * i).cos());
            s.x_mm.push(x);
            s.v_mm_s.push(v);
            s.a_m_s2.push(a);
            s.f_n.push(0.2 * a + 0.01 * v + 1.5 * x - 3.0);
        }
        s
    }

    #[test]
    fn constant_parameters_are_recovered_from_noise_free_samples() {
        for lambda in [0.9, 0.99, 1.0] {
            let last = *estimate(&linear(), lambda).last().unwrap();
            for (found, truth) in last.into_iter().zip([0.2, 0.01, 1.5, -3.0]) {
                assert!((found - truth).abs() < 1e-5, "{lambda} {last:?}");
            }
        }
    }

    #[test]
    fn without_forgetting_it_is_ordinary_least_squares() {
        // y = 1, 2, 4 at x = 0, 1, 2: slope 1.5, offset 5/6
        let s = Sorted {
            x_mm: vec![0.0, 1.0, 2.0],
            v_mm_s: vec![0.0; 3],
            a_m_s2: vec![0.0; 3],
            f_n: vec![1.0, 2.0, 4.0],
        };
        let last = *estimate(&s, 1.0).last().unwrap();
        assert!((last[2] - 1.5).abs() < 1e-5, "{last:?}");
        assert!((last[3] - 5.0 / 6.0).abs() < 1e-5, "{last:?}");
    }

    #[test]
    fn the_memory_is_a_length() {
        let s = linear();
        // 200 samples over 19.9 mm
        assert!((s.memory_mm(0.99) - 19.9 / 200.0 * 100.0).abs() < 1e-9);
        assert_eq!(s.memory_mm(1.0), f64::INFINITY);
    }
}
