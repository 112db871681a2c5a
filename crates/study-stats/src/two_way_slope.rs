//! A slope beside two fixed factors, by sums.

use super::describe::mean;
use super::distribution::t_two_sided;
use super::finite;

/// A slope beside fixed subjects and realizations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoWaySlope {
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

/// Most levels of the second factor: the work goes with the square.
const MAX_LEVELS: usize = 300;

/// Slope of y on x with two fixed factors, by Frisch, Waugh and Lovell: the
/// first factor is swept out by centring within it, which leaves normal equations
/// of the second factor's indicators and x. Their sums go over the levels of the
/// first factor, whose rows have to stand together, so that no column is ever
/// stored. The levels of the second, `b`, are small numbers: a table is as long
/// as the largest. What rounding costs, one step of iterative refinement gives back: the
/// residuals are taken row by row and fitted again. `None` if the factors leave
/// nothing of x, or no degree of freedom.
pub fn two_way_slope(x: &[f64], y: &[f64], a: &[u32], b: &[u32]) -> Option<TwoWaySlope> {
    let n = x.len();
    let (level_of, levels) = numbered(b);
    if n < 3 || levels > MAX_LEVELS {
        return None;
    }
    let (mx, my) = (mean(x)?, mean(y)?);
    let mut groups = Groups {
        rows: (x.iter().zip(y))
            .zip(b)
            .map(|((x, y), b)| Row {
                x: x - mx,
                y: y - my,
                level: level_of[*b as usize],
            })
            .collect(),
        ends: ends(a),
        levels,
    };
    let size: f64 = groups.rows.iter().map(|r| r.x * r.x).sum();
    groups.centre();
    let (normal, mut right, yy) = groups.normal_equations();
    let factor = Factor::new(normal);
    let spread = factor.pivots[0];
    let df = n as f64 - groups.ends.len() as f64 - (factor.rank() as f64 - 1.0) - 1.0;
    if !(spread > 1e-12 * size && df >= 1.0) {
        return None;
    }
    let mut found = vec![0.0; right.len()];
    let mut residual = 0.0;
    for _ in 0..3 {
        for (f, step) in found.iter_mut().zip(factor.solve(&right)) {
            *f += step;
        }
        (residual, right) = groups.residuals(&found);
    }
    let slope = finite(found[0])?;
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

/// Where each run of equal numbers ends.
fn ends(a: &[u32]) -> Vec<usize> {
    let mut end = 0;
    a.chunk_by(|x, y| x == y)
        .map(|run| {
            end += run.len();
            end
        })
        .collect()
}

struct Row {
    x: f64,
    y: f64,
    level: u32,
}

impl Row {
    fn level(&self) -> usize {
        self.level as usize
    }
}

/// Rows, the levels of the first factor one after another. Unknowns are the slope
/// (the first) and the levels of the second factor but its first, which is the
/// reference.
struct Groups {
    rows: Vec<Row>,
    ends: Vec<usize>,
    levels: usize,
}

impl Groups {
    fn each(&self) -> impl Iterator<Item = &[Row]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(s, e)| &self.rows[s..*e])
    }

    /// Takes the mean of its group off every x and y.
    fn centre(&mut self) {
        let mut start = 0;
        for &end in &self.ends {
            let rows = &mut self.rows[start..end];
            start = end;
            let n = rows.len() as f64;
            let mx = rows.iter().map(|r| r.x).sum::<f64>() / n;
            let my = rows.iter().map(|r| r.y).sum::<f64>() / n;
            for r in rows {
                r.x -= mx;
                r.y -= my;
            }
        }
    }

    /// Matrix, right side, and the sum of squares of y within the groups.
    fn normal_equations(&self) -> (Vec<Vec<f64>>, Vec<f64>, f64) {
        let p = self.levels;
        let mut normal = vec![vec![0.0; p]; p];
        let mut right = vec![0.0; p];
        let mut yy = 0.0;
        // By level: rows, sum of x, sum of y.
        let mut sums = vec![(0.0, 0.0, 0.0); p];
        let mut seen: Vec<usize> = Vec::new();
        for rows in self.each() {
            let n = rows.len() as f64;
            for r in rows {
                let s = &mut sums[r.level()];
                if s.0 == 0.0 {
                    seen.push(r.level());
                }
                *s = (s.0 + 1.0, s.1 + r.x, s.2 + r.y);
                normal[0][0] += r.x * r.x;
                right[0] += r.x * r.y;
                yy += r.y * r.y;
            }
            for &j in seen.iter().filter(|j| **j > 0) {
                normal[j][0] += sums[j].1;
                right[j] += sums[j].2;
                normal[j][j] += sums[j].0;
                for &k in seen.iter().filter(|k| **k > 0) {
                    normal[j][k] -= sums[j].0 * sums[k].0 / n;
                }
            }
            for j in seen.drain(..) {
                sums[j] = (0.0, 0.0, 0.0);
            }
        }
        let (slope, levels) = normal.split_at_mut(1);
        for (cell, row) in slope[0][1..].iter_mut().zip(levels) {
            *cell = row[0];
        }
        (normal, right, yy)
    }

    /// Sum of squares of the residuals, and the right side that they make.
    fn residuals(&self, found: &[f64]) -> (f64, Vec<f64>) {
        let effect = |level: usize| if level == 0 { 0.0 } else { found[level] };
        let (mut squares, mut right) = (0.0, vec![0.0; self.levels]);
        let mut own: Vec<f64> = Vec::new();
        for rows in self.each() {
            let n = rows.len() as f64;
            own.clear();
            own.extend(
                rows.iter()
                    .map(|r| r.y - effect(r.level()) - found[0] * r.x),
            );
            let m = own.iter().sum::<f64>() / n;
            for (r, e) in rows.iter().zip(&own) {
                let e = e - m;
                squares += e * e;
                right[0] += r.x * e;
                right[r.level()] += if r.level == 0 { 0.0 } else { e };
            }
        }
        (squares, right)
    }
}

/// Cholesky's factor of a matrix whose first unknown is eliminated last, so that
/// its pivot is what the others leave of it. Unknowns that the ones before
/// determine are left at 0.
struct Factor {
    lower: Vec<Vec<f64>>,
    /// Squares of the diagonal, in the order of the unknowns; 0: left out.
    pivots: Vec<f64>,
}

impl Factor {
    fn new(matrix: Vec<Vec<f64>>) -> Self {
        let p = matrix.len();
        let mut lower = vec![vec![0.0; p]; p];
        let mut pivots = vec![0.0; p];
        let order = || (1..p).chain([0]);
        for i in order() {
            for j in order() {
                let before = order().take_while(|k| *k != j);
                let rest = matrix[i][j] - before.map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
                if i == j {
                    // The slope's own pivot is judged by the caller.
                    let free = rest > if i == 0 { 0.0 } else { 1e-11 * matrix[i][i] };
                    pivots[i] = if free { rest } else { 0.0 };
                    lower[i][i] = pivots[i].sqrt();
                    break;
                }
                lower[i][j] = if pivots[j] > 0.0 {
                    rest / lower[j][j]
                } else {
                    0.0
                };
            }
        }
        Self { lower, pivots }
    }

    fn rank(&self) -> usize {
        self.pivots.iter().filter(|p| **p > 0.0).count()
    }

    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let p = right.len();
        let order: Vec<usize> = (1..p).chain([0]).collect();
        let mut z = vec![0.0; p];
        for (at, &i) in order.iter().enumerate() {
            if self.pivots[i] > 0.0 {
                let known: f64 = order[..at].iter().map(|&k| self.lower[i][k] * z[k]).sum();
                z[i] = (right[i] - known) / self.lower[i][i];
            }
        }
        let mut solution = vec![0.0; p];
        for (at, &i) in order.iter().enumerate().rev() {
            if self.pivots[i] > 0.0 {
                let later = &order[at + 1..];
                let known: f64 = later.iter().map(|&k| self.lower[k][i] * solution[k]).sum();
                solution[i] = (z[i] - known) / self.lower[i][i];
            }
        }
        solution
    }
}

/// Numbers the levels that occur, in ascending order: the number of each, and how
/// many there are.
fn numbered(b: &[u32]) -> (Vec<u32>, usize) {
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
    (numbers, next as usize)
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
    fn an_x_that_is_the_realization_leaves_nothing() {
        let b = [0, 1, 2, 0, 1, 2];
        let x = b.map(f64::from);
        let y = [1.0, 2.0, 2.0, 3.0, 4.0, 4.5];
        assert_eq!(two_way_slope(&x, &y, &[0, 0, 0, 1, 1, 1], &b), None);
    }
}
