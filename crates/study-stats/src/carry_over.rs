//! Whether a rating depends on the one before it.
//!
//! A regression on the previous rating with an intercept for each subject is biased
//! below 0 (Nickell 1981), more so if subjects prefer some realizations, because the
//! orders do not repeat a realization soon. Here the product of neighboring residuals
//! is compared with its mean over all orders of the trials within their blocks. That
//! comparison has neither bias: where ratings do not depend on the order, every order of
//! a block was equally likely.

use super::describe::mean;
use super::distribution::{t_quantile, t_two_sided};
use super::finite;
use super::paired::one_sample;

/// A rating, in the order of presentation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrderedRating {
    /// Any number that identifies the subject.
    pub subject: u32,
    /// A small number that identifies the realization: a table as long as the largest is
    /// allocated.
    pub realization: u32,
    /// The block within which the order was random, such as a repetition.
    pub block: u32,
    /// The rating.
    pub rating: f64,
}

/// The dependence of a rating on the one before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarryOver {
    /// Change of a rating per unit of the previous one.
    pub slope: f64,
    /// Standard error of the slope, over subjects.
    pub se: f64,
    /// slope/se.
    pub t: f64,
    /// Number of subjects − 1.
    pub df: f64,
    /// Two-sided p of t.
    pub p: f64,
    /// slope ± t(.975, df)·se.
    pub ci95: (f64, f64),
}

/// The carry-over of ratings that are sorted by subject and then by presentation.
///
/// With r the ratings less the means of subject and of realization, a subject
/// contributes D = Σ rₜrₜ₋₁ − E. E is the mean of the sum over all orders within blocks:
/// (T² − Σr²)/n for the neighbors within a block of n trials with the sum T, and the
/// product of the means for the neighbors of two blocks. The slope is ΣD/ΣQ, with Q what
/// a slope of 1 adds to D at first order: of the mean square of a block, (n − 1)(1 − 2/n)
/// within it and 1 − 1/nn′ at its border with a block of n′, since neighbors are also
/// among the pairs that E averages. t is that of the mean of D, which is 0 without
/// carry-over.
///
/// `None` for fewer than two subjects, or if the residuals or the standard error are 0, or
/// all blocks have one trial.
pub fn carry_over(ratings: &[OrderedRating]) -> Option<CarryOver> {
    let residuals = residuals(ratings);
    let (mut products, mut units) = (Vec::new(), Vec::new());
    let mut from = 0;
    for own in ratings.chunk_by(|a, b| a.subject == b.subject) {
        let r = &residuals[from..from + own.len()];
        from += own.len();
        let (expected, unit) = over_orders(own, r);
        products.push(r.windows(2).map(|w| w[0] * w[1]).sum::<f64>() - expected);
        units.push(unit);
    }
    let test = one_sample(&products)?;
    let size = mean(&units)?;
    let (slope, df) = (finite(test.mean / size)?, test.n as f64 - 1.0);
    let se = finite(test.sd / (test.n as f64).sqrt() / size).filter(|se| *se > 1e-12)?;
    let t = slope / se;
    let half = t_quantile(0.975, df)? * se;
    Some(CarryOver {
        slope,
        se,
        t,
        df,
        p: t_two_sided(t, df)?,
        ci95: (slope - half, slope + half),
    })
}

/// The ratings less the mean of their subject and of what that leaves for their
/// realization.
fn residuals(ratings: &[OrderedRating]) -> Vec<f64> {
    let mut residuals = Vec::with_capacity(ratings.len());
    for own in ratings.chunk_by(|a, b| a.subject == b.subject) {
        let mean = own.iter().map(|r| r.rating).sum::<f64>() / own.len() as f64;
        residuals.extend(own.iter().map(|r| r.rating - mean));
    }
    let levels = ratings.iter().map(|r| r.realization as usize + 1).max();
    let mut means = vec![(0.0, 0.0); levels.unwrap_or(0)];
    for (r, residual) in ratings.iter().zip(&residuals) {
        let (sum, n) = &mut means[r.realization as usize];
        *sum += residual;
        *n += 1.0;
    }
    for (r, residual) in ratings.iter().zip(&mut residuals) {
        let (sum, n) = means[r.realization as usize];
        *residual -= sum / n;
    }
    residuals
}

/// E and Q of one subject.
fn over_orders(own: &[OrderedRating], r: &[f64]) -> (f64, f64) {
    let (mut expected, mut unit, mut from) = (0.0, 0.0, 0);
    let mut before: Option<(f64, f64, f64)> = None;
    for block in own.chunk_by(|a, b| a.block == b.block) {
        let r = &r[from..from + block.len()];
        from += block.len();
        let n = r.len() as f64;
        let total: f64 = r.iter().sum();
        let squares: f64 = r.iter().map(|r| r * r).sum();
        expected += (total * total - squares) / n;
        unit += squares / n * (n - 1.0) * (1.0 - 2.0 / n);
        if let Some((mean, square, size)) = before {
            expected += mean * total / n;
            unit += square * (1.0 - 1.0 / (n * size));
        }
        before = Some((total / n, squares / n, n));
    }
    (expected, unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{RandomSource, SplitMix64};

    /// Calls `visit` with every order of the values from `from` on.
    fn orders(x: &mut [f64], from: usize, visit: &mut impl FnMut(&[f64])) {
        if from == x.len() {
            return visit(x);
        }
        for i in from..x.len() {
            x.swap(from, i);
            orders(x, from + 1, visit);
            x.swap(from, i);
        }
    }

    #[test]
    fn the_expectation_is_the_mean_over_all_orders() {
        let mut first = [1.0, -2.0, 4.0];
        let mut second = [0.5, 3.0, -1.0, 2.0];
        let own: Vec<OrderedRating> = [0, 0, 0, 1, 1, 1, 1]
            .map(|block| OrderedRating {
                subject: 0,
                realization: 0,
                block,
                rating: 0.0,
            })
            .to_vec();
        let all: Vec<f64> = first.iter().chain(&second).copied().collect();
        let (mut sum, mut n) = (0.0, 0.0);
        orders(&mut first, 0, &mut |a| {
            orders(&mut second, 0, &mut |b| {
                let r: Vec<f64> = a.iter().chain(b).copied().collect();
                sum += r.windows(2).map(|w| w[0] * w[1]).sum::<f64>();
                n += 1.0;
            });
        });
        assert!((over_orders(&own, &all).0 - sum / n).abs() < 1e-12);
    }

    /// Subjects × three repetitions of five realizations in random order. Subjects have
    /// preferences, for which the regression on the previous rating rejects in 19 % of
    /// studies without carry-over.
    fn study(seed: u64, carried: f64) -> Vec<OrderedRating> {
        let mut noise = SplitMix64::new(seed);
        let mut ratings = Vec::new();
        for subject in 0..12 {
            let taste: Vec<f64> = (0..5).map(|_| 0.5 * noise.normal()).collect();
            let mut before = 0.0;
            for block in 0..3 {
                let mut order: Vec<(f64, u32)> = (0..5).map(|m| (noise.normal(), m)).collect();
                order.sort_by(|a, b| a.0.total_cmp(&b.0));
                for (_, realization) in order {
                    let own = taste[realization as usize] + 0.8 * noise.normal();
                    before = own + carried * before;
                    ratings.push(OrderedRating {
                        subject,
                        realization,
                        block,
                        rating: before,
                    });
                }
            }
        }
        ratings
    }

    #[test]
    fn the_slope_is_unbiased_and_its_p_calibrated() {
        for (carried, bias) in [(0.0, 0.01), (0.3, 0.05)] {
            let studies = 2000;
            let found: Vec<CarryOver> = (0..studies)
                .map(|i| carry_over(&study(i, carried)).unwrap())
                .collect();
            let mean = found.iter().map(|f| f.slope).sum::<f64>() / studies as f64;
            assert!((mean - carried).abs() < bias, "{carried}: {mean}");
            let without_0 = |f: &CarryOver| f.ci95.0 * f.ci95.1 > 0.0;
            assert!(found.iter().all(|f| without_0(f) == (f.p <= 0.05)));
            let rejected = found.iter().filter(|f| f.p <= 0.05).count() as f64 / studies as f64;
            if carried > 0.0 {
                assert!(rejected > 0.5, "{rejected}");
            } else {
                // Three binomial standard deviations.
                assert!((rejected - 0.05).abs() < 0.015, "{rejected}");
            }
        }
    }

    #[test]
    fn constant_ratings_and_single_subjects_have_no_slope() {
        let equal = study(1, 0.0)
            .iter()
            .map(|r| OrderedRating { rating: 4.0, ..*r })
            .collect::<Vec<_>>();
        assert_eq!(carry_over(&equal), None);
        assert_eq!(carry_over(&study(1, 0.0)[..15]), None);
        assert_eq!(carry_over(&[]), None);
    }
}
