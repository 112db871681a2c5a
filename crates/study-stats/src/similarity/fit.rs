//! How a map lies to known properties of its objects, by Procrustes' rotation, and how certain it is.

use super::Dissimilarities;
use super::scaling::{Map, Precision, Scale, smacof_from};
use crate::describe;
use crate::matrix::{Matrix, SymmetricEigen};
use crate::permutation::enumerate_orders;
use crate::random::RandomSource;

/// Largest number of objects of which all orders are enumerated.
pub const MAX_EXACT: usize = 8;
/// Number of random orders of more objects.
pub const DRAWS: u32 = 9_999;
/// Number of resamples of participants.
pub const RESAMPLES: usize = 499;

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
    /// Standard errors of the coordinates: by object, then by dimension. Maps of resamples are turned to the map first.
    pub errors: Vec<Vec<f64>>,
    /// Percentile interval of [`procrustes`]; `None` without properties.
    pub r_ci95: Option<(f64, f64)>,
    /// Resamples that gave a map.
    pub resamples: usize,
}

/// Draws participants with replacement [`RESAMPLES`] times, and scales the mean of their dissimilarities from the map on.
/// `None` for fewer than two participants, or if fewer than 95 % of the resamples give a map.
pub fn resampled(
    participants: &[Dissimilarities],
    map: &Map,
    properties: &[Vec<f64>],
    random: &mut impl RandomSource,
) -> Option<Resampled> {
    let n = participants.len();
    if n < 2 {
        return None;
    }
    let unit = Dissimilarities::mean(participants.iter())?;
    let start = smacof_from(map, &unit, Scale::Ordinal, Precision::COARSE)?.map;
    let to_units = size(map) / size(&start);
    let mut maps = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        let drawn: Vec<usize> = (0..n).map(|_| random.below(n as u64) as usize).collect();
        let mean = Dissimilarities::mean(drawn.iter().map(|at| &participants[*at]));
        let found =
            mean.and_then(|mean| smacof_from(&start, &mean, Scale::Ordinal, Precision::COARSE));
        let turned = found.and_then(|found| turned(&found.map.scaled(to_units), map));
        maps.extend(turned);
    }
    if maps.len() * 20 < RESAMPLES * 19 {
        return None;
    }
    let error = |object: usize, k: usize| {
        let own: Vec<f64> = maps.iter().map(|map| map.point(object)[k]).collect();
        describe::sd(&own)
    };
    let errors: Option<Vec<Vec<f64>>> = (0..map.objects())
        .map(|object| (0..map.dimensions()).map(|k| error(object, k)).collect())
        .collect();
    let r: Option<Vec<f64>> = maps.iter().map(|map| procrustes(map, properties)).collect();
    let r_ci95 = r.and_then(|r| {
        let sorted = describe::sorted(&r);
        Some((
            describe::quantile(&sorted, 0.025)?,
            describe::quantile(&sorted, 0.975)?,
        ))
    });
    Some(Resampled {
        errors: errors?,
        r_ci95,
        resamples: maps.len(),
    })
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
