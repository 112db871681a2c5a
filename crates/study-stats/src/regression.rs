//! Least squares: a line, and a parabola beside it.

use super::correlation::pearson;
use super::describe::{Sum, is_constant, mean, sum_of_products, sum_of_squares};
use super::distribution::{f_upper, t_two_sided};
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
    if x.len() < 3 || x.len() != y.len() || is_constant(x) || is_constant(y) {
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
    if x.len() < 2 || x.len() != y.len() || is_constant(x) {
        return None;
    }
    if is_constant(y) {
        return Some(0.0);
    }
    finite(sum_of_products(x, y)? / sum_of_squares(x)?)
}

/// y = a + b·x + c·x².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parabola {
    /// c.
    pub square: f64,
    /// Its standard error.
    pub se: f64,
    /// c/se on n − 3; undefined if nothing is left to explain.
    pub t: Option<f64>,
    /// Two-sided.
    pub p: Option<f64>,
    /// n − 3.
    pub df: f64,
    /// Of x and x² together, on 2 and n − 3.
    pub f: Option<f64>,
    /// Its p.
    pub p_f: Option<f64>,
    /// 1 − residual/total sum of squares.
    pub r2: f64,
    /// Where it turns, if it is not straight.
    pub turn: Option<f64>,
}

/// The parabola through four points or more. What x leaves of (x − x̄)² carries
/// the curvature. `None` if y is constant or x has fewer than three values.
pub fn parabola(x: &[f64], y: &[f64]) -> Option<Parabola> {
    let n = x.len();
    if n < 4 || n != y.len() || is_constant(x) || is_constant(y) {
        return None;
    }
    let (mx, my) = (mean(x)?, mean(y)?);
    let z: Vec<f64> = x.iter().map(|v| v - mx).collect();
    let squares: Vec<f64> = z.iter().map(|v| v * v).collect();
    let zz = sum_of_squares(&z)?;
    let along = finite(sum_of_products(&z, &squares)? / zz)?;
    let ms = mean(&squares)?;
    let bent: Vec<f64> = z
        .iter()
        .zip(&squares)
        .map(|(z, s)| s - ms - along * z)
        .collect();
    let bb: f64 = bent.iter().map(|v| v * v).sum();
    if bb <= 1e-18 * squares.iter().map(|v| v * v).sum::<f64>() {
        return None;
    }
    let straight = finite(sum_of_products(&z, y)? / zz)?;
    let square = finite(bent.iter().zip(y).map(|(w, v)| w * (v - my)).sum::<f64>() / bb)?;
    let residual: Sum = (0..n)
        .map(|i| (y[i] - my - straight * z[i] - square * bent[i]).powi(2))
        .collect();
    let (residual, total) = (residual.get(), sum_of_squares(y)?);
    let df = n as f64 - 3.0;
    let left = residual > 1e-24 * total;
    let se = finite((residual / df / bb).sqrt())?;
    let t = if left { finite(square / se) } else { None };
    let f = if left {
        finite((total - residual) / 2.0 / (residual / df))
    } else {
        None
    };
    // y = … + (straight − square·along)·z + square·z²
    let turn = finite(mx - (straight - square * along) / (2.0 * square));
    Some(Parabola {
        square,
        se,
        t,
        p: t.and_then(|t| t_two_sided(t, df)),
        df,
        f,
        p_f: f.and_then(|f| f_upper(f, 2.0, df)),
        r2: 1.0 - residual / total,
        turn,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_turns_where_its_slope_is_zero() {
        let x = [1.0, 2.0, 3.0, 4.0, 5.0];
        let y = x.map(|v: f64| 5.0 - (v - 3.4).powi(2));
        let p = parabola(&x, &y).unwrap();
        assert!((p.square + 1.0).abs() < 1e-12 && (p.turn.unwrap() - 3.4).abs() < 1e-12);
        assert_eq!((p.t, p.df), (None, 2.0));
        // Orthogonal polynomials: the quadratic contrast is (2,−1,−2,−1,2), its
        // sum of squares 14; Σwy = 2−3−8−4+4 = −9, so c = −9/14.
        let p = parabola(&x, &[1.0, 3.0, 4.0, 4.0, 2.0]).unwrap();
        assert!((p.square + 9.0 / 14.0).abs() < 1e-12);
        // Σwy²-part 81/14, line (−2,−1,0,1,2)·y = 3, 9/10; total 6.8.
        let residual: f64 = 6.8 - 81.0 / 14.0 - 0.9;
        assert!((p.se - (residual / 2.0 / 14.0).sqrt()).abs() < 1e-12);
        assert!((p.r2 - (1.0 - residual / 6.8)).abs() < 1e-12);
    }

    #[test]
    fn two_values_of_x_have_no_curvature() {
        assert_eq!(parabola(&[1.0, 1.0, 2.0, 2.0], &[1.0, 2.0, 3.0, 5.0]), None);
    }
}
