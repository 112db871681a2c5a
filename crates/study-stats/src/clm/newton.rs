//! Newton's method for a likelihood of few parameters, with step halving.

use crate::matrix::{Cholesky, SymmetricMatrix, dot};

/// A log-likelihood with its derivatives at some parameters.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Evaluation {
    /// The log-likelihood.
    pub(crate) value: f64,
    /// First derivatives.
    pub(crate) gradient: Vec<f64>,
    /// Second derivatives.
    pub(crate) hessian: SymmetricMatrix,
}

impl Evaluation {
    /// Nothing yet.
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            value: 0.0,
            gradient: vec![0.0; size],
            hessian: SymmetricMatrix::zero(size),
        }
    }
}

/// Where the search ended.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Maximum {
    /// The parameters.
    pub(crate) at: Vec<f64>,
    /// The log-likelihood.
    pub(crate) value: f64,
    /// Less the second derivatives.
    pub(crate) information: SymmetricMatrix,
}

/// No parameter moves further in one step: the scale is that of logits.
const LONGEST_STEP: f64 = 2.0;

const MOST_STEPS: usize = 100;

/// A step that promises less than this of log-likelihood is the last one.
const PROMISE: f64 = 1e-9;

/// The maximum of a smooth log-likelihood; `None` if the search finds none.
///
/// A step solves (−H + ρ·diag|H|)·δ = g with the smallest ρ of 0, 10⁻³, 10⁻² …
/// that makes the matrix positive definite, and is halved until the value does
/// not fall. `at` is `None` where the parameters are not admissible. The last
/// step, once the promise ½gᵀδ is small, squares what is left of the error.
pub(crate) fn maximise(
    start: Vec<f64>,
    mut at: impl FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Maximum> {
    let mut here = start;
    let mut point = at(&here)?;
    for _ in 0..MOST_STEPS {
        let (step, newton) = direction(&point)?;
        let promise = 0.5 * dot(&step, &point.gradient);
        let last = newton && promise < PROMISE;
        let longest = step.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let mut share = (LONGEST_STEP / longest).min(1.0);
        let slack = 1e-13 * point.value.abs();
        let mut found = None;
        while share > 1e-10 {
            let there: Vec<f64> = here.iter().zip(&step).map(|(x, d)| x + share * d).collect();
            match at(&there) {
                Some(next) if next.value >= point.value - slack => {
                    found = Some((there, next));
                    break;
                }
                // The promise is below the rounding of the value.
                _ if last => break,
                _ => share *= 0.5,
            }
        }
        match found {
            Some((there, next)) => (here, point) = (there, next),
            None if last => {}
            None => return None,
        }
        if last {
            return Some(Maximum {
                at: here,
                value: point.value,
                information: point.hessian.negated(),
            });
        }
    }
    None
}

/// The step, and whether it is Newton's own.
fn direction(point: &Evaluation) -> Option<(Vec<f64>, bool)> {
    let information = point.hessian.negated();
    let mut ridge = 0.0;
    while ridge < 1e9 {
        let mut matrix = information.clone();
        for i in 0..matrix.size() {
            let diagonal = information.get(i, i).abs().max(1e-12);
            matrix.add(i, i, ridge * diagonal);
        }
        if let Some(factor) = Cholesky::definite(&matrix) {
            return Some((factor.solve(&point.gradient), ridge == 0.0));
        }
        ridge = if ridge == 0.0 { 1e-3 } else { ridge * 10.0 };
    }
    None
}
