//! In which state springs enter a recording.
//!
//! What a Maxwell branch holds at the first sample comes from the motion before it, which is not
//! recorded. It fades within a few relaxation times, but as long as it lasts it is of the order of
//! the whole force. So it is no part of the model but one unknown number for each branch and
//! recording, which the recorded force tells: by least squares over all samples, or those that were
//! not left out, with a constant error beside it so that another zero of the sensor is not taken for
//! it. Initial states are treated so in system identification (Ljung 1999).

use super::{between, force_n};
use crate::identify::Training;
use crate::identify::samples::weight_of;
use crate::model::Elements;
use crate::recording::Recording;
use study_wire::elements::{MAX_SPRINGS, Spring, SpringState};
use study_wire::predict::{Lookup, locate};

/// z of all springs at the first sample of each recording.
pub(super) type Starts = Vec<Vec<f64>>;

/// Share of a column's mean square over all samples that keeps at 0 what fades at once, or before the
/// first sample that tells.
const RIDGE: f64 = 1e-3;
/// Rounds of the coordinate descent, which are enough for five unknowns.
const ROUNDS: usize = 200;

/// z of springs at the first sample: as after a long motion at its speed, without force where
/// they relax.
pub(super) fn entering(springs: &[Spring], recording: &Recording) -> Vec<f64> {
    let (x, v) = (recording.x_mm[0], recording.v_mm_s[0]);
    (springs.iter())
        .map(|spring| match spring {
            Spring::Maxwell { .. } => 0.0,
            _ => SpringState::<f64>::settled(spring, x, v).z(),
        })
        .collect()
}

/// The same in all recordings.
pub(super) fn settled(training: &Training<'_>, springs: &[Spring]) -> Starts {
    (training.recordings.iter())
        .map(|recording| entering(springs, recording))
        .collect()
}

/// Calls `visit` with every sample and z of all springs.
pub(super) fn follow_one(
    recording: &Recording,
    springs: &[Spring],
    start: &[f64],
    mut visit: impl FnMut(usize, &[f64]),
) {
    let x = &recording.x_mm;
    let mut z = start.to_vec();
    let mut states: Vec<SpringState> = start.iter().map(|z| SpringState::deflected(*z)).collect();
    let mut tuned_s = f64::NAN;
    for i in 0..recording.len() {
        let before = i.saturating_sub(1);
        let span_s = recording.t_s[i] - recording.t_s[before];
        // time stamps that are rounded differ in their last digits
        let same = (span_s / tuned_s - 1.0).abs() < 1e-6;
        if i > 0 && !same {
            tuned_s = span_s;
            for (state, spring) in states.iter_mut().zip(springs) {
                state.tune(spring, span_s);
            }
        }
        for ((z, state), spring) in z.iter_mut().zip(&mut states).zip(springs) {
            *z = state.step(spring, x[i], x[i] - x[before]);
        }
        visit(i, &z);
    }
}

/// z of the springs of elements at the first sample of each recording.
pub(super) fn all(training: &Training<'_>, elements: &Elements) -> Starts {
    (training.recordings.iter().enumerate())
        .map(|(r, recording)| {
            let weight = |i: usize| weight_of(training.weights.as_deref(), r, i);
            weighted(elements, recording, weight)
        })
        .collect()
}

/// z of the springs of elements at the first sample of a recording, by the force of the samples
/// that `tells` names; 0 where there is no spring.
pub(in crate::identify) fn of(
    elements: &Elements,
    recording: &Recording,
    tells: impl Fn(usize) -> bool,
) -> [f64; MAX_SPRINGS] {
    let mut z = [0.0; MAX_SPRINGS];
    let found = weighted(elements, recording, |i| f64::from(u8::from(tells(i))));
    z.iter_mut().zip(&found).for_each(|(z, found)| *z = *found);
    z
}

fn weighted(elements: &Elements, recording: &Recording, weight: impl Fn(usize) -> f64) -> Vec<f64> {
    let springs = &elements.springs;
    let mut start = entering(springs, recording);
    let relaxing: Vec<(usize, f64)> = (springs.iter().enumerate())
        .filter_map(|(k, spring)| match spring {
            Spring::Maxwell { relaxation_s, .. } => Some((k, *relaxation_s)),
            _ => None,
        })
        .collect();
    if relaxing.is_empty() {
        return start;
    }
    // the constant error, then what the force gains by z = 1 of each branch at the first sample
    let q = 1 + relaxing.len();
    let (mut normal, mut right) = (vec![vec![0.0; q]; q], vec![0.0; q]);
    // of all samples, and the sum of the weights
    let (mut squares, mut weights) = (vec![0.0; q], 0.0);
    let mut left = vec![1.0; relaxing.len()];
    let mut row = vec![1.0; q];
    follow_one(recording, springs, &start, |i, z| {
        let span_s = recording.t_s[i] - recording.t_s[i.saturating_sub(1)];
        let (node, share) = locate(&elements.x_mm, Lookup::Linear, recording.x_mm[i]);
        for (j, (k, relaxation_s)) in relaxing.iter().enumerate() {
            // a spring that slips has forgotten it
            let kept = z[*k].abs() < 1.0;
            left[j] *= if kept {
                (-span_s / relaxation_s).exp()
            } else {
                0.0
            };
            row[1 + j] = left[j] * between(&elements.spring_n[*k], node, share);
        }
        let weight = weight(i);
        weights += weight;
        let error_n = recording.f_n[i] - force_n(elements, recording, i, z);
        for (j, one) in row.iter().enumerate() {
            squares[j] += one * one;
            right[j] += weight * one * error_n;
            for (sum, other) in normal[j].iter_mut().zip(&row) {
                *sum += weight * one * other;
            }
        }
    });
    let ridge = RIDGE * weights / recording.len() as f64;
    for (j, row) in normal.iter_mut().enumerate().skip(1) {
        row[j] += ridge * squares[j];
    }
    let found = within_one(&normal, &right);
    for ((k, _), z) in relaxing.iter().zip(&found[1..]) {
        start[*k] = *z;
    }
    start
}

/// The least-squares solution with all unknowns but the first in [−1, 1].
fn within_one(normal: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let q = right.len();
    let mut found = vec![0.0; q];
    for _ in 0..ROUNDS {
        for j in 0..q {
            let product: f64 = normal[j].iter().zip(&found).map(|(n, x)| n * x).sum();
            let moved = found[j] + (right[j] - product) / normal[j][j];
            // not finite where nothing depends on it
            if moved.is_finite() {
                let most = if j == 0 { f64::MAX } else { 1.0 };
                found[j] = moved.clamp(-most, most);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bounded_start_is_the_least_square_within_its_bounds() {
        // ½ xᵀ A x − bᵀ x with the free minimum at (0, 2, 0): held at 1, x₀ = 1/2 by hand
        let normal = vec![vec![2.0, 1.0, 0.0], vec![1.0, 2.0, 0.0], vec![0.0; 3]];
        let found = within_one(&normal, &[2.0, 4.0, 0.0]);
        assert_eq!(found, [0.5, 1.0, 0.0]);
    }
}
