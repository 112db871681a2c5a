//! Blocked cross-validation: strokes of the recordings are left out.
//!
//! Neighboring samples have nearly the same error, so a sample that is left out alone is predicted by
//! its neighbors, whatever the method. Left out are whole strokes, a fifth of them at a time, from
//! the slowest to the fastest: what predicts a kind of motion that it has not seen will predict
//! another recording. Where there are too few strokes, as in a single slow press and release, left
//! out are tenths of the travel in one direction, every fifth one at a time, between 8 and 92 % of
//! the travel.
//!
//! A prediction runs over the whole recording, because its state depends on the motion before, and
//! counts where samples were left out inside the range of the others. Their force does not tell in
//! which state springs enter the recording either.

use super::perceptual::{Reference, Weights};
use super::vaf;
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance};
use rayon::prelude::*;
use study_base::sort::SmallSort as _;

/// Folds.
pub const FOLDS: usize = 5;
/// Parts of a stroke where there are too few.
const PARTS: f64 = 10.0;
/// Nothing is left out of this share of the travel at either end, which no other part predicts.
const END: f64 = 0.08;
/// The fold of samples that are never left out.
const KEPT: usize = FOLDS;
/// A reversal is one of at least this share of the travel.
const REVERSAL: f64 = 0.05;

/// Recordings divided into folds.
#[derive(Debug)]
pub struct Folds<'r> {
    recordings: &'r [&'r Recording],
    /// The fold of each sample.
    of: Vec<Vec<usize>>,
    /// Whether whole strokes are left out, and not parts of them.
    pub whole_strokes: bool,
}

/// The accuracy on data that were left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// 1 − Σ e²/Σ (F − mean F)² over all folds: below 0 a constant predicts better.
    pub vaf: f64,
    /// rms error, N.
    pub rms_n: f64,
    /// Perceptual VAF, if there are weights and the force has anything of what is weighed. Unlike `vaf` it does not count a
    /// constant error.
    pub perceptual: Option<f64>,
}

/// Recording, sample, and its error, N.
type Error = (usize, usize, f64);

impl<'r> Folds<'r> {
    /// Divides recordings.
    pub fn new(recordings: &'r [&'r Recording]) -> Self {
        let strokes: Vec<Vec<usize>> = recordings.iter().map(|r| strokes(r)).collect();
        let count: usize = strokes
            .iter()
            .map(|of| of.last().map_or(0, |n| n + 1))
            .sum();
        let whole_strokes = count >= 2 * FOLDS;
        let kinds = kinds(recordings, &strokes);
        let mut before = 0;
        let of: Vec<Vec<usize>> = (recordings.iter().zip(&strokes))
            .map(|(recording, strokes)| {
                let fold: Vec<usize> = if whole_strokes {
                    (strokes.iter())
                        .map(|stroke| kinds[before + stroke])
                        .collect()
                } else {
                    let [low, high] = recording.range_mm();
                    let part = |(x, stroke): (&f64, &usize)| {
                        let inside = ((x - low) / (high - low) - END) / (1.0 - 2.0 * END);
                        // the same place is not left out in both directions at once
                        let fold = ((PARTS * inside) as usize + 2 * (before + stroke)) % FOLDS;
                        match (0.0..1.0).contains(&inside) {
                            true => fold,
                            false => KEPT,
                        }
                    };
                    recording.x_mm.iter().zip(strokes).map(part).collect()
                };
                before += strokes.last().map_or(0, |n| n + 1);
                fold
            })
            .collect();
        Self {
            recordings,
            of,
            whole_strokes,
        }
    }

    /// The weights of all samples without a fold: 0 or 1. Of the rest every `every`th sample is kept,
    /// which saves time where there are many.
    pub fn without(&self, fold: usize, every: usize) -> Vec<Vec<f64>> {
        let weight = |(i, of): (usize, &usize)| match *of != fold && i % every == 0 {
            true => 1.0,
            false => 0.0,
        };
        (self.of.iter())
            .map(|of| of.iter().enumerate().map(weight).collect())
            .collect()
    }

    /// The accuracy of realizations, each on the fold that it was identified without; `None` if
    /// there is none for a fold, or a force is not finite.
    pub fn left_out(
        &self,
        realization: impl Fn(usize) -> Option<Realization> + Sync,
        weights: Option<&Weights>,
    ) -> Option<LeftOut> {
        let of_fold = |fold: usize| -> Option<Vec<Error>> {
            let realization = realization(fold)?;
            let [low, high] = realization.trained.x_mm;
            let mut all = Vec::new();
            for (r, (recording, of)) in self.recordings.iter().zip(&self.of).enumerate() {
                let predicted = vaf::predict_told(&realization, recording, |i| of[i] != fold);
                for (i, predicted_n) in predicted.enumerate() {
                    if of[i] == fold && (low..=high).contains(&recording.x_mm[i]) {
                        all.push((r, i, predicted_n - recording.f_n[i]));
                    }
                }
            }
            Some(all)
        };
        let each: Vec<Vec<Error>> = (0..FOLDS)
            .into_par_iter()
            .map(of_fold)
            .collect::<Option<_>>()?;
        let errors = each.concat();
        let square = errors.iter().map(|(_, _, e)| e * e).sum::<f64>() / errors.len() as f64;
        let forces = errors.iter().map(|(r, i, _)| self.recordings[*r].f_n[*i]);
        let forces: Vec<f64> = forces.collect();
        if !square.is_finite() {
            return None;
        }
        let (_, variance) = mean_and_variance(&forces);
        (variance > 0.0).then(|| LeftOut {
            vaf: 1.0 - square / variance,
            rms_n: square.sqrt(),
            perceptual: weights.and_then(|weights| self.perceptual(errors, weights)),
        })
    }

    /// The perceptual VAF of all recordings together.
    fn perceptual(&self, mut errors: Vec<Error>, weights: &Weights) -> Option<f64> {
        errors.small_sort_by_key(|(r, i, _)| (*r, *i));
        let (mut missed, mut force) = (0.0, 0.0);
        for own in errors.chunk_by(|a, b| a.0 == b.0) {
            let samples: Vec<usize> = own.iter().map(|(_, i, _)| *i).collect();
            let recording = self.recordings[own[0].0].select(&samples);
            let of_samples: Vec<f64> = own.iter().map(|(_, _, error)| *error).collect();
            let [own_missed, own_force] =
                Reference::of(&recording)?.weighed(&of_samples, weights)?;
            missed += own_missed;
            force += own_force;
        }
        (force > 0.0).then(|| 1.0 - missed / force)
    }
}

/// The fold of each stroke of all recordings: from the slowest fifth to the fastest, by its top
/// speed.
fn kinds(recordings: &[&Recording], strokes: &[Vec<usize>]) -> Vec<usize> {
    let mut top_mm_s: Vec<f64> = Vec::new();
    for (recording, strokes) in recordings.iter().zip(strokes) {
        let before = top_mm_s.len();
        for (v, stroke) in recording.v_mm_s.iter().zip(strokes) {
            let at = before + stroke;
            top_mm_s.resize(top_mm_s.len().max(at + 1), 0.0);
            top_mm_s[at] = v.abs().max(top_mm_s[at]);
        }
    }
    let mut order: Vec<usize> = (0..top_mm_s.len()).collect();
    order.small_sort_by(|a, b| top_mm_s[*a].total_cmp(&top_mm_s[*b]));
    let mut of = vec![0; order.len()];
    for (rank, stroke) in order.iter().enumerate() {
        of[*stroke] = rank * FOLDS / order.len();
    }
    of
}

/// The stroke of each sample, from 0: a stroke ends where the target turns back by [`REVERSAL`] of
/// the travel.
pub(super) fn strokes(recording: &Recording) -> Vec<usize> {
    let [low, high] = recording.range_mm();
    let reversal_mm = REVERSAL * (high - low);
    let x = &recording.x_mm;
    let mut turns = Vec::new();
    // the direction, 0 while unknown, and the sample that went furthest
    let (mut direction, mut furthest, mut lowest) = (0.0, 0, 0);
    for i in 0..x.len() {
        if direction == 0.0 {
            furthest = if x[i] > x[furthest] { i } else { furthest };
            lowest = if x[i] < x[lowest] { i } else { lowest };
            if x[i] - x[lowest] > reversal_mm {
                (direction, furthest) = (1.0, i);
            } else if x[furthest] - x[i] > reversal_mm {
                (direction, furthest) = (-1.0, i);
            }
        } else if direction * (x[i] - x[furthest]) >= 0.0 {
            furthest = i;
        } else if direction * (x[furthest] - x[i]) > reversal_mm {
            turns.push(furthest);
            (direction, furthest) = (-direction, i);
        }
    }
    (0..x.len())
        .map(|i| turns.partition_point(|turn| *turn < i))
        .collect()
}
