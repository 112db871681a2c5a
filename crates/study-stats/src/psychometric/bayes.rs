//! Maximum a posteriori and posterior of the beta-binomial model of Schütt, Harmeling,
//! Macke & Wichmann (2016), with their priors or those of adaptive tracks ([`Priors`]).
//!
//! The positive answers of a level are beta-binomial with the mean ψ and ν = 1/η² − 1,
//! so that η, between 0 and 1, is an overdispersion on the scale of a standard
//! deviation; 0 is the binomial distribution.

mod grid;
mod rows;

use super::{Core, Curve, Experiment, Level, NoThreshold, Spacing, pooled, simplex};
use rows::row_term;
use std::f64::consts::PI;

/// The largest λ, and γ of a yes–no experiment.
const MOST_RATE: f64 = 0.5;
/// The largest η.
const MOST_ETA: f64 = 0.999;

/// The range that the priors refer to: that of the levels, or for an adaptive track,
/// which sits at one place, that of its ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Lowest level.
    pub low: f64,
    /// Highest level.
    pub high: f64,
    /// Least distance of two levels.
    pub least: f64,
}

impl Support {
    /// That of a list of levels. `None` with fewer than two different ones.
    pub fn of(levels: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut levels: Vec<f64> = levels.into_iter().collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let steps = levels.windows(2).map(|pair| pair[1] - pair[0]);
        let least = steps.fold(f64::INFINITY, f64::min);
        Some(Self {
            low: *levels.first()?,
            high: *levels.last()?,
            least: Some(least).filter(|l| l.is_finite())?,
        })
    }

    fn range(&self) -> f64 {
        self.high - self.low
    }

    /// Logarithm of the prior of a threshold, up to a constant: even within the range,
    /// raised-cosine falls over half a range on both sides.
    fn threshold(&self, t: f64) -> f64 {
        let (r, far) = (self.range(), (self.low - t).max(t - self.high).max(0.0));
        if far >= r / 2.0 {
            return f64::NEG_INFINITY;
        }
        ((1.0 + (2.0 * PI * far / r).cos()) / 2.0).ln()
    }

    /// Logarithm of the prior of a width: rises from the least distance to twice that,
    /// falls from the range to three times that.
    fn width(&self, w: f64) -> f64 {
        let (least, r) = (self.least, self.range());
        if w <= least || w >= 3.0 * r {
            return f64::NEG_INFINITY;
        }
        let rise = if w < 2.0 * least {
            (1.0 - (PI * (w - least) / least).cos()) / 2.0
        } else {
            1.0
        };
        let fall = if w > r {
            (1.0 + (PI / 2.0 * (w - r) / r).cos()) / 2.0
        } else {
            1.0
        };
        (rise * fall).ln()
    }
}

/// The prior of a width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WidthPrior {
    /// Even from twice the least distance of the levels to their range, with falls on both sides.
    Even,
    /// ln W is normal with the mean ln 1.63, which is the width of a Weibull function of exponent
    /// 2.5 over logarithms, and the standard deviation 0.6.
    OfRatios,
    /// ln(W/(threshold − origin)) is normal with the mean ln 1.7 and the standard deviation 0.7;
    /// thresholds are above the origin, where a stimulus equals the standard.
    FromOrigin(f64),
}

impl WidthPrior {
    /// Mean and standard deviation of the logarithm of a width over logarithms. 1.63 is
    /// (ln(−ln .05) − ln(−ln .95))/2.5.
    const OF_RATIOS: (f64, f64) = (0.486_664, 0.6);
    /// The same, of a width in multiples of the distance of the threshold from the origin: 1.7 lies
    /// between 1.4, of a Weibull function of exponent 2.5, and 2.8, of a d′ in proportion to the level.
    const FROM_ORIGIN: (f64, f64) = (0.530_628, 0.7);
}

/// What is assumed of a function before the answers. The threshold is even over the support and
/// falls over half a range on both sides; λ is Beta(1, `lapse`), and so is γ where it equals λ;
/// γ of a yes–no experiment and η are Beta(1, 10).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Priors {
    /// The range that the priors refer to; `None`: that of the levels presented.
    pub support: Option<Support>,
    /// The width.
    pub width: WidthPrior,
    /// b of λ ~ Beta(1, b), whose mean is 1/(1 + b).
    pub lapse: f64,
}

impl Priors {
    /// Those of Schütt et al. (2016), for data of any kind.
    pub fn schuett(support: Option<Support>) -> Self {
        Self {
            support,
            width: WidthPrior::Even,
            lapse: 10.0,
        }
    }

    /// Those of a track over a ladder. With the priors of Schütt et al. the thresholds of 40
    /// to 150 trials near one level are 8 to 25 % too low: a share of lapses of 9 % on average
    /// and widths of up to three ladders are taken to be plausible there (docs/calibration.md).
    pub fn track(support: Option<Support>, width: WidthPrior) -> Self {
        Self {
            support,
            width,
            lapse: 30.0,
        }
    }
}

/// b of η and of γ as a parameter.
const RATE: f64 = 10.0;

/// Logarithm of Beta(1, b), up to a constant.
fn rate(x: f64, b: f64) -> f64 {
    (b - 1.0) * (1.0 - x).ln()
}

/// The mode of the posterior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Map {
    /// The curve.
    pub curve: Curve,
    /// Overdispersion.
    pub eta: f64,
    /// Logarithm of likelihood times prior, without binomial coefficients and the
    /// constants of the priors.
    pub log_kernel: f64,
}

/// An estimate with its equal-tailed 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Posterior mean.
    pub mean: f64,
    /// From 2.5 % to 97.5 %.
    pub ci95: (f64, f64),
    /// The posterior median.
    pub median: f64,
}

/// The posterior, with λ, η and, in a yes–no experiment, γ integrated out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posterior {
    /// Where S is ½.
    pub threshold: Interval,
    /// From S = .05 to S = .95.
    pub width: Interval,
    /// Posterior mean of λ.
    pub lambda: f64,
    /// Posterior mean of γ, if it is a parameter.
    pub gamma: Option<f64>,
    /// Posterior mean of η.
    pub eta: f64,
    /// Posterior mean of e to the power of the threshold.
    exponential: f64,
}

impl Posterior {
    /// The threshold as a level: over logarithms too the mean is that of the level, not of its
    /// logarithm, whose tail towards 0 is long. The median is the same on either scale.
    pub fn threshold_level(&self, spacing: Spacing) -> Interval {
        let mean = match spacing {
            Spacing::Lin => self.threshold.mean,
            Spacing::Log => self.exponential,
        };
        let (low, high) = self.threshold.ci95;
        Interval {
            mean,
            ci95: (spacing.level(low), spacing.level(high)),
            median: spacing.level(self.threshold.median),
        }
    }
}

/// What is to be fitted, with levels added up.
struct Problem {
    core: Core,
    levels: Vec<Level>,
    experiment: Experiment,
    support: Support,
    priors: Priors,
}

impl Problem {
    fn new(
        core: Core,
        levels: &[Level],
        experiment: Experiment,
        priors: &Priors,
    ) -> Result<Self, NoThreshold> {
        let levels = pooled(levels);
        let good = |l: &Level| {
            let whole = l.positive.fract() == 0.0 && l.trials.fract() == 0.0;
            let counts = l.positive >= 0.0 && l.positive <= l.trials && l.trials <= 1e5;
            whole && counts && l.level.is_finite()
        };
        let guess = match experiment {
            Experiment::ForcedChoice(guess) => (0.0..1.0).contains(&guess),
            Experiment::YesNo | Experiment::Comparison => true,
        };
        if !guess || !levels.iter().all(good) {
            return Err(NoThreshold::Invalid);
        }
        let own = || Support::of(levels.iter().map(|l| l.level));
        let support = priors.support.or_else(own).ok_or(NoThreshold::OneLevel)?;
        if levels.is_empty() {
            return Err(NoThreshold::OneLevel);
        }
        let valid = support.least > 0.0 && support.range() >= support.least;
        let problem = Self {
            core,
            levels,
            experiment,
            support,
            priors: *priors,
        };
        valid.then_some(problem).ok_or(NoThreshold::Invalid)
    }

    /// Logarithm of the priors of the rates.
    fn rates(&self, lambda: f64, gamma: f64, eta: f64) -> f64 {
        rate(lambda, self.priors.lapse)
            + rate(eta, RATE)
            + match self.experiment {
                Experiment::ForcedChoice(_) => 0.0,
                Experiment::YesNo => rate(gamma, RATE),
                Experiment::Comparison => rate(gamma, self.priors.lapse),
            }
    }

    /// Logarithm of the prior of a width, up to a constant.
    fn width(&self, threshold: f64, width: f64) -> f64 {
        let log_normal = |multiple: f64, (mean, sd): (f64, f64)| {
            let z = (multiple.ln() - mean) / sd;
            -0.5 * z * z - width.ln()
        };
        match self.priors.width {
            WidthPrior::Even => self.support.width(width),
            WidthPrior::OfRatios => log_normal(width, WidthPrior::OF_RATIOS),
            WidthPrior::FromOrigin(origin) if threshold > origin => {
                log_normal(width / (threshold - origin), WidthPrior::FROM_ORIGIN)
            }
            WidthPrior::FromOrigin(_) => f64::NEG_INFINITY,
        }
    }

    /// Where ln W can be: the support of its prior, or all of it that counts.
    fn log_widths(&self) -> (f64, f64) {
        let (support, range) = (&self.support, self.support.range());
        match self.priors.width {
            WidthPrior::Even => (support.least.ln(), (3.0 * range).ln()),
            WidthPrior::OfRatios => {
                let (mean, sd) = WidthPrior::OF_RATIOS;
                (mean - 5.0 * sd, mean + 5.0 * sd)
            }
            WidthPrior::FromOrigin(origin) => {
                let (mean, sd) = WidthPrior::FROM_ORIGIN;
                let farthest = support.high + range / 2.0 - origin;
                let nearest = (support.low - origin).max(support.least / 2.0);
                (
                    nearest.ln() + mean - 5.0 * sd,
                    farthest.max(support.least).ln() + mean + 5.0 * sd,
                )
            }
        }
    }

    /// Logarithm of likelihood times prior.
    fn log_kernel(&self, curve: &Curve, eta: f64) -> f64 {
        let prior = self.support.threshold(curve.threshold)
            + self.width(curve.threshold, curve.width)
            + self.rates(curve.lambda, curve.gamma, eta);
        if prior == f64::NEG_INFINITY {
            return prior;
        }
        let theta = eta * eta / (1.0 - eta * eta);
        let terms = self
            .levels
            .iter()
            .map(|l| row_term(l.positive, l.trials, curve.value(l.level), theta));
        let sum = prior + terms.sum::<f64>();
        if sum.is_nan() { f64::NEG_INFINITY } else { sum }
    }

    /// Coordinates of the search: threshold in ranges, ln of the width, λ, η, γ. Rates
    /// outside their bounds are moved there.
    fn curve(&self, at: &[f64]) -> (Curve, f64) {
        let lambda = at[2].clamp(0.0, MOST_RATE - 1e-9);
        let guess = self.experiment.guess(lambda);
        let gamma = guess.unwrap_or_else(|| at[4].clamp(0.0, MOST_RATE));
        let curve = Curve {
            core: self.core,
            threshold: self.support.low + at[0] * self.support.range(),
            width: at[1].exp() * self.support.range(),
            gamma,
            lambda: lambda.min(1.0 - gamma - 1e-9),
        };
        (curve, at[3].clamp(0.0, MOST_ETA))
    }

    fn parameters(&self) -> usize {
        match self.experiment {
            Experiment::YesNo => 5,
            Experiment::ForcedChoice(_) | Experiment::Comparison => 4,
        }
    }
}

/// The mode of the posterior; often at λ = 0 or η = 0. Equal levels are added up.
pub fn map(
    core: Core,
    levels: &[Level],
    experiment: Experiment,
    priors: &Priors,
) -> Result<Map, NoThreshold> {
    let problem = Problem::new(core, levels, experiment, priors)?;
    mode(&problem).ok_or(NoThreshold::Invalid)
}

/// The highest of the maxima that are found from the best two of 150 starts.
fn mode(problem: &Problem) -> Option<Map> {
    let size = problem.parameters();
    let kernel = |at: &[f64]| {
        let (curve, eta) = problem.curve(at);
        problem.log_kernel(&curve, eta)
    };
    let mut starts: Vec<(Vec<f64>, f64)> = Vec::new();
    for i in 0..25 {
        for width in [0.05, 0.1, 0.2, 0.4, 0.8, 1.6f64] {
            let t = -0.3 + f64::from(i) / 15.0;
            let at = [t, width.ln(), 0.01, 0.01, 0.01][..size].to_vec();
            let value = kernel(&at);
            starts.push((at, value));
        }
    }
    starts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let sizes = [0.05, 0.3, 0.02, 0.05, 0.02];
    let found = (starts.iter().take(2))
        .map(|(at, _)| simplex::maximize(kernel, at, &sizes[..size]))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|found| found.1.is_finite())?;
    let (curve, eta) = problem.curve(&found.0);
    Some(Map {
        curve,
        eta,
        log_kernel: found.1,
    })
}

/// Posterior means and intervals by quadrature over all parameters.
/// Equal levels are added up.
pub fn posterior(
    core: Core,
    levels: &[Level],
    experiment: Experiment,
    priors: &Priors,
) -> Result<Posterior, NoThreshold> {
    let problem = Problem::new(core, levels, experiment, priors)?;
    grid::integrate(&problem).ok_or(NoThreshold::Invalid)
}
