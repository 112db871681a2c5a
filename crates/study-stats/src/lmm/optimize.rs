//! Newton's method with bounds and absolute eigenvalues.
//!
//! A step is −Σ q q'g/|λ| over the eigenpairs of the Hessian of the free coordinates: a
//! descent direction also where the criterion is not convex. It is halved until the
//! criterion decreases. A bounded coordinate that is 0 and whose gradient points outwards
//! is held at exactly 0. A direction with neither slope nor curvature is left out: if the
//! intercept has no variance, θ₂² and δ cannot be separated, and the criterion is flat
//! along their sum. The search has converged when the predicted decrease of the deviance
//! is below 10⁻⁷; three more steps refine the last digits, with the Hessian of the first
//! of them.

use super::differences::{gradient, second};
use crate::matrix::{Matrix, SymmetricEigen, dot};

/// The result of a search.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub(super) at: Vec<f64>,
    pub(super) value: f64,
    /// Coordinates off the boundary.
    pub(super) free: Vec<usize>,
}

const MAX_STEPS: usize = 80;
const MAX_HALVINGS: usize = 40;
/// Longest step in a coordinate, relative to its size or to 1.
const REACH: f64 = 3.0;
/// Predicted decrease below which the search has converged.
const SMALL: f64 = 1e-7;
/// γ = e⁴⁰: the error variance is practically 0.
const FAR: f64 = 40.0;

/// A direction is flat if its curvature is below this share of the largest one, and its
/// slope below the noise of the differences.
const FLAT: f64 = 1e-6;
const LEVEL: f64 = 1e-5;

/// Searches a local minimum from `start`; `None` if the search does not converge.
pub(super) fn minimize(
    f: &dyn Fn(&[f64]) -> Option<f64>,
    start: &[f64],
    bounded: &[bool],
) -> Option<Minimum> {
    let all: Vec<usize> = (0..start.len()).collect();
    let mut at = start.to_vec();
    let mut value = f(&at)?;
    let mut polished = 0;
    let mut kept = None;
    for _ in 0..MAX_STEPS {
        let (gradient, hessian) = match kept.take() {
            Some(hessian) => (gradient(f, &at, &all)?, hessian),
            None => second(f, &at, &all)?,
        };
        let free: Vec<usize> = all
            .iter()
            .copied()
            .filter(|&i| !(bounded[i] && at[i] <= 0.0 && gradient[i] >= 0.0))
            .collect();
        let small = free.len();
        let g: Vec<f64> = free.iter().map(|&i| gradient[i]).collect();
        let h = Matrix::from_fn(small, small, |i, j| hessian[(free[i], free[j])]);
        let Some((mut step, decrease)) = direction(&g, h) else {
            return Some(Minimum { at, value, free });
        };
        if decrease < SMALL {
            for (k, &i) in free.iter().enumerate() {
                at[i] = inside(at[i] + step[k], bounded[i]);
            }
            polished += 1;
            if polished == 3 || small == 0 {
                value = f(&at)?;
                let free = (0..at.len())
                    .filter(|&i| !(bounded[i] && at[i] <= 0.0))
                    .collect();
                let far = (0..at.len()).any(|i| bounded[i] && at[i] >= FAR);
                return (!far).then_some(Minimum { at, value, free });
            }
            kept = Some(hessian);
            continue;
        }
        polished = 0;
        let longest = free
            .iter()
            .zip(step.iter())
            .map(|(&i, s)| s.abs() / at[i].abs().max(1.0))
            .fold(0.0, f64::max);
        if longest > REACH {
            step.iter_mut().for_each(|s| *s *= REACH / longest);
        }
        let mut moved = None;
        for halving in 0..MAX_HALVINGS {
            let t = 0.5f64.powi(halving as i32);
            let mut next = at.clone();
            for (k, &i) in free.iter().enumerate() {
                next[i] = inside(at[i] + t * step[k], bounded[i]);
            }
            if let Some(v) = f(&next).filter(|v| *v < value) {
                moved = Some((next, v));
                break;
            }
        }
        (at, value) = moved?;
        if (0..at.len()).any(|i| at[i].abs() >= 1e12 || bounded[i] && at[i] >= FAR) {
            return None;
        }
    }
    None
}

/// A bounded coordinate below this is on its boundary.
const ZERO: f64 = 1e-8;

fn inside(x: f64, bounded: bool) -> f64 {
    if bounded && x < ZERO {
        0.0
    } else if bounded {
        x.min(FAR)
    } else {
        x
    }
}

/// The step and its predicted decrease; `None` without free coordinates.
fn direction(g: &[f64], h: Matrix) -> Option<(Vec<f64>, f64)> {
    if g.is_empty() {
        return None;
    }
    let eigen = SymmetricEigen::new(h);
    let largest = eigen.largest();
    let floor = (1e-9 * largest).max(1e-9);
    let mut step = vec![0.0; g.len()];
    let mut decrease = 0.0;
    for (k, value) in eigen.values.iter().enumerate() {
        let vector = eigen.vectors.row(k);
        let slope = dot(vector, g);
        if value.abs() < FLAT * largest && slope.abs() < LEVEL {
            continue;
        }
        let size = value.abs().max(floor);
        decrease += 0.5 * slope * slope / size;
        for (s, v) in step.iter_mut().zip(vector) {
            *s -= v * slope / size;
        }
    }
    Some((step, decrease))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interior_minimum_is_found_precisely() {
        let f = |x: &[f64]| Some((x[0] - 1.0).powi(2) + 10.0 * (x[1] - x[0] * x[0]).powi(2));
        let m = minimize(&f, &[3.0, 0.5], &[true, false]).unwrap();
        assert!(
            (m.at[0] - 1.0).abs() < 1e-9 && (m.at[1] - 1.0).abs() < 1e-9,
            "{:?}",
            m.at
        );
        assert_eq!(m.free, [0, 1]);
    }

    #[test]
    fn a_coordinate_on_the_boundary_is_exactly_zero() {
        let f = |x: &[f64]| Some((x[0] + 0.3).powi(2) + (x[1] - x[0] - 2.0).powi(2));
        let m = minimize(&f, &[4.0, 1.0], &[true, true]).unwrap();
        assert_eq!(m.at[0], 0.0);
        assert!((m.at[1] - 2.0).abs() < 1e-10);
        assert_eq!(m.free, [1]);
    }

    #[test]
    fn a_flat_direction_does_not_prevent_convergence() {
        // Only the sum of the squares has a minimum; the criterion has the size of a
        // deviance.
        let f = |x: &[f64]| Some(150.0 + (x[0] * x[0] + x[1] * x[1] - 2.0).powi(2));
        let m = minimize(&f, &[0.3, 1.0], &[false, false]).unwrap();
        assert!((m.value - 150.0).abs() < 1e-9, "{m:?}");
    }

    #[test]
    fn a_criterion_without_minimum_gives_none() {
        assert!(minimize(&|x| Some(-x[0]), &[1.0], &[true]).is_none());
        assert!(minimize(&|x| Some(-x[0]), &[1.0], &[false]).is_none());
    }
}
