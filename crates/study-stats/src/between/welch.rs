//! One number of each subject, where each group has a variance of its own: Welch's (1947,
//! 1951) tests.

use super::Difference;
use crate::describe::{mean, variance};
use crate::distribution::f_upper;
use crate::finite;

/// The test that the means of several groups are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneWay {
    /// F on `df1` and `df2` degrees of freedom.
    pub f: f64,
    /// Groups less one.
    pub df1: f64,
    /// Welch's approximation.
    pub df2: f64,
    /// P(F ≥ f).
    pub p: Option<f64>,
}

/// Welch's analysis of variance. `None` for fewer than two groups, or if one has fewer than
/// two numbers or no variance.
///
/// With w = n/s², W = Σw, m = Σw·x̄/W, k groups and
/// h = Σ (1 − w/W)²/(n − 1): F = Σw(x̄ − m)²/(k − 1) / (1 + 2(k − 2)h/(k² − 1)), and
/// df2 = (k² − 1)/(3h) (Welch 1951).
pub fn one_way<R: AsRef<[f64]>>(groups: &[R]) -> Option<OneWay> {
    let k = groups.len() as f64;
    if groups.len() < 2 {
        return None;
    }
    let mut terms = Vec::new();
    for group in groups {
        let x = group.as_ref();
        let (n, mean, variance) = (x.len() as f64, mean(x)?, variance(x)?);
        let weight = finite(n / variance).filter(|w| *w > 0.0)?;
        terms.push((n, mean, weight));
    }
    let all: f64 = terms.iter().map(|t| t.2).sum();
    let center = terms.iter().map(|(_, mean, w)| w * mean).sum::<f64>() / all;
    let h: f64 = (terms.iter())
        .map(|(n, _, w)| (1.0 - w / all).powi(2) / (n - 1.0))
        .sum();
    let between: f64 = (terms.iter())
        .map(|(_, mean, w)| w * (mean - center).powi(2))
        .sum();
    let (df1, df2) = (k - 1.0, (k * k - 1.0) / (3.0 * h));
    let f = finite(between / df1 / (1.0 + 2.0 * (k - 2.0) * h / (k * k - 1.0)))?;
    Some(OneWay {
        f,
        df1,
        df2,
        p: f_upper(f, df1, df2),
    })
}

/// Welch's t test, with Welch's and Satterthwaite's degrees of freedom. `None` if a group has
/// fewer than two numbers, or neither varies.
pub fn difference(a: &[f64], b: &[f64]) -> Option<Difference> {
    let (na, nb) = (a.len() as f64, b.len() as f64);
    let (va, vb) = (variance(a)? / na, variance(b)? / nb);
    let df = finite((va + vb).powi(2) / (va * va / (na - 1.0) + vb * vb / (nb - 1.0)))?;
    Difference::of(a, b, (va + vb).sqrt(), df)
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [f64; 5] = [0.31, 0.22, 0.45, 0.28, 0.39];
    const B: [f64; 6] = [0.42, 0.35, 0.51, 0.33, 0.61, 0.7];
    const C: [f64; 4] = [0.55, 0.3, 0.8, 0.66];

    fn close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }

    /// R 4.2.2: oneway.test.
    #[test]
    fn several_groups_are_those_of_r() {
        let found = one_way(&[&A[..], &B, &C]).unwrap();
        close(found.f, 3.55829822717);
        close(found.df2, 6.46217336495);
        close(found.p.unwrap(), 0.0907890101741);
    }

    /// R 4.2.2: t.test; g by its formula with lgamma.
    #[test]
    fn two_groups_are_those_of_r() {
        let found = difference(&A, &B).unwrap();
        close(found.t, -2.1558272183);
        close(found.df, 8.40667300755);
        close(found.p.unwrap(), 0.0615724427073);
        close(found.ci95.0, -0.3228462296951);
        close(found.ci95.1, 0.0095128963618);
        close(found.hedges_g.unwrap(), -1.14009857338);
        // F of two groups is t².
        let f = one_way(&[&A[..], &B]).unwrap();
        close(f.f, found.t * found.t);
        close(f.df2, found.df);
    }

    #[test]
    fn groups_without_variance_have_no_test() {
        assert_eq!(one_way(&[&A[..], &[1.0, 1.0]]), None);
        assert_eq!(one_way(&[&A[..], &[1.0]]), None);
        assert_eq!(one_way(&[&A[..]]), None);
        assert_eq!(difference(&[1.0, 1.0], &[2.0, 2.0]), None);
        assert_eq!(difference(&A, &[]), None);
    }
}
