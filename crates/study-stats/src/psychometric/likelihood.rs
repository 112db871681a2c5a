//! Maximum likelihood.

use super::{Core, Curve, Experiment, Level, pooled};
use crate::clm::newton::{Evaluation, Maximum, maximize};
use crate::matrix::Cholesky;
use crate::random::RandomSource;
use thiserror::Error;

/// A maximum whose log-likelihood is not higher than this above that of a limit is none.
const MARGIN: f64 = 1e-6;
/// Farthest threshold from the levels, and largest width, in ranges of the levels.
const FARTHEST: f64 = 50.0;

/// Why there is no threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum NoThreshold {
    /// Two parameters need two levels.
    #[error("there are fewer than two levels with trials")]
    OneLevel,
    /// Counts or rates outside their ranges.
    #[error("the counts or the rates are not possible")]
    Invalid,
    /// Every answer is positive.
    #[error("every answer is positive: the threshold is below the levels")]
    AllPositive,
    /// The function would have to start above every level.
    #[error("no level is above the guess rate")]
    NoneAboveGuess,
    /// A constant fits at least as well as any rising function.
    #[error("the share of positive answers does not rise with the level")]
    NotRising,
    /// A step fits at least as well: the likelihood grows as the width goes to 0.
    #[error(
        "a step fits at least as well: the width goes to 0, and the threshold is only known to lie between two levels"
    )]
    Step,
}

/// A curve fitted by maximum likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// The curve.
    pub curve: Curve,
    /// Standard error of the threshold, from the observed information in threshold and
    /// width. `None` if that is singular.
    pub threshold_se: Option<f64>,
    /// Standard error of the width.
    pub width_se: Option<f64>,
    /// Covariance of threshold and width.
    pub covariance: Option<f64>,
    /// Deviance.
    pub deviance: f64,
    /// Levels minus the two parameters.
    pub df: usize,
    /// Log-likelihood without binomial coefficients.
    pub log_likelihood: f64,
}

impl Fit {
    /// Standard error of the JND.
    pub fn jnd_se(&self) -> Option<f64> {
        Some(self.width_se? * self.curve.core.jnd_of_width())
    }
}

/// The curve with given γ and λ and the highest likelihood. Levels may repeat.
///
/// ```
/// # use study_stats::psychometric::{Core, Level, NoThreshold, maximum_likelihood};
/// let level = |level, positive| Level { level, positive, trials: 20.0 };
/// // As many answers above one half as below it: the threshold is the middle.
/// let levels = [level(1.0, 2.0), level(2.0, 10.0), level(3.0, 18.0)];
/// let fit = maximum_likelihood(Core::Logistic, &levels, 0.0, 0.0)?;
/// assert!((fit.curve.threshold - 2.0).abs() < 1e-6);
/// # Ok::<(), NoThreshold>(())
/// ```
pub fn maximum_likelihood(
    core: Core,
    levels: &[Level],
    gamma: f64,
    lambda: f64,
) -> Result<Fit, NoThreshold> {
    let problem = Problem::new(core, levels, gamma, lambda)?;
    let found = problem.search().ok_or_else(|| problem.reason())?;
    problem.accept(found)
}

/// The curve with the highest likelihood for 0 ≤ λ ≤ `most`, and with γ as the
/// experiment has it; `gamma` is that of a yes–no experiment. Standard errors take λ for
/// given.
pub fn free_lapse(
    core: Core,
    levels: &[Level],
    experiment: Experiment,
    gamma: f64,
    most: f64,
) -> Result<Fit, NoThreshold> {
    let problem = |lambda: f64| {
        let gamma = experiment.guess(lambda).unwrap_or(gamma);
        Problem::new(core, levels, gamma, lambda)
    };
    problem(0.0)?;
    let value = |lambda: f64| {
        let found = problem(lambda).ok().and_then(|p| p.search());
        found.map_or(f64::NEG_INFINITY, |m| m.value)
    };
    const STEPS: usize = 12;
    let at = |i: usize| most * i as f64 / STEPS as f64;
    let values: Vec<f64> = (0..=STEPS).map(|i| value(at(i))).collect();
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let best = values.iter().position(|v| *v == top).unwrap_or(0);
    let (mut low, mut high) = (at(best.saturating_sub(1)), at((best + 1).min(STEPS)));
    // Golden section.
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (value(a), value(b));
    while high - low > 1e-9 {
        if at_a >= at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = value(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = value(b);
        }
    }
    let inner = 0.5 * (low + high);
    let candidates = [inner, at(best), 0.0, most];
    let lambda = (candidates.into_iter())
        .max_by(|x, y| value(*x).total_cmp(&value(*y)))
        .unwrap_or(inner);
    let problem = problem(lambda)?;
    let found = problem.search().ok_or_else(|| problem.reason())?;
    problem.accept(found)
}

/// The share of simulated data sets, from the fitted curve, whose deviance is at least
/// as large, with the observed one among them: (1 + #{D* ≥ D})/(`repeats` + 1).
/// Not for adaptive tracks, whose levels depend on the answers.
pub fn deviance_p(
    fit: &Fit,
    levels: &[Level],
    repeats: u32,
    random: &mut impl RandomSource,
) -> f64 {
    const UNIT: u64 = 1 << 53;
    let levels = pooled(levels);
    let curve = fit.curve;
    let limits: Vec<u64> = (levels.iter())
        .map(|l| (curve.value(l.level) * UNIT as f64) as u64)
        .collect();
    let mut larger = 0u32;
    for _ in 0..repeats {
        let drawn: Vec<Level> = (levels.iter().zip(&limits))
            .map(|(l, limit)| {
                let trials = l.trials as u64;
                let positive = (0..trials).filter(|_| random.below(UNIT) < *limit).count();
                Level {
                    positive: positive as f64,
                    ..*l
                }
            })
            .collect();
        let problem = Problem {
            levels: drawn,
            ..Problem::of(curve, &levels)
        };
        let start = problem.coordinates(&curve);
        let found = maximize(start.to_vec(), |at| problem.evaluate(at));
        let rising = found.map_or(f64::NEG_INFINITY, |m| m.value);
        let best = rising.max(problem.constant()).max(problem.step());
        let deviance = 2.0 * (problem.saturated() - best);
        // Equal within rounding is equal.
        larger += u32::from(deviance >= fit.deviance - 1e-9);
    }
    f64::from(larger + 1) / f64::from(repeats + 1)
}

/// k ln p, 0 for k = 0.
fn k_ln_p(k: f64, p: f64) -> f64 {
    if k > 0.0 { k * p.ln() } else { 0.0 }
}

/// A search, in the coordinates (threshold − middle)/range and ln(width/range).
struct Problem {
    core: Core,
    levels: Vec<Level>,
    gamma: f64,
    lambda: f64,
    middle: f64,
    range: f64,
}

impl Problem {
    fn new(core: Core, levels: &[Level], gamma: f64, lambda: f64) -> Result<Self, NoThreshold> {
        let levels = pooled(levels);
        let good = |l: &Level| {
            l.level.is_finite() && l.positive >= 0.0 && l.positive <= l.trials && l.trials < 1e9
        };
        let rates = gamma >= 0.0 && lambda >= 0.0 && gamma + lambda < 1.0;
        if !rates || !levels.iter().all(good) {
            return Err(NoThreshold::Invalid);
        }
        if levels.len() < 2 {
            return Err(NoThreshold::OneLevel);
        }
        let curve = Curve {
            core,
            threshold: 0.0,
            width: 1.0,
            gamma,
            lambda,
        };
        let problem = Self::of(curve, &levels);
        Ok(Self { levels, ..problem })
    }

    /// Without its data. There are two levels or more.
    fn of(curve: Curve, levels: &[Level]) -> Self {
        let (low, high) = (levels[0].level, levels[levels.len() - 1].level);
        Self {
            core: curve.core,
            levels: Vec::new(),
            gamma: curve.gamma,
            lambda: curve.lambda,
            middle: 0.5 * (low + high),
            range: high - low,
        }
    }

    fn coordinates(&self, curve: &Curve) -> [f64; 2] {
        [
            (curve.threshold - self.middle) / self.range,
            (curve.width / self.range).ln(),
        ]
    }

    fn curve(&self, at: &[f64]) -> Curve {
        Curve {
            core: self.core,
            threshold: self.middle + at[0] * self.range,
            width: at[1].exp() * self.range,
            gamma: self.gamma,
            lambda: self.lambda,
        }
    }

    /// Log-likelihood with its derivatives.
    fn evaluate(&self, at: &[f64]) -> Option<Evaluation> {
        let mut sum = Evaluation::zero(2);
        let inner = 1.0 - self.gamma - self.lambda;
        let shrink = (-at[1]).exp();
        for l in &self.levels {
            let x = (l.level - self.middle) / self.range;
            let u = (x - at[0]) * shrink;
            let (s, slope, curvature) = self.core.derivatives(u);
            let p = self.gamma + inner * s;
            let (k, misses) = (l.positive, l.trials - l.positive);
            sum.value += k_ln_p(k, p) + k_ln_p(misses, 1.0 - p);
            // Derivatives of the term in p, and of p in the coordinates.
            let safe = |k: f64, p: f64| if k > 0.0 { k / p } else { 0.0 };
            let first = safe(k, p) - safe(misses, 1.0 - p);
            let second = -safe(safe(k, p), p) - safe(safe(misses, 1.0 - p), 1.0 - p);
            let (du_t, du_w) = (-shrink, -u);
            let (p_t, p_w) = (inner * slope * du_t, inner * slope * du_w);
            let p_tt = inner * curvature * du_t * du_t;
            let p_tw = inner * (curvature * du_t * du_w + slope * shrink);
            let p_ww = inner * (curvature * du_w * du_w + slope * u);
            sum.gradient[0] += first * p_t;
            sum.gradient[1] += first * p_w;
            sum.hessian.add(0, 0, second * p_t * p_t + first * p_tt);
            sum.hessian.add(1, 0, second * p_t * p_w + first * p_tw);
            sum.hessian.add(1, 1, second * p_w * p_w + first * p_ww);
        }
        let finite = sum.value.is_finite()
            && sum.gradient.iter().all(|g| g.is_finite())
            && at[0].abs() < FARTHEST
            && at[1].abs() < FARTHEST;
        finite.then_some(sum)
    }

    fn value(&self, curve: &Curve) -> f64 {
        (self.levels.iter())
            .map(|l| {
                let p = curve.value(l.level);
                k_ln_p(l.positive, p) + k_ln_p(l.trials - l.positive, 1.0 - p)
            })
            .sum()
    }

    /// The highest maximum from the three best points of a grid.
    fn search(&self) -> Option<Maximum> {
        let mut starts: Vec<([f64; 2], f64)> = Vec::new();
        for i in 0..17 {
            for width in [0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0f64] {
                let at = [-1.0 + f64::from(i) / 8.0, width.ln()];
                let value = self.value(&self.curve(&at));
                if value.is_finite() {
                    starts.push((at, value));
                }
            }
        }
        starts.sort_by(|a, b| b.1.total_cmp(&a.1));
        let found = (starts.iter().take(3))
            .filter_map(|(at, _)| maximize(at.to_vec(), |at| self.evaluate(at)));
        found.max_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// The maximum, unless a limit of the curve is as likely.
    fn accept(&self, found: Maximum) -> Result<Fit, NoThreshold> {
        let limit = self.constant().max(self.step());
        let rising = self
            .levels
            .iter()
            .any(|l| l.positive > self.gamma * l.trials);
        if !rising || found.value <= limit + MARGIN {
            return Err(self.reason());
        }
        let curve = self.curve(&found.at);
        let factor = Cholesky::definite(&found.information);
        let of_threshold = factor.as_ref().map(|f| f.solve(&[1.0, 0.0]));
        let of_width = factor.as_ref().map(|f| f.solve(&[0.0, 1.0]));
        Ok(Fit {
            curve,
            threshold_se: of_threshold.as_ref().map(|v| v[0].sqrt() * self.range),
            width_se: of_width.map(|v| v[1].sqrt() * curve.width),
            covariance: of_threshold.map(|v| v[1] * self.range * curve.width),
            deviance: curve.deviance(&self.levels),
            df: self.levels.len() - 2,
            log_likelihood: found.value,
        })
    }

    fn reason(&self) -> NoThreshold {
        let levels = &self.levels;
        if levels.iter().all(|l| l.positive == l.trials) {
            NoThreshold::AllPositive
        } else if levels.iter().all(|l| l.positive <= self.gamma * l.trials) {
            NoThreshold::NoneAboveGuess
        } else if self.step() > self.constant() {
            NoThreshold::Step
        } else {
            NoThreshold::NotRising
        }
    }

    /// The log-likelihood of the best constant: the limit of a width without end.
    fn constant(&self) -> f64 {
        let sum = |f: fn(&Level) -> f64| self.levels.iter().map(f).sum::<f64>();
        let (k, n) = (sum(|l| l.positive), sum(|l| l.trials));
        let p = (k / n).clamp(self.gamma, 1.0 - self.lambda);
        k_ln_p(k, p) + k_ln_p(n - k, 1.0 - p)
    }

    /// The log-likelihood of the best step: γ below, 1 − λ above, one level between.
    fn step(&self) -> f64 {
        let term =
            |l: &Level, p: f64| k_ln_p(l.positive, p) + k_ln_p(l.trials - l.positive, 1.0 - p);
        (0..self.levels.len())
            .map(|free| {
                (self.levels.iter().enumerate())
                    .map(|(i, l)| {
                        let (low, high) = (self.gamma, 1.0 - self.lambda);
                        match i.cmp(&free) {
                            std::cmp::Ordering::Less => term(l, low),
                            std::cmp::Ordering::Equal => {
                                term(l, (l.positive / l.trials).clamp(low, high))
                            }
                            std::cmp::Ordering::Greater => term(l, high),
                        }
                    })
                    .sum()
            })
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The log-likelihood of the shares themselves.
    fn saturated(&self) -> f64 {
        (self.levels.iter())
            .map(|l| {
                let p = l.positive / l.trials;
                k_ln_p(l.positive, p) + k_ln_p(l.trials - l.positive, 1.0 - p)
            })
            .sum()
    }
}
