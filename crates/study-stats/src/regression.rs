//! Least-squares lines and parabolas.

use super::correlation::pearson;
use super::describe::{Sum, is_constant, mean, sum_of_products, sum_of_squares};
use super::distribution::{f_upper, t_two_sided};
use super::finite;

/// A least-squares line y = intercept + slope·x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Value of the line at x = 0.
    pub intercept: f64,
    /// Change of y per unit of x.
    pub slope: f64,
    /// Standard error of the intercept.
    pub intercept_se: f64,
    /// Standard error of the slope.
    pub slope_se: f64,
    /// Residual standard deviation: √(residual sum of squares/(n − 2)).
    pub residual_sd: f64,
    /// R²: 1 − residual/total sum of squares.
    pub r2: f64,
    /// F of the slope on 1 and n − 2 degrees of freedom; `None` if the residuals are 0.
    pub f: Option<f64>,
    /// Pearson's correlation of x and y.
    pub r: f64,
}

/// The least-squares line. `None` for fewer than three points, unequal lengths, or if x
/// or y is constant.
///
/// ```
/// # use study_stats::regression::line;
/// // The first of Anscombe's (1973) quartet: y = 3 + x/2.
/// let x = [10., 8., 13., 9., 11., 14., 6., 4., 12., 7., 5.];
/// let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
/// let fit = line(&x, &y).unwrap();
/// assert_eq!(format!("{:.2} {:.3} {:.2}", fit.intercept, fit.slope, fit.r2), "3.00 0.500 0.67");
/// ```
pub fn line(x: &[f64], y: &[f64]) -> Option<Line> {
    let n = x.len() as f64;
    if x.len() < 3 || x.len() != y.len() || is_constant(x) || is_constant(y) {
        return None;
    }
    let (mx, my) = (mean(x)?, mean(y)?);
    let (xx, yy) = (sum_of_squares(x)?, sum_of_squares(y)?);
    let slope = finite(sum_of_products(x, y)? / xx)?;
    let intercept = my - slope * mx;
    // From the residuals, because the difference of large sums would lose digits.
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

/// The least-squares slope of y on x; 0 if y is constant. `None` for fewer than two
/// points, unequal lengths, or if x is constant.
pub fn slope(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() < 2 || x.len() != y.len() || is_constant(x) {
        return None;
    }
    if is_constant(y) {
        return Some(0.0);
    }
    finite(sum_of_products(x, y)? / sum_of_squares(x)?)
}

/// A least-squares parabola y = a + b·x + c·x².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parabola {
    /// The quadratic coefficient c.
    pub square: f64,
    /// Standard error of c.
    pub se: f64,
    /// c/se, with n − 3 degrees of freedom; `None` if the residuals are 0.
    pub t: Option<f64>,
    /// Two-sided p of t.
    pub p: Option<f64>,
    /// Residual degrees of freedom, n − 3.
    pub df: f64,
    /// F of x and x² together, on 2 and n − 3 degrees of freedom.
    pub f: Option<f64>,
    /// p of F.
    pub p_f: Option<f64>,
    /// R²: 1 − residual/total sum of squares.
    pub r2: f64,
    /// The x of the vertex; `None` if c is 0.
    pub turn: Option<f64>,
}

/// The least-squares parabola. The curvature is the coefficient of the part of
/// (x − x̄)² that is orthogonal to x. `None` for fewer than four points, unequal lengths,
/// if y is constant or x has fewer than three distinct values.
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
    let curved: Vec<f64> = z
        .iter()
        .zip(&squares)
        .map(|(z, s)| s - ms - along * z)
        .collect();
    let bb: f64 = curved.iter().map(|v| v * v).sum();
    if bb <= 1e-18 * squares.iter().map(|v| v * v).sum::<f64>() {
        return None;
    }
    let linear = finite(sum_of_products(&z, y)? / zz)?;
    let square = finite(curved.iter().zip(y).map(|(w, v)| w * (v - my)).sum::<f64>() / bb)?;
    let residual: Sum = (0..n)
        .map(|i| (y[i] - my - linear * z[i] - square * curved[i]).powi(2))
        .collect();
    let (residual, total) = (residual.get(), sum_of_squares(y)?);
    let df = n as f64 - 3.0;
    let imperfect = residual > 1e-24 * total;
    let se = finite((residual / df / bb).sqrt())?;
    let t = if imperfect { finite(square / se) } else { None };
    let f = if imperfect {
        finite((total - residual) / 2.0 / (residual / df))
    } else {
        None
    };
    // y = … + (linear − square·along)·z + square·z²
    let turn = finite(mx - (linear - square * along) / (2.0 * square));
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
    fn a_parabola_has_its_vertex_where_its_slope_is_zero() {
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
