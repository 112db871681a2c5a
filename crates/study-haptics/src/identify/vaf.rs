//! How much of a recording's force a realization predicts.
//!
//! VAF = 1 − var(F − F̂) / var(F). It does not see a constant error, so the bias,
//! mean(F̂ − F), stands beside it, and so does the residual as a force, the
//! standard deviation of F − F̂. The prediction is that of [`study_wire::predict`]:
//! a sample with v = 0 takes the direction of the sample before it (the first:
//! +), and outside the nodes the edge parameters apply to the actual x.

use crate::model::Realization;
use crate::recording::Recording;
use study_wire::predict::{DirectionState, Motion, force_n};

/// What came of a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Variance accounted for, at most 1; below 0 the mean would be better.
    pub vaf: f64,
    /// mean(F̂ − F), N: positive where the realization is too strong.
    pub bias_n: f64,
    /// Standard deviation of F − F̂, N.
    pub residual_n: f64,
}

/// Predicted force of each sample, N.
pub fn predict<'r>(
    realization: &'r Realization,
    recording: &'r Recording,
) -> impl Iterator<Item = f64> + 'r {
    let table = realization.table();
    let rule = realization.direction;
    let mut state = DirectionState::default();
    (0..recording.len()).map(move |i| {
        let motion = Motion {
            x_mm: recording.x_mm[i],
            v_mm_s: recording.v_mm_s[i],
            a_m_s2: recording.a_m_s2[i],
        };
        force_n(&table, state.step(rule, motion), motion)
    })
}

/// Compares the prediction with what was measured.
pub fn score(realization: &Realization, recording: &Recording) -> Score {
    let errors: Vec<f64> = predict(realization, recording)
        .zip(&recording.f_n)
        .map(|(predicted, measured)| predicted - measured)
        .collect();
    let (bias_n, error_variance) = mean_and_variance(&errors);
    let (_, variance) = mean_and_variance(&recording.f_n);
    Score {
        vaf: 1.0 - error_variance / variance,
        bias_n,
        residual_n: error_variance.sqrt(),
    }
}

/// Variance (÷ n).
pub(super) fn variance(values: &[f64]) -> f64 {
    mean_and_variance(values).1
}

/// Mean and variance (÷ n) in two passes: a large mean costs no digits.
pub(super) fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, squares / n)
}
