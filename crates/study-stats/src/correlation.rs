//! Correlation of two columns: Pearson, Spearman, Kendall, repeated measures.

use super::describe::{is_constant, mean, products_about, squares_about};
use super::distribution::{normal_quantile, normal_upper, t_two_sided};
use super::finite;
use super::rank::{doubled_ranks, mid_ranks};

/// Pearson's r = Sxy/√(Sxx Syy). `None` if a column is constant, for fewer than two
/// pairs or unequal lengths.
///
/// ```
/// # use study_stats::correlation::{pearson, spearman};
/// let (x, y) = ([1.0, 2.0, 3.0, 4.0], [1.0, 4.0, 9.0, 16.0]);
/// assert_eq!(format!("{:.4}", pearson(&x, &y).unwrap()), "0.9844");
/// assert!((spearman(&x, &y).unwrap() - 1.0).abs() < 1e-12);
/// ```
pub fn pearson(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() < 2 || x.len() != y.len() || is_constant(x) || is_constant(y) {
        return None;
    }
    let (mx, my) = (mean(x)?, mean(y)?);
    let (xx, yy) = (squares_about(x, mx)?, squares_about(y, my)?);
    if !(xx > 0.0 && yy > 0.0) {
        return None;
    }
    finite(products_about(x, mx, y, my)? / (xx.sqrt() * yy.sqrt())).map(|r| r.clamp(-1.0, 1.0))
}

/// Spearman's rho: Pearson's r of the mid-ranks. `None` as for [`pearson`].
pub fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    pearson(&mid_ranks(x), &mid_ranks(y))
}

/// Kendall's tau-b: (concordant − discordant)/√((n₀ − n₁)(n₀ − n₂)), with
/// n₀ = n(n−1)/2 and n₁, n₂ the tied pairs of either column (Kendall 1945).
/// `None` if a column is constant, for unequal lengths, or for more than 5000 pairs: the
/// work grows with their square.
///
/// ```
/// # use study_stats::correlation::kendall;
/// // Five pairs of six are in the same order, one is not.
/// assert_eq!(format!("{:.4}", kendall(&[1., 2., 3., 4.], &[1., 2., 4., 3.]).unwrap()), "0.6667");
/// ```
pub fn kendall(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() > 5000 || x.len() != y.len() {
        return None;
    }
    let (rx, ry) = (doubled_ranks(x), doubled_ranks(y));
    let (mut score, mut untied_x, mut untied_y) = (0i64, 0i64, 0i64);
    for i in 0..rx.len() {
        for j in 0..i {
            let (a, b) = ((rx[i] - rx[j]).signum(), (ry[i] - ry[j]).signum());
            score += a * b;
            untied_x += a.abs();
            untied_y += b.abs();
        }
    }
    let pairs = (untied_x as f64).sqrt() * (untied_y as f64).sqrt();
    finite(score as f64 / pairs)
}

/// Two-sided p of a correlation r, from t = r√(df/(1 − r²)); `df` is n − 2 for a plain
/// correlation. `None` for |r| = 1 or `df` < 1.
pub fn p_of_r(r: f64, df: f64) -> Option<f64> {
    if df < 1.0 || r.abs() >= 1.0 {
        return None;
    }
    t_two_sided(r * (df / ((1.0 - r) * (1.0 + r))).sqrt(), df)
}

/// Fisher's 95 % interval of a correlation: tanh(atanh r ± 1.96/√`weight`), where
/// `weight` is n − 3 for a plain correlation. `None` for |r| = 1 or unless `weight` > 0.
///
/// ```
/// # use study_stats::correlation::fisher_interval;
/// // r = .5 of 28 pairs.
/// let (low, high) = fisher_interval(0.5, 25.0).unwrap();
/// assert_eq!(format!("{low:.3} {high:.3}"), "0.156 0.736");
/// ```
pub fn fisher_interval(r: f64, weight: f64) -> Option<(f64, f64)> {
    if r.abs() >= 1.0 || weight <= 0.0 {
        return None;
    }
    let half = normal_quantile(0.975)? / weight.sqrt();
    let z = r.atanh();
    Some(((z - half).tanh(), (z + half).tanh()))
}

/// A test that a correlation is small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equivalence {
    /// The larger p of the two one-sided tests.
    pub p: f64,
    /// 90 % interval, which lies within the margin where p < .05.
    pub ci90: (f64, f64),
}

/// Tests that a correlation lies within ±`margin` by two one-sided tests of Fisher's z
/// (Goertzen & Cribbie 2010). `weight` is n − 3 for a plain correlation. `None` for |r| = 1
/// or unless `weight` > 0 and 0 < `margin` < 1.
pub fn equivalence(r: f64, weight: f64, margin: f64) -> Option<Equivalence> {
    if !(r.abs() < 1.0 && weight > 0.0 && margin > 0.0 && margin < 1.0) {
        return None;
    }
    let half = normal_quantile(0.95)? / weight.sqrt();
    let z = r.atanh();
    Some(Equivalence {
        p: normal_upper((margin.atanh() - z.abs()) * weight.sqrt()),
        ci90: ((z - half).tanh(), (z + half).tanh()),
    })
}

/// A repeated-measures correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WithinSubjects {
    /// The correlation.
    pub r: f64,
    /// Degrees of freedom: N − S − 1 for N pairs of S subjects.
    pub df: f64,
    /// Two-sided p by t; `None` for |r| = 1.
    pub p: Option<f64>,
    /// 95 % interval by Fisher's z with weight df − 1; `None` for |r| = 1 or df = 1.
    pub ci95: Option<(f64, f64)>,
}

/// Repeated-measures correlation (Bakdash & Marusich 2017): Pearson's r of the
/// deviations from each subject's own means, with N − S − 1 degrees of freedom.
/// The pairs of a subject are adjacent; `lengths` holds the number of pairs of each
/// subject. `None` if r is not defined, if there is no degree of freedom left, or if
/// `lengths` exceeds the columns.
pub fn within_subjects(x: &[f64], y: &[f64], lengths: &[usize]) -> Option<WithinSubjects> {
    let (mut dx, mut dy) = (Vec::with_capacity(x.len()), Vec::with_capacity(x.len()));
    let mut subjects = 0;
    let mut start = 0;
    for n in lengths.iter().copied().filter(|n| *n > 0) {
        let (own_x, own_y) = (x.get(start..start + n)?, y.get(start..start + n)?);
        start += n;
        subjects += 1;
        for (own, deviations) in [(own_x, &mut dx), (own_y, &mut dy)] {
            let m = mean(own)?;
            // Deviations of a constant column would be rounding errors.
            let same = is_constant(own);
            deviations.extend(own.iter().map(|v| if same { 0.0 } else { v - m }));
        }
    }
    let df = dx.len() as f64 - f64::from(subjects) - 1.0;
    if df < 1.0 {
        return None;
    }
    let r = pearson(&dx, &dy)?;
    Some(WithinSubjects {
        r,
        df,
        p: p_of_r(r, df),
        ci95: fisher_interval(r, df - 1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_correlates_perfectly_and_has_no_t() {
        let r = pearson(&[1.0, 2.0, 3.0], &[2.0, 4.0, 6.0]).unwrap();
        assert!((r - 1.0).abs() < 1e-15);
        assert_eq!(p_of_r(1.0, 1.0), None);
        assert_eq!(fisher_interval(1.0, 3.0), None);
    }

    #[test]
    fn a_constant_column_has_no_correlation() {
        let third = 1.0 / 3.0;
        let nearly = [third, 1.0 - 2.0 * third, third];
        assert_eq!(pearson(&nearly, &[1.0, 2.0, 3.0]), None);
        assert_eq!(spearman(&nearly, &[1.0, 2.0, 3.0]), None);
        assert_eq!(kendall(&nearly, &[1.0, 2.0, 3.0]), None);
    }

    /// By hand: (0.4 − 0.1)·√25 = 1.5, and P(Z > 1.5) = .0668072.
    #[test]
    fn a_small_correlation_is_within_the_margin() {
        let e = equivalence(-0.1f64.tanh(), 25.0, 0.4f64.tanh()).unwrap();
        assert!((e.p - 0.066_807_2).abs() < 1e-7, "{e:?}");
        let (low, high) = e.ci90;
        // −0.1 ± 1.644854/5.
        assert!((low.atanh() + 0.428_970_7).abs() < 1e-7, "{e:?}");
        assert!((high.atanh() - 0.228_970_7).abs() < 1e-7, "{e:?}");
        assert_eq!(equivalence(0.1, 0.0, 0.5), None);
    }

    #[test]
    fn ties_lower_tau_b_as_in_kendalls_formula() {
        // 5 concordant of 6 pairs, one tie in y: 5/√(6·5).
        let tau = kendall(&[1.0, 2.0, 3.0, 4.0], &[1.0, 2.0, 2.0, 3.0]).unwrap();
        assert!((tau - 5.0 / 30f64.sqrt()).abs() < 1e-15);
    }
}
