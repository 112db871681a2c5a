//! Variance accounted for (VAF): how well a realization predicts a recording's force.
//!
//! VAF = 1 − var(F − F̂) / var(F). It is insensitive to a constant error, so it comes
//! with the bias, mean(F̂ − F), and the residual, the standard deviation of F − F̂. The
//! prediction is that of [`study_wire::predict`]: a sample with v = 0 has the direction
//! of the previous sample (+ for the first), and outside the nodes the parameters of
//! the nearest node apply to the actual x.

use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance};
use study_wire::predict::{DirectionState, Motion, force_n};

/// The accuracy of a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Variance accounted for, at most 1; below 0 the mean force predicts better.
    pub vaf: f64,
    /// mean(F̂ − F), N; positive where the predicted force is too large.
    pub bias_n: f64,
    /// Standard deviation of F − F̂, N.
    pub residual_n: f64,
}

/// The motion of a sample.
pub(super) fn motion(recording: &Recording, i: usize) -> Motion {
    Motion {
        x_mm: recording.x_mm[i],
        v_mm_s: recording.v_mm_s[i],
        a_m_s2: recording.a_m_s2[i],
    }
}

/// The predicted force of each sample, N. That of a mechanism passes the low-pass that the
/// recorded force had passed when it was identified. In which state springs that relax enter
/// the recording, its force tells.
pub fn predict<'r>(
    realization: &'r Realization,
    recording: &'r Recording,
) -> Box<dyn Iterator<Item = f64> + 'r> {
    predict_told(realization, recording, |_| true)
}

/// The same, where only the force of some samples tells in which state springs that relax enter
/// the recording; without any they enter without force.
pub(super) fn predict_told<'r>(
    realization: &'r Realization,
    recording: &'r Recording,
    tells: impl Fn(usize) -> bool,
) -> Box<dyn Iterator<Item = f64> + 'r> {
    if let Some(mechanism) = &realization.mechanism {
        return Box::new(super::mechanism::low_passed(mechanism, recording).into_iter());
    }
    if let Some(elements) = &realization.elements {
        return Box::new(
            super::mechanism::predict_elements(elements, recording, tells).into_iter(),
        );
    }
    let table = realization.table();
    let rule = realization.direction;
    let mut state = DirectionState::default();
    Box::new((0..recording.len()).map(move |i| {
        let motion = motion(recording, i);
        force_n(&table, state.step(rule, motion), motion)
    }))
}

/// The prediction error F̂ − F of each sample, N.
pub fn errors(realization: &Realization, recording: &Recording) -> Vec<f64> {
    predict(realization, recording)
        .zip(&recording.f_n)
        .map(|(predicted, measured)| predicted - measured)
        .collect()
}

/// Compares the prediction with the measured force.
pub fn score(realization: &Realization, recording: &Recording) -> Score {
    let (bias_n, error_variance) = mean_and_variance(&errors(realization, recording));
    let (_, variance) = mean_and_variance(&recording.f_n);
    Score {
        vaf: 1.0 - error_variance / variance,
        bias_n,
        residual_n: error_variance.sqrt(),
    }
}
