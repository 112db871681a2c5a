//! Friedman's and Page's rank tests of a table with a row for each subject and a column
//! for each realization.

mod exact;

use super::distribution::{chi2_upper, f_upper, normal_upper};
use super::rank::{doubled_ranks, mid_ranks};
use super::{finite, rectangular};

/// Friedman's test (1937) of n rows and k columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Friedman {
    /// Mean mid-rank of each column.
    pub mean_ranks: Vec<f64>,
    /// Degrees of freedom of χ²: k − 1.
    pub df: f64,
    /// The statistic, corrected for ties; `None` if every row is constant.
    pub chi2: Option<f64>,
    /// p by the χ² approximation.
    pub p: Option<f64>,
    /// Kendall's W = χ²/(n(k − 1)).
    pub kendall_w: Option<f64>,
    /// Iman & Davenport's (1980) F = (n−1)χ²/(n(k−1) − χ²), on k − 1 and (k−1)(n−1)
    /// degrees of freedom; `None` also if the rows agree perfectly.
    pub iman_davenport: Option<f64>,
    /// p of Iman & Davenport's F.
    pub iman_davenport_p: Option<f64>,
    /// Exact P(statistic ≥ observed) over all orders within rows; `None` for tables that
    /// are too large, which depends on size and ties, not on the statistic.
    pub exact_p: Option<f64>,
}

/// Friedman's test: χ² = (k−1) Σⱼ(Rⱼ − n(k+1)/2)² / (Σᵢⱼ rᵢⱼ² − nk(k+1)²/4), with the
/// correction for ties (Conover 1999, §5.8). `None` for fewer than two rows or columns.
///
/// ```
/// # use study_stats::friedman::friedman;
/// // Three subjects who agree on three realizations: one of 3!² relative orders.
/// let test = friedman(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [1.0, 5.0, 7.0]]).unwrap();
/// assert_eq!((test.chi2, test.kendall_w), (Some(6.0), Some(1.0)));
/// assert_eq!(test.exact_p, Some(1.0 / 36.0));
/// ```
pub fn friedman<R: AsRef<[f64]>>(rows: &[R]) -> Option<Friedman> {
    let rows = rectangular(rows)?;
    let (n, k) = (rows.len(), rows[0].len());
    if n < 2 || k < 2 {
        return None;
    }
    let ranks: Vec<Vec<i64>> = rows.iter().map(|r| doubled_ranks(r)).collect();
    let sums: Vec<i64> = (0..k).map(|j| ranks.iter().map(|r| r[j]).sum()).collect();
    let (nf, kf) = (n as f64, k as f64);
    // Doubled ranks are whole numbers; the expected rank sum is n(k+1).
    let center = n as i64 * (k as i64 + 1);
    let between: i64 = sums.iter().map(|s| (s - center) * (s - center)).sum();
    let within: i64 = ranks
        .iter()
        .flatten()
        .map(|r| (r - (k as i64 + 1)) * (r - (k as i64 + 1)))
        .sum();
    let chi2 = (within > 0).then(|| (kf - 1.0) * between as f64 / within as f64);
    let (df1, df2) = (kf - 1.0, (kf - 1.0) * (nf - 1.0));
    let iman_davenport =
        chi2.and_then(|c| finite((nf - 1.0) * c / (nf * (kf - 1.0) - c)).filter(|f| *f >= 0.0));
    Some(Friedman {
        mean_ranks: sums.iter().map(|&s| s as f64 / (2.0 * nf)).collect(),
        df: df1,
        chi2,
        p: chi2.and_then(|c| chi2_upper(c, df1)),
        kendall_w: chi2.map(|c| c / (nf * (kf - 1.0))),
        iman_davenport,
        iman_davenport_p: iman_davenport.and_then(|f| f_upper(f, df1, df2)),
        exact_p: chi2.and_then(|_| exact::upper_tail(&ranks, between)),
    })
}

/// Page's trend test (1963).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Page {
    /// L = Σⱼ score ⱼ × rank sum ⱼ.
    pub l: f64,
    /// (L − E)/√V with the permutation variance, which accounts for ties; `None` if
    /// every row is constant.
    pub z: Option<f64>,
    /// One-sided p of z, for an increasing trend.
    pub p_greater: Option<f64>,
    /// The same with Page's own variance, which assumes no ties; `None` if the scores
    /// are tied.
    pub p_greater_no_tie_correction: Option<f64>,
}

/// Page's test for an increasing trend in the order of `order`, a number for each column:
/// L = Σⱼ Yⱼ Rⱼ with Y the mid-ranks of `order`, E = nk(k+1)²/4,
/// V = Σᵢ Σⱼ(Yⱼ − Ȳ)² Σⱼ(rᵢⱼ − r̄)²/(k − 1). `None` for fewer than two rows or columns, or
/// if all scores are equal.
pub fn page<R: AsRef<[f64]>>(rows: &[R], order: &[f64]) -> Option<Page> {
    let rows = rectangular(rows).filter(|rows| rows[0].len() == order.len())?;
    let (n, k) = (rows.len(), order.len());
    if n < 2 || k < 2 {
        return None;
    }
    let (nf, kf) = (n as f64, k as f64);
    let scores = mid_ranks(order);
    let middle = (kf + 1.0) / 2.0;
    let spread = |r: &[f64]| r.iter().map(|v| (v - middle) * (v - middle)).sum::<f64>();
    let score_spread = spread(&scores);
    if score_spread <= 0.0 {
        return None;
    }
    let (mut l, mut variance) = (0.0, 0.0);
    for row in rows {
        let ranks = mid_ranks(row);
        l += ranks.iter().zip(&scores).map(|(r, y)| r * y).sum::<f64>();
        variance += score_spread * spread(&ranks) / (kf - 1.0);
    }
    let expected = nf * kf * (kf + 1.0) * (kf + 1.0) / 4.0;
    let z = (variance > 0.0).then(|| (l - expected) / variance.sqrt());
    let untied = nf * kf * kf * (kf + 1.0) * (kf + 1.0) * (kf - 1.0) / 144.0;
    let distinct = super::rank::tie_term(order) == 0.0;
    Some(Page {
        l,
        z,
        p_greater: z.map(normal_upper),
        p_greater_no_tie_correction: distinct.then(|| normal_upper((l - expected) / untied.sqrt())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With k = 3 and n = 3 without ties, 6 of 216 arrangements agree perfectly.
    #[test]
    fn three_perfect_rows_of_three_have_exact_p_one_in_36() {
        let rows = vec![vec![1.0, 2.0, 3.0]; 3];
        let f = friedman(&rows).unwrap();
        assert_eq!(f.chi2, Some(6.0));
        assert!((f.exact_p.unwrap() - 6.0 / 216.0).abs() < 1e-15);
        assert_eq!(f.kendall_w, Some(1.0));
        // Its denominator is 0.
        assert_eq!(f.iman_davenport, None);
    }

    #[test]
    fn constant_rows_have_mean_ranks_and_no_statistic() {
        let f = friedman(&vec![vec![4.0; 5]; 5]).unwrap();
        assert_eq!(f.mean_ranks, [3.0; 5]);
        assert_eq!((f.chi2, f.p, f.exact_p), (None, None, None));
        let p = page(&vec![vec![4.0; 5]; 5], &[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!((p.l, p.z, p.p_greater), (225.0, None, None));
    }
}
