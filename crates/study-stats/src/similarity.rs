//! Similarity: how different participants say that stimuli are, two at a time. Means and agreement,
//! whether the order within a pair matters, a map in which distances stand for differences
//! ([`scaling`]), its number of dimensions and whether it is better than chance ([`dimensions`]), how it
//! lies to known properties of the stimuli ([`fit`]), and how participants weigh its dimensions ([`individual`]).
//!
//! A pair that was not rated has no dissimilarity; maps give it the weight 0.

pub mod dimensions;
pub mod fit;
pub mod individual;
pub mod scaling;

use super::correlation::pearson;
use super::describe;
use super::friedman::friedman;
use super::random::RandomSource;

/// Most rounds of [`Dissimilarities::in_common`], and the change of a factor after which there is none more.
const ROUNDS: usize = 1_000;
const CLOSE: f64 = 1e-12;

/// The dissimilarities of the pairs of some objects: 0 if two are alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Dissimilarities {
    objects: usize,
    /// By pair, in the order of [`pairs`].
    values: Vec<Option<f64>>,
}

/// The pairs of objects (a, b) with a < b: (0, 1), (0, 2), … (1, 2), ….
pub fn pairs(objects: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..objects).flat_map(move |a| (a + 1..objects).map(move |b| (a, b)))
}

impl Dissimilarities {
    /// Those that `of` gives for two objects (a, b) with a < b.
    pub fn from_fn(objects: usize, of: impl Fn(usize, usize) -> Option<f64>) -> Self {
        Self {
            objects,
            values: pairs(objects).map(|(a, b)| of(a, b)).collect(),
        }
    }

    /// Number of objects.
    pub fn objects(&self) -> usize {
        self.objects
    }

    /// By pair, in the order of [`pairs`].
    pub fn values(&self) -> &[Option<f64>] {
        &self.values
    }

    /// The dissimilarity of two objects, in any order. `None` of an object and itself.
    pub fn get(&self, a: usize, b: usize) -> Option<f64> {
        let (a, b) = (a.min(b), a.max(b));
        let before = a * (2 * self.objects - a - 1) / 2;
        let place = (a < b && b < self.objects).then(|| before + b - a - 1);
        self.values[place?]
    }

    /// Those that are known.
    pub fn known(&self) -> Vec<f64> {
        self.values.iter().copied().flatten().collect()
    }

    /// Each divided by their mean, so that it is 1 and no difference stays 0: who uses a smaller part of a scale counts as
    /// much as the others. `None` without a dissimilarity above 0.
    pub fn rescaled(&self) -> Option<Self> {
        let mean = describe::mean(&self.known()).filter(|mean| *mean > 0.0)?;
        Some(self.divided(mean))
    }

    /// The mean of each pair over those who rated it; all have the same objects. `None` of nobody.
    pub fn mean<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
        let objects = all.clone().next()?.objects;
        let of_pair = |pair: usize| {
            let rated: Vec<f64> = all.clone().filter_map(|own| own.values[pair]).collect();
            describe::mean(&rated)
        };
        Some(Self {
            objects,
            values: (0..pairs(objects).count()).map(of_pair).collect(),
        })
    }

    /// What some have in common: the mean of each pair over those who rated it, after each one's were divided by a factor. Where
    /// all rated the same pairs the factors are 1, and this is [`Self::mean`]. Otherwise the mean of all that one rated says which
    /// pairs they were, too, so that a factor is the sum of what one rated over that of the common values of the same pairs, found by turns
    /// (iterative proportional fitting, Deming & Stephan 1940). `None` of nobody.
    ///
    /// ```
    /// # use study_stats::similarity::Dissimilarities;
    /// let near = Dissimilarities::from_fn(4, |a, b| (b - a < 3).then_some((b - a) as f64));
    /// let far = Dissimilarities::from_fn(4, |a, b| (b - a > 1).then_some(5.0 * (b - a) as f64));
    /// let found = Dissimilarities::in_common([near, far].iter()).unwrap();
    /// let ratio = found.get(0, 3).unwrap() / found.get(0, 1).unwrap();
    /// assert!((ratio - 3.0).abs() < 1e-9);
    /// ```
    pub fn in_common<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
        let people: Vec<&Self> = all.clone().collect();
        let mut common = Self::mean(all)?;
        let whole = |own: &&Self| own.values.iter().all(Option::is_some);
        if people.iter().all(whole) {
            return Some(common);
        }
        let mut factors = vec![1.0; people.len()];
        for _ in 0..ROUNDS {
            let mut most: f64 = 0.0;
            for (own, factor) in people.iter().zip(&mut factors) {
                let (rated, expected) = own.common(&common);
                let found = rated.iter().sum::<f64>() / expected.iter().sum::<f64>();
                if let Some(found) = super::finite(found).filter(|found| *found > 0.0) {
                    most = most.max((found / *factor - 1.0).abs());
                    *factor = found;
                }
            }
            let divided: Vec<Self> = (people.iter().zip(&factors))
                .map(|(own, factor)| own.divided(*factor))
                .collect();
            common = Self::mean(divided.iter())?;
            if most < CLOSE {
                break;
            }
        }
        Some(common)
    }

    fn divided(&self, by: f64) -> Self {
        let values = self.values.iter();
        Self {
            objects: self.objects,
            values: values.map(|value| Some((*value)? / by)).collect(),
        }
    }

    /// Those that two have both, in the same order.
    fn common(&self, other: &Self) -> (Vec<f64>, Vec<f64>) {
        let both = self.values.iter().zip(&other.values);
        both.filter_map(|(a, b)| Some(((*a)?, (*b)?))).unzip()
    }

    /// Pearson's correlation with those of another, over the pairs that both have.
    pub fn correlation(&self, other: &Self) -> Option<f64> {
        let (own, others) = self.common(other);
        pearson(&own, &others)
    }
}

/// Whether participants find the same pairs different.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Mean over all pairs of participants of the correlation of their dissimilarities. `None` if no two have one.
    pub mean_correlation: Option<f64>,
    /// Kendall's W (1939) of the participants who rated every pair that anybody rated, corrected for ties. `None` with fewer than two.
    pub kendall_w: Option<f64>,
    /// Participants on whom W rests.
    pub complete: usize,
}

/// The agreement of participants.
///
/// ```
/// # use study_stats::similarity::{Dissimilarities, agreement};
/// let own = Dissimilarities::from_fn(4, |a, b| Some((b - a) as f64));
/// let twice = Dissimilarities::from_fn(4, |a, b| Some(2.0 * (b - a) as f64));
/// let found = agreement(&[own, twice]);
/// assert!((found.mean_correlation.unwrap() - 1.0).abs() < 1e-12);
/// assert_eq!(found.kendall_w, Some(1.0));
/// ```
pub fn agreement(participants: &[Dissimilarities]) -> Agreement {
    let correlations: Vec<f64> = pairs(participants.len())
        .filter_map(|(a, b)| participants[a].correlation(&participants[b]))
        .collect();
    // Pairs that nobody was to rate are missing to nobody.
    let all = participants.first().map_or(0, |own| own.values.len());
    let rated: Vec<usize> = (0..all)
        .filter(|pair| participants.iter().any(|own| own.values[*pair].is_some()))
        .collect();
    let complete: Vec<Vec<f64>> = (participants.iter())
        .filter_map(|own| rated.iter().map(|pair| own.values[*pair]).collect())
        .collect();
    Agreement {
        mean_correlation: describe::mean(&correlations),
        kendall_w: friedman(&complete).and_then(|found| found.kendall_w),
        complete: complete.len(),
    }
}

/// How each of some participants agrees with the mean of the others: the correlation of their dissimilarities.
pub fn with_the_others(participants: &[Dissimilarities]) -> Vec<Option<f64>> {
    let of = |(own, mine): (usize, &Dissimilarities)| {
        let others = (participants.iter().enumerate()).filter(|(at, _)| *at != own);
        let mean = Dissimilarities::in_common(others.map(|(_, other)| other))?;
        mine.correlation(&mean)
    };
    participants.iter().enumerate().map(of).collect()
}

/// Number of random choices of signs in [`asymmetry`].
pub const SIGNS: u32 = 9_999;

/// Whether it matters which of two is felt first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asymmetry {
    /// Root mean square over pairs of the mean difference between the two orders, in the units of the ratings.
    pub rms: f64,
    /// (b + 1)/(B + 1), where b of B = [`SIGNS`] random choices of the signs of all differences give an `rms`
    /// that is at least as large.
    pub p: f64,
    /// Pairs that somebody rated in both orders.
    pub pairs: usize,
    /// Their differences, of all participants.
    pub differences: usize,
}

/// Whether the two orders of pairs are rated alike. `differences` are those of each participant, by pair: the
/// rating with the first object first less that with the second first. If the order does not matter, each has either sign with
/// equal probability. `None` without a difference.
pub fn asymmetry(
    differences: &[Vec<Option<f64>>],
    random: &mut impl RandomSource,
) -> Option<Asymmetry> {
    let most = differences.iter().map(Vec::len).max()?;
    let of_pair = |pair: usize| -> Vec<f64> {
        let own = differences.iter();
        own.filter_map(|own| own.get(pair).copied().flatten())
            .collect()
    };
    let mut by_pair: Vec<Vec<f64>> = (0..most).map(of_pair).collect();
    by_pair.retain(|own| !own.is_empty());
    let pairs = by_pair.len();
    let rms = |by_pair: &[Vec<f64>]| {
        let squares = by_pair.iter().map(|own| {
            let mean = own.iter().sum::<f64>() / own.len() as f64;
            mean * mean
        });
        (squares.sum::<f64>() / pairs as f64).sqrt()
    };
    let found = super::finite(rms(&by_pair)).filter(|_| pairs > 0)?;
    let mut as_large = 1u32;
    for _ in 0..SIGNS {
        for difference in by_pair.iter_mut().flatten() {
            if random.below(2) == 0 {
                *difference = -*difference;
            }
        }
        as_large += u32::from(rms(&by_pair) >= found - 1e-9 * found.abs());
    }
    Some(Asymmetry {
        rms: found,
        p: f64::from(as_large) / f64::from(SIGNS + 1),
        pairs,
        differences: by_pair.iter().map(Vec::len).sum(),
    })
}

#[cfg(test)]
mod tests;
