//! Realizations compared within subjects, where not everybody rated all of them.
//!
//! In the model cell mean ~ subject + realization, both as fixed factors, a difference
//! between two realizations rests on subjects who link them only. Who rates severely and
//! who leniently does not matter, also if lenient subjects rated other realizations than
//! severe ones (the intrablock analysis of block designs: Yates 1936, Ann. Eugenics 7,
//! 121–140). Least squares; F and t are exact for normal errors of equal variance. Each cell
//! counts once, however often it was rated. In complete tables F is that of the analysis of
//! variance, and the differences are those of the means over subjects.
//!
//! Realizations that no chain of subjects links cannot be compared: see [`Within::sets`].

mod clustered;
mod trend;

pub use clustered::{Clustered, Differences, MAX_CLUSTERED_REALIZATIONS, MAX_CLUSTERED_SUBJECTS};
pub use trend::Trend;

use crate::distribution::{f_upper, t_quantile, t_two_sided};
use crate::finite;
use crate::lmm::{CellSummary, ContrastF, ContrastT};
use crate::matrix::{Cholesky, Matrix, SymmetricMatrix};

/// Most realizations: the work grows with their cube.
pub const MAX_REALIZATIONS: usize = 300;

/// Why realizations are not compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WithinError {
    /// No cell.
    #[error("there are no ratings")]
    NoData,
    /// One realization.
    #[error("there is only one realization")]
    OneRealization,
    /// Too many of them.
    #[error("realizations are compared within participants up to {MAX_REALIZATIONS}")]
    TooMany,
    /// Too many for standard errors clustered by subject.
    #[error(
        "standard errors clustered by participant are computed for up to {MAX_CLUSTERED_REALIZATIONS} realizations and {MAX_CLUSTERED_SUBJECTS} participants"
    )]
    TooManyClustered,
    /// A number is not finite.
    #[error("the ratings are too large to be squared")]
    Overflow,
}

/// Realizations, compared within subjects.
#[derive(Debug, Clone, PartialEq)]
pub struct Within {
    /// The numbers that identify the realizations, sorted.
    pub realizations: Vec<usize>,
    /// For each of them the set of realizations that subjects link, numbered from 0 by its first member.
    pub sets: Vec<usize>,
    /// What a mean subject would rate: the mean over subjects of their level, plus the
    /// effect of the realization. Levels of different sets cannot be compared.
    pub means: Vec<f64>,
    /// The test that all realizations of a set have one mean, over all sets; `None` without
    /// degrees of freedom or without residuals.
    pub effect: Option<ContrastF>,
    /// Variance of a cell mean about the model, and its degrees of freedom.
    pub error: Option<(f64, f64)>,
    /// Effects, 0 for the reference of each set.
    effects: Vec<f64>,
    /// Their covariance over the variance of a cell mean.
    unit: Matrix,
    /// Their covariance, by the variance of each cell, which depends on how often it was rated.
    covariance: Option<Matrix>,
    /// The same if a cell of n ratings has the variance 1 + 1/n: what the design says, whatever the ratings are.
    of_design: Matrix,
}

/// The cells of one subject: realization as a position, mean, ratings.
type Own = Vec<(usize, f64, usize)>;

impl Within {
    /// Compares the realizations of some cells, whatever their covariate. Those of one subject
    /// have to be adjacent.
    ///
    /// # Errors
    /// [`WithinError`].
    pub fn of(cells: &[CellSummary]) -> Result<Self, WithinError> {
        let mut realizations: Vec<usize> = cells.iter().map(|c| c.realization).collect();
        realizations.sort_unstable();
        realizations.dedup();
        let k = realizations.len();
        match k {
            0 => return Err(WithinError::NoData),
            1 => return Err(WithinError::OneRealization),
            _ if k > MAX_REALIZATIONS => return Err(WithinError::TooMany),
            _ => {}
        }
        let place = |c: &CellSummary| realizations.binary_search(&c.realization).unwrap_or(0);
        let subjects: Vec<Own> = (cells.chunk_by(|a, b| a.subject == b.subject))
            .map(|own| own.iter().map(|c| (place(c), c.mean, c.n)).collect())
            .collect();
        let rated: Vec<Vec<usize>> = (subjects.iter())
            .map(|own| own.iter().map(|c| c.0).collect())
            .collect();
        let sets = linked_sets(&rated, k);

        // The normal equations without the levels of the subjects.
        let (mut normal, mut right, mut total) = (SymmetricMatrix::zero(k), vec![0.0; k], 0.0);
        for own in &subjects {
            let n = own.len() as f64;
            let mean = own.iter().map(|c| c.1).sum::<f64>() / n;
            for (i, &(a, y, _)) in own.iter().enumerate() {
                right[a] += y - mean;
                total += (y - mean).powi(2);
                normal.add(a, a, 1.0 - 1.0 / n);
                for &(b, ..) in &own[..i] {
                    normal.add(a, b, -1.0 / n);
                }
            }
        }
        // The last realization of each set is its reference.
        let is_reference = |j: usize| !sets[j + 1..].contains(&sets[j]);
        let free: Vec<usize> = (0..k).filter(|j| !is_reference(*j)).collect();
        let reduced = SymmetricMatrix::from_fn(free.len(), |i, j| normal.get(free[i], free[j]));
        let factor = Cholesky::semidefinite(&reduced, |_| 1e-11)
            .filter(|factor| factor.rank() == free.len())
            .ok_or(WithinError::Overflow)?;
        let mut effects = vec![0.0; k];
        let solved = factor.solve(&free.iter().map(|&j| right[j]).collect::<Vec<_>>());
        let inverse = factor.inverse();
        let mut at = vec![None; k];
        for (i, &j) in free.iter().enumerate() {
            (effects[j], at[j]) = (solved[i], Some(i));
        }
        let unit = Matrix::from_fn(k, k, |a, b| match (at[a], at[b]) {
            (Some(a), Some(b)) => inverse[(a, b)],
            _ => 0.0,
        });

        let residual = |own: &Own| -> (f64, f64) {
            let n = own.len() as f64;
            let level = own.iter().map(|&(j, y, _)| y - effects[j]).sum::<f64>() / n;
            let squares = own
                .iter()
                .map(|&(j, y, _)| (y - effects[j] - level).powi(2));
            (level, squares.sum())
        };
        let (levels, squares): (Vec<f64>, Vec<f64>) = subjects.iter().map(residual).unzip();
        let squares: f64 = squares.iter().sum();
        let level = levels.iter().sum::<f64>() / levels.len() as f64;
        let means: Vec<f64> = effects.iter().map(|effect| level + effect).collect();
        if !(squares.is_finite() && means.iter().all(|mean| mean.is_finite())) {
            return Err(WithinError::Overflow);
        }
        let df1 = free.len() as f64;
        let df2 = cells.len() as f64 - subjects.len() as f64 - df1;
        // Equal thirds differ in their last bits only.
        let size = cells.iter().fold(0.0f64, |size, c| size.max(c.mean.abs()));
        let varies = squares > 1e-24 * size * size * cells.len() as f64;
        let error = (df2 >= 1.0 && varies).then(|| (squares / df2, df2));
        let effect = error.filter(|_| df1 >= 1.0).and_then(|(variance, df2)| {
            let f = finite(((total - squares) / df1).max(0.0) / variance)?;
            Some(ContrastF {
                f,
                df1,
                df2: Some(df2),
                p: f_upper(f, df1, df2),
            })
        });
        let mut found = Self {
            realizations,
            sets,
            means,
            effect,
            error,
            effects,
            unit,
            covariance: None,
            of_design: Matrix::zeros(k, k),
        };
        found.covariance = found.by_cell(cells, &subjects);
        found.of_design = found.sandwich(&subjects, |n| 1.0 + 1.0 / n as f64);
        Ok(found)
    }

    /// Whether subjects link all realizations, directly or by way of others.
    pub fn is_connected(&self) -> bool {
        self.sets.iter().all(|set| *set == 0)
    }

    /// The difference of two realizations, by their positions: the first minus the second. `None` if no
    /// subjects link them, or without residuals.
    pub fn difference(&self, first: usize, second: usize) -> Option<ContrastT> {
        let (variance, df) = self
            .error
            .filter(|_| self.sets[first] == self.sets[second])?;
        let estimate = self.effects[first] - self.effects[second];
        let se = (variance * spread(&self.unit, first, second)).sqrt();
        let t = finite(estimate / se);
        let half = t_quantile(0.975, df).map(|t| t * se);
        Some(ContrastT {
            estimate,
            se,
            t,
            df: Some(df),
            p: t.and_then(|t| t_two_sided(t, df)),
            ci95: half.map(|half| (estimate - half, estimate + half)),
        })
    }

    /// The same with the means of some realizations moved, by their positions. Their precision stays; there is no `effect`.
    #[must_use]
    pub fn moved(&self, by: &[f64]) -> Self {
        Self {
            means: sums(&self.means, by),
            effects: sums(&self.effects, by),
            effect: None,
            ..self.clone()
        }
    }

    /// How unlike the design makes the precision of the differences between linked realizations, of those at
    /// some positions: the largest variance over the smallest, if a cell of n ratings has the variance 1 + 1/n. 1 in a
    /// balanced design.
    pub fn precision_ratio(&self, positions: impl Fn(usize) -> bool) -> f64 {
        let of: Vec<usize> = (0..self.realizations.len())
            .filter(|i| positions(*i))
            .collect();
        let pairs =
            (of.iter().enumerate()).flat_map(|(at, i)| of[at + 1..].iter().map(move |j| (*i, *j)));
        let linked = pairs.filter(|(i, j)| self.sets[*i] == self.sets[*j]);
        let (low, high) = linked.fold((f64::INFINITY, 0.0f64), |(low, high), (i, j)| {
            let variance = spread(&self.of_design, i, j);
            (low.min(variance), high.max(variance))
        });
        if high > 0.0 { high / low } else { 1.0 }
    }

    /// The covariance of the effects. A cell mean of n ratings has the variance a + b/n: b is the
    /// variance of the ratings within cells, a the rest of the variance of a cell mean about the model.
    fn by_cell(&self, cells: &[CellSummary], subjects: &[Own]) -> Option<Matrix> {
        let (variance, _) = self.error?;
        let k = self.realizations.len();
        let even = cells.iter().all(|c| c.n == cells[0].n);
        let df: f64 = cells.iter().map(|c| c.n as f64 - 1.0).sum();
        if even || df < 1.0 {
            return Some(Matrix::from_fn(k, k, |i, j| variance * self.unit[(i, j)]));
        }
        let within = cells.iter().map(|c| c.within).sum::<f64>() / df;
        let inverse = cells.iter().map(|c| 1.0 / c.n as f64).sum::<f64>() / cells.len() as f64;
        let between = (variance - within * inverse).max(0.0);
        let full = self.sandwich(subjects, |n| between + within / n as f64);
        (full.elements().iter())
            .all(|x| x.is_finite())
            .then_some(full)
    }

    /// The covariance of the effects, if a cell of n ratings has this variance.
    fn sandwich(&self, subjects: &[Own], variance: impl Fn(usize) -> f64) -> Matrix {
        let k = self.realizations.len();
        // Σ over subjects of M diag(v) M, with M = I − 11ᵀ/n.
        let mut inner = SymmetricMatrix::zero(k);
        for own in subjects {
            let n = own.len() as f64;
            let v: Vec<f64> = own.iter().map(|c| variance(c.2)).collect();
            let sum = v.iter().sum::<f64>() / (n * n);
            for i in 0..own.len() {
                for j in 0..=i {
                    let same = if i == j { v[i] } else { 0.0 };
                    inner.add(own[i].0, own[j].0, same - (v[i] + v[j]) / n + sum);
                }
            }
        }
        let half = Matrix::from_fn(k, k, |i, j| {
            (0..k).map(|l| self.unit[(i, l)] * inner.get(l, j)).sum()
        });
        Matrix::from_fn(k, k, |i, j| {
            (0..k).map(|l| half[(i, l)] * self.unit[(l, j)]).sum()
        })
    }
}

/// The sums of numbers, one by one.
fn sums(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Variance of the difference of two effects.
fn spread(covariance: &Matrix, i: usize, j: usize) -> f64 {
    covariance[(i, i)] + covariance[(j, j)] - 2.0 * covariance[(i, j)]
}

/// For each of `n` things the number of its set, by the first member: the things of a group are linked, and so are
/// those of groups that share one. Things are positions below `n`.
pub fn linked_sets(groups: &[Vec<usize>], n: usize) -> Vec<usize> {
    let mut sets: Vec<usize> = (0..n).collect();
    loop {
        let before = sets.clone();
        for group in groups {
            let least = group.iter().map(|thing| sets[*thing]).min().unwrap_or(0);
            group.iter().for_each(|thing| sets[*thing] = least);
        }
        if sets == before {
            break;
        }
    }
    let mut first = sets.clone();
    first.sort_unstable();
    first.dedup();
    (sets.iter())
        .map(|set| first.binary_search(set).unwrap_or(0))
        .collect()
}

#[cfg(test)]
mod tests;
