//! A map that participants share, whose dimensions each of them weighs (INDSCAL).
//!
//! The squared distances of participant k are Σ w_kr (x_ir − x_jr)² over the dimensions r, so that the scalar products (the doubly centered
//! matrix −½d²) are B_k = X W_k Xᵀ with a diagonal W_k. Carroll & Chang (1970, Psychometrika 35) fit B_k = X W_k Yᵀ by alternating least
//! squares (canonical decomposition), which comes to Y = X; here with weights of 0 or more, because a negative one has no distances. Each
//! B_k has the sum of squares 1, so that participants count alike, and each column of X, so that a squared weight is about the share of
//! B_k for which its dimension accounts. Unlike those of other maps the axes have a meaning: they cannot be turned without loss,
//! unless all participants have the same weights but for a factor.

use super::Dissimilarities;
use super::scaling::{Map, Precision, centered};
use crate::finite;
use crate::matrix::{Cholesky, Matrix, SymmetricEigen, SymmetricMatrix, dot};
use crate::random::RandomSource;

/// A shared map and the weights of its dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighted {
    /// The sum of squares along each dimension is 1; that with the largest weights is the first.
    pub map: Map,
    /// By participant, then by dimension; 0 or more.
    pub weights: Vec<Vec<f64>>,
    /// By participant: the share of the squares of the scalar products for which the map accounts.
    pub fits: Vec<f64>,
}

impl Weighted {
    /// The mean of the fits: the share for which the map accounts over all participants.
    pub fn fit(&self) -> f64 {
        self.fits.iter().sum::<f64>() / self.fits.len() as f64
    }
}

/// Most rounds of [`common_fit`], and the gain after which there is none more.
const ROUNDS: usize = 50;
const CLOSE: f64 = 1e-9;

/// The map with the largest fit of several starts: the map of the mean scalar products, and `starts` random ones.
/// `None` for fewer than two participants, for fewer objects than dimensions and two, if a participant lacks a pair or has no two
/// objects that differ, or if no start comes to an end.
///
/// ```
/// # use study_stats::random::SplitMix64;
/// # use study_stats::similarity::{Dissimilarities, individual::weighted, scaling::Precision};
/// // One participant notices the first of two properties, the other one the second.
/// let places = [[0.0, 0.0], [1.0, 3.0], [4.0, 1.0], [5.0, 5.0], [2.0, 4.0]];
/// let along = |k: usize| Dissimilarities::from_fn(5, |a, b| Some(f64::abs(places[a][k] - places[b][k])));
/// let random = &mut SplitMix64::new(1);
/// let found = weighted(&[along(0), along(1)], 2, 5, Precision::FINE, random).unwrap();
/// assert!((found.fit() - 1.0).abs() < 1e-6);
/// assert!(found.weights.iter().all(|own| own.iter().any(|w| *w < 1e-3)));
/// ```
pub fn weighted(
    participants: &[Dissimilarities],
    dimensions: usize,
    starts: usize,
    precision: Precision,
    random: &mut impl RandomSource,
) -> Option<Weighted> {
    let problem = Problem::new(participants, dimensions)?;
    let objects = problem.objects;
    let mut best = problem.decomposed(&problem.mean_axes(), precision);
    for _ in 0..starts {
        let mut axis = || -> Vec<f64> { (0..objects).map(|_| random.normal()).collect() };
        let drawn: Axes = (0..dimensions).map(|_| axis()).collect();
        let found = problem.decomposed(&drawn, precision);
        best = match (best, found) {
            (Some(best), Some(found)) if found.fit() > best.fit() => Some(found),
            (None, found) => found,
            (best, _) => best,
        };
    }
    best
}

/// The fit of a map of so many dimensions to which all participants give the same weights but for a factor of their own. `None` as
/// [`weighted`].
pub fn common_fit(participants: &[Dissimilarities], dimensions: usize) -> Option<f64> {
    let problem = Problem::new(participants, dimensions)?;
    let mut factors = vec![1.0; problem.products.len()];
    let mut fit = f64::NEG_INFINITY;
    for _ in 0..ROUNDS {
        let map = problem.common_products(&factors);
        let squares = dot(map.elements(), map.elements());
        let along = problem
            .products
            .iter()
            .map(|own| dot(own.elements(), map.elements()));
        factors = along.map(|product| (product / squares).max(0.0)).collect();
        let explained = factors.iter().map(|factor| factor * factor * squares);
        let next = finite(explained.sum::<f64>() / factors.len() as f64)?;
        let gain = next - fit;
        fit = next;
        if gain < CLOSE {
            break;
        }
    }
    Some(fit)
}

/// Number of deals in [`differ`].
pub const DRAWS: u32 = 199;
/// Random starts beside the map of the mean, of what is dealt.
const STARTS: usize = 2;

/// Whether participants weigh the dimensions differently.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Differ {
    /// What weights add to the fit of a map to which all give the same ones but for a factor.
    pub gain: f64,
    /// Its mean after the dissimilarities of each pair were dealt to the participants.
    pub by_chance: f64,
    /// (b + 1)/(B + 1), where b of B = [`DRAWS`] such deals have at least this gain.
    pub p: f64,
}

/// Compares what weights add with that after the dissimilarities of each pair were dealt to the participants at random: if they differ
/// by chance only, all deals are equally likely, and their mean stays what it is. `None` as [`weighted`].
pub fn differ(
    participants: &[Dissimilarities],
    dimensions: usize,
    random: &mut impl RandomSource,
) -> Option<Differ> {
    let gain = |people: &[Dissimilarities], random: &mut _| {
        let fit = weighted(people, dimensions, STARTS, Precision::COARSE, random)?.fit();
        Some(fit - common_fit(people, dimensions)?)
    };
    let found = gain(participants, random)?;
    let (mut as_large, mut sum) = (1u32, 0.0);
    for _ in 0..DRAWS {
        let chance = gain(&dealt(participants, random), random)?;
        sum += chance;
        as_large += u32::from(chance >= found - 1e-9);
    }
    Some(Differ {
        gain: found,
        by_chance: sum / f64::from(DRAWS),
        p: f64::from(as_large) / f64::from(DRAWS + 1),
    })
}

/// The same dissimilarities, those of each pair dealt to the participants at random.
fn dealt(participants: &[Dissimilarities], random: &mut impl RandomSource) -> Vec<Dissimilarities> {
    let mut all = participants.to_vec();
    let mut order: Vec<usize> = (0..participants.len()).collect();
    let pairs = participants.first().map_or(0, |own| own.values.len());
    for pair in 0..pairs {
        random.shuffle(&mut order);
        for (own, from) in all.iter_mut().zip(&order) {
            own.values[pair] = participants[*from].values[pair];
        }
    }
    all
}

/// The scalar products of some participants.
struct Problem {
    objects: usize,
    dimensions: usize,
    /// Each with the sum of squares 1.
    products: Vec<Matrix>,
}

/// Coordinates, one dimension after the other.
type Axes = Vec<Vec<f64>>;

impl Problem {
    fn new(participants: &[Dissimilarities], dimensions: usize) -> Option<Self> {
        let objects = participants.first()?.objects();
        if dimensions == 0 || objects < dimensions + 2 || participants.len() < 2 {
            return None;
        }
        let of = |own: &Dissimilarities| {
            let products = centered(own)?;
            let length = dot(products.elements(), products.elements()).sqrt();
            let length = finite(length).filter(|length| *length > 0.0)?;
            Some(Matrix::from_fn(objects, objects, |i, j| {
                products[(i, j)] / length
            }))
        };
        Some(Self {
            objects,
            dimensions,
            products: participants.iter().map(of).collect::<Option<_>>()?,
        })
    }

    /// The sum of the scalar products times factors, and its eigenvalues.
    fn eigen(&self, factors: &[f64]) -> (SymmetricEigen, Vec<usize>) {
        let sum = Matrix::from_fn(self.objects, self.objects, |i, j| {
            let both = self.products.iter().zip(factors);
            both.map(|(own, factor)| factor * own[(i, j)]).sum()
        });
        let eigen = SymmetricEigen::new(sum);
        let mut order: Vec<usize> = (0..self.objects).collect();
        order.sort_by(|a, b| eigen.values[*b].total_cmp(&eigen.values[*a]));
        order.truncate(self.dimensions);
        (eigen, order)
    }

    /// The axes of the map of the mean.
    fn mean_axes(&self) -> Axes {
        let (eigen, order) = self.eigen(&vec![1.0; self.products.len()]);
        let axis = |at: &usize| eigen.vectors.row(*at).to_vec();
        order.iter().map(axis).collect()
    }

    /// The scalar products of the map with so many dimensions that is nearest to their sum.
    fn common_products(&self, factors: &[f64]) -> Matrix {
        let (eigen, order) = self.eigen(factors);
        Matrix::from_fn(self.objects, self.objects, |i, j| {
            let along = order.iter().map(|at| {
                let axis = eigen.vectors.row(*at);
                eigen.values[*at].max(0.0) * axis[i] * axis[j]
            });
            along.sum()
        })
    }

    /// Canonical decomposition from some axes; `None` if a dimension vanishes.
    fn decomposed(&self, start: &[Vec<f64>], precision: Precision) -> Option<Weighted> {
        let (mut x, mut y) = (normalized(start)?, normalized(start)?);
        let mut weights = vec![vec![1.0; self.dimensions]; self.products.len()];
        let mut fit = f64::NEG_INFINITY;
        for _ in 0..precision.iterations {
            x = normalized(&self.axes(&y, &weights)?)?;
            y = normalized(&self.axes(&x, &weights)?)?;
            let (own, fits) = self.weights(&x, &y)?;
            weights = own;
            let next = fits.iter().sum::<f64>() / fits.len() as f64;
            let gain = next - fit;
            fit = next;
            if gain < precision.change {
                break;
            }
        }
        let both = |(x, y): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            let sign = dot(x, y).signum();
            x.iter().zip(y).map(|(x, y)| sign * x + y).collect()
        };
        let both: Axes = x.iter().zip(&y).map(both).collect();
        self.ordered(&normalized(&both)?)
    }

    /// The axes that fit best beside other ones, by least squares.
    fn axes(&self, others: &[Vec<f64>], weights: &[Vec<f64>]) -> Option<Axes> {
        let normal = SymmetricMatrix::from_fn(self.dimensions, |r, s| {
            let products = weights.iter().map(|own| own[r] * own[s]);
            dot(&others[r], &others[s]) * products.sum::<f64>()
        });
        let factor = Cholesky::definite(&normal)?;
        let mut sums = vec![vec![0.0; self.dimensions]; self.objects];
        for (products, own) in self.products.iter().zip(weights) {
            for (r, (axis, weight)) in others.iter().zip(own).enumerate() {
                for (sum, along) in sums.iter_mut().zip(products.times(axis)) {
                    sum[r] += weight * along;
                }
            }
        }
        let points: Vec<Vec<f64>> = sums.iter().map(|sum| factor.solve(sum)).collect();
        let axis = |r: usize| -> Vec<f64> { points.iter().map(|point| point[r]).collect() };
        Some((0..self.dimensions).map(axis).collect())
    }

    /// The weights of each participant by least squares, none below 0, and the fits.
    fn weights(&self, x: &[Vec<f64>], y: &[Vec<f64>]) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
        let gram = SymmetricMatrix::from_fn(x.len(), |r, s| dot(&x[r], &x[s]) * dot(&y[r], &y[s]));
        let of = |products: &Matrix| {
            let along = x.iter().zip(y).map(|(x, y)| dot(x, &products.times(y)));
            nonnegative(&gram, &along.collect::<Vec<_>>())
        };
        let all: Vec<(Vec<f64>, f64)> = self.products.iter().map(of).collect();
        let is_finite = all.iter().all(|(_, fit)| fit.is_finite());
        is_finite.then(|| all.into_iter().unzip())
    }

    /// The map with these axes, that with the largest weights first; on each the object farthest from the middle is positive.
    fn ordered(&self, axes: &[Vec<f64>]) -> Option<Weighted> {
        let (weights, fits) = self.weights(axes, axes)?;
        let squares = |r: usize| weights.iter().map(|own| own[r] * own[r]).sum::<f64>();
        let mut order: Vec<usize> = (0..self.dimensions).collect();
        order.sort_by(|a, b| squares(*b).total_cmp(&squares(*a)));
        let mut coordinates = vec![0.0; self.objects * self.dimensions];
        for (to, from) in order.iter().enumerate() {
            let axis = &axes[*from];
            let most = axis.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let far = axis.iter().find(|x| x.abs() >= most * (1.0 - 1e-6));
            let sign = far.map_or(1.0, |x| x.signum());
            for (object, x) in axis.iter().enumerate() {
                coordinates[object * self.dimensions + to] = sign * x;
            }
        }
        let turned = |own: &Vec<f64>| -> Vec<f64> { order.iter().map(|from| own[*from]).collect() };
        Some(Weighted {
            map: Map::new(self.dimensions, coordinates),
            weights: weights.iter().map(turned).collect(),
            fits,
        })
    }
}

/// Each axis with the sum of squares 1; `None` if one has no extent.
fn normalized(axes: &[Vec<f64>]) -> Option<Axes> {
    let one = |axis: &Vec<f64>| -> Option<Vec<f64>> {
        let length = finite(dot(axis, axis).sqrt()).filter(|length| *length > 0.0)?;
        Some(axis.iter().map(|x| x / length).collect())
    };
    axes.iter().map(one).collect()
}

/// The w ≥ 0 with the largest 2wᵀc − wᵀGw, and this value: of all sets of weights that are not 0 the best one whose solution has none
/// below 0. There are few dimensions.
fn nonnegative(gram: &SymmetricMatrix, along: &[f64]) -> (Vec<f64>, f64) {
    let mut best = (vec![0.0; along.len()], 0.0);
    for set in 1..1u32 << along.len() {
        let own: Vec<usize> = (0..along.len()).filter(|r| (set >> *r) & 1 == 1).collect();
        let part = SymmetricMatrix::from_fn(own.len(), |i, j| gram.get(own[i], own[j]));
        let right: Vec<f64> = own.iter().map(|r| along[*r]).collect();
        let Some(factor) = Cholesky::definite(&part) else {
            continue;
        };
        let solved = factor.solve(&right);
        let value = dot(&solved, &right);
        if value > best.1 && solved.iter().all(|w| *w >= 0.0) {
            let mut weights = vec![0.0; along.len()];
            own.iter().zip(&solved).for_each(|(r, w)| weights[*r] = *w);
            best = (weights, value);
        }
    }
    best
}

#[cfg(test)]
mod tests;
