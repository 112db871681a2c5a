//! Weights that may be below 0, and what is known of their shares.

use super::maximum::{Terms, maximum};
use super::{Data, LEAST, RESAMPLES};
use crate::distribution::t_quantile;
use crate::matrix::SymmetricMatrix;
use crate::random::RandomSource;

/// Weights of scaled errors that may be below 0, with their covariance over resamples.
#[derive(Debug)]
pub(super) struct Free {
    pub(super) weights: Vec<f64>,
    pub(super) covariance: SymmetricMatrix,
    /// The sum of equal weights, and its variance.
    pub(super) equal: (f64, f64),
    /// Units less 1.
    pub(super) df: f64,
}

impl Free {
    /// `None` if numbers overflow.
    pub(super) fn of(data: &Data, random: &mut impl RandomSource) -> Option<Self> {
        let k = data.rows.first()?.len();
        let (sums, least) = (data.sums(), f64::NEG_INFINITY);
        let fit = |counts: &[f64]| -> Option<(Vec<f64>, f64)> {
            let weights = maximum(&data.rows, counts, &Terms::of(k, LEAST), least)?;
            let equal = maximum(&sums, counts, &Terms::of_equal(k), least)?;
            Some((weights, k as f64 * equal.first()?))
        };
        let (weights, equal) = fit(&data.all())?;
        let n = data.units.len();
        let mut found = Vec::new();
        for _ in 0..RESAMPLES {
            let mut times = vec![0.0; n];
            for _ in 0..n {
                // Below the number of units, which is a usize.
                times[random.below(n as u64) as usize] += 1.0;
            }
            found.push(fit(&data.counts(times.into_iter().enumerate()))?);
        }
        let df = n as f64 - 1.0;
        let drawn = found.len() as f64;
        // Resamples of n units vary less by (n − 1)/n.
        let each = (df + 1.0) / (df * (drawn - 1.0));
        let mean = |i: usize| found.iter().map(|(w, _)| w[i]).sum::<f64>() / drawn;
        let means: Vec<f64> = (0..k).map(mean).collect();
        let equal_mean = found.iter().map(|(_, sum)| sum).sum::<f64>() / drawn;
        let mut covariance = SymmetricMatrix::zero(k);
        let mut variance = 0.0;
        for (own, sum) in &found {
            let apart: Vec<f64> = own.iter().zip(&means).map(|(w, mean)| w - mean).collect();
            covariance.add_outer(each, &apart);
            variance += each * (sum - equal_mean).powi(2);
        }
        Some(Self {
            weights,
            covariance,
            equal: (equal, variance),
            df,
        })
    }

    /// The covariance of a weight with the sum of all.
    fn with_sum(&self, i: usize) -> f64 {
        (0..self.weights.len())
            .map(|j| self.covariance.get(i, j))
            .sum()
    }

    /// 95 % interval of the sum of equal weights.
    pub(super) fn equal_sum(&self) -> (f64, f64) {
        let (sum, variance) = self.equal;
        let t = t_quantile(0.975, self.df).unwrap_or(f64::INFINITY);
        let half = t * variance.max(0.0).sqrt();
        (sum - half, sum + half)
    }

    /// The interval of a share, within 0 and 1.
    pub(super) fn share(&self, i: usize) -> (f64, f64) {
        let sum: f64 = self.weights.iter().sum();
        let of_sum: f64 = (0..self.weights.len()).map(|j| self.with_sum(j)).sum();
        let (own, of_own, both) = (self.weights[i], self.covariance.get(i, i), self.with_sum(i));
        let level = 1.0 - 0.025 / self.weights.len() as f64;
        let t = t_quantile(level, self.df).unwrap_or(f64::INFINITY);
        let square = t * t;
        // a s² − 2 b s + c ≤ 0
        let a = sum * sum - square * of_sum;
        let b = own * sum - square * both;
        let c = own * own - square * of_own;
        if !(a > 0.0 && sum > 0.0) {
            return (0.0, 1.0);
        }
        let root = (b * b - a * c).max(0.0).sqrt();
        let end = |sign: f64| ((b + sign * root) / a).clamp(0.0, 1.0);
        (end(-1.0), end(1.0))
    }
}
