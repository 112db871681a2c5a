//! The crossed model with a covariate on complete, balanced data, in closed form.
//!
//! y = Xβ + subject + realization + cell + error, every subject × realization cell with R
//! ratings. The mean squares of error e, cells c, realizations about the line m and
//! subjects s are independent, with expectations λ that satisfy λₑ ≤ λ_c ≤ λₘ and
//! λ_c ≤ λₛ. Off the boundary REML's λ are the mean squares; on it neighbors whose order
//! is wrong are pooled, weighted by their degrees of freedom: of the eight poolings the
//! possible one with the highest likelihood −½Σ ν log λ. The variance of the slope is
//! λₘ/(nRΣ(x − x̄)²), and Satterthwaite's degrees of freedom are those of the pool of m.

/// The slope of a balanced table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BalancedSlope {
    /// Slope per unit of the covariate.
    pub estimate: f64,
    /// Its standard error.
    pub se: f64,
    /// Degrees of freedom of estimate/se.
    pub df: f64,
    /// Whether a variance is 0.
    pub singular: bool,
}

/// A mean square: sum of squares and degrees of freedom.
#[derive(Debug, Clone, Copy, Default)]
struct Square(f64, f64);

impl Square {
    fn and(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }

    fn mean(self) -> f64 {
        self.0 / self.1
    }
}

/// The REML fit of the crossed model, as [`super::fit`] with effects of realizations and,
/// for `repetitions` > 1, of cells. `means` are the cell means, `x.len()` for each subject;
/// `within` is the sum of squares of the ratings about them. `None` for fewer than two
/// subjects or three realizations, a covariate that does not vary, or no variance of error.
pub fn balanced_slope(
    means: &[f64],
    x: &[f64],
    repetitions: usize,
    within: f64,
) -> Option<BalancedSlope> {
    let q = x.len();
    let n = means.len() / q.max(1);
    if q < 3 || n < 2 || means.len() != n * q || repetitions == 0 {
        return None;
    }
    let (nf, qf, r) = (n as f64, q as f64, repetitions as f64);
    let mut columns = vec![0.0; q];
    let mut all = 0.0;
    for row in means.chunks_exact(q) {
        for (sum, mean) in columns.iter_mut().zip(row) {
            *sum += mean;
        }
    }
    for sum in &mut columns {
        *sum /= nf;
        all += *sum;
    }
    let grand = all / qf;
    let center = x.iter().sum::<f64>() / qf;
    let (mut sxx, mut sxy, mut of_columns) = (0.0, 0.0, 0.0);
    for (x, mean) in x.iter().zip(&columns) {
        sxx += (x - center).powi(2);
        sxy += (x - center) * (mean - grand);
        of_columns += (mean - grand).powi(2);
    }
    let (mut of_rows, mut of_cells) = (0.0, 0.0);
    for row in means.chunks_exact(q) {
        let own = row.iter().sum::<f64>() / qf - grand;
        of_rows += own * own;
        for (mean, column) in row.iter().zip(&columns) {
            of_cells += (mean - own - column).powi(2);
        }
    }
    let estimate = sxy / sxx;
    let about_line = (of_columns - estimate * sxy).max(0.0);
    let m = Square(nf * r * about_line, qf - 2.0);
    let s = Square(qf * r * of_rows, nf - 1.0);
    let c = Square(r * of_cells, (nf - 1.0) * (qf - 1.0));
    let e = (repetitions > 1).then_some(Square(within, nf * qf * (r - 1.0)));
    let (of_line, singular) = pooled(e, c, m, s)?;
    let se = (of_line.mean() / (nf * r * sxx)).sqrt();
    (se > 0.0 && se.is_finite() && sxx > 0.0).then_some(BalancedSlope {
        estimate,
        se,
        df: of_line.1,
        singular,
    })
}

/// The pool of m, and whether anything was pooled. Without e the cells are the error.
fn pooled(e: Option<Square>, c: Square, m: Square, s: Square) -> Option<(Square, bool)> {
    let error = e.unwrap_or(c);
    let total = c.and(m).and(s).0 + e.map_or(0.0, |e| e.0);
    if error.0 <= 1e-13 * total {
        return None;
    }
    if e.is_none_or(|e| e.mean() <= c.mean()) && c.mean() <= m.mean() && c.mean() <= s.mean() {
        return Some((m, false));
    }
    let mut best: Option<(f64, Square)> = None;
    for pools in 1..8 {
        let [with_e, with_m, with_s] = [1, 2, 4].map(|bit| pools & bit != 0);
        if with_e && e.is_none() {
            continue;
        }
        let (mut base, mut deviance) = (c, 0.0);
        let log = |square: Square| square.1 * square.mean().ln();
        for (joins, square) in [(with_e, e), (with_m, Some(m)), (with_s, Some(s))] {
            match square {
                Some(square) if joins => base = base.and(square),
                Some(square) => deviance += log(square),
                None => {}
            }
        }
        deviance += log(base);
        let base_mean = base.mean();
        let possible = (with_e || e.is_none_or(|e| e.mean() <= base_mean))
            && (with_m || base_mean <= m.mean())
            && (with_s || base_mean <= s.mean());
        if possible && best.is_none_or(|(least, _)| deviance < least) {
            best = Some((deviance, if with_m { base } else { m }));
        }
    }
    best.map(|(_, of_line)| (of_line, true))
}
