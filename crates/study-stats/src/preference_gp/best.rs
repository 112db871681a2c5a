//! The best point so far, and pairs whose comparison leads to the best one.

use super::probit::{DENSITY_AT_0, cumulative, density};
use super::{Posterior, TIE};

impl Posterior {
    /// The expected utility of the better of two points (EUBO), without the noise of the answer: with means
    /// m_a ≥ m_b, θ the standard deviation of f_a − f_b, and t = (m_a − m_b)/θ, it is m_a + θ (φ(t) − t Φ(−t)).
    ///
    /// # Panics
    /// If there is no such point.
    pub fn expected_best(&self, a: usize, b: usize) -> f64 {
        let (higher, apart, spread) = self.compared(a, b);
        if spread <= 0.0 {
            return higher;
        }
        let t = apart / spread;
        higher + spread * (density(t) - t * cumulative(-t)).max(0.0)
    }

    /// The pair with the largest [`expected_best`](Self::expected_best), the lower index first; of pairs within
    /// [`TIE`] of it, the first one in the order (0, 1), (0, 2), (1, 2), (0, 3) and so on. `may` says of a point whether it
    /// can be one of them. `None` with fewer than two such points.
    pub fn best_pair(&self, may: impl Fn(usize) -> bool) -> Option<(usize, usize)> {
        let pairs = || self.pairs().filter(|(a, b)| may(*a) && may(*b));
        let most = pairs().fold(f64::NEG_INFINITY, |most, (a, b)| {
            if self.bound(a, b) < most {
                most
            } else {
                most.max(self.expected_best(a, b))
            }
        });
        let tied = most - TIE * most.abs().max(1.0);
        pairs().find(|(a, b)| self.bound(*a, *b) >= tied && self.expected_best(*a, *b) >= tied)
    }

    /// The best point so far and its challenger, the lower index first: of all others the point that may be better by most, in
    /// the sense that the mean of its advantage over the best point plus `sds` of its standard deviations is largest; of points
    /// within [`TIE`] of that, the first. `may` says of a point whether it can be one of them. `None` with fewer than two such
    /// points.
    ///
    /// Pairs by [`best_pair`](Self::best_pair) are the best ones if the next answer is the last. Challenges look further ahead: a
    /// region of which nothing is known is visited even if one answer could not make it the best.
    pub fn challenge(&self, sds: f64, may: impl Fn(usize) -> bool) -> Option<(usize, usize)> {
        let best = self.best_point(&may)?;
        let promise = |other: usize| {
            let variance = self.covariance(best, best) + self.covariance(other, other)
                - 2.0 * self.covariance(best, other);
            self.mean()[other] - self.mean()[best] + sds * variance.max(0.0).sqrt()
        };
        let others = || (0..self.mean().len()).filter(|other| *other != best && may(*other));
        let most = others().map(promise).fold(f64::NEG_INFINITY, f64::max);
        let tied = most - TIE * most.abs().max(1.0);
        let other = others().find(|other| promise(*other) >= tied)?;
        Some((best.min(other), best.max(other)))
    }

    /// Of the points that `may` be it, the one with the largest mean; of points within [`TIE`] of it, the first. `None` if there
    /// is no such point.
    pub fn best_point(&self, may: impl Fn(usize) -> bool) -> Option<usize> {
        let points = || (0..self.mean().len()).filter(|point| may(*point));
        let means = points().map(|point| self.mean()[point]);
        let most = means.fold(f64::NEG_INFINITY, f64::max);
        let tied = most - TIE * most.abs().max(1.0);
        points().find(|point| self.mean()[*point] >= tied)
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.mean().len()).flat_map(|b| (0..b).map(move |a| (a, b)))
    }

    /// The larger mean, by how much it is larger, and the standard deviation of the difference.
    fn compared(&self, a: usize, b: usize) -> (f64, f64, f64) {
        let (one, two) = (self.mean()[a], self.mean()[b]);
        let variance = self.covariance(a, a) + self.covariance(b, b) - 2.0 * self.covariance(a, b);
        (one.max(two), (one - two).abs(), variance.max(0.0).sqrt())
    }

    /// What [`expected_best`](Self::expected_best) cannot exceed, even rounded: φ(t) − t Φ(−t) is largest at 0.
    fn bound(&self, a: usize, b: usize) -> f64 {
        let (higher, _, spread) = self.compared(a, b);
        higher + spread * DENSITY_AT_0 + 1e-12 * (1.0 + higher.abs() + spread)
    }
}
