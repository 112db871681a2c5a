//! Least squares: a line, and a line beside two fixed factors.

use super::correlation::pearson;
use super::describe::{Sum, constant, mean, sum_of_products, sum_of_squares};
use super::distribution::t_two_sided;
use super::finite;

/// y = intercept + slope·x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// At x = 0.
    pub intercept: f64,
    /// Per unit of x.
    pub slope: f64,
    /// Standard error of the intercept.
    pub intercept_se: f64,
    /// Standard error of the slope.
    pub slope_se: f64,
    /// √(residual sum of squares/(n − 2)).
    pub residual_sd: f64,
    /// 1 − residual/total sum of squares.
    pub r2: f64,
    /// On 1 and n − 2.
    pub f: Option<f64>,
    /// Pearson's.
    pub r: f64,
}

/// The line through three points or more; `None` if x or y is constant.
pub fn line(x: &[f64], y: &[f64]) -> Option<Line> {
    let n = x.len() as f64;
    if x.len() < 3 || constant(x) || constant(y) {
        return None;
    }
    let (mx, my) = (mean(x)?, mean(y)?);
    let (xx, yy) = (sum_of_squares(x)?, sum_of_squares(y)?);
    let slope = finite(sum_of_products(x, y)? / xx)?;
    let intercept = my - slope * mx;
    // From the residuals, not as a difference of large sums.
    let residual: Sum = x
        .iter()
        .zip(y)
        .map(|(a, b)| {
            let e = (b - my) - slope * (a - mx);
            e * e
        })
        .collect();
    let variance = residual.get() / (n - 2.0);
    Some(Line {
        intercept,
        slope,
        intercept_se: finite((variance * (1.0 / n + mx * mx / xx)).sqrt())?,
        slope_se: finite((variance / xx).sqrt())?,
        residual_sd: variance.sqrt(),
        r2: 1.0 - residual.get() / yy,
        f: if variance > 0.0 {
            finite(slope * slope * xx / variance)
        } else {
            None
        },
        r: pearson(x, y)?,
    })
}

/// Slope of y on x where y does not vary: 0; `None` where x does not.
pub fn slope(x: &[f64], y: &[f64]) -> Option<f64> {
    if constant(x) || x.len() < 2 {
        return None;
    }
    if constant(y) {
        return Some(0.0);
    }
    finite(sum_of_products(x, y)? / sum_of_squares(x)?)
}

/// A slope beside fixed subjects and realizations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beside {
    /// Per unit of x.
    pub slope: f64,
    /// Its standard error.
    pub se: f64,
    /// slope/se; undefined if nothing is left to explain.
    pub t: Option<f64>,
    /// Two-sided.
    pub p: Option<f64>,
    /// n − rank of the design.
    pub df: f64,
}

/// Most levels of the second factor: its columns are orthogonalised in turn.
const MAX_LEVELS: usize = 300;

/// Slope of y on x with two fixed factors, by Frisch, Waugh and Lovell: the
/// first factor is swept out by centring within it, the second by Gram–Schmidt
/// on its centred columns, twice for the digits; then y on what is left of x.
/// `None` if the factors leave nothing of x, or no degree of freedom.
pub fn beside_factors(x: &[f64], y: &[f64], a: &[u32], b: &[u32]) -> Option<Beside> {
    let n = x.len();
    let levels_a = distinct(a);
    let levels_b = distinct(b);
    if n < 3 || levels_b.len() > MAX_LEVELS {
        return None;
    }
    let groups: Vec<usize> = a
        .iter()
        .map(|v| levels_a.partition_point(|l| l < v))
        .collect();
    let sweep = |column: &mut [f64]| {
        let mut sums = vec![(0.0, 0.0); levels_a.len()];
        for (v, g) in column.iter().zip(&groups) {
            sums[*g].0 += v;
            sums[*g].1 += 1.0;
        }
        for (v, g) in column.iter_mut().zip(&groups) {
            *v -= sums[*g].0 / sums[*g].1;
        }
    };
    let mut basis: Vec<Vec<f64>> = Vec::new();
    // The first level is the reference: the sum of all is swept out already.
    for level in levels_b.iter().skip(1) {
        let mut column: Vec<f64> = b.iter().map(|v| f64::from(u8::from(v == level))).collect();
        let size = dot(&column, &column).sqrt();
        sweep(&mut column);
        clear(&mut column, &basis);
        let norm = dot(&column, &column).sqrt();
        if norm > 1e-9 * size {
            column.iter_mut().for_each(|v| *v /= norm);
            basis.push(column);
        }
    }
    let centre = |v: &[f64]| -> Option<Vec<f64>> {
        let m = mean(v)?;
        Some(v.iter().map(|u| u - m).collect())
    };
    let (mut x, mut y) = (centre(x)?, centre(y)?);
    let size = dot(&x, &x).sqrt();
    for column in [&mut x, &mut y] {
        sweep(column);
        clear(column, &basis);
    }
    let xx = dot(&x, &x);
    let df = n as f64 - levels_a.len() as f64 - basis.len() as f64 - 1.0;
    if !(xx.sqrt() > 1e-9 * size && df >= 1.0) {
        return None;
    }
    let slope = finite(dot(&x, &y) / xx)?;
    let yy = dot(&y, &y);
    let residual: f64 = x.iter().zip(&y).map(|(u, v)| (v - slope * u).powi(2)).sum();
    let se = finite((residual / df / xx).sqrt())?;
    let t = if residual > 1e-24 * yy {
        finite(slope / se)
    } else {
        None
    };
    Some(Beside {
        slope,
        se,
        t,
        p: t.and_then(|t| t_two_sided(t, df)),
        df,
    })
}

fn distinct(v: &[u32]) -> Vec<u32> {
    let mut levels = v.to_vec();
    levels.sort_unstable();
    levels.dedup();
    levels
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Takes off what lies in the span of an orthonormal basis, twice.
fn clear(column: &mut [f64], basis: &[Vec<f64>]) {
    for _ in 0..2 {
        for direction in basis {
            let along = dot(column, direction);
            for (c, d) in column.iter_mut().zip(direction) {
                *c -= along * d;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_beside_unbalanced_factors() {
        let a = [0, 0, 0, 1, 1, 1, 2, 2];
        let b = [0, 1, 2, 0, 1, 1, 2, 0];
        let x = [1.0, 5.0, 2.0, 7.0, 3.0, 8.0, 4.0, 9.0];
        let y: Vec<f64> = (0..8)
            .map(|i| 10.0 * f64::from(a[i]) - 3.0 * f64::from(b[i]) + 0.5 * x[i])
            .collect();
        let found = beside_factors(&x, &y, &a, &b).unwrap();
        assert!((found.slope - 0.5).abs() < 1e-12);
        assert_eq!((found.df, found.t), (2.0, None));
    }

    #[test]
    fn an_x_that_is_the_realization_leaves_nothing() {
        let b = [0, 1, 2, 0, 1, 2];
        let x = b.map(f64::from);
        let y = [1.0, 2.0, 2.0, 3.0, 4.0, 4.5];
        assert_eq!(beside_factors(&x, &y, &[0, 0, 0, 1, 1, 1], &b), None);
    }
}
