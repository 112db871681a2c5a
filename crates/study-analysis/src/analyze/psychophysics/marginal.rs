//! A parameter of a psychometric function in its posterior.

use crate::analyze::record::{Interval, Stat, Why, statistics};
use study_stats::psychometric;

statistics! {
    /// A parameter in the posterior.
    pub struct Marginal {
        /// its mean
        mean: Stat,
        /// its median, the same over levels and logarithms
        median: Option<Stat>,
        /// equal-tailed
        ci95: Option<Interval>,
    }
}

impl Marginal {
    /// Only its mean; without one, `why`.
    pub(super) fn of_mean(mean: Option<f64>, why: &Why) -> Self {
        Self {
            mean: Stat::or(mean, why.clone()),
            median: None,
            ci95: None,
        }
    }

    /// With median and interval; without a posterior, `why`.
    pub(super) fn of(found: Option<psychometric::Interval>, why: &Why) -> Self {
        Self {
            median: Some(Stat::or(found.map(|i| i.median), why.clone())),
            ci95: Some(Interval::or(found.map(|i| i.ci95), why.clone())),
            ..Self::of_mean(found.map(|i| i.mean), why)
        }
    }
}
