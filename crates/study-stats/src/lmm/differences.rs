//! Derivatives by central differences of fourth order.

use crate::matrix::Matrix;

/// The step for coordinates up to 1; for larger ones it is relative.
const STEP: f64 = 0.01;

pub(super) fn step(at: f64) -> f64 {
    STEP * at.abs().max(1.0)
}

/// ∂f/∂xᵢ of a vector-valued f: (8(f₁ − f₋₁) − (f₂ − f₋₂))/12h.
pub(super) fn first(
    f: &dyn Fn(&[f64]) -> Option<Vec<f64>>,
    at: &[f64],
    i: usize,
) -> Option<Vec<f64>> {
    let h = step(at[i]);
    let moved = |k: f64| {
        let mut x = at.to_vec();
        x[i] += k * h;
        f(&x)
    };
    let (near, far) = ([moved(1.0)?, moved(-1.0)?], [moved(2.0)?, moved(-2.0)?]);
    let difference = |k: usize| 8.0 * (near[0][k] - near[1][k]) - (far[0][k] - far[1][k]);
    let elements = 0..near[0].len();
    Some(elements.map(|k| difference(k) / (12.0 * h)).collect())
}

/// Gradient over some coordinates.
pub(super) fn gradient(
    f: &dyn Fn(&[f64]) -> Option<f64>,
    at: &[f64],
    over: &[usize],
) -> Option<Vec<f64>> {
    let f = |x: &[f64]| Some(vec![f(x)?]);
    over.iter().map(|&i| Some(first(&f, at, i)?[0])).collect()
}

/// Gradient and Hessian over some coordinates.
pub(super) fn second(
    f: &dyn Fn(&[f64]) -> Option<f64>,
    at: &[f64],
    over: &[usize],
) -> Option<(Vec<f64>, Matrix)> {
    let d = over.len();
    let (mut gradient, mut hessian) = (vec![0.0; d], Matrix::zeros(d, d));
    let middle = f(at)?;
    let moved = |moves: &[(usize, f64)]| {
        let mut x = at.to_vec();
        for &(i, k) in moves {
            x[i] += k * step(at[i]);
        }
        f(&x)
    };
    for (a, &i) in over.iter().enumerate() {
        let h = step(at[i]);
        let (f1, b1) = (moved(&[(i, 1.0)])?, moved(&[(i, -1.0)])?);
        let (f2, b2) = (moved(&[(i, 2.0)])?, moved(&[(i, -2.0)])?);
        gradient[a] = (8.0 * (f1 - b1) - (f2 - b2)) / (12.0 * h);
        hessian[(a, a)] =
            (16.0 * (f1 + b1 - 2.0 * middle) - (f2 + b2 - 2.0 * middle)) / (12.0 * h * h);
        for (b, &j) in over[..a].iter().enumerate() {
            let cross = |k: f64| -> Option<f64> {
                let corners = moved(&[(i, k), (j, k)])?
                    - moved(&[(i, k), (j, -k)])?
                    - moved(&[(i, -k), (j, k)])?
                    + moved(&[(i, -k), (j, -k)])?;
                Some(corners / (4.0 * k * k * h * step(at[j])))
            };
            // Richardson extrapolation of the four corners.
            let mixed = (4.0 * cross(1.0)? - cross(2.0)?) / 3.0;
            hessian[(a, b)] = mixed;
            hessian[(b, a)] = mixed;
        }
    }
    Some((gradient, hessian))
}
