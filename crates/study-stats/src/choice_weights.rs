//! What is weighed in choices: how much each component of an error tells of which of two stimuli is preferred.
//!
//! Stimulus i has errors e_ik ≥ 0, one for each component k. Its utility, in units of the noise of one impression, is
//! u_i = −Σ_k w_k e_ik with weights w_k ≥ 0, and of two stimuli the one whose impression is better is preferred:
//! P(i over j) = Φ((u_i − u_j)/√2), Thurstone's Case V. The sum of the weights is the sensitivity, their shares say what
//! is weighed.
//!
//! The weights have the largest logarithm of the likelihood less ½ λ Σ (w_k − w̄)² less ½ ε Σ w_k², after all errors were
//! divided by the root of the mean over the choices of Σ_k (e_jk − e_ik)². With λ = ∞ all weights are equal, so that the
//! sum of the errors is all that counts ([`Penalty::Equal`]); ε = 0.001 keeps weights finite if every choice is
//! predicted. Where few components count, those with small weights are left out by α Σ w_k/w⁰_k in place of the first
//! penalty, with the weights w⁰ of λ = 0.01 (Zou 2006): w_k is 0 if w⁰_k is less than about √α standard errors, and hardly
//! smaller than w⁰_k if it is many. The functions are concave and have one maximum, which is found by Newton's method with
//! bounds.
//!
//! The penalty is chosen by cross-validation over participants, and what is predicted of choices that were left out is compared
//! with the prediction by equal weights (`left_out`). The interval of a share is Fieller's (1954): every s for which
//! w_k − s Σ w is not told from 0, by t with Bonferroni's correction for the number of components. It is from 0 to 1 if
//! the sum of the weights is not told from 0. Its covariance is that of the weights, with the least λ and without the bound
//! at 0, over a bootstrap of participants: it says what the choices alone tell.

mod free;
mod left_out;
mod maximum;

pub use left_out::LeftOut;

use super::matrix::{Cholesky, SymmetricMatrix};
use super::random::RandomSource;
use free::Free;
use maximum::{Terms, maximum};
use std::collections::BTreeMap;
use thiserror::Error;

/// With fewer participants than this choices are left out and resampled one by one, and what is found is of these
/// participants only.
pub const FEWEST_PEOPLE: usize = 5;
/// Fewest choices.
pub const FEWEST_CHOICES: usize = 10;
/// Most components: the work grows with their cube.
pub const MOST_COMPONENTS: usize = 20;
/// Resamples of the bootstrap.
pub const RESAMPLES: u32 = 1000;
/// λ from which one is chosen besides ∞, the strongest first.
const LAMBDAS: [f64; 6] = [1e3, 1e2, 1e1, 1.0, 1e-1, LEAST];
/// The least λ.
const LEAST: f64 = 1e-2;
/// α from which one is chosen besides, the strongest first.
const ALPHAS: [f64; 3] = [8.0, 4.0, 2.0];
/// ε, the penalty on the size of weights.
const SIZE: f64 = 1e-3;

/// An answer: of two stimuli, one was preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chosen {
    /// Index of the stimulus that was preferred.
    pub preferred: usize,
    /// Index of the other one.
    pub other: usize,
    /// Index of the participant.
    pub participant: usize,
}

/// How weights are penalized.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Penalty {
    /// λ = ∞: all weights are equal.
    Equal,
    /// This λ, at least 0.
    Unequal(f64),
    /// This α, at least 0.
    Sparse(f64),
}

/// Why nothing is known of weights.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NoWeights {
    /// No component or too many, or stimuli with another number of them.
    #[error("stimuli need the same 1 to {MOST_COMPONENTS} components of their error")]
    Components,
    /// An error that is not finite.
    #[error("an error is not a finite number")]
    NotFinite,
    /// A choice of a stimulus that there is not, or between a stimulus and itself.
    #[error("choice {0} is not between two of the stimuli")]
    Choice(usize),
    /// Fewer than [`FEWEST_CHOICES`].
    #[error("{0} choices are too few; {FEWEST_CHOICES} are needed")]
    TooFew(usize),
    /// The stimuli of every choice have the same errors.
    #[error("the errors of the stimuli that were compared do not differ")]
    Alike,
    /// The search found no maximum.
    #[error("no weights were found with which the choices are most likely")]
    NotFound,
}

/// What choices tell of weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighed {
    /// The weight of each component, in units of the noise of one impression per unit of error.
    pub weights: Vec<f64>,
    /// Their shares, which sum to 1; `None` if all weights are 0.
    pub shares: Option<Vec<f64>>,
    /// The interval of each share; all of them hold together with 95 %.
    pub shares_ci95: Vec<(f64, f64)>,
    /// 95 % interval of the sum of equal weights that may be below 0: the sum of the errors is known to be weighed if the
    /// interval is above 0.
    pub sensitivity_ci95: (f64, f64),
    /// The penalty that was chosen.
    pub penalty: Penalty,
    /// Choices.
    pub choices: usize,
    /// Participants with a choice.
    pub participants: usize,
    /// Whether participants were left out and resampled, and not single choices.
    pub over_participants: bool,
    /// The prediction of participants who were left out, or of choices.
    pub left_out: Option<LeftOut>,
    /// The prediction of choices between stimuli of which one or both were left out.
    pub other_stimuli: Option<LeftOut>,
}

/// How the differences of components over the choices lie to each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Root mean square over the choices of the difference of each component.
    pub rms: Vec<f64>,
    /// Cosine of the differences of two components over the choices: ±1 if they vary together, 0 if one does not vary.
    pub cosine: Vec<Vec<f64>>,
    /// The part of each component's sum of squared differences that no weighted sum of the others has; 0 if it
    /// does not vary.
    pub own: Vec<f64>,
}

/// The shares of weights; `None` if all of them are 0.
pub fn shares(weights: &[f64]) -> Option<Vec<f64>> {
    let sum: f64 = weights.iter().sum();
    (sum > 0.0).then(|| weights.iter().map(|w| w / sum).collect())
}

/// How components differ over the choices.
///
/// # Errors
/// [`NoWeights`].
pub fn spread(errors: &[Vec<f64>], chosen: &[Chosen]) -> Result<Spread, NoWeights> {
    let k = components(errors)?;
    check(errors, chosen)?;
    let mut products = SymmetricMatrix::zero(k);
    for one in chosen {
        products.add_outer(1.0, &difference(errors, one));
    }
    let root = |i: usize| products.get(i, i).sqrt();
    let cosine = |i: usize, j: usize| match root(i) * root(j) {
        0.0 => 0.0,
        size => (products.get(i, j) / size).clamp(-1.0, 1.0),
    };
    let own = |last: usize| {
        let mut order: Vec<usize> = (0..k).filter(|i| *i != last).collect();
        order.push(last);
        let turned = SymmetricMatrix::from_fn(k, |i, j| products.get(order[i], order[j]));
        let factor = Cholesky::semidefinite(&turned, |_| 1e-12);
        let left = factor.and_then(|factor| factor.pivots.last().copied());
        match products.get(last, last) {
            0.0 => 0.0,
            all => left.unwrap_or(0.0) / all,
        }
    };
    let n = chosen.len() as f64;
    Ok(Spread {
        rms: (0..k).map(|i| root(i) / n.sqrt()).collect(),
        cosine: (0..k)
            .map(|i| (0..k).map(|j| cosine(i, j)).collect())
            .collect(),
        own: (0..k).map(own).collect(),
    })
}

/// The weights with one penalty.
///
/// # Errors
/// [`NoWeights`].
///
/// ```
/// # use study_stats::choice_weights::{Chosen, NoWeights, Penalty, fit, shares};
/// // Of two components only the first one decides.
/// let errors = [vec![0.0, 1.0], vec![1.0, 0.0], vec![1.0, 1.0], vec![0.0, 0.0]];
/// let choose = |preferred, other| Chosen { preferred, other, participant: 0 };
/// let mut chosen = vec![choose(0, 1), choose(0, 2), choose(3, 1), choose(3, 2)];
/// chosen.extend([choose(0, 3), choose(3, 0), choose(1, 2), choose(2, 1)]);
/// chosen.extend_from_within(..);
/// let weights = fit(&errors, &chosen, Penalty::Unequal(0.01))?;
/// assert!(shares(&weights).is_some_and(|shares| shares[0] > 0.9));
/// # Ok::<(), NoWeights>(())
/// ```
pub fn fit(
    errors: &[Vec<f64>],
    chosen: &[Chosen],
    penalty: Penalty,
) -> Result<Vec<f64>, NoWeights> {
    let data = Data::new(errors, chosen)?;
    let weights = data.fit(&data.all(), penalty);
    let weights = weights.ok_or(NoWeights::NotFound)?;
    Ok(weights.iter().map(|w| w / data.scale).collect())
}

/// The weights with a penalty that is chosen by cross-validation, their intervals, and what they predict.
///
/// # Errors
/// [`NoWeights`].
pub fn weigh(
    errors: &[Vec<f64>],
    chosen: &[Chosen],
    random: &mut impl RandomSource,
) -> Result<Weighed, NoWeights> {
    let data = Data::new(errors, chosen)?;
    let everybody: Vec<usize> = (0..data.units.len()).collect();
    let penalty = left_out::penalty(&data, &everybody);
    let weights = data.fit(&data.all(), penalty);
    let weights = weights.ok_or(NoWeights::NotFound)?;
    let shares = shares(&weights);
    let free = Free::of(&data, random).ok_or(NoWeights::NotFound)?;
    let ci95 = |i: usize| {
        let (low, high) = free.share(i);
        let own = shares.as_ref().map(|shares| shares[i]);
        (low.min(own.unwrap_or(low)), high.max(own.unwrap_or(high)))
    };
    let (low, high) = free.equal_sum();
    Ok(Weighed {
        weights: weights.iter().map(|w| w / data.scale).collect(),
        shares_ci95: (0..weights.len()).map(ci95).collect(),
        sensitivity_ci95: (low / data.scale, high / data.scale),
        shares,
        penalty,
        choices: chosen.len(),
        participants: data.participants,
        over_participants: data.over_participants,
        left_out: left_out::units(&data),
        other_stimuli: left_out::stimuli(&data),
    })
}

/// The number of components.
fn components(errors: &[Vec<f64>]) -> Result<usize, NoWeights> {
    let k = errors.first().map_or(0, Vec::len);
    if !(1..=MOST_COMPONENTS).contains(&k) || errors.iter().any(|e| e.len() != k) {
        return Err(NoWeights::Components);
    }
    if errors.iter().flatten().any(|e| !e.is_finite()) {
        return Err(NoWeights::NotFinite);
    }
    Ok(k)
}

fn check(errors: &[Vec<f64>], chosen: &[Chosen]) -> Result<(), NoWeights> {
    let wrong = |c: &Chosen| c.preferred.max(c.other) >= errors.len() || c.preferred == c.other;
    if let Some(place) = chosen.iter().position(wrong) {
        return Err(NoWeights::Choice(place));
    }
    match chosen.len() {
        few @ 0..FEWEST_CHOICES => Err(NoWeights::TooFew(few)),
        _ => Ok(()),
    }
}

/// The errors of the other stimulus less those of the preferred one.
fn difference(errors: &[Vec<f64>], chosen: &Chosen) -> Vec<f64> {
    let both = errors[chosen.other].iter().zip(&errors[chosen.preferred]);
    both.map(|(other, preferred)| other - preferred).collect()
}

/// Choices, each pair once.
#[derive(Debug, Clone)]
struct Data {
    /// By pair: the preferred stimulus and the other one.
    pairs: Vec<[usize; 2]>,
    /// By pair: the scaled errors of the other one less those of the preferred one.
    rows: Vec<Vec<f64>>,
    /// What is left out and resampled: pairs, and how often each was chosen.
    units: Vec<Vec<(usize, f64)>>,
    participants: usize,
    over_participants: bool,
    /// By which errors were divided.
    scale: f64,
}

impl Data {
    fn new(errors: &[Vec<f64>], chosen: &[Chosen]) -> Result<Self, NoWeights> {
        components(errors)?;
        check(errors, chosen)?;
        let mut rows: BTreeMap<[usize; 2], Vec<f64>> = BTreeMap::new();
        let mut people: BTreeMap<usize, BTreeMap<[usize; 2], f64>> = BTreeMap::new();
        let mut squares = 0.0;
        for one in chosen {
            let pair = [one.preferred, one.other];
            let row = difference(errors, one);
            squares += row.iter().map(|d| d * d).sum::<f64>();
            rows.insert(pair, row);
            let own = people.entry(one.participant).or_default();
            *own.entry(pair).or_default() += 1.0;
        }
        let scale = (squares / chosen.len() as f64).sqrt();
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(NoWeights::Alike);
        }
        let pairs: Vec<[usize; 2]> = rows.keys().copied().collect();
        let place = |pair: &[usize; 2]| pairs.binary_search(pair).unwrap_or_default();
        let over_participants = people.len() >= FEWEST_PEOPLE;
        let units = match over_participants {
            true => (people.values())
                .map(|own| own.iter().map(|(pair, n)| (place(pair), *n)).collect())
                .collect(),
            false => (chosen.iter())
                .map(|one| vec![(place(&[one.preferred, one.other]), 1.0)])
                .collect(),
        };
        let mut rows: Vec<Vec<f64>> = rows.into_values().collect();
        rows.iter_mut().flatten().for_each(|d| *d /= scale);
        Ok(Self {
            pairs,
            rows,
            units,
            participants: people.len(),
            over_participants,
            scale,
        })
    }

    /// How often each pair was chosen by these units, each counted so many times.
    fn counts(&self, units: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
        let mut counts = vec![0.0; self.rows.len()];
        for (unit, times) in units {
            for (row, n) in &self.units[unit] {
                counts[*row] += times * n;
            }
        }
        counts
    }

    /// How often each pair was chosen.
    fn all(&self) -> Vec<f64> {
        self.counts((0..self.units.len()).map(|unit| (unit, 1.0)))
    }

    /// The sum of each row.
    fn sums(&self) -> Vec<Vec<f64>> {
        let sum = |row: &Vec<f64>| vec![row.iter().sum::<f64>()];
        self.rows.iter().map(sum).collect()
    }

    /// The weights of scaled errors; `None` if numbers overflow.
    fn fit(&self, counts: &[f64], penalty: Penalty) -> Option<Vec<f64>> {
        let k = self.rows.first()?.len();
        match penalty {
            Penalty::Unequal(lambda) => maximum(&self.rows, counts, &Terms::of(k, lambda), 0.0),
            Penalty::Sparse(alpha) => {
                let first = self.fit(counts, Penalty::Unequal(LEAST))?;
                let kept: Vec<usize> = (0..k).filter(|i| first[*i] > 0.0).collect();
                let mut weights = vec![0.0; k];
                if kept.is_empty() {
                    return Some(weights);
                }
                let of_kept = |row: &Vec<f64>| kept.iter().map(|i| row[*i]).collect();
                let rows: Vec<Vec<f64>> = self.rows.iter().map(of_kept).collect();
                let slopes = kept.iter().map(|i| alpha / first[*i]).collect();
                let found = maximum(&rows, counts, &Terms::with(slopes), 0.0)?;
                for (i, weight) in kept.into_iter().zip(found) {
                    weights[i] = weight;
                }
                Some(weights)
            }
            Penalty::Equal => {
                let found = maximum(&self.sums(), counts, &Terms::of_equal(k), 0.0)?;
                Some(vec![*found.first()?; k])
            }
        }
    }
}

#[cfg(test)]
mod tests;
