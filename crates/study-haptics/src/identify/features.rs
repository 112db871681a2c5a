//! Features of the force that are narrower than the nodes of a realization follow.
//!
//! The error of a realization at one place is averaged in the first half of every recording and in the
//! second. What both halves have in common repeats and is no noise: their product is an unbiased
//! estimate of its square. Of it counts what changes within four distances of the nodes, which no
//! table with these nodes can have.

use super::problem::Warning;
use super::vaf;
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance, range};

/// Bins per distance of the nodes.
const BINS: f64 = 4.0;
/// Distances of the nodes over which the error is smoothed; what remains is narrow.
const SMOOTHED: f64 = 4.0;
/// Least share of the force's variance that is worth a warning.
const LEAST: f64 = 0.02;
/// Most bins.
const MOST_BINS: f64 = 1e5;

/// A warning if the force has repeatable features that are narrower than two distances of the nodes.
pub(super) fn narrower(recordings: &[&Recording], realization: &Realization) -> Option<Warning> {
    let dx_mm = realization.provenance.dx_mm?;
    let width_mm = dx_mm / BINS;
    let ranges = recordings.iter().map(|r| range(&r.x_mm));
    let [low, high] = ranges.fold([f64::INFINITY, f64::NEG_INFINITY], |all, one| {
        [all[0].min(one[0]), all[1].max(one[1])]
    });
    let bins = ((high - low) / width_mm).ceil();
    if !(1.0..MOST_BINS).contains(&bins) {
        return None;
    }
    // Σ error and number, by direction, half and bin
    let mut sums = vec![[[(0.0, 0.0); 2]; 2]; bins as usize];
    let mut forces = Vec::new();
    for recording in recordings {
        let errors = vaf::errors(realization, recording);
        for (i, error) in errors.iter().enumerate() {
            let v = recording.v_mm_s[i];
            let bin = ((recording.x_mm[i] - low) / width_mm) as usize;
            if v == 0.0 || bin >= sums.len() {
                continue;
            }
            let half = usize::from(2 * i >= recording.len());
            let of = &mut sums[bin][usize::from(v < 0.0)][half];
            *of = (of.0 + error, of.1 + 1.0);
        }
        forces.extend_from_slice(&recording.f_n);
    }
    let (_, variance) = mean_and_variance(&forces);
    let reach = (0.5 * SMOOTHED * BINS) as usize;
    let (mut product, mut weight) = (0.0, 0.0);
    for side in 0..2 {
        let mean = |bin: usize, half: usize| {
            let (sum, n) = sums[bin][side][half];
            (n > 0.0).then(|| sum / n)
        };
        for bin in 0..sums.len() {
            let narrow = |half: usize| -> Option<f64> {
                let around = bin.saturating_sub(reach)..(bin + reach + 1).min(sums.len());
                let near: Vec<f64> = around.filter_map(|b| mean(b, half)).collect();
                Some(mean(bin, half)? - near.iter().sum::<f64>() / near.len() as f64)
            };
            if let Some((first, second)) = narrow(0).zip(narrow(1)) {
                product += first * second;
                weight += 1.0;
            }
        }
    }
    let repeatable = product / weight;
    (repeatable > LEAST * variance).then(|| Warning::Narrow {
        rms_n: repeatable.sqrt(),
        dx_mm,
    })
}
