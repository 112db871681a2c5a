//! Paired and one-sample comparisons: t, Wilcoxon's signed-rank test, equivalence, and
//! Holm's correction.

use super::describe::{is_constant, mean, power_of_two, rounded, sd};
use super::distribution::{normal_upper, t_quantile, t_two_sided, t_upper};
use super::finite;
use super::rank::{doubled_ranks, tie_term_of_ranks};

/// Most non-zero differences for which Wilcoxon's exact distribution is computed.
pub const MAX_EXACT: usize = 500;

/// A one-sample t test against 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneSample {
    /// Number of numbers.
    pub n: usize,
    /// Mean of the numbers.
    pub mean: f64,
    /// Standard deviation, with n − 1; 0 if all numbers are equal.
    pub sd: f64,
    /// mean·√n/sd; `None` if the standard deviation is 0.
    pub t: Option<f64>,
    /// Two-sided p of t, with n − 1 degrees of freedom.
    pub p: Option<f64>,
    /// mean ± t(.975, n−1)·sd/√n.
    pub ci95: (f64, f64),
}

/// One-sample t test of the mean against 0. `None` for fewer than two numbers.
///
/// ```
/// # use study_stats::paired::one_sample;
/// // The extra sleep of Student (1908), one drug less the other.
/// let test = one_sample(&[1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4]).unwrap();
/// assert_eq!(format!("{:.4} {:.6}", test.t.unwrap(), test.p.unwrap()), "4.0621 0.002833");
/// ```
pub fn one_sample(x: &[f64]) -> Option<OneSample> {
    let n = x.len();
    let (m, s) = (mean(x)?, sd(x)?);
    let s = if is_constant(x) { 0.0 } else { s };
    let df = n as f64 - 1.0;
    let sem = s / (n as f64).sqrt();
    let t = if s > 0.0 { finite(m / sem) } else { None };
    let half = t_quantile(0.975, df)? * sem;
    Some(OneSample {
        n,
        mean: m,
        sd: s,
        t,
        p: t.and_then(|t| t_two_sided(t, df)),
        ci95: (m - half, m + half),
    })
}

/// Equivalence test by two one-sided t tests (Schuirmann 1987).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equivalence {
    /// t of the test that the estimate is above −margin.
    pub t_lower: f64,
    /// t of the test that the estimate is below +margin.
    pub t_upper: f64,
    /// The larger of the two p; below .05 the estimate is shown to lie within ±margin.
    pub p: f64,
    /// estimate ± t(.95, df)·se; within ±margin where p is below .05.
    pub ci90: (f64, f64),
}

/// Tests whether the mean of x lies within ±`margin`. `None` for fewer than two numbers,
/// if all are equal, or unless `margin` > 0.
///
/// ```
/// # use study_stats::paired::equivalence;
/// let test = equivalence(&[0.1, -0.2, 0.0, 0.2, -0.1], 0.5).unwrap();
/// assert!(test.p < 0.05);
/// assert!(-0.5 < test.ci90.0 && test.ci90.1 < 0.5);
/// ```
pub fn equivalence(x: &[f64], margin: f64) -> Option<Equivalence> {
    let test = one_sample(x)?;
    let sem = test.sd / (test.n as f64).sqrt();
    equivalence_of(test.mean, sem, test.n as f64 - 1.0, margin)
}

/// Tests whether an estimate, such as a slope or a contrast, lies within ±`margin`, given
/// its standard error and degrees of freedom. `None` unless `se`, `df` and `margin` are
/// above 0.
pub fn equivalence_of(estimate: f64, se: f64, df: f64, margin: f64) -> Option<Equivalence> {
    if !(margin > 0.0 && se > 0.0) {
        return None;
    }
    let t_lower = finite((estimate + margin) / se)?;
    let t_upper_margin = finite((estimate - margin) / se)?;
    let half = t_quantile(0.95, df)? * se;
    Some(Equivalence {
        t_lower,
        t_upper: t_upper_margin,
        p: t_upper(t_lower, df)?.max(t_upper(-t_upper_margin, df)?),
        ci90: (estimate - half, estimate + half),
    })
}

/// Comparison of two columns, a minus b.
#[derive(Debug, Clone, PartialEq)]
pub struct Paired {
    /// Mean difference.
    pub mean_diff: f64,
    /// Paired t; `None` if all differences are equal.
    pub t: Option<f64>,
    /// Two-sided p of t.
    pub p_t: Option<f64>,
    /// Cohen's d_z: mean/standard deviation of the differences.
    pub dz: Option<f64>,
    /// Cohen's d_av: mean difference/√((s²a + s²b)/2) (Cumming 2012).
    pub d_av: Option<f64>,
    /// Wilcoxon's W₊: sum of the ranks of the positive differences. The following
    /// fields are `None` if all differences are 0.
    pub w_plus: Option<f64>,
    /// Number of differences that are not 0.
    pub wilcoxon_n: usize,
    /// Exact two-sided p of W₊, conditional on the ties: min(1, 2·smaller tail); `None`
    /// above [`MAX_EXACT`].
    pub p_exact: Option<f64>,
    /// Two-sided p of W₊ by the normal approximation, with continuity and tie
    /// corrections.
    pub p_normal: Option<f64>,
    /// Rank-biserial correlation (W₊ − W₋)/(W₊ + W₋) (Kerby 2014).
    pub rank_biserial: Option<f64>,
}

/// Compares two columns of the same subjects, a minus b. The ranks are those of the
/// differences rounded to 10⁻¹⁰ of the columns' size, so that rounding errors cancel; so
/// are differences that are then all equal. `None` for fewer than two subjects or unequal
/// lengths.
///
/// ```
/// # use study_stats::paired::paired;
/// // All five ratings of a are higher: the smallest exact p, 2/2⁵.
/// let test = paired(&[5.0, 6.0, 7.0, 5.0, 6.0], &[4.0, 4.0, 4.0, 1.0, 1.0]).unwrap();
/// assert_eq!(test.p_exact, Some(0.0625));
/// assert_eq!(test.rank_biserial, Some(1.0));
/// ```
pub fn paired(a: &[f64], b: &[f64]) -> Option<Paired> {
    if a.len() != b.len() {
        return None;
    }
    let scale = scale(a.iter().chain(b));
    let exact: Vec<f64> = a.iter().zip(b).map(|(x, y)| (x - y) * scale).collect();
    let d: Vec<f64> = exact.iter().map(|d| rounded(*d)).collect();
    let test = one_sample(if is_constant(&d) { &d } else { &exact })?;
    // A mean of 0 but for rounding is that of the rounded differences.
    let center = if test.mean.abs() < 1e-9 {
        mean(&d)?
    } else {
        test.mean
    };
    let (sa, sb) = (sd(a)?, sd(b)?);
    let average = ((sa * sa + sb * sb) / 2.0).sqrt();
    let w = Wilcoxon::new(&d);
    Some(Paired {
        mean_diff: test.mean / scale,
        t: test.t,
        p_t: test.p,
        dz: test.t.and_then(|_| finite(test.mean / test.sd)),
        d_av: if is_constant(a) && is_constant(b) {
            None
        } else {
            finite(center / scale / average)
        },
        w_plus: w.as_ref().map(|w| w.plus as f64 / 2.0),
        wilcoxon_n: w.as_ref().map_or(0, |w| w.ranks.len()),
        p_exact: w.as_ref().and_then(Wilcoxon::exact),
        p_normal: w.as_ref().and_then(Wilcoxon::normal),
        rank_biserial: w.as_ref().map(|w| {
            let all: i64 = w.ranks.iter().sum();
            (2 * w.plus - all) as f64 / all as f64
        }),
    })
}

/// A power of two that brings small numbers to the size of 1, without rounding.
fn scale<'a>(x: impl Iterator<Item = &'a f64>) -> f64 {
    let scale = power_of_two(x);
    if scale > 2.0 { scale } else { 1.0 }
}

/// Wilcoxon's signed ranks without zeros, as doubled mid-ranks.
struct Wilcoxon {
    ranks: Vec<i64>,
    plus: i64,
    ties: f64,
}

impl Wilcoxon {
    fn new(d: &[f64]) -> Option<Self> {
        let nonzero: Vec<f64> = d.iter().copied().filter(|v| *v != 0.0).collect();
        if nonzero.is_empty() {
            return None;
        }
        let sizes: Vec<f64> = nonzero.iter().map(|v| v.abs()).collect();
        let ranks = doubled_ranks(&sizes);
        let plus = ranks
            .iter()
            .zip(&nonzero)
            .filter(|(_, v)| **v > 0.0)
            .map(|(r, _)| r)
            .sum();
        Some(Self {
            ties: tie_term_of_ranks(&ranks),
            ranks,
            plus,
        })
    }

    /// Every subset of the ranks is equally likely to be positive: the generating
    /// function of its sum is the product of ½(1 + x^rank) over the ranks.
    fn exact(&self) -> Option<f64> {
        if self.ranks.len() > MAX_EXACT {
            return None;
        }
        let total: i64 = self.ranks.iter().sum();
        let size = usize::try_from(total).ok()? + 1;
        let mut p = vec![0.0f64; size];
        p[0] = 1.0;
        let mut reached = 0;
        for &rank in &self.ranks {
            let rank = usize::try_from(rank).ok()?;
            for sum in (0..=reached).rev() {
                let half = 0.5 * p[sum];
                p[sum] = half;
                p[sum + rank] += half;
            }
            reached += rank;
        }
        let plus = usize::try_from(self.plus).ok()?;
        let lower: f64 = p[..=plus].iter().sum();
        let upper: f64 = p[plus..].iter().sum();
        Some((2.0 * lower.min(upper)).min(1.0))
    }

    fn normal(&self) -> Option<f64> {
        let n = self.ranks.len() as f64;
        let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - self.ties / 48.0;
        let distance = self.plus as f64 / 2.0 - n * (n + 1.0) / 4.0;
        let corrected = (distance.abs() - 0.5).max(0.0);
        if variance <= 0.0 {
            return None;
        }
        Some((2.0 * normal_upper(corrected / variance.sqrt())).min(1.0))
    }
}

/// Holm's (1979) adjusted p values, in the given order: of the m defined ones, the i-th
/// smallest is multiplied by m − i + 1, then made monotone and limited to 1. Undefined
/// ones stay `None`.
///
/// ```
/// # use study_stats::paired::holm;
/// assert_eq!(holm(&[Some(0.01), None, Some(0.03)]), [Some(0.02), None, Some(0.03)]);
/// ```
pub fn holm(p: &[Option<f64>]) -> Vec<Option<f64>> {
    let mut order: Vec<(usize, f64)> = p
        .iter()
        .enumerate()
        .filter_map(|(i, p)| p.map(|p| (i, p)))
        .collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut adjusted = vec![None; p.len()];
    let mut highest = 0.0f64;
    for (done, (i, p)) in order.iter().enumerate() {
        highest = highest.max((order.len() - done) as f64 * p).min(1.0);
        adjusted[*i] = Some(highest);
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_positive_differences_have_exact_p_one_in_sixteen() {
        let p = paired(&[2.0, 4.0, 6.0, 8.0, 10.0], &[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!(p.p_exact, Some(2.0 / 32.0));
        assert_eq!((p.w_plus, p.rank_biserial), (Some(15.0), Some(1.0)));
    }

    /// A change of unit changes neither t nor ranks.
    #[test]
    fn small_numbers_are_not_rounded_away() {
        let (a, b) = ([3.0, 5.0, 4.0, 7.0], [2.0, 3.0, 4.0, 1.0]);
        let x = paired(&a, &b).unwrap();
        let y = paired(&a.map(|v| v * 1e-12), &b.map(|v| v * 1e-12)).unwrap();
        assert!((y.mean_diff / x.mean_diff / 1e-12 - 1.0).abs() < 1e-12);
        assert!((y.t.unwrap() / x.t.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!((x.p_exact, x.w_plus), (y.p_exact, y.w_plus));
        // t is not that of differences of ten decimals.
        let d = [1e-11, 2e-11, 2.4e-10];
        let t = paired(&d.map(|d| 1.0 + d), &[1.0; 3]).unwrap().t.unwrap();
        assert!((t - 0.9 / (1.3 / 3f64.sqrt())).abs() < 1e-3, "{t}");
    }

    #[test]
    fn equal_columns_have_only_a_mean_difference() {
        let p = paired(&[4.0; 3], &[4.0; 3]).unwrap();
        assert_eq!((p.mean_diff, p.t, p.p_exact, p.dz), (0.0, None, None, None));
    }

    /// By hand: mean 0.2, sd 0.2, n 4, so sem 0.1 and t = 12 and −8 at ±1 with 3
    /// degrees of freedom: P(t > 8) = .002038 (R: pt(8, 3, lower.tail = FALSE)).
    #[test]
    fn a_small_difference_is_within_the_margin_and_a_wide_one_is_not() {
        let s = 0.03f64.sqrt();
        let x = [0.2 - s, 0.2 - s, 0.2 + s, 0.2 + s];
        let e = equivalence(&x, 1.0).unwrap();
        assert!((e.t_lower - 12.0).abs() < 1e-9 && (e.t_upper + 8.0).abs() < 1e-9);
        assert!((e.p - 0.002_038).abs() < 1e-6, "{}", e.p);
        assert!(equivalence(&x, 0.3).unwrap().p > 0.05);
        assert_eq!(equivalence(&[0.1; 4], 1.0), None);
    }

    #[test]
    fn holm_is_monotone_and_skips_what_is_undefined() {
        let adjusted = holm(&[Some(0.01), None, Some(0.04), Some(0.03)]);
        assert_eq!(adjusted, [Some(0.03), None, Some(0.06), Some(0.06)]);
    }
}
