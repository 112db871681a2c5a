//! How a map lies to known properties of its objects, by Procrustes' rotation, and how certain it is.

use super::Dissimilarities;
use super::scaling::{Map, Precision, Scale, smacof_from};
use crate::describe;
use crate::distribution::t_quantile;
use crate::matrix::{Matrix, SymmetricEigen};
use crate::permutation::enumerate_orders;
use crate::random::RandomSource;

/// Largest number of objects of which all orders are enumerated.
pub const MAX_EXACT: usize = 8;
/// Number of random orders of more objects.
pub const DRAWS: u32 = 9_999;
/// Number of resamples of participants.
pub const RESAMPLES: usize = 499;
/// The largest correlation that counts; Fisher's z of 1 is infinite.
const LARGEST: f64 = 0.9999;

/// Objects by coordinates: centered, and the sum of all squares is 1.
struct Shape {
    columns: Vec<Vec<f64>>,
}

impl Shape {
    fn of_map(map: &Map) -> Option<Self> {
        let column = |k: usize| (0..map.objects()).map(move |object| map.point(object)[k]);
        let columns: Vec<Vec<f64>> = (0..map.dimensions()).map(|k| column(k).collect()).collect();
        Self::normed(columns)
    }

    /// Properties have units of their own, so that each has the same variance.
    fn of_properties(properties: &[Vec<f64>]) -> Option<Self> {
        let of = |property: &Vec<f64>| {
            let (mean, sd) = (describe::mean(property)?, describe::sd(property)?);
            let varies = !describe::is_constant(property);
            varies.then(|| property.iter().map(|x| (x - mean) / sd).collect())
        };
        let columns: Option<Vec<Vec<f64>>> = properties.iter().map(of).collect();
        Self::normed(columns?)
    }

    fn normed(mut columns: Vec<Vec<f64>>) -> Option<Self> {
        let squares: f64 = columns.iter().flatten().map(|x| x * x).sum();
        let norm = crate::finite(1.0 / squares.sqrt())?;
        columns.iter_mut().flatten().for_each(|x| *x *= norm);
        Some(Self { columns })
    }

    /// The sum of the singular values of X′Y, where the objects of Y come in an order.
    fn r(&self, other: &Self, order: &[usize]) -> f64 {
        let product = |a: &[f64], b: &[f64]| -> f64 {
            let both = a.iter().zip(order);
            both.map(|(x, at)| x * b[*at]).sum()
        };
        let rows: Vec<Vec<f64>> = (self.columns.iter())
            .map(|a| other.columns.iter().map(|b| product(a, b)).collect())
            .collect();
        let (k, q) = (rows.len(), other.columns.len());
        if k == 1 || q == 1 {
            return rows.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        }
        let gram = Matrix::from_fn(k, k, |i, j| {
            rows[i].iter().zip(&rows[j]).map(|(x, y)| x * y).sum()
        });
        let values = SymmetricEigen::new(gram).values;
        values.iter().map(|v| v.max(0.0).sqrt()).sum()
    }
}

/// The correlation of a map with properties of its objects after the best rotation, reflection and change of
/// units: √(1 − m²), where m² is the sum of squares that is left of two configurations of sum 1 (Gower 1971; `vegan::protest`).
/// Each property has the same variance. A map with more dimensions than there are properties has the correlation 1 only if its other
/// dimensions have no extent. `None` if a property is constant.
pub fn procrustes(map: &Map, properties: &[Vec<f64>]) -> Option<f64> {
    let order: Vec<usize> = (0..map.objects()).collect();
    if properties.is_empty() || properties.iter().any(|p| p.len() != order.len()) {
        return None;
    }
    let (map, properties) = (Shape::of_map(map)?, Shape::of_properties(properties)?);
    Some(map.r(&properties, &order).min(1.0))
}

/// Whether a map follows properties of its objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// [`procrustes`].
    pub r: f64,
    /// The share of the orders of the objects whose `r` is at least as large. Of drawn orders it is (b + 1)/(B + 1).
    pub p: f64,
    /// The smallest p that other properties with the same values could have.
    pub smallest: f64,
    /// Whether all orders were enumerated.
    pub exact: bool,
}

/// A permutation test of [`procrustes`] over the orders of the objects (Jackson 1995). `random` is used above [`MAX_EXACT`]
/// objects. `None` as there, and for fewer than four objects.
pub fn followed(
    map: &Map,
    properties: &[Vec<f64>],
    random: &mut impl RandomSource,
) -> Option<Followed> {
    let r = procrustes(map, properties)?;
    let n = map.objects();
    let (map, properties) = (Shape::of_map(map)?, Shape::of_properties(properties)?);
    let mut order: Vec<usize> = (0..n).collect();
    if n < 4 {
        return None;
    }
    if n <= MAX_EXACT {
        let mut all = Vec::new();
        enumerate_orders(&mut order, |order| all.push(map.r(&properties, order)));
        let most = all.iter().fold(0.0, |most: f64, r| most.max(*r));
        let share = |least: f64| {
            let above = all.iter().filter(|r| **r >= least - 1e-9).count();
            above as f64 / all.len() as f64
        };
        return Some(Followed {
            r,
            p: share(r),
            smallest: share(most),
            exact: true,
        });
    }
    let mut as_large = 1u32;
    for _ in 0..DRAWS {
        random.shuffle(&mut order);
        as_large += u32::from(map.r(&properties, &order) >= r - 1e-9);
    }
    let all = f64::from(DRAWS + 1);
    Some(Followed {
        r,
        p: f64::from(as_large) / all,
        smallest: 1.0 / all,
        exact: false,
    })
}

/// What resampling participants says of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    /// Standard errors of the coordinates: by object, then by dimension. Maps of resamples are turned to the map first. Their
    /// standard deviation times √(n/(n − 1)) for n participants, as of a mean.
    pub errors: Vec<Vec<f64>>,
    /// Interval of [`procrustes`]: Fisher's z, and t(n − 1) times its standard error, which is that of the resamples as of `errors`.
    /// Percentiles would be too low, because maps of resamples are noisier. `None` without properties.
    pub r_ci95: Option<(f64, f64)>,
    /// Resamples that gave a map.
    pub resamples: usize,
}

/// Draws participants with replacement [`RESAMPLES`] times, and scales what their dissimilarities have in common from the map on, as the map was scaled.
/// `None` for fewer than two participants, or if fewer than 95 % of the resamples give a map.
pub fn resampled(
    participants: &[Dissimilarities],
    (map, scale): (&Map, Scale),
    properties: &[Vec<f64>],
    random: &mut impl RandomSource,
) -> Option<Resampled> {
    let n = participants.len();
    if n < 2 {
        return None;
    }
    let unit = Dissimilarities::in_common(participants.iter())?;
    let start = smacof_from(map, &unit, scale, Precision::COARSE)?.map;
    let to_units = size(map) / size(&start);
    let mut maps = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        let drawn: Vec<usize> = (0..n).map(|_| random.below(n as u64) as usize).collect();
        let mean = Dissimilarities::in_common(drawn.iter().map(|at| &participants[*at]));
        let found = mean.and_then(|mean| smacof_from(&start, &mean, scale, Precision::COARSE));
        let turned = found.and_then(|found| turned(&found.map.scaled(to_units), map));
        maps.extend(turned);
    }
    if maps.len() * 20 < RESAMPLES * 19 {
        return None;
    }
    let error = |object: usize, k: usize| {
        let own: Vec<f64> = maps.iter().map(|map| map.point(object)[k]).collect();
        Some(as_of_mean(n) * describe::sd(&own)?)
    };
    let errors: Option<Vec<Vec<f64>>> = (0..map.objects())
        .map(|object| (0..map.dimensions()).map(|k| error(object, k)).collect())
        .collect();
    let r: Option<Vec<f64>> = maps.iter().map(|map| procrustes(map, properties)).collect();
    let r_ci95 = r.and_then(|r| around(procrustes(map, properties)?, &r, n));
    Some(Resampled {
        errors: errors?,
        r_ci95,
        resamples: maps.len(),
    })
}

/// By how much the mean of n varies more than those of its resamples.
fn as_of_mean(n: usize) -> f64 {
    (n as f64 / (n as f64 - 1.0)).sqrt()
}

/// The interval of a correlation of n participants that is at least 0, by its resamples.
pub(super) fn around(r: f64, resamples: &[f64], n: usize) -> Option<(f64, f64)> {
    let z = |r: f64| r.min(LARGEST).atanh();
    let all: Vec<f64> = resamples.iter().map(|r| z(*r)).collect();
    let half = t_quantile(0.975, n as f64 - 1.0)? * as_of_mean(n) * describe::sd(&all)?;
    let [low, high] = [z(r) - half, z(r) + half].map(f64::tanh);
    Some((low.max(0.0).min(r), high.max(r)))
}

/// The square root of the sum of all squares.
fn size(map: &Map) -> f64 {
    let points = (0..map.objects()).flat_map(|object| map.point(object));
    points.map(|x| x * x).sum::<f64>().sqrt()
}

/// A map turned, and reflected where needed, to lie on another. `None` if it lacks one of its dimensions.
fn turned(map: &Map, to: &Map) -> Option<Map> {
    let (n, k) = (map.objects(), map.dimensions());
    let product = Matrix::from_fn(k, k, |i, j| {
        (0..n).map(|o| map.point(o)[i] * to.point(o)[j]).sum()
    });
    // The orthogonal factor of the product: M(M′M)^−½.
    let gram = Matrix::from_fn(k, k, |i, j| {
        (0..k).map(|m| product[(m, i)] * product[(m, j)]).sum()
    });
    let eigen = SymmetricEigen::new(gram);
    let largest = eigen.largest();
    if eigen.values.iter().any(|v| *v <= 1e-12 * largest) {
        return None;
    }
    let root = Matrix::from_fn(k, k, |i, j| {
        let terms = eigen.values.iter().enumerate();
        terms
            .map(|(at, v)| eigen.vectors[(at, i)] * eigen.vectors[(at, j)] / v.sqrt())
            .sum()
    });
    let rotation = Matrix::from_fn(k, k, |i, j| {
        (0..k).map(|m| product[(i, m)] * root[(m, j)]).sum()
    });
    let coordinates = (0..n).flat_map(|object| {
        let point = map.point(object);
        let rotation = &rotation;
        (0..k).map(move |j| (0..k).map(|i| point[i] * rotation[(i, j)]).sum::<f64>())
    });
    Some(Map::new(k, coordinates.collect()))
}
