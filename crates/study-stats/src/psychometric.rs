//! Psychometric functions: the share of positive answers (correct, "yes", "greater")
//! against the level of a stimulus.
//!
//! ψ(x) = γ + (1 − γ − λ)·S(x), with the guess rate γ, the lapse rate λ and a core S of
//! two parameters (Schütt, Harmeling, Macke & Wichmann 2016): S(threshold) = ½, and the
//! width is the distance between S = .05 and S = .95. A Weibull function is the Gumbel
//! core over the logarithm of the level.
//!
//! The functions here know nothing of the scale: [`Spacing`] takes levels to it, and thresholds back.
//!
//! [`maximum_likelihood`] has γ and λ fixed and an explicit test whether a maximum
//! exists; [`free_lapse`] estimates λ, too. [`posterior`] integrates over λ, γ and
//! overdispersion, and always has an answer. [`hierarchy`] learns the functions of several
//! participants together.

mod bayes;
mod core;
mod group;
pub mod hierarchy;
mod likelihood;
mod simplex;
mod spacing;

pub use self::core::Core;
pub use bayes::{Interval, Map, Posterior, Priors, Support, WidthPrior, map, posterior};
pub use group::{Group, group};
pub use likelihood::{Fit, NoThreshold, deviance_p, free_lapse, maximum_likelihood};
pub use spacing::Spacing;

/// The trials of one level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// The level.
    pub level: f64,
    /// Positive answers.
    pub positive: f64,
    /// Trials.
    pub trials: f64,
}

/// Adds up the trials of equal levels; levels rise. Levels without trials are left out.
pub fn pooled(levels: &[Level]) -> Vec<Level> {
    let mut sorted: Vec<Level> = (levels.iter().copied())
        .filter(|l| l.trials > 0.0)
        .collect();
    sorted.sort_by(|a, b| a.level.total_cmp(&b.level));
    let mut sums: Vec<Level> = Vec::new();
    for level in sorted {
        match sums.last_mut() {
            Some(last) if last.level == level.level => {
                last.positive += level.positive;
                last.trials += level.trials;
            }
            _ => sums.push(level),
        }
    }
    sums
}

/// What the answer to a trial is, which decides about γ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Experiment {
    /// Correct or not, with this share of correct guesses.
    ForcedChoice(f64),
    /// "Yes" or "no": γ is a parameter of its own.
    YesNo,
    /// "Greater" or "smaller": γ = λ.
    Comparison,
}

impl Experiment {
    /// γ, if `lambda` determines it.
    fn guess(self, lambda: f64) -> Option<f64> {
        match self {
            Self::ForcedChoice(guess) => Some(guess),
            Self::YesNo => None,
            Self::Comparison => Some(lambda),
        }
    }
}

/// A psychometric function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    /// S.
    pub core: Core,
    /// Where S is ½.
    pub threshold: f64,
    /// Distance from S = .05 to S = .95.
    pub width: f64,
    /// Guess rate.
    pub gamma: f64,
    /// Lapse rate.
    pub lambda: f64,
}

impl Curve {
    /// ψ(x).
    pub fn value(&self, x: f64) -> f64 {
        let s = self.core.value((x - self.threshold) / self.width);
        self.gamma + (1.0 - self.gamma - self.lambda) * s
    }

    /// The level at which ψ is `share`. `None` unless γ < share < 1 − λ.
    pub fn level_at(&self, share: f64) -> Option<f64> {
        let s = (share - self.gamma) / (1.0 - self.gamma - self.lambda);
        Some(self.threshold + self.width * self.core.inverse(s)?)
    }

    /// Half the distance between S = .25 and S = .75, the difference threshold of a
    /// comparison.
    pub fn jnd(&self) -> f64 {
        self.width * self.core.jnd_of_width()
    }

    /// 2·(saturated − fitted), without binomial coefficients.
    pub fn deviance(&self, levels: &[Level]) -> f64 {
        (levels.iter())
            .map(|l| {
                let p = self.value(l.level);
                let part = |k: f64, expected: f64| {
                    if k > 0.0 {
                        2.0 * k * (k / expected).ln()
                    } else {
                        0.0
                    }
                };
                part(l.positive, l.trials * p) + part(l.trials - l.positive, l.trials * (1.0 - p))
            })
            .sum()
    }
}

#[cfg(test)]
mod tests;
