//! Agreement of raters: intraclass correlations and Krippendorff's alpha.

use super::describe::{Sum, sum};
use super::distribution::{f_quantile, f_upper};
use super::{finite, rectangular};

/// A coefficient with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// The estimated coefficient.
    pub value: f64,
    /// (lower, upper); `None` if there is no interval. A bound is `None` if it is
    /// infinite, which occurs only for ICC2k.
    pub ci95: Option<(Option<f64>, Option<f64>)>,
}

/// The six intraclass correlations of Shrout & Fleiss (1979). Without a variance of error
/// a coefficient has no interval; it is `None` if the targets do not differ either.
#[derive(Debug, Clone, PartialEq)]
pub struct Icc {
    /// Mean square between targets.
    pub ms_targets: f64,
    /// Mean square between raters.
    pub ms_raters: f64,
    /// Residual mean square.
    pub ms_error: f64,
    /// F of ICC1: mean square between targets over that within targets.
    pub f_1: Option<f64>,
    /// p of `f_1`.
    pub p_1: Option<f64>,
    /// F of ICC3: mean square between targets over the residual one.
    pub f_3: Option<f64>,
    /// p of `f_3`.
    pub p_3: Option<f64>,
    /// Each target has its own raters; reliability of a single rating.
    pub icc1: Option<Coefficient>,
    /// The same for the mean of k ratings; without interval.
    pub icc1k: Option<f64>,
    /// Random raters, absolute agreement, single rating.
    pub icc2: Option<Coefficient>,
    /// The same for the mean of k ratings; its interval is that of ICC2 transformed by
    /// the Spearman–Brown formula.
    pub icc2k: Option<Coefficient>,
    /// Fixed raters, consistency, single rating.
    pub icc3: Option<Coefficient>,
    /// The same for the mean of k ratings.
    pub icc3k: Option<Coefficient>,
}

/// Intraclass correlations of a table with a row for each target and a column for each
/// rater. With n targets, k raters and mean squares T (targets), R (raters), E (residual)
/// and W (raters and residual together):
/// ICC1 = (T − W)/(T + (k−1)W), ICC2 = (T − E)/(T + (k−1)E + k(R − E)/n),
/// ICC3 = (T − E)/(T + (k−1)E). Intervals as in Shrout & Fleiss (1979).
/// `None` for fewer than two targets or raters.
///
/// ```
/// # use study_stats::agreement::icc;
/// // Six targets and four raters, Shrout & Fleiss (1979), table 2.
/// let rows = [[9., 2., 5., 8.], [6., 1., 3., 2.], [8., 4., 6., 8.],
///             [7., 1., 2., 6.], [10., 5., 6., 9.], [6., 2., 4., 7.]];
/// let found = icc(&rows).unwrap();
/// let values = [found.icc1, found.icc2, found.icc3].map(|c| format!("{:.2}", c.unwrap().value));
/// assert_eq!(values, ["0.17", "0.29", "0.71"]);
/// ```
pub fn icc<R: AsRef<[f64]>>(rows: &[R]) -> Option<Icc> {
    let rows = rectangular(rows)?;
    let (n, k) = (rows.len(), rows[0].len());
    if n < 2 || k < 2 {
        return None;
    }
    let (nf, kf) = (n as f64, k as f64);
    let row_means: Vec<f64> = rows.iter().map(|r| sum(r) / kf).collect();
    let grand = sum(&row_means) / nf;
    let mut columns = vec![Sum::default(); k];
    for row in &rows {
        for (sum, x) in columns.iter_mut().zip(*row) {
            sum.add(*x);
        }
    }
    let column_means: Vec<f64> = columns.iter().map(|sum| sum.get() / nf).collect();
    let squares = |means: &[f64]| {
        let squares: Sum = means.iter().map(|m| (m - grand).powi(2)).collect();
        squares.get()
    };
    let targets = kf * squares(&row_means) / (nf - 1.0);
    let raters = nf * squares(&column_means) / (kf - 1.0);
    let (mut residual, mut size) = (Sum::default(), 0.0);
    for (row, rm) in rows.iter().zip(&row_means) {
        for (x, cm) in row.iter().zip(&column_means) {
            residual.add((x - rm - cm + grand).powi(2));
            size += (x - grand).powi(2);
        }
    }
    let residual = residual.get();
    let (df_t, df_e, df_w) = (nf - 1.0, (nf - 1.0) * (kf - 1.0), nf * (kf - 1.0));
    let error = residual / df_e;
    let within = (residual + raters * (kf - 1.0)) / df_w;
    let floor = 1e-24 * size;
    let differ = targets > floor;
    // Agreement without error, if there is anything to agree about.
    let perfect = |mean_square: f64| {
        (mean_square <= floor && differ).then_some(Coefficient {
            value: 1.0,
            ci95: None,
        })
    };
    let f_1 = (within > floor).then(|| targets / within).and_then(finite);
    let f_3 = (error > floor).then(|| targets / error).and_then(finite);
    let single = |f: f64| (f - 1.0) / (f + kf - 1.0);
    let bounds = |f: f64, df: f64| {
        Some((
            f / f_quantile(0.975, df_t, df)?,
            f * f_quantile(0.975, df, df_t)?,
        ))
    };
    let error = if error > floor { error } else { 0.0 };
    let icc2 = icc2(targets, raters, error, nf, kf).filter(|_| differ || error > 0.0);
    // The Spearman–Brown formula has a pole at −1/(k − 1).
    let spearman_brown = |c: f64| finite(kf * c / (1.0 + (kf - 1.0) * c));
    Some(Icc {
        ms_targets: targets,
        ms_raters: raters,
        ms_error: error,
        p_1: f_1.and_then(|f| f_upper(f, df_t, df_w)),
        p_3: f_3.and_then(|f| f_upper(f, df_t, df_e)),
        icc1: f_1
            .map(|f| Coefficient {
                value: single(f),
                ci95: bounds(f, df_w).map(|(l, h)| (finite(single(l)), finite(single(h)))),
            })
            .or(perfect(within)),
        icc1k: f_1
            .and_then(|f| finite(1.0 - 1.0 / f))
            .or(perfect(within).map(|c| c.value)),
        icc2k: icc2.and_then(|c| {
            Some(Coefficient {
                value: finite((targets - error) / (targets + (raters - error) / nf))?,
                ci95: c
                    .ci95
                    .map(|(l, h)| (l.and_then(spearman_brown), h.and_then(spearman_brown))),
            })
        }),
        icc2,
        icc3: f_3
            .map(|f| Coefficient {
                value: single(f),
                ci95: bounds(f, df_e).map(|(l, h)| (finite(single(l)), finite(single(h)))),
            })
            .or(perfect(error)),
        icc3k: f_3
            .and_then(|f| {
                let ends = |(l, h): (f64, f64)| (finite(1.0 - 1.0 / l), finite(1.0 - 1.0 / h));
                Some(Coefficient {
                    value: finite(1.0 - 1.0 / f)?,
                    ci95: bounds(f, df_e).map(ends),
                })
            })
            .or(perfect(error)),
        f_1,
        f_3,
    })
}

/// ICC2, with an interval by Satterthwaite's degrees of freedom.
fn icc2(t: f64, r: f64, e: f64, n: f64, k: f64) -> Option<Coefficient> {
    let denominator = t + (k - 1.0) * e + k * (r - e) / n;
    if denominator <= 0.0 {
        return None;
    }
    let value = finite((t - e) / denominator)?;
    if e <= 0.0 {
        return Some(Coefficient { value, ci95: None });
    }
    let f = r / e;
    let a = n * (1.0 + (k - 1.0) * value) - k * value;
    let numerator = (k - 1.0) * (n - 1.0) * (k * value * f + a).powi(2);
    let df = numerator / ((n - 1.0) * (k * value * f).powi(2) + a * a);
    let interval = || {
        let upper = f_quantile(0.975, n - 1.0, df)?;
        let lower = f_quantile(0.975, df, n - 1.0)?;
        let raters = k * r + (k * n - k - n) * e;
        Some((
            Some(finite(n * (t - upper * e) / (upper * raters + n * t))?),
            Some(finite(n * (lower * t - e) / (raters + n * lower * t))?),
        ))
    };
    Some(Coefficient {
        value,
        ci95: interval(),
    })
}

/// Krippendorff's alpha with three metrics; `None` if it is not defined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alpha {
    /// Distance 0 or 1: equal or not.
    pub nominal: Option<f64>,
    /// Distance by the number of ratings in between.
    pub ordinal: Option<f64>,
    /// Distance by the squared difference.
    pub interval: Option<f64>,
}

/// Most distinct numbers for which alpha is computed: the work grows with their square.
const MAX_DISTINCT: usize = 1000;

/// Krippendorff's alpha of units, each a slice of the ratings it received:
/// α = 1 − (n−1) Σ o(c,k) δ²(c,k) / Σ n(c) n(k) δ²(c,k), with the coincidences o within
/// units (a pair has the weight 1/(m − 1) in a unit of m ratings) and their margins n
/// (Krippendorff 2011). Units with one rating do not contribute. `None` if all ratings
/// are equal or more than 1000 are distinct.
///
/// ```
/// # use study_stats::agreement::krippendorff;
/// let alpha = krippendorff(&[[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]);
/// assert_eq!((alpha.nominal, alpha.ordinal), (Some(1.0), Some(1.0)));
/// ```
pub fn krippendorff<U: AsRef<[f64]>>(units: &[U]) -> Alpha {
    const NONE: Alpha = Alpha {
        nominal: None,
        ordinal: None,
        interval: None,
    };
    let units = || units.iter().map(AsRef::as_ref).filter(|u| u.len() >= 2);
    // Ascending. There are few, so that a binary search for each rating is fast.
    let mut distinct: Vec<f64> = Vec::new();
    for x in units().flatten() {
        let x = *x;
        let at = distinct.partition_point(|d| *d < x);
        if distinct.get(at) != Some(&x) {
            if distinct.len() == MAX_DISTINCT {
                return NONE;
            }
            distinct.insert(at, x);
        }
    }
    let v = distinct.len();
    if v < 2 {
        return NONE;
    }
    let mut observed = vec![0.0; v * v];
    let mut margin = vec![0.0; v];
    let mut counts = vec![0.0; v];
    let mut seen: Vec<usize> = Vec::new();
    for unit in units() {
        for x in unit {
            let index = distinct.partition_point(|d| d < x);
            if counts[index] == 0.0 {
                seen.push(index);
            }
            counts[index] += 1.0;
        }
        let others = unit.len() as f64 - 1.0;
        for &c in &seen {
            margin[c] += counts[c];
            for &k in &seen {
                let second = if c == k { counts[k] - 1.0 } else { counts[k] };
                observed[c * v + k] += counts[c] * second / others;
            }
        }
        for c in seen.drain(..) {
            counts[c] = 0.0;
        }
    }
    let below: Vec<f64> = margin
        .iter()
        .scan(0.0, |sum, n| {
            let before = *sum;
            *sum += n;
            Some(before)
        })
        .collect();
    let total: f64 = margin.iter().sum();
    let alpha = |distance: &dyn Fn(usize, usize) -> f64| {
        let (mut o, mut e) = (0.0, 0.0);
        for c in 0..v {
            for k in 0..v {
                let d = distance(c, k);
                o += observed[c * v + k] * d;
                e += margin[c] * margin[k] * d;
            }
        }
        (e > 0.0)
            .then(|| finite(1.0 - (total - 1.0) * o / e))
            .flatten()
    };
    Alpha {
        nominal: alpha(&|c, k| f64::from(u8::from(c != k))),
        ordinal: alpha(&|c, k| {
            let (low, high) = (c.min(k), c.max(k));
            // Sum of the margins from low to high, minus half of the first and last.
            let between = below[high] + margin[high] - below[low];
            (between - (margin[low] + margin[high]) / 2.0).powi(2)
        }),
        interval: alpha(&|c, k| (distinct[c] - distinct[k]).powi(2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shrout & Fleiss (1979), tables 2 to 4: .17, .29, .71, .44, .62, .91.
    #[test]
    fn the_worked_example_of_shrout_and_fleiss_is_reproduced() {
        let rows = [
            [9.0, 2.0, 5.0, 8.0],
            [6.0, 1.0, 3.0, 2.0],
            [8.0, 4.0, 6.0, 8.0],
            [7.0, 1.0, 2.0, 6.0],
            [10.0, 5.0, 6.0, 9.0],
            [6.0, 2.0, 4.0, 7.0],
        ];
        let i = icc(&rows.map(|r| r.to_vec())).unwrap();
        let two = |x: f64| format!("{x:.2}");
        assert_eq!(two(i.icc1.unwrap().value), "0.17");
        assert_eq!(two(i.icc2.unwrap().value), "0.29");
        assert_eq!(two(i.icc3.unwrap().value), "0.71");
        assert_eq!(two(i.icc1k.unwrap()), "0.44");
        assert_eq!(two(i.icc2k.unwrap().value), "0.62");
        assert_eq!(two(i.icc3k.unwrap().value), "0.91");
    }

    /// krippendorff 0.9.0 (Python): nominal 0, ordinal 6/7, interval .9973371205.
    /// Ratings are distinct however small their unit is.
    #[test]
    fn alpha_does_not_round_small_ratings() {
        let units = [vec![1e-12, 2e-12], vec![7e-12, 8e-12], vec![3e-11, 3.1e-11]];
        let a = krippendorff(&units);
        assert!(
            (a.interval.unwrap() - 0.997_337_120_539_676_9).abs() < 1e-12,
            "{a:?}"
        );
        assert!(a.nominal.unwrap().abs() < 1e-12, "{a:?}");
        assert!((a.ordinal.unwrap() - 6.0 / 7.0).abs() < 1e-12, "{a:?}");
    }

    /// The Spearman–Brown formula has its pole at an ICC2 of −1/(k − 1); only the bound
    /// at the pole is undefined.
    #[test]
    fn a_bound_of_icc2k_at_the_pole_is_none() {
        let i = icc(&[vec![5.0, 3.5], vec![4.5, 4.5]]).unwrap();
        let (lo, hi) = i.icc2k.unwrap().ci95.unwrap();
        assert!(lo.is_none() && hi.is_some(), "{lo:?} {hi:?}");
    }

    #[test]
    fn perfect_agreement_is_one_and_no_variation_is_undefined() {
        let a = krippendorff(&[vec![1.0, 1.0], vec![3.0, 3.0], vec![4.0]]);
        assert_eq!(a.nominal, Some(1.0));
        assert_eq!(a.ordinal, Some(1.0));
        assert_eq!(
            krippendorff(&[vec![4.0, 4.0], vec![4.0, 4.0]]).nominal,
            None
        );
        assert!(icc(&vec![vec![4.0; 3]; 3]).unwrap().icc1.is_none());
    }
}
