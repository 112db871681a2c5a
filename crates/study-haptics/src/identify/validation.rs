//! What a VAF is worth: the residual as a force, by direction and by detent, and
//! the most that any model could reach.
//!
//! VAF is of the spread only. Beside it: the error with its mean, as a share of the
//! force's spread (NRMSE = rms(F̂ − F) / σ_F), and the residual as a force,
//! σ_F √(1 − VAF), which a hand compares with the least force difference that it
//! notices, about 0.1 N (Doerrer & Werthschützky 2002).
//!
//! No model explains what does not come back: where the same trajectory was recorded
//! twice, F₁ and F₂ differ by two lots of noise, so the ceiling is
//! 1 − ½ var(F₁ − F₂) / var(F₁).
//!
//! A detent is a place that holds the handle: between two crests, where the force
//! needed at rest falls through zero. Crests are looked for in the mean of the two
//! directions' static profiles, so a recording of one direction has none.

use super::vaf::{self, Score};
use crate::model::Realization;
use crate::recording::Recording;

/// The least difference in force that a hand notices, N.
pub const JUST_NOTICEABLE_N: f64 = 0.1;

/// How wide the bins of the profile are in which crests are looked for, mm.
const PROFILE_MM: f64 = 1.0;

/// How far the force has to go past zero for a crest or valley to count, N: above
/// friction's noise, far below a detent.
const CROSSING_N: f64 = 0.3;

/// Two recordings whose positions differ by more than this on average are not of one
/// trajectory, mm rms.
const SAME_TRAJECTORY_MM: f64 = 0.5;

/// A comparison of some samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// How many.
    pub samples: usize,
    /// Variance accounted for within them.
    pub vaf: f64,
    /// mean(F̂ − F), N.
    pub bias_n: f64,
    /// Standard deviation of F̂ − F, N.
    pub residual_n: f64,
    /// rms(F̂ − F) / σ_F.
    pub nrmse: f64,
}

/// A realization against a recording, whole and in parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// All samples.
    pub whole: Part,
    /// Samples with v > 0, if any.
    pub positive: Option<Part>,
    /// Samples with v < 0, if any.
    pub negative: Option<Part>,
    /// Range of each detent, mm, and the samples in it, if any.
    pub detents: Vec<([f64; 2], Option<Part>)>,
}

impl Part {
    /// How many times what a hand notices the residual is.
    pub fn noticeable(&self) -> f64 {
        self.residual_n / JUST_NOTICEABLE_N
    }

    /// `None` without samples or where the force does not vary.
    fn new(errors: &[f64], forces: &[f64]) -> Option<Self> {
        let variance = vaf::variance(forces);
        if forces.is_empty() || variance == 0.0 {
            return None;
        }
        let (bias_n, spread) = vaf::mean_and_variance(errors);
        Some(Self {
            samples: errors.len(),
            vaf: 1.0 - spread / variance,
            bias_n,
            residual_n: spread.sqrt(),
            nrmse: ((spread + bias_n * bias_n) / variance).sqrt(),
        })
    }
}

impl From<Part> for Score {
    fn from(part: Part) -> Self {
        Self {
            vaf: part.vaf,
            bias_n: part.bias_n,
            residual_n: part.residual_n,
        }
    }
}

/// Compares a realization with a recording; `detents` as [`detents`] finds them.
/// `None` never happens for a recording as [`crate::recording::read`] gives it.
pub fn validate(
    realization: &Realization,
    recording: &Recording,
    detents: &[[f64; 2]],
) -> Option<Validation> {
    let errors: Vec<f64> = vaf::predict(realization, recording)
        .zip(&recording.f_n)
        .map(|(predicted, measured)| predicted - measured)
        .collect();
    let part = |belongs: &dyn Fn(usize) -> bool| {
        let (mut e, mut f) = (Vec::new(), Vec::new());
        for i in (0..recording.len()).filter(|i| belongs(*i)) {
            e.push(errors[i]);
            f.push(recording.f_n[i]);
        }
        Part::new(&e, &f)
    };
    let (x, v) = (&recording.x_mm, &recording.v_mm_s);
    let inside = |[low, high]: [f64; 2]| part(&move |i| x[i] >= low && x[i] < high);
    Some(Validation {
        whole: Part::new(&errors, &recording.f_n)?,
        positive: part(&|i| v[i] > 0.0),
        negative: part(&|i| v[i] < 0.0),
        detents: detents.iter().map(|d| (*d, inside(*d))).collect(),
    })
}

/// The ranges between crests, mm, ascending: the whole range cut at every crest.
/// Empty where there is no crest.
pub fn detents(recording: &Recording) -> Vec<[f64; 2]> {
    let [low, high] = recording.range_mm();
    let bins = ((high - low) / PROFILE_MM).ceil().min(1e6) as usize;
    // Σ F and samples of each direction
    let mut sums = vec![[(0.0, 0.0); 2]; bins.max(1)];
    for i in 0..recording.len() {
        let v = recording.v_mm_s[i];
        if v != 0.0 {
            // inside by construction; the highest x belongs to the last bin
            let bin = (((recording.x_mm[i] - low) / PROFILE_MM) as usize).min(sums.len() - 1);
            let of = &mut sums[bin][usize::from(v < 0.0)];
            *of = (of.0 + recording.f_n[i], of.1 + 1.0);
        }
    }
    let mut crests = Vec::new();
    // whether the force was last clearly positive, and where it was last so
    let mut holding: Option<(bool, f64)> = None;
    for (bin, [plus, minus]) in sums.iter().enumerate() {
        if plus.1 == 0.0 || minus.1 == 0.0 {
            continue;
        }
        let at = low + (bin as f64 + 0.5) * PROFILE_MM;
        let force = 0.5 * (plus.0 / plus.1 + minus.0 / minus.1);
        if force.abs() < CROSSING_N {
            continue;
        }
        if let Some((true, before)) = holding
            && force < 0.0
        {
            crests.push(0.5 * (before + at));
        }
        holding = Some((force > 0.0, at));
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

/// What a repeated recording says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ceiling {
    /// The highest VAF that a model can be expected to reach.
    pub vaf: f64,
    /// Standard deviation of what does not come back, N.
    pub noise_n: f64,
    /// How far apart the two trajectories are, mm rms.
    pub apart_mm: f64,
}

/// The ceiling of `recording` by a repetition of its trajectory; `None` if the two
/// are not of one trajectory or do not overlap in time.
///
/// The repetition is read at the recording's times, from the start of each, by
/// straight lines.
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
    let noise = 0.5 * vaf::variance(&differences);
    let variance = vaf::variance(&forces);
    (apart_mm <= SAME_TRAJECTORY_MM && variance > 0.0).then(|| Ceiling {
        vaf: 1.0 - noise / variance,
        noise_n: noise.sqrt(),
        apart_mm,
    })
}

#[cfg(test)]
mod tests;
