//! Exponentially weighted least squares (EWLS) along position.
//!
//! The samples of one direction, sorted by x, pass once through the recursion
//!
//! ```text
//! f = P φ,  d = 1 / (λ + φᵀ f),  e = F − φᵀ θ
//! θ ← θ + f e d,  P ← (P − f fᵀ d) / λ
//! ```
//!
//! with φ = [a v x 1] and θ = [m b k F0], from θ = 0 and P = 10⁶ I (a "cold" start).
//! Each sample gives one estimate θ. A term that is left out starts with P = 0 and so
//! stays 0. Only the upper triangle of P is computed, so P
//! stays symmetric. P(0) = I would bias the first estimates; 10¹² costs six digits.
//!
//! Departures from the paper, all optional: a "warm" start takes θ and P from a
//! backward pass over the first 3/(1 − λ) samples, so that the first nodes rest on
//! as many samples as the others; with the order "travel" the − direction is passed
//! from the highest x down, as it was moved; with bounds each estimate is the one of
//! least cost with m, b ≥ 0, while the recursion itself stays unbounded.
//!
//! The effect of the forgetting factor depends on how densely x was sampled: the
//! memory is L = 1 / ((1 − λ) ρ) mm, with ρ samples per mm and direction.

use super::constrained;
use super::lanes::recursion::{Run, Sums};
use super::method::{Candidacy, Declared, Estimator, Opt, Options, Setting, Sort, Start, Terms};
use super::problem::START_UP_SAMPLES;
use super::resample::{self, Resample, Resampled};
use super::samples::{Samples, Theta, initial_covariance};
use super::{Cause, Identified, IdentifyError, Training, Trials, Warning, method};
use crate::model::Provenance;
use std::fmt;
use study_wire::predict::Lookup;

/// Memories of the recursion that are compared, in units of dx.
const MEMORIES: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];

/// Options of exponentially weighted least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ewls {
    /// Forgetting factor λ, above 0 and at most 1.
    pub lambda: f64,
    /// Resampling of the estimates at the nodes.
    pub resample: Resample,
    /// Initial state of the recursion.
    pub start: Start,
    /// Order of the samples.
    pub sort: Sort,
    /// Whether m, b ≥ 0 in every estimate.
    pub bounded: bool,
    /// The terms that are estimated.
    pub terms: Terms,
}

impl Ewls {
    /// The method as published: cold start, ascending order, no bounds, all terms.
    pub fn paper(lambda: f64, resample: Resample) -> Self {
        Self {
            lambda,
            resample,
            start: Start::Cold,
            sort: Sort::Ascending,
            bounded: false,
            terms: Terms::ALL,
        }
    }
}

impl Estimator for Ewls {
    fn name(&self) -> &'static str {
        Self::NAMES[usize::from(self.bounded)].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        // check dx before the long computation
        training.nodes(setting.dx_mm)?;
        let estimates = training.estimates(*self)?;
        training.ewls(&estimates, setting.dx_mm, self.resample, setting.lookup)
    }

    fn check(&self) -> Result<(), IdentifyError> {
        method::forgetting(self.lambda)
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.start != Start::Cold {
            write!(f, " start={}", self.start.as_str())?;
        }
        if self.sort != Sort::Ascending {
            write!(f, " sort={}", self.sort.as_str())?;
        }
        self.terms.write(f, true)
    }

    fn lambda(&self) -> Option<f64> {
        Some(self.lambda)
    }

    fn terms_mut(&mut self) -> Option<&mut Terms> {
        Some(&mut self.terms)
    }

    fn id_template(&self, _several_deltas: bool) -> String {
        let bounded = if self.bounded { "constrained-" } else { "" };
        format!("{bounded}lambda-{{lambda}}-dx-{{dx}}")
    }
}

impl Declared for Ewls {
    const NAMES: &'static [(&'static str, &'static str)] = &[
        (
            "ewls",
            "The paper's method: exponentially weighted least squares along x",
        ),
        ("constrained", "The paper's method with m, b >= 0"),
    ];
    const OPTIONS: &'static [Opt] = &[Opt::Lambda, Opt::Dx, Opt::Start, Opt::Terms, Opt::Stiffness];

    fn asked(name: &str, options: &Options) -> Vec<Self> {
        options.each_lambda(|lambda| Self {
            lambda,
            resample: options.resample.unwrap_or(Resample::Bin),
            start: options.start.unwrap_or(Start::Cold),
            sort: options.sort.unwrap_or(Sort::Ascending),
            bounded: name == Self::NAMES[1].0,
            terms: options.kept(),
        })
    }

    /// With the memory of least residual.
    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        let (_, dx_mm) = trials.table()?;
        let training = trials.training();
        let [plus, minus] = training.directions().map(Samples::len);
        let [low, high] = training.range_mm;
        let per_mm = plus.max(minus) as f64 / (high - low);
        let of = |memory: &f64| {
            let forgotten: f64 = 1.0 / (memory * dx_mm * per_mm).max(10.0);
            let lambda = 1.0 - format!("{forgotten:.0e}").parse().unwrap_or(forgotten);
            Self {
                start: Start::Warm,
                terms: Terms::default(),
                ..Self::paper(lambda, Resample::Hat)
            }
            .into()
        };
        let methods = MEMORIES.iter().map(of);
        let tried = methods.map(|method| (method, trials.rms_n(method, dx_mm)));
        let best = tried.min_by(|a, b| a.1.total_cmp(&b.1));
        let method = best.map_or_else(|| of(&1.0), |(method, _)| method);
        Ok(Candidacy::With(method, dx_mm))
    }
}

impl Training<'_> {
    /// One estimate of θ per sample, in both directions. `options.resample` is not
    /// used.
    ///
    /// # Errors
    /// [`IdentifyError`] if λ is not in (0, 1] or an estimate is not finite.
    pub fn estimates(&self, options: Ewls) -> Result<Estimates, IdentifyError> {
        options.check()?;
        let one = |samples, backward| {
            let theta = estimate(samples, &options, backward);
            let finite = theta.iter().flatten().all(|p| p.is_finite());
            finite.then_some(theta).ok_or(IdentifyError::Diverged {
                lambda: options.lambda,
            })
        };
        Ok(Estimates {
            options,
            positive: one(&self.positive, false)?,
            negative: one(&self.negative, true)?,
        })
    }

    /// A table of the EWLS family from estimates computed before.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn ewls(
        &self,
        estimates: &Estimates,
        dx_mm: f64,
        resample: Resample,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        let nodes = self.nodes(dx_mm)?;
        let at_nodes = |samples: &Samples, theta: &[Theta]| {
            resample::at_nodes(resample, &samples.x_mm, theta, &nodes, dx_mm)
        };
        let positive = at_nodes(&self.positive, &estimates.positive);
        let negative = at_nodes(&self.negative, &estimates.negative);
        let options = Ewls {
            resample,
            ..estimates.options
        };
        Ok(self.ewls_table(options, dx_mm, nodes, positive, negative, lookup))
    }

    /// A table of the EWLS family from the parameters at its nodes.
    pub(super) fn ewls_table(
        &self,
        options: Ewls,
        dx_mm: f64,
        nodes: Vec<f64>,
        positive: Resampled,
        negative: Resampled,
        lookup: Lookup,
    ) -> Identified {
        let start_up = self.start_up(&options, &nodes);
        let mut identified = self.table(nodes, positive, negative, Cause::NoSamples, lookup);
        identified.warnings.extend(start_up);
        identified.realization.provenance = Provenance {
            lambda: Some(options.lambda),
            memory_mm: self.memory_mm(options.lambda),
            dx_mm: Some(dx_mm),
            resample: Some(options.resample.as_str().into()),
            ..self.provenance(options)
        };
        identified
    }

    /// A warning about nodes where the recursion of either direction has seen few
    /// samples. A warm start has none.
    fn start_up(&self, options: &Ewls, nodes: &[f64]) -> Option<Warning> {
        if options.start == Start::Warm {
            return None;
        }
        let end_of_start_up = |x: &[f64]| x[START_UP_SAMPLES.min(x.len() - 1)];
        let mut low = end_of_start_up(&self.positive.x_mm);
        let mut high = f64::INFINITY;
        match options.sort {
            Sort::Ascending => low = low.max(end_of_start_up(&self.negative.x_mm)),
            Sort::Travel => {
                let x = &self.negative.x_mm;
                high = x[x.len() - 1 - START_UP_SAMPLES.min(x.len() - 1)];
            }
        }
        let early: Vec<f64> = nodes
            .iter()
            .copied()
            .filter(|node| *node < low || *node > high)
            .collect();
        early.last().map(|last| Warning::StartUp {
            nodes: early.len(),
            to_mm: *last,
        })
    }
}

/// One estimate of θ per sample, in the order of [`Training::directions`].
#[derive(Debug, Clone)]
pub struct Estimates {
    /// The options they were computed with.
    pub options: Ewls,
    /// For v > 0.
    pub positive: Vec<Theta>,
    /// For v < 0, in ascending order of x.
    pub negative: Vec<Theta>,
}

/// One estimate of θ per sample, in the order of `samples` whatever the order of the
/// recursion. λ has to be in (0, 1]; `backward` says that these samples traveled
/// towards lower x.
pub fn estimate(samples: &Samples, options: &Ewls, backward: bool) -> Vec<Theta> {
    let order = match options.sort {
        Sort::Travel if backward => samples.descending(),
        Sort::Travel | Sort::Ascending => (0..samples.len()).collect(),
    };
    let mut recursion = Recursion::cold(options.lambda, options.terms);
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

/// Sums over `runs` of the estimates with m, b ≥ 0, as
/// [`super::lanes::recursion::sums`] computes them without bounds. `samples` are in
/// the order of the recursion, which first passes back over the first `warm` of them.
/// No estimate is stored. `None` if a sum is not finite.
pub(super) fn bounded_sums(
    samples: &Samples,
    (lambda, terms): (f64, Terms),
    warm: usize,
    runs: &[Run],
    moments: bool,
) -> Option<Vec<Sums>> {
    let mut recursion = Recursion::cold(lambda, terms);
    for i in (0..warm.min(samples.len())).rev() {
        recursion.pass(samples, i);
    }
    let mut next = 0;
    runs.iter()
        .map(|run| {
            (next..run.from).for_each(|i| recursion.pass(samples, i));
            next = run.to;
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

/// Number of samples of a warm start's backward pass, 3/(1 − λ); saturates at λ = 1.
pub(super) fn warm_samples(lambda: f64) -> usize {
    (3.0 / (1.0 - lambda)).ceil() as usize
}

/// The state of the recursion between two samples.
struct Recursion {
    lambda: f64,
    theta: Theta,
    /// Only the upper triangle is used.
    p: [[f64; 4]; 4],
}

impl Recursion {
    fn cold(lambda: f64, terms: Terms) -> Self {
        let mut p = [[0.0; 4]; 4];
        for (i, prior) in initial_covariance(terms.kept()).into_iter().enumerate() {
            p[i][i] = prior;
        }
        Self {
            lambda,
            theta: [0.0; 4],
            p,
        }
    }

    fn pass(&mut self, samples: &Samples, i: usize) {
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
    use crate::identify::resample::Resample;

    fn last_estimate(samples: &Samples, lambda: f64) -> Theta {
        let options = Ewls::paper(lambda, Resample::Point);
        *estimate(samples, &options, false).last().unwrap()
    }

    /// Samples of F = 0.2 a + 0.01 v + 1.5 x − 3 at 200 positions.
    fn linear() -> Samples {
        let mut s = Samples::default();
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
            let last = last_estimate(&linear(), lambda);
            for (found, truth) in last.into_iter().zip([0.2, 0.01, 1.5, -3.0]) {
                assert!((found - truth).abs() < 1e-5, "{lambda} {last:?}");
            }
        }
    }

    #[test]
    fn without_forgetting_it_is_ordinary_least_squares() {
        // y = 1, 2, 4 at x = 0, 1, 2: slope 1.5, offset 5/6
        let s = Samples {
            x_mm: vec![0.0, 1.0, 2.0],
            v_mm_s: vec![0.0; 3],
            a_m_s2: vec![0.0; 3],
            f_n: vec![1.0, 2.0, 4.0],
        };
        let last = last_estimate(&s, 1.0);
        assert!((last[2] - 1.5).abs() < 1e-5, "{last:?}");
        assert!((last[3] - 5.0 / 6.0).abs() < 1e-5, "{last:?}");
    }
}
