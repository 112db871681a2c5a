//! The aligned rank transform (Higgins, Blair & Tashtoush 1990; Wobbrock, Findlater, Gergle &
//! Higgins 2011), and contrasts of aligned ranks (Elkin, Kay, Higgins & Wobbrock 2021).
//!
//! For each term every value loses the mean of its cell (of the factors and the group) and
//! gains the estimated effect of this term alone, which is the sum of the marginal means of
//! the term and of all that it contains, with alternating signs. These aligned values of all
//! subjects are ranked together, with mid-ranks, and their ranks are analyzed; only the effect
//! of the term counts. As in ARTool, marginal means are those of all values, so that larger
//! groups have more weight; sums of squares are of type III.
//!
//! Tests of aligned ranks do not hold their level where values are tied, such as single ratings,
//! or spread unequally: they reject too often, the more the more subjects there are (Luepsen
//! 2017; `docs/calibration.md`, "Factors"). The analysis of variance of the same values does.
//!
//! For the contrasts of a term its factors are one factor with all their combinations: the
//! value gains the marginal mean of its combination.

use super::contrasts::{Contrast, alike_in_groups, by_group, product};
use super::table::{Table, over_cells, within_contrasts};
use super::{Factorial, FactorialError, MAX_CELLS, Term, effect, terms};
use crate::anova::unit;
use crate::matrix::dot;
use crate::rank::mid_ranks;

/// Analysis of aligned ranks of a table as that of [`super::analysis`]: each term is aligned
/// and ranked by itself, and tested by type III sums of squares with an error of its own.
/// Values of different participants are ranked together. Sums of squares are of ranks; two
/// aligned values are tied if they agree to 10⁻¹⁰ of the largest deviation from the mean.
///
/// ```
/// # use study_stats::factorial::aligned_ranks;
/// let rows = [[1.0, 2.0, 3.0, 5.0], [2.0, 2.0, 4.0, 5.0], [1.0, 3.0, 2.0, 6.0]].map(Vec::from);
/// let found = aligned_ranks(&rows, &[2, 2], &[]).unwrap();
/// assert_eq!(format!("{:.3}", found.effects[2].f.unwrap()), "84.211");
/// ```
pub fn aligned_ranks(
    rows: &[Vec<f64>],
    levels: &[usize],
    groups: &[usize],
) -> Result<Factorial, FactorialError> {
    let table = Table::new(rows, levels, groups)?;
    let effects = terms(levels.len(), table.has_groups()).into_iter();
    let of_term = |term: Term| {
        let ranked = ranked(&table, &within_contrasts(&term.factors, levels), |means| {
            let all = of_all(means, &table.sizes);
            if term.group {
                deviations(means, &all)
            } else {
                vec![all; means.len()]
            }
        })?;
        effect(&ranked, levels, term)
    };
    Ok(Factorial {
        effects: effects.map(of_term).collect::<Result<_, _>>()?,
        participants: rows.len(),
    })
}

/// A combination of levels of a term.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Level {
    /// The level of each factor of the term.
    pub levels: Vec<usize>,
    /// The group, if it belongs to the term.
    pub group: Option<usize>,
}

/// The comparison of two combinations of levels.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignedPair {
    /// What counts with a plus.
    pub first: Level,
    /// What counts with a minus.
    pub second: Level,
    /// The t test of the difference of aligned ranks, averaged over the other factors, and
    /// over groups without weights; p is not corrected for the number of pairs.
    pub contrast: Contrast,
}

/// Compares all pairs of levels of a term, of an interaction all pairs of combinations, by
/// contrasts of aligned ranks (ART-C). Each is tested by its own differences over subjects,
/// as [`super::contrast`] and [`super::group_contrast`] do.
///
/// ```
/// # use study_stats::factorial::{Term, aligned_pairs};
/// let rows = [[1.0, 2.0, 3.0, 5.0], [2.0, 2.0, 4.0, 5.0], [1.0, 3.0, 2.0, 6.0]].map(Vec::from);
/// let term = Term { factors: vec![0, 1], group: false };
/// assert_eq!(aligned_pairs(&rows, &[2, 2], &[], &term).unwrap().len(), 6);
/// ```
pub fn aligned_pairs(
    rows: &[Vec<f64>],
    levels: &[usize],
    groups: &[usize],
    term: &Term,
) -> Result<Vec<AlignedPair>, FactorialError> {
    let table = Table::new(rows, levels, groups)?;
    let known = term.factors.iter().all(|f| *f < levels.len());
    let ascending = term.factors.windows(2).all(|w| w[0] < w[1]);
    if !known || !ascending || term.order() == 0 || (term.group && !table.has_groups()) {
        return Err(FactorialError::UnknownTerm);
    }
    let combinations = over_cells(levels, |factor, k| {
        if term.factors.contains(&factor) {
            identity(k)
        } else {
            vec![unit(k)]
        }
    });
    let table = ranked(&table, &combinations, |means| {
        if term.group {
            means.to_vec()
        } else {
            vec![of_all(means, &table.sizes); means.len()]
        }
    })?;
    let levels_of_term = level_list(term, levels, table.sizes.len());
    if levels_of_term.len() > MAX_CELLS {
        return Err(FactorialError::TooManyCells);
    }
    let mut pairs = Vec::new();
    for (i, first) in levels_of_term.iter().enumerate() {
        for second in &levels_of_term[i + 1..] {
            let contrast = compared(&table, levels, term, first, second);
            pairs.push(AlignedPair {
                first: first.clone(),
                second: second.clone(),
                contrast: contrast.ok_or(FactorialError::Overflow)?,
            });
        }
    }
    Ok(pairs)
}

fn compared(
    table: &Table,
    levels: &[usize],
    term: &Term,
    first: &Level,
    second: &Level,
) -> Option<Contrast> {
    let mean = |level: &Level| {
        let at = term.factors.iter().copied().zip(level.levels.clone());
        product(levels, &[], &at.collect::<Vec<_>>())
    };
    let (plus, minus) = (mean(first), mean(second));
    if !term.group {
        return alike_in_groups(table, &difference(&plus, &minus));
    }
    let zeros = vec![0.0; plus.len()];
    let of_group = |group: usize| {
        let own = |level: &Level, weights: &[f64]| {
            if level.group == Some(group) {
                weights.to_vec()
            } else {
                zeros.clone()
            }
        };
        difference(&own(first, &plus), &own(second, &minus))
    };
    let weights: Vec<Vec<f64>> = (0..table.sizes.len()).map(of_group).collect();
    by_group(table, &weights)
}

/// All combinations of levels of a term; the group changes slowest, the last factor fastest.
fn level_list(term: &Term, levels: &[usize], groups: usize) -> Vec<Level> {
    let start: Vec<Level> = if term.group {
        let of_group = |group| Level {
            levels: Vec::new(),
            group: Some(group),
        };
        (0..groups).map(of_group).collect()
    } else {
        vec![Level {
            levels: Vec::new(),
            group: None,
        }]
    };
    term.factors.iter().fold(start, |all, factor| {
        let with = |before: &Level| {
            let before = before.clone();
            (0..levels[*factor]).map(move |level| Level {
                levels: [&before.levels[..], &[level]].concat(),
                group: before.group,
            })
        };
        all.iter().flat_map(with).collect()
    })
}

/// The table of the ranks of aligned values: what is left of each value by the mean of its
/// cell, plus the projection onto the orthonormal rows of `effect` of what `of_groups` makes
/// of the means by group.
fn ranked(
    table: &Table,
    effect: &[Vec<f64>],
    of_groups: impl Fn(&[Vec<f64>]) -> Vec<Vec<f64>>,
) -> Result<Table, FactorialError> {
    let (means, mut rows) = table.centered(&identity(table.rows[0].len()));
    let effects: Vec<Vec<f64>> = (of_groups(&means).iter())
        .map(|means| projected(effect, means))
        .collect();
    let of_row = table.groups();
    for (row, group) in rows.iter_mut().zip(&of_row) {
        (row.iter_mut().zip(&effects[*group])).for_each(|(x, effect)| *x += effect);
    }
    let ranks = mid_ranks(&rows.concat());
    let width = table.rows[0].len();
    let rows: Vec<Vec<f64>> = ranks.chunks(width).map(<[f64]>::to_vec).collect();
    Table::of_cells(&rows, &of_row)
}

/// CᵀCx of orthonormal rows C.
fn projected(c: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; x.len()];
    for row in c {
        let along = dot(row, x);
        sum.iter_mut().zip(row).for_each(|(s, c)| *s += along * c);
    }
    sum
}

/// The mean over all subjects of means by group.
fn of_all(means: &[Vec<f64>], sizes: &[usize]) -> Vec<f64> {
    let n = sizes.iter().sum::<usize>() as f64;
    let cell = |j: usize| {
        let weighted = means.iter().zip(sizes).map(|(m, n)| m[j] * *n as f64);
        weighted.sum::<f64>() / n
    };
    (0..means[0].len()).map(cell).collect()
}

fn deviations(means: &[Vec<f64>], all: &[f64]) -> Vec<Vec<f64>> {
    means.iter().map(|mean| difference(mean, all)).collect()
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn identity(k: usize) -> Vec<Vec<f64>> {
    let row = |i: usize| (0..k).map(|j| f64::from(u8::from(i == j))).collect();
    (0..k).map(row).collect()
}
