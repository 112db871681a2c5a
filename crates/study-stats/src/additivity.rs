//! Whether two factors act additively: F tests of their interaction.

use super::distribution::f_upper;
use super::finite;
use super::matrix::{Cholesky, SymmetricMatrix};

/// The ratings of one subject of one realization.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdditivityCell {
    /// Any number that identifies the subject. Cells of one subject have to be adjacent.
    pub subject: usize,
    /// The realization, from 0.
    pub realization: usize,
    /// Number of ratings, at least 1.
    pub n: usize,
    /// Mean of the ratings.
    pub mean: f64,
    /// Sum of squared deviations of the ratings from their mean.
    pub within: f64,
}

/// An F test that there is no interaction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interaction {
    /// F; `None` if there is no variance of error.
    pub f: Option<f64>,
    /// Degrees of freedom of the interaction.
    pub df1: f64,
    /// Degrees of freedom of the error.
    pub df2: f64,
    /// P(F ≥ f).
    pub p: Option<f64>,
}

impl Interaction {
    fn of(interaction: f64, df1: f64, error: f64, df2: f64, size: f64) -> Option<Self> {
        if df1 < 1.0 || df2 < 1.0 {
            return None;
        }
        let f = (error > 1e-20 * size).then(|| (interaction.max(0.0) / df1) / (error / df2));
        let f = f.and_then(finite);
        Some(Self {
            f,
            df1,
            df2,
            p: f.and_then(|f| f_upper(f, df1, df2)),
        })
    }
}

/// Most realizations: the order of the normal equations.
const MAX_REALIZATIONS: usize = 300;

/// Interaction of subjects and realizations against the variance within cells, by least
/// squares; cells may be missing and hold different numbers of ratings. The additive
/// model is fitted to the cell means with their numbers of ratings as weights; what it
/// leaves is the interaction (Searle 1987, §4.9).
///
/// `None` if no cell has two ratings, no degree of freedom is left for the interaction,
/// or there are more than 300 realizations.
pub fn interaction(cells: &[AdditivityCell]) -> Option<Interaction> {
    let k = cells.iter().map(|c| c.realization + 1).max()?;
    if k > MAX_REALIZATIONS {
        return None;
    }
    let total: f64 = cells.iter().map(|c| c.n as f64).sum();
    let centre = cells.iter().map(|c| c.n as f64 * c.mean).sum::<f64>() / total;
    let subjects = || cells.chunk_by(|a, b| a.subject == b.subject);
    // Subjects are removed by centring within them (Frisch & Waugh 1933).
    let mut normal = SymmetricMatrix::zero(k);
    let mut right = vec![0.0; k];
    for own in subjects() {
        let n: f64 = own.iter().map(|c| c.n as f64).sum();
        let mean = own
            .iter()
            .map(|c| c.n as f64 * (c.mean - centre))
            .sum::<f64>()
            / n;
        for (i, a) in own.iter().enumerate() {
            right[a.realization] += a.n as f64 * (a.mean - centre - mean);
            normal.add(a.realization, a.realization, a.n as f64);
            for b in &own[..=i] {
                let share = a.n as f64 * b.n as f64 / n;
                normal.add(a.realization, b.realization, -share);
            }
        }
    }
    let factor = Cholesky::semidefinite(&normal, |_| 1e-10)?;
    let effects = factor.solve(&right);
    let (mut left, mut size) = (0.0, 0.0);
    for own in subjects() {
        let n: f64 = own.iter().map(|c| c.n as f64).sum();
        let rest = |c: &AdditivityCell| c.mean - centre - effects[c.realization];
        let mean = own.iter().map(|c| c.n as f64 * rest(c)).sum::<f64>() / n;
        for c in own {
            left += c.n as f64 * (rest(c) - mean).powi(2);
            size += c.n as f64 * (c.mean - centre).powi(2) + c.within;
        }
    }
    let df1 = cells.len() as f64 - subjects().count() as f64 - factor.rank() as f64;
    let df2 = total - cells.len() as f64;
    let within: f64 = cells.iter().map(|c| c.within).sum();
    Interaction::of(left, df1, within, df2, size)
}

/// Whether the slopes of subjects on a covariate of the realizations differ, in a complete
/// table of subjects × realizations, against the rest of the interaction (Mandel 1961,
/// with a known covariate). With dᵢⱼ the doubly centred table, x centred and
/// cᵢ = Σⱼ dᵢⱼxⱼ/Σxⱼ²: SS = Σ cᵢ² Σxⱼ² on S − 1 degrees of freedom, the error has
/// (S − 1)(k − 2).
///
/// `None` for fewer than two subjects or three realizations, or if the covariate does not
/// vary.
pub fn slopes_differ<R: AsRef<[f64]>>(rows: &[R], x: &[f64]) -> Option<Interaction> {
    let rows = super::rectangular(rows)?;
    let (s, k) = (rows.len(), x.len());
    if s < 2 || k < 3 || rows[0].len() != k {
        return None;
    }
    let mean = |values: &mut dyn Iterator<Item = f64>, n: usize| values.sum::<f64>() / n as f64;
    let centre = mean(&mut x.iter().copied(), k);
    let x: Vec<f64> = x.iter().map(|x| x - centre).collect();
    let xx: f64 = x.iter().map(|x| x * x).sum();
    if !(xx > 1e-24 * centre * centre) {
        return None;
    }
    let columns: Vec<f64> = (0..k)
        .map(|j| mean(&mut rows.iter().map(|r| r[j]), s))
        .collect();
    let grand = mean(&mut columns.iter().copied(), k);
    let (mut slopes, mut all, mut size) = (0.0, 0.0, 0.0);
    for row in &rows {
        let own = mean(&mut row.iter().copied(), k);
        let rest: Vec<f64> = (row.iter().zip(&columns))
            .map(|(y, column)| y - own - column + grand)
            .collect();
        let slope = rest.iter().zip(&x).map(|(d, x)| d * x).sum::<f64>() / xx;
        slopes += slope * slope * xx;
        all += rest.iter().map(|d| d * d).sum::<f64>();
        size += row.iter().map(|y| (y - grand).powi(2)).sum::<f64>();
    }
    let df = (s - 1) as f64;
    Interaction::of(slopes, df, all - slopes, df * (k - 2) as f64, size)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: Option<f64>, expected: f64) -> bool {
        found.is_some_and(|x| (x / expected - 1.0).abs() < 1e-4)
    }

    fn cells(all: &[(usize, usize, &[f64])]) -> Vec<AdditivityCell> {
        let one = |&(subject, realization, y): &(usize, usize, &[f64])| {
            let mean = y.iter().sum::<f64>() / y.len() as f64;
            AdditivityCell {
                subject,
                realization,
                n: y.len(),
                mean,
                within: y.iter().map(|v| (v - mean).powi(2)).sum(),
            }
        };
        all.iter().map(one).collect()
    }

    /// R 4.2: anova(lm(y ~ s + m), lm(y ~ s * m)); one cell is missing.
    #[test]
    fn interaction_of_unequal_cells() {
        let cells = cells(&[
            (0, 0, &[2.0, 3.0]),
            (0, 1, &[4.0, 4.0]),
            (0, 2, &[6.0, 7.0]),
            (1, 0, &[6.0, 5.0]),
            (1, 1, &[4.0, 3.0]),
            (1, 2, &[2.0]),
            (2, 0, &[1.0]),
            (2, 1, &[4.0, 5.0]),
            (2, 2, &[6.0, 6.0, 7.0]),
            (3, 0, &[5.0, 6.0]),
            (3, 2, &[2.0, 3.0]),
        ]);
        let found = interaction(&cells).unwrap();
        assert_eq!((found.df1, found.df2), (5.0, 10.0));
        assert!(near(found.f, 25.29433), "{found:?}");
        assert!(near(found.p, 2.2546e-5), "{found:?}");
    }

    /// R 4.2: anova(lm(y ~ s + m), lm(y ~ s + m + s:x)).
    #[test]
    fn slopes_of_opposed_subjects() {
        let rows = [
            [2.0, 4.0, 5.0, 7.0],
            [6.0, 5.0, 3.0, 1.0],
            [3.0, 4.0, 6.0, 6.0],
            [5.0, 5.0, 4.0, 2.0],
            [1.0, 3.0, 3.0, 6.0],
        ];
        let found = slopes_differ(&rows, &[0.7, 0.75, 0.85, 0.95]).unwrap();
        assert_eq!((found.df1, found.df2), (4.0, 8.0));
        assert!(near(found.f, 34.54803), "{found:?}");
        assert!(near(found.p, 4.2874e-5), "{found:?}");
    }

    #[test]
    fn without_an_error_there_is_no_f() {
        let rows = [[1.0, 2.0, 3.0], [3.0, 4.0, 5.0]];
        let found = slopes_differ(&rows, &[0.7, 0.8, 0.9]).unwrap();
        assert_eq!((found.f, found.p), (None, None));
        let once = cells(&[
            (0, 0, &[1.0]),
            (0, 1, &[2.0]),
            (1, 0, &[2.0]),
            (1, 1, &[1.0]),
        ]);
        assert_eq!(interaction(&once), None);
        assert_eq!(slopes_differ(&rows, &[0.8; 3]), None);
    }
}
