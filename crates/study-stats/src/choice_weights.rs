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
//! predicted. The function is concave and has one maximum, which is found by Newton's method with bounds.
//!
//! λ is chosen by cross-validation over participants, and what is predicted of choices that were left out is compared
//! with the prediction by equal weights (`left_out`). The interval of a share is Fieller's (1954): every s for which
//! w_k − s Σ w is not told from 0, by t with Bonferroni's correction for the number of components. It is from 0 to 1 if
//! the sum of the weights is not told from 0. Its covariance is that of the weights, with the least λ and without the bound
//! at 0, over a bootstrap of participants: it says what the choices alone tell.

mod left_out;

pub use left_out::LeftOut;

use super::distribution::t_quantile;
use super::matrix::{Cholesky, SymmetricMatrix};
use super::preference_gp::probit::of_answer;
use super::random::RandomSource;
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
/// ε, the penalty on the size of weights.
const SIZE: f64 = 1e-3;

const MOST_STEPS: usize = 100;
const MOST_SWEEPS: usize = 10_000;
/// A search ends when no weight changes by more than this, or this part of the largest.
const NEAR: f64 = 1e-9;
/// Rounding errors of the objective, as a part of it.
const SLACK: f64 = 1e-12;

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

/// How much weights that differ are penalized.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Penalty {
    /// λ = ∞: all weights are equal.
    Equal,
    /// This λ, at least 0.
    Unequal(f64),
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

    /// The weights of scaled errors; `None` if numbers overflow.
    fn fit(&self, counts: &[f64], penalty: Penalty) -> Option<Vec<f64>> {
        let k = self.rows.first()?.len();
        match penalty {
            Penalty::Unequal(lambda) => maximum(&self.rows, counts, [lambda, SIZE], 0.0),
            Penalty::Equal => {
                let sum = |row: &Vec<f64>| vec![row.iter().sum::<f64>()];
                let sums: Vec<Vec<f64>> = self.rows.iter().map(sum).collect();
                let found = maximum(&sums, counts, [0.0, SIZE * k as f64], 0.0)?;
                Some(vec![*found.first()?; k])
            }
        }
    }
}

/// Weights of scaled errors that may be below 0, with their covariance over resamples.
#[derive(Debug)]
struct Free {
    weights: Vec<f64>,
    covariance: SymmetricMatrix,
    /// The sum of equal weights, and its variance.
    equal: (f64, f64),
    /// Units less 1.
    df: f64,
}

impl Free {
    /// `None` if numbers overflow.
    fn of(data: &Data, random: &mut impl RandomSource) -> Option<Self> {
        let k = data.rows.first()?.len();
        let sum = |row: &Vec<f64>| vec![row.iter().sum::<f64>()];
        let sums: Vec<Vec<f64>> = data.rows.iter().map(sum).collect();
        let fit = |counts: &[f64]| -> Option<(Vec<f64>, f64)> {
            let least = f64::NEG_INFINITY;
            let weights = maximum(&data.rows, counts, [LEAST, SIZE], least)?;
            let equal = maximum(&sums, counts, [0.0, SIZE * k as f64], least)?;
            Some((weights, k as f64 * equal.first()?))
        };
        let (weights, equal) = fit(&data.all())?;
        let n = data.units.len();
        let mut found = Vec::new();
        for _ in 0..RESAMPLES {
            let mut times = vec![0.0; n];
            for _ in 0..n {
                // Below the number of units, which is a usize.
                times[random.below(n as u64) as usize] += 1.0;
            }
            found.push(fit(&data.counts(times.into_iter().enumerate()))?);
        }
        let df = n as f64 - 1.0;
        let drawn = found.len() as f64;
        // Resamples of n units vary less by (n − 1)/n.
        let each = (df + 1.0) / (df * (drawn - 1.0));
        let mean = |i: usize| found.iter().map(|(w, _)| w[i]).sum::<f64>() / drawn;
        let means: Vec<f64> = (0..k).map(mean).collect();
        let equal_mean = found.iter().map(|(_, sum)| sum).sum::<f64>() / drawn;
        let mut covariance = SymmetricMatrix::zero(k);
        let mut variance = 0.0;
        for (own, sum) in &found {
            let apart: Vec<f64> = own.iter().zip(&means).map(|(w, mean)| w - mean).collect();
            covariance.add_outer(each, &apart);
            variance += each * (sum - equal_mean).powi(2);
        }
        Some(Self {
            weights,
            covariance,
            equal: (equal, variance),
            df,
        })
    }

    /// The covariance of a weight with the sum of all.
    fn with_sum(&self, i: usize) -> f64 {
        (0..self.weights.len())
            .map(|j| self.covariance.get(i, j))
            .sum()
    }

    /// 95 % interval of the sum of equal weights.
    fn equal_sum(&self) -> (f64, f64) {
        let (sum, variance) = self.equal;
        let t = t_quantile(0.975, self.df).unwrap_or(f64::INFINITY);
        let half = t * variance.max(0.0).sqrt();
        (sum - half, sum + half)
    }

    /// The interval of a share, within 0 and 1.
    fn share(&self, i: usize) -> (f64, f64) {
        let sum: f64 = self.weights.iter().sum();
        let of_sum: f64 = (0..self.weights.len()).map(|j| self.with_sum(j)).sum();
        let (own, of_own, both) = (self.weights[i], self.covariance.get(i, i), self.with_sum(i));
        let level = 1.0 - 0.025 / self.weights.len() as f64;
        let t = t_quantile(level, self.df).unwrap_or(f64::INFINITY);
        let square = t * t;
        // a s² − 2 b s + c ≤ 0
        let a = sum * sum - square * of_sum;
        let b = own * sum - square * both;
        let c = own * own - square * of_own;
        if !(a > 0.0 && sum > 0.0) {
            return (0.0, 1.0);
        }
        let root = (b * b - a * c).max(0.0).sqrt();
        let end = |sign: f64| ((b + sign * root) / a).clamp(0.0, 1.0);
        (end(-1.0), end(1.0))
    }
}

/// Minus the logarithm of the likelihood, with the penalty, and its derivatives.
struct Objective {
    value: f64,
    gradient: Vec<f64>,
    curvature: SymmetricMatrix,
}

impl Objective {
    fn at(w: &[f64], rows: &[Vec<f64>], counts: &[f64], [lambda, size]: [f64; 2]) -> Self {
        let k = w.len();
        let mean = w.iter().sum::<f64>() / k as f64;
        let apart = |w: &f64| lambda * (w - mean).powi(2) + size * w * w;
        let mut found = Self {
            value: 0.5 * w.iter().map(apart).sum::<f64>(),
            gradient: w.iter().map(|w| lambda * (w - mean) + size * w).collect(),
            curvature: SymmetricMatrix::from_fn(k, |i, j| {
                let same = f64::from(u8::from(i == j));
                lambda * (same - 1.0 / k as f64) + size * same
            }),
        };
        for (row, n) in rows.iter().zip(counts).filter(|(_, n)| **n > 0.0) {
            let (log, slope, curvature) = of_answer(advantage(row, w));
            found.value -= n * log;
            for (g, d) in found.gradient.iter_mut().zip(row) {
                *g -= n * slope * d;
            }
            found.curvature.add_outer(n * curvature, row);
        }
        found
    }

    /// The step to the smallest value of the quadratic around `w` over weights of at least `least`, by coordinate descent.
    fn step(&self, w: &[f64], least: f64) -> Vec<f64> {
        let mut step = vec![0.0; w.len()];
        for _ in 0..MOST_SWEEPS {
            let (mut change, mut size) = (0.0f64, 0.0f64);
            for (i, own) in w.iter().enumerate() {
                let others: f64 = (step.iter().enumerate())
                    .map(|(j, s)| self.curvature.get(i, j) * s)
                    .sum();
                let slope = self.gradient[i] + others;
                let to = (step[i] - slope / self.curvature.get(i, i)).max(least - own);
                change = change.max((to - step[i]).abs());
                size = size.max((own + to).abs());
                step[i] = to;
            }
            if change <= 0.01 * NEAR * size.max(1.0) {
                break;
            }
        }
        step
    }
}

/// u of the preferred stimulus less that of the other one.
fn advantage(row: &[f64], w: &[f64]) -> f64 {
    row.iter().zip(w).map(|(d, w)| d * w).sum()
}

/// The weights of at least `least` with the largest penalized likelihood, by Newton's method with step halving. `None` if
/// numbers overflow.
fn maximum(rows: &[Vec<f64>], counts: &[f64], penalties: [f64; 2], least: f64) -> Option<Vec<f64>> {
    let mut w = vec![0.0; rows.first()?.len()];
    let mut now = Objective::at(&w, rows, counts, penalties);
    for _ in 0..MOST_STEPS {
        let step = now.step(&w, least);
        let mut share = 1.0;
        let (to, new) = loop {
            let moved = w.iter().zip(&step).map(|(w, s)| (w + share * s).max(least));
            let to: Vec<f64> = moved.collect();
            let new = Objective::at(&to, rows, counts, penalties);
            if new.value <= now.value + SLACK * now.value.abs() {
                break (to, new);
            }
            share *= 0.5;
            // Also if a number is not finite.
            if share < 1e-9 {
                return None;
            }
        };
        // Of the full step, which a shortened one does not make small.
        let change = step.iter().fold(0.0f64, |most, s| most.max(s.abs()));
        let size = to.iter().fold(1.0f64, |most, w| most.max(w.abs()));
        (w, now) = (to, new);
        if change <= NEAR * size {
            return Some(w);
        }
    }
    None
}

#[cfg(test)]
mod tests;
