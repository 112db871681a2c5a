//! Independent groups of subjects.
//!
//! The functions of this module assume the same variance in all groups: the analysis of
//! variance between and within subjects who rated the same realizations. [`welch`] compares
//! one number of each subject without this assumption.
//!
//! As in [`super::anova`], an effect is tested by contrasts y = C·(row of the subject). With
//! the group means ȳg and the mean ȳ of all, SS = Σ ng·|ȳg − ȳ|² and its error is
//! Σ|y − ȳg|². The contrasts decide what is compared: the means of the subjects, their
//! profiles over the realizations, or their slopes.

pub mod welch;

use super::anova::{f_test, helmert, unit};
use super::describe;
use super::distribution::{t_quantile, t_two_sided};
use super::matrix::dot;
use super::{finite, rectangular};

/// A test of differences between groups; q is the number of contrasts, N of the subjects, G
/// of the groups.
#[derive(Debug, Clone, PartialEq)]
pub struct Between {
    /// Sum of squares between the groups.
    pub ss: f64,
    /// Sum of squares within them.
    pub ss_error: f64,
    /// Degrees of freedom: q(G − 1).
    pub df1: f64,
    /// Degrees of freedom of the error: q(N − G).
    pub df2: f64,
    /// F; `None` if nothing varies within the groups.
    pub f: Option<f64>,
    /// p of F, assuming sphericity.
    pub p: Option<f64>,
    /// Greenhouse & Geisser's (1959) ε from the covariance within groups.
    pub eps_gg: Option<f64>,
    /// p of F with both degrees of freedom multiplied by `eps_gg`.
    pub p_gg: Option<f64>,
}

impl Between {
    /// Partial η² = SS/(SS + error); `None` for 0/0.
    pub fn pes(&self) -> Option<f64> {
        finite(self.ss / (self.ss + self.ss_error))
    }
}

/// Do the means of the subjects differ between groups of rows?
pub fn levels<R: AsRef<[f64]>>(groups: &[Vec<R>]) -> Option<Between> {
    let k = groups.first()?.first()?.as_ref().len();
    between(groups, &[unit(k)])
}

/// Do the differences between the columns depend on the group? The interaction of groups
/// and columns.
pub fn profiles<R: AsRef<[f64]>>(groups: &[Vec<R>]) -> Option<Between> {
    let k = groups.first()?.first()?.as_ref().len();
    between(groups, &helmert(k))
}

/// Does one number of each subject differ between groups?
pub fn one_way(groups: &[Vec<f64>]) -> Option<Between> {
    let rows: Vec<Vec<[f64; 1]>> = (groups.iter())
        .map(|group| group.iter().map(|x| [*x]).collect())
        .collect();
    between(&rows, &[vec![1.0]])
}

/// `None` for fewer than two groups, an empty one, or no subject more than groups.
fn between<R: AsRef<[f64]>>(groups: &[Vec<R>], contrasts: &[Vec<f64>]) -> Option<Between> {
    let rows: Vec<&R> = groups.iter().flatten().collect();
    let rows = rectangular(&rows)?;
    let (n, g, q) = (rows.len(), groups.len(), contrasts.len());
    if g < 2 || n <= g || q == 0 || groups.iter().any(Vec::is_empty) {
        return None;
    }
    let mut y: Vec<Vec<f64>> = (rows.iter())
        .map(|row| contrasts.iter().map(|c| dot(c, row)).collect())
        .collect();
    let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
    let means = center_groups(&mut y, &sizes);
    let ss = between_groups(&means, &sizes);
    let size: f64 = rows.iter().map(|r| dot(r, r)).sum();
    let df1 = (q * (g - 1)) as f64;
    // A smaller error is due to rounding.
    let test = f_test(ss, df1, &y, (n - g) as f64, 1e-24 * size);
    Some(Between {
        ss,
        ss_error: test.ss_error,
        df1,
        df2: (q * (n - g)) as f64,
        f: test.f,
        p: test.p,
        eps_gg: test.eps_gg,
        p_gg: test.p_gg,
    })
}

/// Subtracts the mean of its group from each row of `y`, which is in the order of the groups,
/// and returns these means.
pub(super) fn center_groups(y: &mut [Vec<f64>], sizes: &[usize]) -> Vec<Vec<f64>> {
    let q = y.first().map_or(0, Vec::len);
    let mut start = 0;
    let mut means = Vec::new();
    for size in sizes {
        let own = &mut y[start..start + size];
        start += size;
        let mean = |j: usize| own.iter().map(|v| v[j]).sum::<f64>() / *size as f64;
        let mean: Vec<f64> = (0..q).map(mean).collect();
        for v in own {
            v.iter_mut().zip(&mean).for_each(|(v, mean)| *v -= mean);
        }
        means.push(mean);
    }
    means
}

/// Σ ng·|ȳg − ȳ|² of the means of groups of these sizes.
pub(super) fn between_groups(means: &[Vec<f64>], sizes: &[usize]) -> f64 {
    let q = means.first().map_or(0, Vec::len);
    let n = sizes.iter().sum::<usize>() as f64;
    let of_groups = || means.iter().zip(sizes.iter().map(|n| *n as f64));
    let squares = |j: usize| {
        let all = of_groups().map(|(mean, n)| n * mean[j]).sum::<f64>() / n;
        of_groups()
            .map(|(mean, n)| n * (mean[j] - all).powi(2))
            .sum::<f64>()
    };
    (0..q).map(squares).sum()
}

/// The difference of the means of two groups.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Mean of the first minus that of the second.
    pub difference: f64,
    /// 95 % t interval.
    pub ci95: (f64, f64),
    /// t on `df` degrees of freedom.
    pub t: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// Two-sided p of t.
    pub p: Option<f64>,
    /// The difference over the pooled standard deviation, times Hedges' (1981) exact
    /// correction for small samples.
    pub hedges_g: Option<f64>,
}

impl Difference {
    /// The t test of a difference with this standard error.
    fn of(a: &[f64], b: &[f64], se: f64, df: f64) -> Option<Self> {
        let difference = describe::mean(a)? - describe::mean(b)?;
        let t = finite(difference / se)?;
        let half = t_quantile(0.975, df)? * se;
        Some(Self {
            difference,
            ci95: (difference - half, difference + half),
            t,
            df,
            p: t_two_sided(t, df),
            hedges_g: hedges_g(a, b, difference),
        })
    }
}

fn hedges_g(a: &[f64], b: &[f64], difference: f64) -> Option<f64> {
    let (na, nb) = (a.len() as f64, b.len() as f64);
    let squares = (na - 1.0) * describe::variance(a)? + (nb - 1.0) * describe::variance(b)?;
    let df = na + nb - 2.0;
    let correction = libm::exp(
        libm::lgamma(df / 2.0) - libm::lgamma((df - 1.0) / 2.0) - 0.5 * libm::log(df / 2.0),
    );
    finite(difference / (squares / df).sqrt() * correction)
}

/// Student's t test, by the variance within both groups. `None` without such a variance.
///
/// ```
/// # use study_stats::between::difference;
/// let found = difference(&[3.0, 4.0, 5.0], &[1.0, 2.0, 3.0]).unwrap();
/// assert_eq!((found.difference, found.df), (2.0, 4.0));
/// assert_eq!(format!("{:.3}", found.t), "2.449");
/// ```
pub fn difference(a: &[f64], b: &[f64]) -> Option<Difference> {
    let test = one_way(&[a.to_vec(), b.to_vec()])?;
    let variance = test.f.map(|_| test.ss_error / test.df2)?;
    let se = (variance * (1.0 / a.len() as f64 + 1.0 / b.len() as f64)).sqrt();
    Difference::of(a, b, se, test.df2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_close(found: Option<f64>, expected: f64) {
        let found = found.unwrap();
        assert!(
            (found - expected).abs() < 1e-9 * expected.abs(),
            "{found} {expected}"
        );
    }

    fn two_groups() -> Vec<Vec<[f64; 3]>> {
        vec![
            vec![
                [4.0, 5.0, 6.5],
                [3.0, 5.0, 5.5],
                [5.0, 4.5, 7.0],
                [2.0, 4.0, 6.0],
            ],
            vec![[3.0, 4.0, 4.0], [5.0, 4.5, 5.5], [4.0, 5.5, 3.5]],
        ]
    }

    /// R 4.2.2: anova(lm(Y ~ site), lm(Y ~ 1), X = ~1, test = "Spherical"), and
    /// aov(y ~ r * site + Error(s/r)).
    #[test]
    fn profiles_of_unequal_groups_agree_with_r() {
        let found = profiles(&two_groups()).unwrap();
        is_close(Some(found.ss), 5.648_809_523_8);
        is_close(Some(found.ss_error), 5.541_666_666_7);
        assert_eq!((found.df1, found.df2), (2.0, 10.0));
        is_close(found.f, 5.096_670_247_038_9);
        is_close(found.p, 0.029_782_363_404_656);
        is_close(found.p_gg, 0.037_547_846_785_019);
        let eps = found.eps_gg.unwrap();
        assert!((eps - 0.8698).abs() < 5e-5, "{eps}");
    }

    /// The same functions of R, for three groups and four columns.
    #[test]
    fn profiles_of_three_groups_agree_with_r() {
        let groups = vec![
            vec![
                [3.2, 3.2, 5.5, 5.2],
                [5.4, 2.9, 4.7, 5.5],
                [2.7, 3.8, 4.8, 5.0],
                [4.1, 2.9, 3.7, 3.0],
            ],
            vec![
                [5.7, 3.9, 5.4, 2.0],
                [3.4, 3.4, 5.5, 2.2],
                [3.5, 1.8, 3.3, 3.9],
            ],
            vec![
                [3.4, 4.2, 3.1, 5.6],
                [3.7, 3.7, 4.3, 3.2],
                [4.1, 4.9, 5.1, 3.9],
                [5.2, 4.9, 6.2, 5.9],
            ],
        ];
        let found = profiles(&groups).unwrap();
        assert_eq!((found.df1, found.df2), (6.0, 24.0));
        is_close(found.f, 1.615_302_492_365_4);
        is_close(found.p, 0.186_174_727_951_18);
        is_close(found.p_gg, 0.210_373_591_166_6);
    }

    /// R 4.2.2: anova(lm(rowMeans(Y) ~ site)), t.test(…, var.equal = TRUE).
    #[test]
    fn means_and_slopes_of_subjects_agree_with_r() {
        let groups = two_groups();
        let found = levels(&groups).unwrap();
        is_close(found.f, 0.802_742_149_491_37);
        is_close(found.p, 0.411_330_370_273_09);
        let means: Vec<Vec<f64>> = (groups.iter())
            .map(|g| g.iter().map(|r| r.iter().sum::<f64>() / 3.0).collect())
            .collect();
        is_close(one_way(&means).unwrap().f, 0.802_742_149_491_37);
        let found = difference(&means[0], &means[1]).unwrap();
        is_close(
            Some(found.difference),
            4.791_666_666_666_7 - 4.333_333_333_333_3,
        );
        is_close(Some(found.ci95.0), -0.856_663_915_798_74);
        is_close(Some(found.ci95.1), 1.773_330_582_465_41);
        // t² is the F of two groups.
        is_close(Some(found.t * found.t), 0.802_742_149_491_37);
        is_close(found.p, 0.411_330_370_273_09);
    }

    #[test]
    fn without_variance_within_groups_there_is_no_test() {
        let alike = vec![vec![[1.0, 2.0]; 3], vec![[1.0, 4.0]; 3]];
        let found = profiles(&alike).unwrap();
        assert_eq!((found.f, found.p, found.p_gg), (None, None, None));
        assert_eq!(profiles(&alike[..1]), None);
        assert_eq!(
            levels(&[vec![[1.0]], vec![[2.0]]]),
            None,
            "as many groups as subjects"
        );
        assert_eq!(difference(&[1.0], &[2.0]), None);
    }
}
