//! Contrasts over the cells, one degree of freedom at a time.

use super::table::{Table, cells, over_cells};
use crate::distribution::{t_quantile, t_two_sided};
use crate::finite;
use crate::matrix::dot;

/// The t test of a contrast; N is the number of subjects, G of the groups.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contrast {
    /// Σ weight · mean of the cell.
    pub estimate: f64,
    /// Standard error, from the differences of subjects in this contrast alone.
    pub se: f64,
    /// Degrees of freedom: N − G.
    pub df: f64,
    /// estimate/se; `None` if the standard error is 0.
    pub t: Option<f64>,
    /// Two-sided p of t.
    pub p: Option<f64>,
    /// estimate ± t(.975, df)·se.
    pub ci95: (f64, f64),
    /// Cohen's d_z: estimate/(standard deviation of the contrast over subjects of a group);
    /// `None` if that is 0, and of [`group_contrast`].
    pub dz: Option<f64>,
}

/// Tests a contrast over the cells of a table as that of [`super::analysis`]: `weights` has a
/// number for each cell. With groups it is the unweighted mean of the groups, with the
/// variance within them. With weights whose sum is 1 it is a marginal mean. `None` for a
/// table that cannot be analyzed, or weights that are not finite or not one for each cell.
///
/// ```
/// # use study_stats::factorial::contrast;
/// // One group: the t test of the differences 1, 2 and 3.
/// let rows = [vec![2.0, 1.0], vec![4.0, 2.0], vec![6.0, 3.0]];
/// let found = contrast(&rows, &[], &[1.0, -1.0]).unwrap();
/// assert_eq!((found.estimate, found.df, found.dz), (2.0, 2.0, Some(2.0)));
/// ```
pub fn contrast(rows: &[Vec<f64>], groups: &[usize], weights: &[f64]) -> Option<Contrast> {
    alike_in_groups(&Table::of_cells(rows, groups).ok()?, weights)
}

/// The same weights in all groups.
pub(super) fn alike_in_groups(table: &Table, weights: &[f64]) -> Option<Contrast> {
    let groups = table.sizes.len();
    let of_group: Vec<f64> = weights.iter().map(|w| w / groups as f64).collect();
    let found = by_group(table, &vec![of_group; groups])?;
    // se² is the variance times Σ(1/ng)/G².
    let per_subject: f64 = table.sizes.iter().map(|n| 1.0 / *n as f64).sum();
    let sd = found.se * groups as f64 / per_subject.sqrt();
    Some(Contrast {
        dz: found.t.and_then(|_| finite(found.estimate / sd)),
        ..found
    })
}

/// Tests a contrast over the cells and groups: `weights` has a row for each group, with a
/// number for each cell. The variance is that of the means of subjects who have the same
/// covariance in all groups, Σ wgᵀSwg/ng with S pooled. `None` as of [`contrast`].
///
/// ```
/// # use study_stats::factorial::group_contrast;
/// // The difference of two groups in the first of two cells.
/// let rows = [[1.0, 0.0], [2.0, 0.5], [3.0, 0.0], [3.0, 0.5], [4.0, 0.0], [5.0, 0.5]];
/// let weights = [vec![-1.0, 0.0], vec![1.0, 0.0]];
/// let found = group_contrast(&rows.map(Vec::from), &[0, 0, 0, 1, 1, 1], &weights).unwrap();
/// assert_eq!(format!("{} {} {:.3}", found.estimate, found.df, found.t.unwrap()), "2 4 2.449");
/// ```
pub fn group_contrast(
    rows: &[Vec<f64>],
    groups: &[usize],
    weights: &[Vec<f64>],
) -> Option<Contrast> {
    by_group(&Table::of_cells(rows, groups).ok()?, weights)
}

/// Weights for each group.
pub(super) fn by_group(table: &Table, weights: &[Vec<f64>]) -> Option<Contrast> {
    let width = table.rows.first()?.len();
    let fits = |w: &Vec<f64>| w.len() == width && w.iter().all(|w| w.is_finite());
    if weights.len() != table.sizes.len() || !weights.iter().all(fits) {
        return None;
    }
    let (mut estimate, mut squares, mut all, mut size) = (0.0, 0.0, 0.0, 0.0);
    for (group, own) in weights.iter().enumerate() {
        let norm = dot(own, own);
        all += own.iter().sum::<f64>();
        size += own.iter().map(|w| w.abs()).sum::<f64>();
        if norm <= 0.0 {
            continue;
        }
        let (means, y) = table.centered(std::slice::from_ref(own));
        let error: f64 = y.iter().map(|v| dot(v, v)).sum();
        estimate += means[group][0];
        if error > table.least * norm {
            squares += error / table.sizes[group] as f64;
        }
    }
    // The mean of all values is in an estimate whose weights do not cancel.
    let mean = if all.abs() > 1e-12 * size {
        all * table.center
    } else {
        0.0
    };
    let df = table.df();
    let estimate = finite(estimate * table.unit + mean)?;
    let se = finite((squares / df).sqrt() * table.unit)?;
    let t = (se > 0.0).then(|| finite(estimate / se)).flatten();
    let half = finite(t_quantile(0.975, df)? * se)?;
    Some(Contrast {
        estimate,
        se,
        df,
        t,
        p: t.and_then(|t| t_two_sided(t, df)),
        ci95: (estimate - half, estimate + half),
        dz: None,
    })
}

/// A difference of two levels of a factor: the first minus the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pair {
    /// Place of the factor in the list of levels.
    pub factor: usize,
    /// The level that counts with a plus.
    pub first: usize,
    /// The level that counts with a minus.
    pub second: usize,
}

/// What a contrast compares. Factors that it does not name are averaged over.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum What {
    /// Two levels of a factor: marginal if `at` is empty, otherwise where the factors of `at`
    /// have these levels: a simple effect.
    Pair {
        /// What is compared.
        pair: Pair,
        /// Factor and level, of every other factor, ascending.
        at: Vec<(usize, usize)>,
    },
    /// The first difference at the first level of the other pair, minus the same at the second.
    Interaction(Pair, Pair),
}

/// The weights of a contrast over the cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// What is compared.
    pub what: What,
    /// A number for each cell, the level of the last factor changes fastest.
    pub weights: Vec<f64>,
}

/// All pairs of levels of a factor, averaged over the other factors; none if there is no such
/// factor or no such design.
///
/// ```
/// # use study_stats::factorial::marginal_pairs;
/// let pairs = marginal_pairs(&[2, 2], 1);
/// assert_eq!(pairs[0].weights, [0.5, -0.5, 0.5, -0.5]);
/// ```
pub fn marginal_pairs(levels: &[usize], factor: usize) -> Vec<Weights> {
    let weights = |pair: Pair| Weights {
        what: What::Pair {
            pair,
            at: Vec::new(),
        },
        weights: product(levels, &[pair], &[]),
    };
    pairs(levels, factor).into_iter().map(weights).collect()
}

/// All pairs of levels of a factor at each combination of levels of the others; none if there
/// is no such factor or no such design. Combination after combination, with all pairs of each.
pub fn simple_pairs(levels: &[usize], factor: usize) -> Vec<Weights> {
    let pairs = pairs(levels, factor);
    let others = (0..levels.len()).filter(|f| *f != factor);
    let combinations = others.fold(vec![Vec::new()], |all, other| {
        let with = |at: &Vec<(usize, usize)>| {
            let at = at.clone();
            (0..levels[other]).map(move |level| [at.clone(), vec![(other, level)]].concat())
        };
        // Without pairs there is nothing to combine, and the design may be too large.
        if pairs.is_empty() {
            all
        } else {
            all.iter().flat_map(with).collect()
        }
    });
    let weights = |at: &Vec<(usize, usize)>| {
        let weights = |pair: &Pair| Weights {
            what: What::Pair {
                pair: *pair,
                at: at.clone(),
            },
            weights: product(levels, &[*pair], at),
        };
        pairs.iter().map(weights).collect::<Vec<_>>()
    };
    combinations.iter().flat_map(weights).collect()
}

/// All differences of differences of two factors, averaged over the other factors; none if
/// they are one factor, or there is no such factor or no such design.
///
/// ```
/// # use study_stats::factorial::interaction_pairs;
/// let pairs = interaction_pairs(&[2, 2], (0, 1));
/// assert_eq!(pairs[0].weights, [1.0, -1.0, -1.0, 1.0]);
/// ```
pub fn interaction_pairs(levels: &[usize], factors: (usize, usize)) -> Vec<Weights> {
    if factors.0 == factors.1 {
        return Vec::new();
    }
    let second = pairs(levels, factors.1);
    let weights = |a: Pair| {
        second.iter().map(move |b| Weights {
            what: What::Interaction(a, *b),
            weights: product(levels, &[a, *b], &[]),
        })
    };
    pairs(levels, factors.0)
        .into_iter()
        .flat_map(weights)
        .collect()
}

/// The pairs of levels of a factor.
fn pairs(levels: &[usize], factor: usize) -> Vec<Pair> {
    if cells(levels).is_err() {
        return Vec::new();
    }
    let k = levels.get(factor).copied().unwrap_or(0);
    let of_first = |first| {
        (first + 1..k).map(move |second| Pair {
            factor,
            first,
            second,
        })
    };
    (0..k).flat_map(of_first).collect()
}

/// The weights of a contrast over the cells: the product over the factors of a difference of two levels, of
/// one level (factor and level in `at`), or of the mean over its levels.
///
/// ```
/// # use study_stats::factorial::{Pair, product};
/// let pair = Pair { factor: 0, first: 0, second: 1 };
/// assert_eq!(product(&[2, 2], &[pair], &[(1, 1)]), [0.0, 1.0, 0.0, -1.0]);
/// assert_eq!(product(&[2, 2], &[pair], &[]), [0.5, 0.5, -0.5, -0.5]);
/// ```
pub fn product(levels: &[usize], pairs: &[Pair], at: &[(usize, usize)]) -> Vec<f64> {
    let of_factor = |factor: usize, k: usize| {
        let pair = pairs.iter().find(|pair| pair.factor == factor);
        let held = at.iter().find(|(held, _)| *held == factor);
        let weight = |level: usize| match (pair, held) {
            (Some(pair), _) => {
                let is = |of: usize| f64::from(u8::from(level == of));
                is(pair.first) - is(pair.second)
            }
            (None, Some((_, held))) => f64::from(u8::from(level == *held)),
            (None, None) => 1.0 / k as f64,
        };
        vec![(0..k).map(weight).collect()]
    };
    over_cells(levels, of_factor).concat()
}
