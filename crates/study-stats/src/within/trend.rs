//! The slope of the means of realizations on a covariate, with their precision.

use super::Within;
use crate::distribution::{t_quantile, t_two_sided};
use crate::finite;
use crate::matrix::{Cholesky, SymmetricMatrix};

/// The slope of the means of realizations on a covariate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// Change of the mean per unit of the covariate.
    pub slope: f64,
    /// Its standard error.
    pub se: f64,
    /// slope/se; `None` if the means lie on a line.
    pub t: Option<f64>,
    /// Realizations less 2.
    pub df: f64,
    /// Two-sided.
    pub p: Option<f64>,
    /// 95 % interval of the slope.
    pub ci95: Option<(f64, f64)>,
    /// Standard deviation of the realizations about the line, beyond the errors of their means.
    pub sd: f64,
    /// t/√(t² + df): of means with equal precision Pearson's correlation.
    pub r: Option<f64>,
}

/// Steps of the search for the variance of the realizations, by ratios …
const STEPS: usize = 60;
/// … over so many factors of ten below ten times the variance of the means.
const DECADES: f64 = 6.0;
/// Steps of the golden section.
const GOLDEN_STEPS: usize = 60;

impl Within {
    /// The trend over the realizations with a covariate, by their positions: generalized least squares with
    /// the covariance of the differences within subjects plus a variance of the realizations about the line,
    /// which is estimated by restricted maximum likelihood. The standard error is scaled by the weighted
    /// residuals, with t on n − 2 degrees of freedom (Knapp & Hartung 2003, Stat. Med. 22, 2693–2710). If all
    /// means are equally precise it is ordinary least squares, whose t is that of Pearson's correlation.
    ///
    /// `None` with fewer than three realizations with a covariate, if they are not linked, or if the
    /// covariate is constant.
    pub fn trend(&self, covariate: &[Option<f64>]) -> Option<Trend> {
        let known: Vec<(usize, f64)> = (covariate.iter().enumerate())
            .filter_map(|(i, x)| Some((i, (*x)?)))
            .collect();
        let (&(last, x_last), others) = known.split_last()?;
        let linked = others.iter().all(|(i, _)| self.sets[*i] == self.sets[last]);
        if others.len() < 2 || !linked {
            return None;
        }
        let covariance = self.covariance.as_ref()?;
        let contrasts = Contrasts {
            x: others.iter().map(|(_, x)| x - x_last).collect(),
            y: others
                .iter()
                .map(|(i, _)| self.effects[*i] - self.effects[last])
                .collect(),
            errors: SymmetricMatrix::from_fn(others.len(), |a, b| {
                let (i, j) = (others[a].0, others[b].0);
                covariance[(i, j)] - covariance[(i, last)] - covariance[(last, j)]
                    + covariance[(last, last)]
            }),
        };
        if contrasts.x.iter().all(|x| *x == 0.0) {
            return None;
        }
        let variance = contrasts.variance()?;
        let line = contrasts.line(variance)?;
        let df = others.len() as f64 - 1.0;
        let se = finite((line.squares / df / line.information).sqrt())?;
        // Means on a line leave rounding only.
        let scatters = line.squares > 1e-20 * line.total;
        let t = finite(line.slope / se).filter(|_| scatters);
        let half = t_quantile(0.975, df).map(|t| t * se);
        Some(Trend {
            slope: line.slope,
            se,
            t,
            df,
            p: t.and_then(|t| t_two_sided(t, df)),
            ci95: half.map(|half| (line.slope - half, line.slope + half)),
            sd: variance.sqrt(),
            r: t.map(|t| t / (t * t + df).sqrt()),
        })
    }
}

/// Differences of realizations from the last one.
struct Contrasts {
    x: Vec<f64>,
    y: Vec<f64>,
    /// Covariance of the errors.
    errors: SymmetricMatrix,
}

/// A fitted line.
struct Line {
    slope: f64,
    /// 1 / the variance of the slope.
    information: f64,
    /// Weighted sum of squares of the residuals.
    squares: f64,
    /// The same of the differences themselves.
    total: f64,
    /// −2 restricted log likelihood.
    criterion: f64,
}

impl Contrasts {
    /// The line with a variance of the realizations.
    fn line(&self, variance: f64) -> Option<Line> {
        let size = self.x.len();
        let full = SymmetricMatrix::from_fn(size, |i, j| {
            let own = if i == j { 2.0 } else { 1.0 };
            self.errors.get(i, j) + own * variance
        });
        let factor = Cholesky::definite(&full)?;
        let (mut x, mut y) = (self.x.clone(), self.y.clone());
        factor.solve_lower(&mut x);
        factor.solve_lower(&mut y);
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let information = product(&x, &x);
        let slope = finite(product(&x, &y) / information)?;
        let squares: f64 = (x.iter().zip(&y))
            .map(|(x, y)| (y - slope * x).powi(2))
            .sum();
        Some(Line {
            slope,
            information,
            squares,
            total: product(&y, &y),
            criterion: factor.log_determinant() + information.ln() + squares,
        })
    }

    /// The variance of the realizations with the greatest restricted likelihood.
    fn variance(&self) -> Option<f64> {
        let criterion = |variance: f64| self.line(variance).map_or(f64::INFINITY, |l| l.criterion);
        let size = self.y.iter().map(|y| y * y).sum::<f64>() / self.y.len() as f64;
        let top = 10.0 * size;
        let at = |step: usize| match step {
            0 => 0.0,
            _ => top * 10f64.powf(-DECADES * (1.0 - step as f64 / STEPS as f64)),
        };
        let all: Vec<f64> = (0..=STEPS).map(|step| criterion(at(step))).collect();
        let best = (0..=STEPS).min_by(|a, b| all[*a].total_cmp(&all[*b]))?;
        let (mut low, mut high) = (at(best.saturating_sub(1)), at((best + 1).min(STEPS)));
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let inner = golden * (high - low);
        let (mut left, mut right) = (criterion(high - inner), criterion(low + inner));
        for _ in 0..GOLDEN_STEPS {
            if left <= right {
                (high, right) = (low + golden * (high - low), left);
                left = criterion(high - golden * (high - low));
            } else {
                (low, left) = (high - golden * (high - low), right);
                right = criterion(low + golden * (high - low));
            }
        }
        let (found, at_zero) = (0.5 * (low + high), all[0]);
        let of_found = criterion(found);
        finite(of_found.min(at_zero))?;
        Some(if of_found < at_zero { found } else { 0.0 })
    }
}
