//! Thresholds of several participants.

use crate::describe;
use crate::distribution::t_quantile;

/// Positive thresholds, summed up on their natural logarithms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Group {
    /// Number of thresholds.
    pub n: usize,
    /// exp of the mean logarithm.
    pub geometric_mean: f64,
    /// exp of its t interval; `None` for one threshold.
    pub ci95: Option<(f64, f64)>,
    /// exp of the standard deviation of the logarithms.
    pub geometric_sd: Option<f64>,
    /// Mean of the thresholds.
    pub arithmetic_mean: f64,
}

/// `None` without thresholds, or if one is not above 0.
pub fn group(thresholds: &[f64]) -> Option<Group> {
    if !thresholds.iter().all(|t| *t > 0.0) {
        return None;
    }
    let logs: Vec<f64> = thresholds.iter().map(|t| t.ln()).collect();
    let mean = describe::mean(&logs)?;
    let sd = describe::sd(&logs);
    let n = logs.len();
    let half =
        (sd.zip(t_quantile(0.975, n as f64 - 1.0))).map(|(sd, t)| t * sd / (n as f64).sqrt());
    Some(Group {
        n,
        geometric_mean: mean.exp(),
        ci95: half.map(|h| ((mean - h).exp(), (mean + h).exp())),
        geometric_sd: sd.map(f64::exp),
        arithmetic_mean: describe::mean(thresholds)?,
    })
}
