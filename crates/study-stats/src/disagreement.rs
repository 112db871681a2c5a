//! Whether subjects disagree about the realizations: their interaction.

use super::distribution::f_upper;
use super::finite;
use super::lmm::CellSummary;
use super::matrix::{Cholesky, SymmetricMatrix, dot};
use std::collections::BTreeMap;

/// The test that no subject × realization effects exist beside those of subjects and of
/// realizations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disagreement {
    /// Mean square of the interaction over that of repeated ratings.
    pub f: f64,
    /// Degrees of freedom of the interaction.
    pub df1: f64,
    /// Degrees of freedom of the repeated ratings.
    pub df2: f64,
    /// P(F ≥ f).
    pub p: Option<f64>,
}

/// Most realizations: the order of a dense Cholesky factor.
const MAX_REALIZATIONS: usize = 200;

/// F test of the interaction in y ~ subject + realization + interaction, with the
/// variation of the ratings within cells as error (a test of lack of fit; Scheffé
/// 1959, §4.3). It finds any disagreement that persists over repetitions, such as two
/// camps with opposite tastes, and holds for tables with missing cells.
///
/// `None` if no cell has two ratings or all ratings of each cell are equal, if subjects
/// and realizations leave nothing to explain, or above 200 realizations.
pub fn disagreement(cells: &[CellSummary]) -> Option<Disagreement> {
    let mut realizations: Vec<usize> = cells.iter().map(|c| c.realization).collect();
    realizations.sort_unstable();
    realizations.dedup();
    let mut subjects: BTreeMap<usize, Vec<&CellSummary>> = BTreeMap::new();
    for cell in cells {
        subjects.entry(cell.subject).or_default().push(cell);
    }
    let k = realizations.len();
    if k > MAX_REALIZATIONS {
        return None;
    }
    let n: f64 = cells.iter().map(|c| c.n as f64).sum();
    let within: f64 = cells.iter().map(|c| c.within).sum();
    // Subjects are eliminated; one realization is left out by the factor.
    let mut normal = SymmetricMatrix::zero(k);
    let mut right = vec![0.0; k];
    let mut rest = 0.0;
    let mut row = vec![0.0; k];
    for own in subjects.values() {
        let total: f64 = own.iter().map(|c| c.n as f64).sum();
        let mean = own.iter().map(|c| c.n as f64 * c.mean).sum::<f64>() / total;
        row.fill(0.0);
        for c in own {
            let (m, weight) = (
                realizations.partition_point(|r| *r < c.realization),
                c.n as f64,
            );
            row[m] += weight;
            normal.add(m, m, weight);
            right[m] += weight * (c.mean - mean);
            rest += weight * (c.mean - mean).powi(2);
        }
        normal.add_outer(-1.0 / total, &row);
    }
    let factor = Cholesky::semidefinite(&normal, |_| 1e-11)?;
    let explained = dot(&factor.solve(&right), &right);
    let df1 = (cells.len() - subjects.len() - factor.rank()) as f64;
    let df2 = n - cells.len() as f64;
    if !(df1 > 0.0 && df2 > 0.0 && within > 1e-24 * (rest + within)) {
        return None;
    }
    let f = finite((rest - explained).max(0.0) / df1 / (within / df2))?;
    Some(Disagreement {
        f,
        df1,
        df2,
        p: f_upper(f, df1, df2),
    })
}

/// Whether the slopes of subjects on a covariate of the realizations differ, in a complete
/// table of subjects × realizations, against the rest of the interaction (Mandel 1961,
/// with a known covariate). With dᵢⱼ the doubly centered table, x centered and
/// cᵢ = Σⱼ dᵢⱼxⱼ/Σxⱼ²: SS = Σ cᵢ² Σxⱼ² on S − 1 degrees of freedom, the error has
/// (S − 1)(k − 2).
///
/// `None` for fewer than two subjects or three realizations, or if the covariate or the
/// error does not vary.
pub fn slopes_differ<R: AsRef<[f64]>>(rows: &[R], x: &[f64]) -> Option<Disagreement> {
    let rows = super::rectangular(rows)?;
    let (s, k) = (rows.len(), x.len());
    if s < 2 || k < 3 || rows[0].len() != k {
        return None;
    }
    let mean = |values: &mut dyn Iterator<Item = f64>, n: usize| values.sum::<f64>() / n as f64;
    let center = mean(&mut x.iter().copied(), k);
    let x: Vec<f64> = x.iter().map(|x| x - center).collect();
    let xx: f64 = x.iter().map(|x| x * x).sum();
    if xx.is_nan() || xx <= 1e-24 * center * center {
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
    let error = all - slopes;
    if error <= 1e-20 * size {
        return None;
    }
    let df2 = df * (k - 2) as f64;
    let f = finite((slopes / df) / (error / df2))?;
    Some(Disagreement {
        f,
        df1: df,
        df2,
        p: f_upper(f, df, df2),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every subject rates twice, a and a + 1, so that the mean is a + ½.
    fn cells(a: &[[f64; 3]]) -> Vec<CellSummary> {
        let rows = a.iter().enumerate();
        let cell = |s: usize, m: usize, a: f64| CellSummary {
            subject: s,
            realization: m,
            x: 0.0,
            n: 2,
            mean: a + 0.5,
            within: 0.5,
        };
        rows.flat_map(|(s, row)| (0..3).map(move |m| cell(s, m, row[m])))
            .collect()
    }

    /// By hand: the interaction of two opposed subjects is ±1, 0, ∓1, its sum of squares
    /// 2·4 = 8 on 2 degrees of freedom; the error is 6·½ on 6.
    #[test]
    fn opposed_subjects_disagree_and_shifted_ones_do_not() {
        let found = disagreement(&cells(&[[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]])).unwrap();
        assert_eq!((found.f, found.df1, found.df2), (8.0, 2.0, 6.0));
        let shifted = disagreement(&cells(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])).unwrap();
        assert!(shifted.f < 1e-12);
    }

    #[test]
    fn without_repeated_ratings_there_is_no_test() {
        let single: Vec<CellSummary> = cells(&[[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]])
            .iter()
            .map(|c| CellSummary {
                n: 1,
                within: 0.0,
                ..*c
            })
            .collect();
        assert_eq!(disagreement(&single), None);
        assert_eq!(disagreement(&[]), None);
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
        assert!((found.f / 34.54803 - 1.0).abs() < 1e-6, "{found:?}");
        assert!(
            (found.p.unwrap() / 4.2874e-5 - 1.0).abs() < 1e-4,
            "{found:?}"
        );
    }

    #[test]
    fn without_an_error_slopes_have_no_test() {
        let rows = [[1.0, 2.0, 3.0], [3.0, 4.0, 5.0]];
        assert_eq!(slopes_differ(&rows, &[0.7, 0.8, 0.9]), None);
        assert_eq!(slopes_differ(&rows, &[0.8; 3]), None);
    }
}
