//! Ratings on an ordered scale, with participants and realizations as draws from populations: the posterior, by Gibbs
//! sampling.
//!
//! Participant i rates realization j, with covariate xⱼ, on a scale of K categories. With η = βxⱼ + mⱼ + uᵢ + wᵢⱼ,
//!
//! P(y ≤ k) = (1 − λ)Φ(cₖ − η) + λk/K,
//!
//! mⱼ ~ N(0, τ²), uᵢ ~ N(0, σ²), wᵢⱼ ~ N(0, ω²): a cumulative probit model in which a share λ of the ratings is given
//! without attention. Thresholds c₁ < … < c_{K−1} have normal priors, β too, the standard deviations half-normal ones, λ is Beta(1, b);
//! see [`OrdinalPriors`]. The unit is the standard deviation of a rating of a participant from one time to the next.
//!
//! Each step draws the thresholds, their shift together with the effects, the scale of all latent numbers and λ, by slice sampling (Neal 2003, Ann. Stat. 31, 705–767) with the latent ratings
//! integrated out, then latent ratings (Albert & Chib 1993, J. Am. Stat. Assoc. 88, 669–679), then the standard deviations with all effects
//! integrated out, then the effects. The result is a pure function of the data and of the random source.

mod diagnostics;
mod effects;
mod sampler;
#[cfg(test)]
mod tests;

pub use diagnostics::Convergence;

use super::random::{RandomSource, SplitMix64};
use diagnostics::convergence;
use sampler::{Chain, Draw};
use thiserror::Error;

/// Most categories.
pub const MAX_CATEGORIES: usize = 101;

/// Ratings of one participant of one realization.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OrdinalCell {
    /// Index of the participant, from 0 without gaps.
    pub participant: usize,
    /// Index of the realization, from 0 without gaps.
    pub realization: usize,
    /// How often each category was the rating, from the lowest.
    pub counts: Vec<u32>,
}

/// What is assumed before the ratings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrdinalPriors {
    /// Standard deviation of each threshold.
    pub threshold: f64,
    /// Standard deviation of β.
    pub slope: f64,
    /// Scale of the half-normal τ, σ and ω.
    pub spread: f64,
    /// b of λ ~ Beta(1, b).
    pub lapse: f64,
}

impl Default for OrdinalPriors {
    /// Weak beside the ratings of a study: effects of up to two or three units, about 3 % of lapses.
    fn default() -> Self {
        Self {
            threshold: 3.0,
            slope: 1.0,
            spread: 1.0,
            lapse: 30.0,
        }
    }
}

impl OrdinalPriors {
    /// The same with effects and their spread so many times as large: to see how much the answers depend on them.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            slope: factor * self.slope,
            spread: factor * self.spread,
            ..self
        }
    }
}

/// How many draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OrdinalEffort {
    /// Independent chains.
    pub chains: usize,
    /// Steps of each before its draws.
    pub warmup: usize,
    /// Draws of each.
    pub draws: usize,
}

impl OrdinalEffort {
    /// What an analysis uses.
    pub const ANALYSIS: Self = Self {
        chains: 4,
        warmup: 500,
        draws: 3000,
    };
}

/// The posterior of one number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posterior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Median.
    pub median: f64,
    /// From 2.5 % to 97.5 %.
    pub ci95: (f64, f64),
}

/// The difference of two realizations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrdinalDifference {
    /// Index of the first.
    pub first: usize,
    /// Index of the second.
    pub second: usize,
    /// First less second.
    pub difference: Posterior,
    /// Posterior probability that the first is above the second.
    pub above: f64,
    /// Posterior probability that they differ by less than the margin; `None` without one, and with one threshold.
    pub equivalent: Option<f64>,
}

/// The posterior of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct OrdinalHierarchy {
    /// βxⱼ + mⱼ of each realization, less their mean.
    pub realizations: Vec<Posterior>,
    /// Posterior probability of each realization to be the highest.
    pub highest: Vec<f64>,
    /// Posterior probability of each realization to be the lowest.
    pub lowest: Vec<f64>,
    /// All pairs in their order.
    pub differences: Vec<OrdinalDifference>,
    /// β; `None` without a covariate.
    pub slope: Option<Posterior>,
    /// Posterior probability that β is above 0.
    pub slope_above: Option<f64>,
    /// τ, about the line if there is one.
    pub between_realizations: Posterior,
    /// σ.
    pub between_participants: Posterior,
    /// ω.
    pub interaction: Posterior,
    /// λ.
    pub lapse: Posterior,
    /// c.
    pub thresholds: Vec<Posterior>,
    /// Whether the draws can be relied upon.
    pub convergence: Convergence,
}

/// Why there is no model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum OrdinalError {
    /// Fewer than two of either.
    #[error("there are fewer than two participants or realizations")]
    TooFew,
    /// One category, too many, or cells that differ in their number.
    #[error("the scale has to have 2 to {MAX_CATEGORIES} categories, the same for all")]
    Categories,
    /// All ratings are the same.
    #[error("all ratings are the same")]
    Constant,
    /// A covariate that is not finite, or of another number of realizations.
    #[error("the covariate does not fit the realizations")]
    Covariate,
}

/// Draws from the posterior of ratings. `covariate` is that of each realization, best with mean 0 and standard deviation 1; nothing for a model without β. `margin` is the
/// difference below which two realizations are taken as equivalent, in categories: in mean distances of neighboring thresholds.
///
/// # Errors
/// [`OrdinalError`].
pub fn ordinal_hierarchy(
    cells: &[OrdinalCell],
    covariate: &[f64],
    priors: &OrdinalPriors,
    margin: Option<f64>,
    effort: OrdinalEffort,
    random: &mut impl RandomSource,
) -> Result<OrdinalHierarchy, OrdinalError> {
    let data = Data::new(cells, covariate)?;
    let chains: Vec<Vec<Draw>> = (0..effort.chains)
        .map(|_| {
            let seed = random.below(u64::MAX);
            let mut chain = Chain::new(&data, priors, SplitMix64::new(seed));
            (0..effort.warmup).for_each(|_| chain.step());
            let draw = |_| {
                chain.step();
                chain.draw()
            };
            (0..effort.draws).map(draw).collect()
        })
        .collect();
    Ok(summary(&data, &chains, margin))
}

/// The data, checked.
struct Data {
    participants: usize,
    realizations: usize,
    categories: usize,
    cells: Vec<OrdinalCell>,
    /// x; empty without β.
    covariate: Vec<f64>,
}

impl Data {
    fn new(cells: &[OrdinalCell], covariate: &[f64]) -> Result<Self, OrdinalError> {
        let number =
            |of: fn(&OrdinalCell) -> usize| cells.iter().map(of).max().map_or(0, |n| n + 1);
        let participants = number(|c| c.participant);
        let realizations = number(|c| c.realization);
        let categories = cells.first().map_or(0, |c| c.counts.len());
        let alike = cells.iter().all(|c| c.counts.len() == categories);
        if !(2..=MAX_CATEGORIES).contains(&categories) || !alike {
            return Err(OrdinalError::Categories);
        }
        if participants < 2 || realizations < 2 {
            return Err(OrdinalError::TooFew);
        }
        let used = |k: usize| cells.iter().any(|c| c.counts[k] > 0);
        if (0..categories).filter(|k| used(*k)).count() < 2 {
            return Err(OrdinalError::Constant);
        }
        let fits = covariate.is_empty() || covariate.len() == realizations;
        if !fits || covariate.iter().any(|x| !x.is_finite()) {
            return Err(OrdinalError::Covariate);
        }
        Ok(Self {
            participants,
            realizations,
            categories,
            cells: (cells.iter())
                .filter(|c| c.counts.iter().any(|n| *n > 0))
                .cloned()
                .collect(),
            covariate: covariate.to_vec(),
        })
    }
}

fn summary(data: &Data, chains: &[Vec<Draw>], margin: Option<f64>) -> OrdinalHierarchy {
    let all = || chains.iter().flatten();
    let n = all().count() as f64;
    let mut traced: Vec<Vec<Vec<f64>>> = Vec::new();
    let mut of = |quantity: &dyn Fn(&Draw) -> f64| {
        let traces: Vec<Vec<f64>> = (chains.iter())
            .map(|chain| chain.iter().map(quantity).collect())
            .collect();
        let found = posterior(&traces);
        traced.push(traces);
        found
    };
    let k = data.realizations;
    let centered = |draw: &Draw, j: usize| {
        let mean = draw.realizations.iter().sum::<f64>() / k as f64;
        draw.realizations[j] - mean
    };
    let realizations = (0..k).map(|j| of(&|draw| centered(draw, j))).collect();
    let pairs = (0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b)));
    let differences = pairs
        .map(|(first, second)| {
            let difference = |draw: &Draw| draw.realizations[first] - draw.realizations[second];
            let share =
                |is: &dyn Fn(&Draw) -> bool| all().filter(|draw| is(draw)).count() as f64 / n;
            OrdinalDifference {
                first,
                second,
                difference: of(&difference),
                above: share(&|draw| difference(draw) > 0.0),
                equivalent: (margin.filter(|_| data.categories > 2))
                    .map(|margin| share(&|draw| difference(draw).abs() < margin * draw.category())),
            }
        })
        .collect();
    let has_slope = !data.covariate.is_empty();
    let slope = has_slope.then(|| of(&|draw| draw.slope));
    let between_realizations = of(&|draw| draw.spread[0]);
    let between_participants = of(&|draw| draw.spread[1]);
    let interaction = of(&|draw| draw.spread[2]);
    let lapse = of(&|draw| draw.lapse);
    let thresholds = (0..data.categories - 1)
        .map(|i| of(&|draw| draw.thresholds[i]))
        .collect();
    let probable = |is: &dyn Fn(f64, f64) -> bool| {
        let is_end = |draw: &&Draw, j: usize| {
            let own = draw.realizations[j];
            draw.realizations.iter().all(|other| is(own, *other))
        };
        let of = |j: usize| all().filter(|draw| is_end(draw, j)).count() as f64 / n;
        (0..k).map(of).collect::<Vec<f64>>()
    };
    OrdinalHierarchy {
        realizations,
        highest: probable(&|own, other| own >= other),
        lowest: probable(&|own, other| own <= other),
        differences,
        slope,
        slope_above: has_slope.then(|| all().filter(|draw| draw.slope > 0.0).count() as f64 / n),
        between_realizations,
        between_participants,
        interaction,
        lapse,
        thresholds,
        convergence: convergence(&traced),
    }
}

fn posterior(traces: &[Vec<f64>]) -> Posterior {
    let mut all: Vec<f64> = traces.iter().flatten().copied().collect();
    all.sort_by(f64::total_cmp);
    let quantile = |p: f64| super::describe::quantile(&all, p).unwrap_or(f64::NAN);
    Posterior {
        mean: super::describe::mean(&all).unwrap_or(f64::NAN),
        sd: super::describe::sd(&all).unwrap_or(f64::NAN),
        median: quantile(0.5),
        ci95: (quantile(0.025), quantile(0.975)),
    }
}
