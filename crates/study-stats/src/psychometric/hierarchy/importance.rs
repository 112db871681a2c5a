//! Weighted draws of a population's parameters.
//!
//! The mode of the posterior is found by Newton's method with numerical derivatives. Draws about
//! it, in three rounds, show the covariance of the posterior and, as it is not normal, its shape: those
//! of the third round and the final ones are from a mixture of t distributions about draws of
//! the round before and of a wide one about the mean. Their places come from a lattice (Kronecker's sequence of powers of the
//! root of x^(d+1) = x + 1), shifted at random for each set, so that a set is independent of the
//! others and its mean has no bias.

use super::marginal::Model;
use super::{Diagnostics, Effort};
use crate::distribution::t_quantile;
use crate::matrix::{Cholesky, SymmetricMatrix};
use crate::random::RandomSource;

/// Degrees of freedom of the draws.
const DF: f64 = 5.0;
/// Draws of each of the rounds in which the posterior is learned; the last one has twice as many.
const LEARNING: usize = 512;
/// Until so large a share of the final draws is effective, twice as many are made anew about them, in
/// so many rounds at most.
const MOST_ROUNDS: usize = 3;
const ENOUGH: f64 = 0.3;
/// Draws of a round about which the next ones are made.
const CENTERS: usize = 160;
/// Standard deviation about them, in those of the posterior.
const AROUND: f64 = 0.75;
/// Standard deviation of the wide distribution, and its share of the draws.
const WIDE: (f64, f64) = (1.5, 0.2);
/// Values of the quantile function of t.
const QUANTILES: usize = 2048;

/// A draw.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draw {
    pub(super) at: Vec<f64>,
    /// Weights have the sum 1.
    pub(super) weight: f64,
    /// The set it belongs to.
    pub(super) set: usize,
}

/// Where draws are made: t distributions along the axes of L, of equal shape, about some centers.
struct Proposal {
    mean: Vec<f64>,
    /// L of the covariance.
    factor: Cholesky,
    /// Places in units of L, the scale there, and the logarithm of the share.
    centers: Vec<(Vec<f64>, f64, f64)>,
}

impl Proposal {
    /// One t distribution.
    fn single(mean: Vec<f64>, factor: Cholesky) -> Self {
        Self {
            centers: vec![(vec![0.0; mean.len()], 1.0, 0.0)],
            mean,
            factor,
        }
    }

    /// Logarithm of the density at a place in units of L, up to a constant.
    fn log_density(&self, place: &[f64]) -> f64 {
        let unit = DF - 2.0;
        let of_center = |(center, scale, share): &(Vec<f64>, f64, f64)| {
            let product: f64 = (place.iter().zip(center))
                .map(|(x, c)| 1.0 + ((x - c) / scale).powi(2) / unit)
                .product();
            share - place.len() as f64 * scale.ln() - 0.5 * (DF + 1.0) * product.ln()
        };
        let logs: Vec<f64> = self.centers.iter().map(of_center).collect();
        let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        highest + logs.iter().map(|l| (l - highest).exp()).sum::<f64>().ln()
    }
}

pub(super) fn draw(
    model: &Model<'_>,
    effort: Effort,
    random: &mut impl RandomSource,
) -> Option<Vec<Draw>> {
    let (start, scale) = model.start();
    let first = mode(|at| model.log_density(at), start, &scale)?;
    let table = Quantiles::new()?;
    let draws = weighted(model, &first, &table, (1, LEARNING), random)?;
    let second = learned(&first, &draws)?;
    let draws = weighted(model, &second, &table, (1, LEARNING), random)?;
    let third = mixture(learned(&second, &draws)?, &draws);
    let mut draws = weighted(model, &third, &table, (1, 2 * LEARNING), random)?;
    let mut proposal = third;
    for round in 0..MOST_ROUNDS {
        proposal = mixture(learned(&proposal, &draws)?, &draws);
        let size = (effort.sets.max(4), effort.draws << round);
        draws = weighted(model, &proposal, &table, size, random)?;
        if effective(&draws) >= ENOUGH * draws.len() as f64 {
            break;
        }
    }
    Some(draws)
}

/// (Σw)²/Σw² (Kish 1965), of weights whose sum is 1.
fn effective(draws: &[Draw]) -> f64 {
    1.0 / draws.iter().map(|d| d.weight * d.weight).sum::<f64>()
}

/// The mode and the inverse of the curvature there, somewhat widened.
fn mode(density: impl Fn(&[f64]) -> f64, mut at: Vec<f64>, scale: &[f64]) -> Option<Proposal> {
    let n = at.len();
    let mut value = density(&at);
    if !value.is_finite() {
        return None;
    }
    let mut steps: Vec<f64> = scale.iter().map(|s| 0.1 * s).collect();
    let mut damping = 1e-2;
    for _ in 0..60 {
        let (slope, information) = derivatives(&density, &at, value, &steps);
        let mut gain = 0.0;
        for _ in 0..12 {
            let damped = SymmetricMatrix::from_fn(n, |i, j| {
                let own = information.get(i, j);
                if i == j {
                    own + damping * own.abs().max(1.0 / (scale[i] * scale[i]))
                } else {
                    own
                }
            });
            let step = Cholesky::positive(&damped).map(|f| f.solve(&slope));
            let far = |s: &Vec<f64>| s.iter().zip(scale).any(|(s, by)| s.abs() > 4.0 * by);
            let Some(step) = step.filter(|s| !far(s)) else {
                damping *= 4.0;
                continue;
            };
            let next: Vec<f64> = at.iter().zip(&step).map(|(x, s)| x + s).collect();
            let found = density(&next);
            if found > value {
                gain = found - value;
                (at, value) = (next, found);
                damping = (0.2 * damping).max(1e-6);
                break;
            }
            damping *= 4.0;
        }
        // Steps of the numerical derivatives follow the curvature.
        for i in 0..n {
            let sd = information.get(i, i).max(1e-6).sqrt().recip();
            steps[i] = (0.2 * sd).min(0.3 * scale[i]);
        }
        if gain < 1e-4 {
            break;
        }
    }
    let (_, information) = derivatives(&density, &at, value, &steps);
    // Where the density hardly bends, the scale of the coordinate does.
    let mut ridge = 1e-3;
    let factor = loop {
        let bent = SymmetricMatrix::from_fn(n, |i, j| {
            let own = information.get(i, j);
            if i == j {
                own + ridge / (scale[i] * scale[i])
            } else {
                own
            }
        });
        match Cholesky::definite(&bent) {
            Some(factor) => break factor,
            None if ridge > 1e6 => return None,
            None => ridge *= 4.0,
        }
    };
    let inverse = factor.inverse();
    let covariance = SymmetricMatrix::from_fn(n, |i, j| 1.3 * inverse[(i, j)]);
    Some(Proposal::single(at, Cholesky::definite(&covariance)?))
}

/// Slope and negative curvature by differences. A step that would leave the range is halved.
fn derivatives(
    density: &impl Fn(&[f64]) -> f64,
    at: &[f64],
    value: f64,
    steps: &[f64],
) -> (Vec<f64>, SymmetricMatrix) {
    let n = at.len();
    let moved = |by: &[(usize, f64)]| {
        let mut place = at.to_vec();
        by.iter().for_each(|(i, h)| place[*i] += h);
        density(&place)
    };
    let (mut slope, mut up, mut used) = (vec![0.0; n], vec![0.0; n], steps.to_vec());
    let mut information = SymmetricMatrix::zero(n);
    for i in 0..n {
        for _ in 0..20 {
            let h = used[i];
            let (above, below) = (moved(&[(i, h)]), moved(&[(i, -h)]));
            if above.is_finite() && below.is_finite() {
                slope[i] = (above - below) / (2.0 * h);
                up[i] = above;
                information.add(i, i, -(above - 2.0 * value + below) / (h * h));
                break;
            }
            used[i] /= 2.0;
        }
    }
    for i in 0..n {
        for j in 0..i {
            let (h, k) = (used[i], used[j]);
            let both = moved(&[(i, h), (j, k)]);
            let mixed = -(both - up[i] - up[j] + value) / (h * k);
            if mixed.is_finite() {
                information.add(i, j, mixed);
            }
        }
    }
    (slope, information)
}

/// Quantiles of t with [`DF`] degrees of freedom and the variance 1, at the middles of even
/// probabilities; between them by straight lines, beyond the last ones exactly.
struct Quantiles {
    values: Vec<f64>,
    unit: f64,
}

impl Quantiles {
    fn new() -> Option<Self> {
        let unit = ((DF - 2.0) / DF).sqrt();
        let half = (0..QUANTILES / 2).map(|i| {
            let p = (i as f64 + 0.5) / QUANTILES as f64;
            Some(unit * t_quantile(p, DF)?)
        });
        let low: Vec<f64> = half.collect::<Option<_>>()?;
        let high = low.iter().rev().map(|x| -x);
        Some(Self {
            values: low.iter().copied().chain(high).collect(),
            unit,
        })
    }

    /// The quantile.
    fn at(&self, p: f64) -> Option<f64> {
        let place = p * QUANTILES as f64 - 0.5;
        let last = (QUANTILES - 1) as f64;
        // In the tails, and near them, where straight lines are not precise enough.
        if place < 64.0 || place > last - 64.0 {
            return Some(self.unit * t_quantile(p.clamp(1e-12, 1.0 - 1e-12), DF)?);
        }
        let i = place as usize;
        let (a, b) = (self.values[i], self.values[i + 1]);
        Some(a + (b - a) * (place - i as f64))
    }
}

/// Draws with their weights.
fn weighted(
    model: &Model<'_>,
    proposal: &Proposal,
    table: &Quantiles,
    (sets, draws): (usize, usize),
    random: &mut impl RandomSource,
) -> Option<Vec<Draw>> {
    let n = proposal.mean.len();
    // The last coordinate of the lattice chooses the center.
    let generators = generators(n + 1);
    let shares = proposal.centers.iter().map(|c| c.2.exp());
    let mut found = Vec::with_capacity(sets * draws);
    let mut logs = Vec::with_capacity(sets * draws);
    for set in 0..sets {
        let shift: Vec<f64> = (0..=n)
            .map(|_| random.below(1 << 53) as f64 / (1u64 << 53) as f64)
            .collect();
        for i in 0..draws {
            let at = |k: usize| (shift[k] + generators[k] * (i + 1) as f64).fract();
            let (mut below, chosen) = (0.0, at(n));
            let center = shares.clone().position(|share| {
                below += share;
                chosen < below
            });
            let (center, scale, _) = &proposal.centers[center.unwrap_or(0)];
            let place = (0..n).map(|k| Some(center[k] + scale * table.at(at(k))?));
            let place: Vec<f64> = place.collect::<Option<_>>()?;
            let moved = proposal.factor.times(&place);
            let at: Vec<f64> = (moved.iter().zip(&proposal.mean))
                .map(|(x, m)| x + m)
                .collect();
            logs.push(model.log_density(&at) - proposal.log_density(&place));
            found.push(Draw {
                at,
                weight: 0.0,
                set,
            });
        }
    }
    let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !highest.is_finite() {
        return None;
    }
    let weights: Vec<f64> = logs.iter().map(|l| (l - highest).exp()).collect();
    let sum: f64 = weights.iter().sum();
    for (draw, weight) in found.iter_mut().zip(weights) {
        draw.weight = weight / sum;
    }
    Some(found)
}

/// Kronecker's generators: powers of the inverse of the root of x^(d+1) = x + 1.
fn generators(n: usize) -> Vec<f64> {
    let mut root: f64 = 1.5;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (n as f64 + 1.0));
    }
    (1..=n).map(|k| root.powi(-(k as i32)).fract()).collect()
}

/// Mean and covariance of the draws; the old covariance keeps a tenth, in case a few draws
/// have most of the weight.
fn learned(before: &Proposal, draws: &[Draw]) -> Option<Proposal> {
    let n = before.mean.len();
    // No draw counts for more than a fiftieth.
    let weights: Vec<f64> = draws.iter().map(|d| d.weight.min(0.02)).collect();
    let sum: f64 = weights.iter().sum();
    let mean: Vec<f64> = (0..n)
        .map(|k| {
            draws
                .iter()
                .zip(&weights)
                .map(|(d, w)| w * d.at[k])
                .sum::<f64>()
                / sum
        })
        .collect();
    let mut covariance = SymmetricMatrix::zero(n);
    for (draw, weight) in draws.iter().zip(&weights) {
        let away: Vec<f64> = draw.at.iter().zip(&mean).map(|(x, m)| x - m).collect();
        covariance.add_outer(0.9 * weight / sum, &away);
    }
    for i in 0..n {
        let mut unit = vec![0.0; n];
        unit[i] = 1.0;
        let column = before.factor.times(&unit);
        covariance.add_outer(0.1, &column);
    }
    Some(Proposal::single(mean, Cholesky::definite(&covariance)?))
}

/// Draws about draws, each as often as its weight says, and a wide distribution about the mean.
fn mixture(about: Proposal, draws: &[Draw]) -> Proposal {
    let size = about.mean.len();
    let (wide, share) = WIDE;
    let mut centers = vec![(vec![0.0; size], wide, share.ln())];
    let each = ((1.0 - share) / CENTERS as f64).ln();
    let (mut sum, mut next) = (0.0, 0.5 / CENTERS as f64);
    let total: f64 = draws.iter().map(|d| d.weight).sum();
    for draw in draws {
        sum += draw.weight / total;
        while next < sum {
            let mut place: Vec<f64> = draw
                .at
                .iter()
                .zip(&about.mean)
                .map(|(x, m)| x - m)
                .collect();
            about.factor.solve_lower(&mut place);
            centers.push((place, AROUND, each));
            next += 1.0 / CENTERS as f64;
        }
    }
    Proposal { centers, ..about }
}

/// What the draws say of themselves; `errors` are the standard deviation of each quantity's mean
/// between sets and its posterior standard deviation.
pub(super) fn diagnostics(draws: &[Draw], errors: &[(f64, f64)], at_edge: f64) -> Diagnostics {
    let sets = draws.iter().map(|d| d.set + 1).max().unwrap_or(1) as f64;
    let ratios = errors.iter().map(|(sets, sd)| sets / sd.max(1e-300));
    let worst = ratios.fold(0.0, f64::max);
    Diagnostics {
        draws: draws.len(),
        effective: effective(draws),
        pareto_k: pareto_k(draws.iter().map(|d| d.weight)),
        r_hat: (1.0 + worst * worst).sqrt(),
        error: worst / sets.sqrt(),
        at_edge,
    }
}

/// k̂ of the generalized Pareto distribution of the largest weights, min(n/5, 3√n) of them, by
/// Zhang and Stephens's (2009) estimator with the prior of Vehtari et al. (2024).
fn pareto_k(weights: impl Iterator<Item = f64>) -> f64 {
    let mut weights: Vec<f64> = weights.collect();
    weights.sort_by(|a, b| b.total_cmp(a));
    let n = weights.len() as f64;
    let tail = (n / 5.0).min(3.0 * n.sqrt()) as usize;
    if tail < 5 {
        return f64::INFINITY;
    }
    let cut = weights[tail];
    let mut x: Vec<f64> = weights[..tail].iter().map(|w| w - cut).collect();
    x.reverse();
    let largest = x[tail - 1];
    // Equal weights have no tail.
    if largest <= 1e-9 * weights[0] {
        return f64::NEG_INFINITY;
    }
    let grid = 30 + (tail as f64).sqrt() as usize;
    let quarter = x[(tail as f64 / 4.0 + 0.5) as usize - 1].max(1e-12 * largest);
    let b = |j: usize| {
        let j = j as f64 + 0.5;
        1.0 / largest + (1.0 - (grid as f64 / j).sqrt()) / (3.0 * quarter)
    };
    let k_of = |b: f64| x.iter().map(|x| (-b * x).ln_1p()).sum::<f64>() / tail as f64;
    let logs: Vec<f64> = (0..grid)
        .map(|j| {
            let (b, k) = (b(j), k_of(b(j)));
            tail as f64 * ((-b / k).ln() - k - 1.0)
        })
        .collect();
    let weight = |j: usize| 1.0 / logs.iter().map(|l| (l - logs[j]).exp()).sum::<f64>();
    let mean = (0..grid).map(|j| weight(j) * b(j)).sum::<f64>();
    let k = k_of(mean);
    (k * tail as f64 + 5.0) / (tail as f64 + 10.0)
}
