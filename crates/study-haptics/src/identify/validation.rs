//! Validation in detail: accuracy by direction and detent, and the highest VAF that a
//! model can reach.
//!
//! VAF ignores a constant error. NRMSE = rms(F̂ − F) / σ_F includes it, and the residual
//! force σ_F √(1 − VAF) can be compared with the just noticeable difference in force
//! ([`force_jnd_n`]).
//!
//! No model explains what is not repeatable: if the same trajectory was recorded twice,
//! F₁ − F₂ contains the noise of both, so the ceiling of VAF is
//! 1 − ½ var(F₁ − F₂) / var(F₁).
//!
//! A detent is the range between two crests, where the static force falls through
//! zero. Crests are found in the mean of the static profiles of both directions, in bins of
//! [`Recording::scale_mm`], so a
//! recording of one direction has none.

use super::vaf;
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance, range};
use study_base::perception::force_jnd_n;

/// The force of a crest or valley has to exceed this share of the range of force: above the
/// noise of friction, far below a detent.
const CROSSING: f64 = 0.015;

/// Recordings whose positions differ by more than this rms, in units of
/// [`Recording::scale_mm`], are not of the same trajectory.
const SAME_TRAJECTORY: f64 = 0.5;

/// The accuracy of a prediction over some samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Number of samples.
    pub samples: usize,
    /// Variance accounted for, within these samples.
    pub vaf: f64,
    /// mean(F̂ − F), N.
    pub bias_n: f64,
    /// Standard deviation of F̂ − F, N.
    pub residual_n: f64,
    /// rms(F̂ − F) / σ_F.
    pub nrmse: f64,
}

/// The accuracy of a realization on a recording, overall and in parts. A part without
/// samples, or in which the force does not vary, is `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// The just noticeable difference in force at the forces of the recording, N.
    pub noticeable_n: f64,
    /// All samples.
    pub whole: Accuracy,
    /// Samples with v > 0.
    pub positive: Option<Accuracy>,
    /// Samples with v < 0.
    pub negative: Option<Accuracy>,
    /// The range of each detent, mm, and the samples in it.
    pub detents: Vec<([f64; 2], Option<Accuracy>)>,
}

impl Accuracy {
    /// `None` without samples or if the force does not vary.
    fn new(errors: &[f64], forces: &[f64]) -> Option<Self> {
        let (_, variance) = mean_and_variance(forces);
        if forces.is_empty() || variance == 0.0 {
            return None;
        }
        let (bias_n, spread) = mean_and_variance(errors);
        Some(Self {
            samples: errors.len(),
            vaf: 1.0 - spread / variance,
            bias_n,
            residual_n: spread.sqrt(),
            nrmse: ((spread + bias_n * bias_n) / variance).sqrt(),
        })
    }
}

/// Compares a realization with a recording; `detents` as found by [`detents`]. `None`
/// if the force of the recording does not vary; [`crate::recording::read`] rejects
/// such recordings.
pub fn validate(
    realization: &Realization,
    recording: &Recording,
    detents: &[[f64; 2]],
) -> Option<Validation> {
    let errors = vaf::errors(realization, recording);
    let part = |belongs: &dyn Fn(usize) -> bool| {
        let (mut e, mut f) = (Vec::new(), Vec::new());
        for i in (0..recording.len()).filter(|i| belongs(*i)) {
            e.push(errors[i]);
            f.push(recording.f_n[i]);
        }
        Accuracy::new(&e, &f)
    };
    let (x, v) = (&recording.x_mm, &recording.v_mm_s);
    let inside = |[low, high]: [f64; 2]| part(&move |i| x[i] >= low && x[i] < high);
    let [least_n, most_n] = range(&recording.f_n);
    Some(Validation {
        noticeable_n: force_jnd_n(least_n.abs().max(most_n.abs())),
        whole: Accuracy::new(&errors, &recording.f_n)?,
        positive: part(&|i| v[i] > 0.0),
        negative: part(&|i| v[i] < 0.0),
        detents: detents.iter().map(|d| (*d, inside(*d))).collect(),
    })
}

/// The ranges between crests, mm, ascending: the whole range divided at every crest.
/// Empty if there is no crest.
pub fn detents(recording: &Recording) -> Vec<[f64; 2]> {
    let [low, high] = recording.range_mm();
    let profile_mm = recording.scale_mm();
    let [least_n, most_n] = range(&recording.f_n);
    let crossing_n = CROSSING * (most_n - least_n);
    let bins = ((high - low) / profile_mm).ceil().min(1e6) as usize;
    // Σ F and number of samples, for each direction
    let mut sums = vec![[(0.0, 0.0); 2]; bins.max(1)];
    for i in 0..recording.len() {
        let v = recording.v_mm_s[i];
        if v != 0.0 {
            // the highest x belongs to the last bin
            let bin = (((recording.x_mm[i] - low) / profile_mm) as usize).min(sums.len() - 1);
            let of = &mut sums[bin][usize::from(v < 0.0)];
            *of = (of.0 + recording.f_n[i], of.1 + 1.0);
        }
    }
    let mut crests = Vec::new();
    // whether the force of the last bin above crossing_n was positive, and its position
    let mut last: Option<(bool, f64)> = None;
    for (bin, [plus, minus]) in sums.iter().enumerate() {
        if plus.1 == 0.0 || minus.1 == 0.0 {
            continue;
        }
        let at = low + (bin as f64 + 0.5) * profile_mm;
        let force = 0.5 * (plus.0 / plus.1 + minus.0 / minus.1);
        if force.abs() < crossing_n {
            continue;
        }
        if let Some((true, before)) = last
            && force < 0.0
        {
            crests.push(0.5 * (before + at));
        }
        last = Some((force > 0.0, at));
    }
    if crests.is_empty() {
        return Vec::new();
    }
    let mut edges = vec![f64::NEG_INFINITY];
    edges.extend(crests);
    edges.push(f64::INFINITY);
    edges
        .windows(2)
        .map(|pair| {
            [
                pair[0].max(low),
                pair[1].min(high + f64::EPSILON * high.abs()),
            ]
        })
        .collect()
}

/// The repeatability of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ceiling {
    /// The highest VAF that a model can be expected to reach.
    pub vaf: f64,
    /// Standard deviation of the part of the force that is not repeatable, N.
    pub noise_n: f64,
    /// Difference of the positions in the two recordings, mm rms.
    pub apart_mm: f64,
}

impl Ceiling {
    /// The variance that a model with this VAF does not explain, in multiples of the one that
    /// no model can explain: (1 − VAF)/(1 − ceiling).
    pub fn residual(&self, vaf: f64) -> f64 {
        (1.0 - vaf) / (1.0 - self.vaf)
    }
}

/// The ceiling of VAF on `recording` from a second recording of its trajectory; `None`
/// if the trajectories differ or overlap by less than half in time.
///
/// The repetition is interpolated linearly at the times of the recording, both counted
/// from their first sample.
pub fn ceiling(recording: &Recording, repeat: &Recording) -> Option<Ceiling> {
    let (start, other) = (recording.t_s[0], repeat.t_s[0]);
    let mut right = 1;
    let (mut differences, mut forces) = (Vec::new(), Vec::new());
    let mut apart = 0.0;
    for i in 0..recording.len() {
        let t = recording.t_s[i] - start + other;
        while right < repeat.len() && repeat.t_s[right] < t {
            right += 1;
        }
        if right == repeat.len() {
            break;
        }
        let span = repeat.t_s[right] - repeat.t_s[right - 1];
        let weight = (t - repeat.t_s[right - 1]) / span;
        let at = |column: &[f64]| column[right - 1] + weight * (column[right] - column[right - 1]);
        let dx = recording.x_mm[i] - at(&repeat.x_mm);
        apart += dx * dx;
        differences.push(recording.f_n[i] - at(&repeat.f_n));
        forces.push(recording.f_n[i]);
    }
    let overlap = differences.len() as f64;
    if overlap < 0.5 * recording.len() as f64 {
        return None;
    }
    let apart_mm = (apart / overlap).sqrt();
    let noise = 0.5 * mean_and_variance(&differences).1;
    let (_, variance) = mean_and_variance(&forces);
    let most_mm = SAME_TRAJECTORY * recording.scale_mm();
    (apart_mm <= most_mm && variance > 0.0).then(|| Ceiling {
        vaf: 1.0 - noise / variance,
        noise_n: noise.sqrt(),
        apart_mm,
    })
}

#[cfg(test)]
mod tests;
