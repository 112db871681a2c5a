//! Multidimensional scaling: classical, and by majorization of stress.

use super::{Dissimilarities, pairs};
use crate::finite;
use crate::matrix::{Cholesky, Matrix, SymmetricEigen, SymmetricMatrix};
use crate::random::RandomSource;

/// Objects in a space, centered, on principal axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    dimensions: usize,
    /// By object, then by dimension.
    coordinates: Vec<f64>,
}

impl Map {
    /// From one coordinate after the other, by object; centered.
    pub(super) fn new(dimensions: usize, mut coordinates: Vec<f64>) -> Self {
        let n = (coordinates.len() / dimensions) as f64;
        for dimension in 0..dimensions {
            let own = || (dimension..coordinates.len()).step_by(dimensions);
            let mean = own().map(|at| coordinates[at]).sum::<f64>() / n;
            own().for_each(|at| coordinates[at] -= mean);
        }
        Self {
            dimensions,
            coordinates,
        }
    }

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Number of objects.
    pub fn objects(&self) -> usize {
        self.coordinates.len() / self.dimensions
    }

    /// Where an object lies.
    pub fn point(&self, object: usize) -> &[f64] {
        &self.coordinates[object * self.dimensions..(object + 1) * self.dimensions]
    }

    /// The distance of two objects.
    pub fn distance(&self, a: usize, b: usize) -> f64 {
        let both = self.point(a).iter().zip(self.point(b));
        both.map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
    }

    /// All distances.
    pub fn distances(&self) -> Dissimilarities {
        Dissimilarities::from_fn(self.objects(), |a, b| Some(self.distance(a, b)))
    }

    /// The same map in other units.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        let coordinates = self.coordinates.iter().map(|x| x * by);
        Self {
            dimensions: self.dimensions,
            coordinates: coordinates.collect(),
        }
    }

    /// Scaled so that its distances are those of given dissimilarities, by least squares.
    fn in_units_of(&self, dissimilarities: &Dissimilarities) -> Option<Self> {
        let known = pairs(self.objects()).zip(dissimilarities.values());
        let (mut products, mut squares) = (0.0, 0.0);
        for ((a, b), value) in known {
            let distance = self.distance(a, b);
            products += value.map_or(0.0, |value| value * distance);
            squares += value.map_or(0.0, |_| distance * distance);
        }
        Some(self.scaled(finite(products / squares)?))
    }

    /// Turned to principal axes, the longest first; on each the object farthest from the middle is positive.
    fn principal(&self) -> Self {
        let k = self.dimensions;
        let product = |i: usize, j: usize| {
            (0..self.objects())
                .map(|object| self.point(object)[i] * self.point(object)[j])
                .sum()
        };
        let eigen = SymmetricEigen::new(Matrix::from_fn(k, k, product));
        let mut order: Vec<usize> = (0..k).collect();
        order.sort_by(|a, b| eigen.values[*b].total_cmp(&eigen.values[*a]));
        let mut turned = vec![0.0; self.coordinates.len()];
        for (to, from) in order.into_iter().enumerate() {
            let axis = eigen.vectors.row(from);
            let along: Vec<f64> = (0..self.objects())
                .map(|object| {
                    let own = self.point(object).iter().zip(axis);
                    own.map(|(x, a)| x * a).sum()
                })
                .collect();
            // What is farther by no more than rounding does not decide.
            let most = along.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let far = along.iter().find(|x| x.abs() >= most * (1.0 - 1e-6));
            let sign = far.map_or(1.0, |x| x.signum());
            for (object, x) in along.iter().enumerate() {
                turned[object * k + to] = sign * x;
            }
        }
        Self {
            dimensions: k,
            coordinates: turned,
        }
    }
}

/// Classical scaling.
#[derive(Debug, Clone, PartialEq)]
pub struct Classical {
    /// The map; axes beyond those with a positive eigenvalue are 0.
    pub map: Map,
    /// All eigenvalues of the doubly centered matrix −½d², the largest first.
    pub eigenvalues: Vec<f64>,
    /// The share of the sum of their absolute values that the dimensions of the map have.
    pub share: f64,
}

/// Classical scaling (Torgerson 1952). `None` if a pair is missing, for fewer objects than dimensions and one, or if no two
/// differ.
///
/// ```
/// # use study_stats::similarity::{Dissimilarities, scaling::classical};
/// let line = Dissimilarities::from_fn(4, |a, b| Some((b - a) as f64));
/// let found = classical(&line, 1).unwrap();
/// assert!((found.share - 1.0).abs() < 1e-12);
/// assert!((found.map.distance(0, 3) - 3.0).abs() < 1e-12);
/// ```
pub fn classical(dissimilarities: &Dissimilarities, dimensions: usize) -> Option<Classical> {
    let n = dissimilarities.objects();
    if dimensions == 0 || n <= dimensions {
        return None;
    }
    let eigen = SymmetricEigen::new(centered(dissimilarities)?);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.values[*b].total_cmp(&eigen.values[*a]));
    let eigenvalues: Vec<f64> = order.iter().map(|at| eigen.values[*at]).collect();
    let sum: f64 = eigenvalues.iter().map(|v| v.abs()).sum();
    let kept = eigenvalues[..dimensions].iter().map(|v| v.max(0.0));
    let share = finite(kept.sum::<f64>() / sum).filter(|share| *share > 0.0)?;
    let mut coordinates = vec![0.0; n * dimensions];
    for (to, from) in order.iter().take(dimensions).enumerate() {
        let length = eigen.values[*from].max(0.0).sqrt();
        for (object, x) in eigen.vectors.row(*from).iter().enumerate() {
            coordinates[object * dimensions + to] = length * x;
        }
    }
    Some(Classical {
        map: Map::new(dimensions, coordinates).principal(),
        eigenvalues,
        share,
    })
}

/// The scalar products of objects about their middle: the doubly centered matrix −½d². `None` if a pair is missing.
pub(super) fn centered(dissimilarities: &Dissimilarities) -> Option<Matrix> {
    let n = dissimilarities.objects();
    let squares: Option<Vec<f64>> = (0..n * n)
        .map(|at| match (at / n, at % n) {
            (i, j) if i == j => Some(0.0),
            (i, j) => dissimilarities.get(i, j).map(|d| d * d),
        })
        .collect();
    let squares = squares?;
    let mean = |own: &mut dyn Iterator<Item = f64>| own.sum::<f64>() / n as f64;
    let rows: Vec<f64> = (0..n)
        .map(|i| mean(&mut (0..n).map(|j| squares[i * n + j])))
        .collect();
    let all = mean(&mut rows.iter().copied());
    Some(Matrix::from_fn(n, n, |i, j| {
        -0.5 * (squares[i * n + j] - rows[i] - rows[j] + all)
    }))
}

/// How distances follow dissimilarities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Ratio,
    /// In the same order; of equal dissimilarities any order will do (the primary approach to ties).
    Ordinal,
}

/// Less stress is none: majorization ends before it has vanished.
const NONE: f64 = 1e-5;

/// A map with little stress.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaled {
    /// In the units of the dissimilarities.
    pub map: Map,
    /// Kruskal's (1964) stress 1: √(Σ(d − d̂)²/Σd²) over the known pairs.
    pub stress: f64,
}

/// When majorization ends.
#[derive(Debug, Clone, Copy)]
pub struct Precision {
    /// Once stress² falls by less in an iteration.
    pub change: f64,
    /// After so many iterations.
    pub iterations: usize,
}

impl Precision {
    /// Of what is reported.
    pub const FINE: Self = Self {
        change: 1e-13,
        iterations: 5_000,
    };
    /// Of what is resampled, or compared with other starts.
    pub const COARSE: Self = Self {
        change: 1e-6,
        iterations: 200,
    };
}

/// The map with the least stress of several starts, by majorization (SMACOF; de Leeuw 1977, de Leeuw & Heiser 1980): the classical
/// map, where missing dissimilarities are the mean of the others, and `starts` random ones. The best one goes on to `precision`.
/// `None` for fewer objects than dimensions and two, if pairs do not connect all objects, or if no two differ.
pub fn smacof(
    dissimilarities: &Dissimilarities,
    dimensions: usize,
    scale: Scale,
    starts: usize,
    precision: Precision,
    random: &mut impl RandomSource,
) -> Option<Scaled> {
    let problem = Problem::new(dissimilarities, dimensions, scale)?;
    let first = problem.torgerson(dissimilarities, random);
    let rough = Precision {
        change: precision.change.max(Precision::COARSE.change),
        iterations: precision.iterations.min(Precision::COARSE.iterations),
    };
    let mut best = problem.majorized(first, rough)?;
    for _ in 0..starts {
        let drawn = (0..problem.objects * dimensions).map(|_| random.normal());
        let found = problem.majorized(drawn.collect(), rough);
        best = match found {
            Some(found) if found.1 < best.1 => found,
            _ => best,
        };
    }
    problem.finished(best, precision, dissimilarities)
}

/// The map that majorization comes to from a given one. `None` as [`smacof`].
pub fn smacof_from(
    start: &Map,
    dissimilarities: &Dissimilarities,
    scale: Scale,
    precision: Precision,
) -> Option<Scaled> {
    let problem = Problem::new(dissimilarities, start.dimensions, scale)?;
    let found = problem.majorized(start.coordinates.clone(), precision)?;
    problem.finished(found, precision, dissimilarities)
}

/// Known dissimilarities, and what majorization needs of them.
struct Problem {
    objects: usize,
    dimensions: usize,
    scale: Scale,
    pairs: Vec<(usize, usize)>,
    values: Vec<f64>,
    /// Places of `values`, the smallest first, in runs of equal ones.
    order: Vec<usize>,
    runs: Vec<usize>,
    /// V⁻ of the weights up to a constant; `None`: all pairs are known, and it is a division by their number.
    inverse: Option<Matrix>,
}

impl Problem {
    fn new(all: &Dissimilarities, dimensions: usize, scale: Scale) -> Option<Self> {
        let objects = all.objects();
        if dimensions == 0 || objects < dimensions + 2 {
            return None;
        }
        let known = pairs(objects).zip(all.values());
        let (pairs, values): (Vec<_>, Vec<f64>) = known
            .filter_map(|(pair, value)| Some((pair, (*value)?)))
            .unzip();
        let sum: f64 = values.iter().sum();
        if !(sum > 0.0 && sum.is_finite()) || values.iter().any(|v| *v < 0.0) {
            return None;
        }
        let inverse = match values.len() == all.values().len() {
            true => None,
            false => {
                let mut weights = SymmetricMatrix::from_fn(objects, |_, _| 1.0);
                for &(a, b) in &pairs {
                    weights.add(a, a, 1.0);
                    weights.add(b, b, 1.0);
                    weights.add(a, b, -1.0);
                }
                Some(Cholesky::definite(&weights)?.inverse())
            }
        };
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        // Means of the same ratings in another order of addition are equal.
        let tied = |a: &usize, b: &usize| (values[*a] - values[*b]).abs() <= 1e-9 * sum;
        let runs = order.chunk_by(tied).map(<[usize]>::len).collect();
        Some(Self {
            objects,
            dimensions,
            scale,
            pairs,
            values,
            order,
            runs,
            inverse,
        })
    }

    /// The classical map. An axis without extent is drawn: majorization would leave it at 0.
    fn torgerson(&self, all: &Dissimilarities, random: &mut impl RandomSource) -> Vec<f64> {
        let mean = self.values.iter().sum::<f64>() / self.values.len() as f64;
        let filled =
            Dissimilarities::from_fn(self.objects, |a, b| Some(all.get(a, b).unwrap_or(mean)));
        let mut found = classical(&filled, self.dimensions).map_or_else(
            || vec![0.0; self.objects * self.dimensions],
            |found| found.map.coordinates,
        );
        for dimension in 0..self.dimensions {
            let own = || (dimension..self.objects * self.dimensions).step_by(self.dimensions);
            if own().all(|at| found[at].abs() < 1e-6 * mean) {
                own().for_each(|at| found[at] = 0.1 * mean * random.normal());
            }
        }
        found
    }

    fn distances(&self, x: &[f64]) -> Vec<f64> {
        let k = self.dimensions;
        let distance = |&(a, b): &(usize, usize)| {
            let both = x[a * k..(a + 1) * k].iter().zip(&x[b * k..(b + 1) * k]);
            both.map(|(p, q)| (p - q) * (p - q)).sum::<f64>().sqrt()
        };
        self.pairs.iter().map(distance).collect()
    }

    /// The targets d̂ that are nearest to some distances.
    fn targets(&self, distances: &[f64]) -> Vec<f64> {
        match self.scale {
            Scale::Ratio => {
                let both = || self.values.iter().zip(distances);
                let products: f64 = both().map(|(value, d)| value * d).sum();
                let squares: f64 = self.values.iter().map(|value| value * value).sum();
                let slope = products / squares;
                self.values.iter().map(|value| slope * value).collect()
            }
            Scale::Ordinal => self.monotone(distances),
        }
    }

    /// Monotone regression on the order of the dissimilarities, by pooling adjacent violators.
    fn monotone(&self, distances: &[f64]) -> Vec<f64> {
        let mut order = self.order.clone();
        let mut rest = order.as_mut_slice();
        for run in &self.runs {
            let (own, next) = rest.split_at_mut(*run);
            own.sort_by(|a, b| distances[*a].total_cmp(&distances[*b]));
            rest = next;
        }
        // Means of pools with their numbers.
        let mut pools: Vec<(f64, usize)> = Vec::with_capacity(order.len());
        for at in &order {
            let mut pool = (distances[*at], 1);
            while let Some(&(mean, n)) = pools.last().filter(|last| last.0 >= pool.0) {
                let both = n + pool.1;
                pool = (
                    (mean * n as f64 + pool.0 * pool.1 as f64) / both as f64,
                    both,
                );
                pools.pop();
            }
            pools.push(pool);
        }
        let mut targets = vec![0.0; distances.len()];
        let fitted = pools
            .iter()
            .flat_map(|(mean, n)| std::iter::repeat_n(*mean, *n));
        for (at, target) in order.iter().zip(fitted) {
            targets[*at] = target;
        }
        targets
    }

    /// Stress²: `None` if all distances are 0.
    fn stress(distances: &[f64], targets: &[f64]) -> Option<f64> {
        let both = distances.iter().zip(targets);
        let residuals: f64 = both.map(|(d, t)| (d - t) * (d - t)).sum();
        let squares: f64 = distances.iter().map(|d| d * d).sum();
        finite(residuals / squares)
    }

    /// Guttman's transform of a configuration, with targets whose squares have the mean 1.
    fn transformed(&self, x: &[f64], distances: &[f64], targets: &[f64]) -> Vec<f64> {
        let (n, k) = (self.objects, self.dimensions);
        let squares: f64 = targets.iter().map(|t| t * t).sum();
        let norm = (targets.len() as f64 / squares).sqrt();
        let mut product = vec![0.0; n * k];
        for ((&(a, b), d), target) in self.pairs.iter().zip(distances).zip(targets) {
            let ratio = if *d > 0.0 { norm * target / d } else { 0.0 };
            for dimension in 0..k {
                let pull = ratio * (x[a * k + dimension] - x[b * k + dimension]);
                product[a * k + dimension] += pull;
                product[b * k + dimension] -= pull;
            }
        }
        let Some(inverse) = &self.inverse else {
            product.iter_mut().for_each(|value| *value /= n as f64);
            return product;
        };
        let mut turned = vec![0.0; n * k];
        for (a, of_a) in turned.chunks_mut(k).enumerate() {
            for (weight, of_b) in inverse.row(a).iter().zip(product.chunks(k)) {
                of_a.iter_mut()
                    .zip(of_b)
                    .for_each(|(to, own)| *to += weight * own);
            }
        }
        turned
    }

    /// A configuration, and its stress².
    fn majorized(&self, mut x: Vec<f64>, precision: Precision) -> Option<(Vec<f64>, f64)> {
        let mut distances = self.distances(&x);
        let mut targets = self.targets(&distances);
        let mut stress = Self::stress(&distances, &targets)?;
        for _ in 0..precision.iterations {
            let next = self.transformed(&x, &distances, &targets);
            let of_next = self.distances(&next);
            let aims = self.targets(&of_next);
            let Some(less) = Self::stress(&of_next, &aims) else {
                break;
            };
            let change = stress - less;
            if change >= 0.0 {
                (x, distances, targets, stress) = (next, of_next, aims, less);
            }
            if change < precision.change {
                break;
            }
        }
        Some((x, stress))
    }

    fn finished(
        &self,
        (x, _): (Vec<f64>, f64),
        precision: Precision,
        all: &Dissimilarities,
    ) -> Option<Scaled> {
        let (x, stress) = self.majorized(x, precision)?;
        let map = Map::new(self.dimensions, x).principal();
        Some(Scaled {
            map: map.in_units_of(all)?,
            stress: if stress > NONE * NONE {
                stress.sqrt()
            } else {
                0.0
            },
        })
    }
}
