//! Agreement: intraclass correlations and Krippendorff's alpha.

use super::describe::{Sum, sum};
use super::distribution::{f_quantile, f_upper};
use super::{finite, rectangular};

/// A coefficient with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// The estimate.
    pub value: f64,
    /// Its interval; an end that is infinite is `None` (only of ICC2k).
    pub ci95: Option<(Option<f64>, Option<f64>)>,
}

/// Shrout & Fleiss's six intraclass correlations (1979).
#[derive(Debug, Clone, PartialEq)]
pub struct Icc {
    /// Mean square between targets.
    pub ms_targets: f64,
    /// Mean square between raters.
    pub ms_raters: f64,
    /// Residual mean square.
    pub ms_error: f64,
    /// MST/MSW.
    pub f_1: Option<f64>,
    /// Its p.
    pub p_1: Option<f64>,
    /// MST/MSE.
    pub f_3: Option<f64>,
    /// Its p.
    pub p_3: Option<f64>,
    /// Each target by its own raters, one rating.
    pub icc1: Option<Coefficient>,
    /// The same, mean of k; no interval here.
    pub icc1k: Option<f64>,
    /// Random raters, absolute agreement, one rating.
    pub icc2: Option<Coefficient>,
    /// The same, mean of k; its interval is Spearman–Brown's of the single one's.
    pub icc2k: Option<Coefficient>,
    /// Fixed raters, consistency, one rating.
    pub icc3: Option<Coefficient>,
    /// The same, mean of k.
    pub icc3k: Option<Coefficient>,
}

/// Rows are targets, columns raters. With n targets, k raters and mean squares
/// T, R, E and W (raters and residual together):
/// ICC1 = (T − W)/(T + (k−1)W), ICC2 = (T − E)/(T + (k−1)E + k(R − E)/n),
/// ICC3 = (T − E)/(T + (k−1)E). Intervals as in Shrout & Fleiss (1979).
/// `None` below two of either.
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
    let f_1 = (within > floor).then(|| targets / within).and_then(finite);
    let f_3 = (error > floor).then(|| targets / error).and_then(finite);
    let single = |f: f64| (f - 1.0) / (f + kf - 1.0);
    let bounds = |f: f64, df: f64| {
        Some((
            f / f_quantile(0.975, df_t, df)?,
            f * f_quantile(0.975, df, df_t)?,
        ))
    };
    let icc2 = icc2(targets, raters, error, nf, kf);
    // Spearman–Brown's formula has a pole at −1/(k − 1): an end there is infinite.
    let brown = |c: f64| finite(kf * c / (1.0 + (kf - 1.0) * c));
    Some(Icc {
        ms_targets: targets,
        ms_raters: raters,
        ms_error: error,
        p_1: f_1.and_then(|f| f_upper(f, df_t, df_w)),
        p_3: f_3.and_then(|f| f_upper(f, df_t, df_e)),
        icc1: f_1.map(|f| Coefficient {
            value: single(f),
            ci95: bounds(f, df_w).map(|(l, h)| (finite(single(l)), finite(single(h)))),
        }),
        icc1k: f_1.and_then(|f| finite(1.0 - 1.0 / f)),
        icc2k: icc2.and_then(|c| {
            Some(Coefficient {
                value: finite((targets - error) / (targets + (raters - error) / nf))?,
                ci95: c.ci95.map(|(l, h)| (l.and_then(brown), h.and_then(brown))),
            })
        }),
        icc2,
        icc3: f_3.map(|f| Coefficient {
            value: single(f),
            ci95: bounds(f, df_e).map(|(l, h)| (finite(single(l)), finite(single(h)))),
        }),
        icc3k: f_3.and_then(|f| {
            Some(Coefficient {
                value: finite(1.0 - 1.0 / f)?,
                ci95: bounds(f, df_e).map(|(l, h)| (finite(1.0 - 1.0 / l), finite(1.0 - 1.0 / h))),
            })
        }),
        f_1,
        f_3,
    })
}

/// ICC2 with Satterthwaite's degrees of freedom for its interval.
fn icc2(t: f64, r: f64, e: f64, n: f64, k: f64) -> Option<Coefficient> {
    let below = t + (k - 1.0) * e + k * (r - e) / n;
    if below <= 0.0 || e <= 0.0 {
        return None;
    }
    let value = finite((t - e) / below)?;
    let f = r / e;
    let a = n * (1.0 + (k - 1.0) * value) - k * value;
    let above = (k - 1.0) * (n - 1.0) * (k * value * f + a).powi(2);
    let df = above / ((n - 1.0) * (k * value * f).powi(2) + a * a);
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

/// Krippendorff's alpha with three metrics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alpha {
    /// Equal or not.
    pub nominal: Option<f64>,
    /// By the ratings that lie between.
    pub ordinal: Option<f64>,
    /// Squared difference.
    pub interval: Option<f64>,
}

/// Most distinct numbers for which alpha is computed: the work goes with the
/// square.
const MAX_DISTINCT: usize = 1000;

/// α = 1 − (n−1) Σ o(c,k) δ²(c,k) / Σ n(c) n(k) δ²(c,k), with o the coincidences
/// within units (each pair weighs 1/(m − 1) in a unit of m ratings) and n the
/// margins (Krippendorff 2011). Units of one rating do not count. Undefined if
/// all ratings are equal.
pub fn krippendorff<U: AsRef<[f64]>>(units: &[U]) -> Alpha {
    const NONE: Alpha = Alpha {
        nominal: None,
        ordinal: None,
        interval: None,
    };
    let units = || units.iter().map(AsRef::as_ref).filter(|u| u.len() >= 2);
    // Ascending; there are few, so each rating is looked up among them.
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
            let place = distinct.partition_point(|d| d < x);
            if counts[place] == 0.0 {
                seen.push(place);
            }
            counts[place] += 1.0;
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
            // Σ of the margins from low to high, less half of the two ends.
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
    fn the_worked_example_of_shrout_and_fleiss_comes_out() {
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
    /// Ratings are apart however small their unit is.
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

    /// Spearman–Brown's formula has its pole at an ICC2 of −1/(k − 1); only the
    /// end that lies there is lost.
    #[test]
    fn an_end_of_icc2k_at_the_pole_leaves_the_other() {
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
