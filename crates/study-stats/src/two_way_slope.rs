//! The slope on a covariate beside two fixed factors.

use super::describe::mean;
use super::distribution::t_two_sided;
use super::finite;
use super::matrix::{Cholesky, SymmetricMatrix};

/// The slope on a covariate, adjusted for two fixed factors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoWaySlope {
    /// Change of y per unit of x.
    pub slope: f64,
    /// Standard error of the slope.
    pub se: f64,
    /// slope/se; `None` if the residuals are 0.
    pub t: Option<f64>,
    /// Two-sided p of t.
    pub p: Option<f64>,
    /// Residual degrees of freedom: n less the rank of the design.
    pub df: f64,
}

/// Most levels of the second factor: the work grows with their square.
const MAX_LEVELS: usize = 300;

/// The least-squares slope of y on x in y ~ x + a + b, with a and b as factors.
///
/// The four slices are as long as there are observations. Those of one level of `a`
/// have to be adjacent. The levels of `b` should be small numbers: a table as long as
/// the largest is allocated.
///
/// The first factor is removed by centering within its levels (Frisch & Waugh 1933;
/// Lovell 1963). This leaves normal equations for the levels of the second factor and
/// x, whose sums are collected over the levels of the first. Three rounds of iterative
/// refinement, with residuals taken row by row, restore the digits that are lost to
/// rounding.
///
/// `None` if the slices differ in length, there are fewer than three observations or
/// more than 300 levels of `b`, the factors determine x, or no degree of freedom is
/// left.
pub fn two_way_slope(x: &[f64], y: &[f64], a: &[u32], b: &[u32]) -> Option<TwoWaySlope> {
    let n = x.len();
    let (level_of, levels) = numbered(b);
    if n < 3 || [y.len(), a.len(), b.len()] != [n; 3] || levels > MAX_LEVELS {
        return None;
    }
    let (mx, my) = (mean(x)?, mean(y)?);
    let mut groups = Groups {
        rows: (0..n)
            .map(|i| Row {
                group: a[i],
                level: level_of[b[i] as usize],
                x: x[i] - mx,
                y: y[i] - my,
            })
            .collect(),
        levels,
    };
    let size: f64 = groups.rows.iter().map(|r| r.x * r.x).sum();
    groups.center();
    let (normal, mut right, yy) = groups.normal_equations();
    // The slope is the last unknown, so that its pivot is what the factors leave of x;
    // that is compared with the size of x below.
    let last = levels - 1;
    let tolerance = |i: usize| if i == last { 0.0 } else { 1e-11 };
    let factor = Cholesky::semidefinite(&normal, tolerance)?;
    let spread = factor.pivots[last];
    let df = n as f64 - groups.each().count() as f64 - (factor.rank() as f64 - 1.0) - 1.0;
    if !(spread > 1e-12 * size && df >= 1.0) {
        return None;
    }
    let mut effects = vec![0.0; right.len()];
    let mut residual = 0.0;
    for _ in 0..3 {
        for (effect, step) in effects.iter_mut().zip(factor.solve(&right)) {
            *effect += step;
        }
        (residual, right) = groups.residuals(&effects);
    }
    let slope = finite(effects[last])?;
    let se = finite((residual / df / spread).sqrt())?;
    let t = if residual > 1e-24 * yy {
        finite(slope / se)
    } else {
        None
    };
    Some(TwoWaySlope {
        slope,
        se,
        t,
        p: t.and_then(|t| t_two_sided(t, df)),
        df,
    })
}

struct Row {
    /// Level of the first factor.
    group: u32,
    /// Level of the second factor.
    level: usize,
    x: f64,
    y: f64,
}

impl Row {
    /// The unknown of this row's level; the first level is the reference.
    fn unknown(&self) -> Option<usize> {
        self.level.checked_sub(1)
    }
}

/// The observations by level of the first factor. The unknowns are the levels of the
/// second factor except its first, and then the slope.
struct Groups {
    rows: Vec<Row>,
    levels: usize,
}

/// Number of rows, sum of x and sum of y of one level.
#[derive(Clone, Copy, Default)]
struct LevelSums {
    n: f64,
    x: f64,
    y: f64,
}

impl Groups {
    fn each(&self) -> impl Iterator<Item = &[Row]> {
        self.rows.chunk_by(|a, b| a.group == b.group)
    }

    /// Subtracts the mean of its group from every x and y.
    fn center(&mut self) {
        for rows in self.rows.chunk_by_mut(|a, b| a.group == b.group) {
            let n = rows.len() as f64;
            let mx = rows.iter().map(|r| r.x).sum::<f64>() / n;
            let my = rows.iter().map(|r| r.y).sum::<f64>() / n;
            for r in rows {
                r.x -= mx;
                r.y -= my;
            }
        }
    }

    /// Matrix, right-hand side, and the sum of squares of y within the groups.
    fn normal_equations(&self) -> (SymmetricMatrix, Vec<f64>, f64) {
        let slope = self.levels - 1;
        let mut normal = SymmetricMatrix::zero(self.levels);
        let mut right = vec![0.0; self.levels];
        let mut yy = 0.0;
        let mut sums = vec![LevelSums::default(); slope];
        let mut seen: Vec<usize> = Vec::new();
        for rows in self.each() {
            let n = rows.len() as f64;
            for r in rows {
                normal.add(slope, slope, r.x * r.x);
                right[slope] += r.x * r.y;
                yy += r.y * r.y;
                if let Some(j) = r.unknown() {
                    if sums[j].n == 0.0 {
                        seen.push(j);
                    }
                    sums[j].n += 1.0;
                    sums[j].x += r.x;
                    sums[j].y += r.y;
                }
            }
            for &j in &seen {
                normal.add(slope, j, sums[j].x);
                right[j] += sums[j].y;
                normal.add(j, j, sums[j].n);
                for &k in seen.iter().filter(|k| **k <= j) {
                    normal.add(j, k, -sums[j].n * sums[k].n / n);
                }
            }
            for j in seen.drain(..) {
                sums[j] = LevelSums::default();
            }
        }
        (normal, right, yy)
    }

    /// Sum of squares of the residuals, and the right-hand side that they make.
    fn residuals(&self, effects: &[f64]) -> (f64, Vec<f64>) {
        let slope = self.levels - 1;
        let effect = |row: &Row| row.unknown().map_or(0.0, |j| effects[j]);
        let (mut squares, mut right) = (0.0, vec![0.0; self.levels]);
        for rows in self.each() {
            let n = rows.len() as f64;
            let left = |r: &Row| r.y - effect(r) - effects[slope] * r.x;
            let mean = rows.iter().map(left).sum::<f64>() / n;
            for r in rows {
                let e = left(r) - mean;
                squares += e * e;
                right[slope] += r.x * e;
                if let Some(j) = r.unknown() {
                    right[j] += e;
                }
            }
        }
        (squares, right)
    }
}

/// Numbers the levels that occur, in ascending order: the number of each, and how
/// many there are.
fn numbered(b: &[u32]) -> (Vec<usize>, usize) {
    let largest = b.iter().max().map_or(0, |m| *m as usize);
    let mut numbers = vec![0; largest + 1];
    for level in b {
        numbers[*level as usize] = 1;
    }
    let mut next = 0;
    for number in &mut numbers {
        let used = *number;
        *number = next;
        next += used;
    }
    (numbers, next)
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
        let found = two_way_slope(&x, &y, &a, &b).unwrap();
        assert!((found.slope - 0.5).abs() < 1e-12);
        assert_eq!((found.df, found.t), (2.0, None));
    }

    #[test]
    fn a_covariate_that_is_the_factor_has_no_slope() {
        let b = [0, 1, 2, 0, 1, 2];
        let x = b.map(f64::from);
        let y = [1.0, 2.0, 2.0, 3.0, 4.0, 4.5];
        assert_eq!(two_way_slope(&x, &y, &[0, 0, 0, 1, 1, 1], &b), None);
    }

    #[test]
    fn slices_of_different_lengths_have_no_slope() {
        let x = [1.0, 2.0, 4.0, 3.0];
        assert_eq!(two_way_slope(&x, &x, &[0; 4], &[0; 3]), None);
        assert_eq!(two_way_slope(&[], &[], &[], &[]), None);
    }
}
