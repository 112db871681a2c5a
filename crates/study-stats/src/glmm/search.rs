//! The maximum of a likelihood whose gradient is known, by Newton's method with differences of the
//! gradient.

use crate::clm::newton::{Evaluation, Maximum, maximize};
use crate::matrix::{Cholesky, SymmetricMatrix};

/// Within this distance in each parameter a search keeps the Hessian.
const NEAR: f64 = 0.05;

/// The step of differences.
const STEP: f64 = 1e-4;

/// A value and its gradient, if the parameters are admissible.
type Gradient<'a> = dyn FnMut(&[f64]) -> Option<(f64, Vec<f64>)> + 'a;

/// The maximum from a start, with the observed information there; `None` if there is none that the
/// search finds.
pub(super) fn maximum(
    start: Vec<f64>,
    mut gradient: impl FnMut(&[f64]) -> Option<(f64, Vec<f64>)>,
) -> Option<Maximum> {
    let mut kept: Option<(Vec<f64>, SymmetricMatrix)> = None;
    let found = maximize(start, |at| {
        let (value, slope) = gradient(at)?;
        let near = |(from, _): &&(Vec<f64>, SymmetricMatrix)| {
            let mut moves = from.iter().zip(at);
            moves.all(|(from, at)| (from - at).abs() < NEAR)
        };
        let hessian = match kept.as_ref().filter(near) {
            Some((_, hessian)) => hessian.clone(),
            None => {
                let hessian = hessian(at, &mut gradient)?;
                kept = Some((at.to_vec(), hessian.clone()));
                hessian
            }
        };
        Some(Evaluation {
            value,
            gradient: slope,
            hessian,
        })
    })?;
    // A last step, with the Hessian of the maximum.
    let information = hessian(&found.at, &mut gradient)?.negated();
    let (_, slope) = gradient(&found.at)?;
    let step = Cholesky::definite(&information)?.solve(&slope);
    let at: Vec<f64> = found.at.iter().zip(step).map(|(x, d)| x + d).collect();
    Some(Maximum {
        value: gradient(&at)?.0,
        at,
        information,
    })
}

/// The Hessian by central differences of the gradient.
fn hessian(at: &[f64], gradient: &mut Gradient<'_>) -> Option<SymmetricMatrix> {
    let mut hessian = SymmetricMatrix::zero(at.len());
    let mut moved = at.to_vec();
    for i in 0..at.len() {
        let mut side = |by: f64| {
            moved[i] = at[i] + by;
            gradient(&moved)
        };
        let (_, above) = side(STEP)?;
        let (_, below) = side(-STEP)?;
        moved[i] = at[i];
        for (j, (above, below)) in above.iter().zip(&below).enumerate() {
            // Each element off the diagonal is added twice.
            let share = if i == j { 1.0 } else { 0.5 };
            hessian.add(i, j, share * (above - below) / (2.0 * STEP));
        }
    }
    Some(hessian)
}
