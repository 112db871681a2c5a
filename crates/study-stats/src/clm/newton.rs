//! Newton's method with step halving for a log-likelihood of few parameters.

use crate::matrix::{Cholesky, SymmetricMatrix, dot};

/// A log-likelihood and its derivatives at given parameters.
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
    /// All zero.
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            value: 0.0,
            gradient: vec![0.0; size],
            hessian: SymmetricMatrix::zero(size),
        }
    }
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Maximum {
    /// The parameters.
    pub(crate) at: Vec<f64>,
    /// The log-likelihood.
    pub(crate) value: f64,
    /// Observed information: the negative Hessian.
    pub(crate) information: SymmetricMatrix,
}

/// Largest change of a parameter in one step, in logits.
const LONGEST_STEP: f64 = 2.0;

const MOST_STEPS: usize = 100;

/// The step whose predicted gain of log-likelihood is smaller is the last one.
const SMALLEST_GAIN: f64 = 1e-9;

/// The maximum of a smooth log-likelihood; `None` if the search finds none.
///
/// A step solves (−H + ρ·diag|H|)·δ = g with the smallest ρ of 0, 10⁻³, 10⁻² …
/// that makes the matrix positive definite, and is halved until the value does
/// not decrease. `evaluate` is `None` if the parameters are not admissible. The last
/// step, once the predicted gain ½gᵀδ is small, squares the remaining error.
pub(crate) fn maximize(
    start: Vec<f64>,
    mut evaluate: impl FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Maximum> {
    let mut at = start;
    let mut point = evaluate(&at)?;
    for _ in 0..MOST_STEPS {
        let (step, newton) = direction(&point)?;
        let gain = 0.5 * dot(&step, &point.gradient);
        let last = newton && gain < SMALLEST_GAIN;
        let longest = step.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let mut share = (LONGEST_STEP / longest).min(1.0);
        let slack = 1e-13 * point.value.abs();
        let mut found = None;
        while share > 1e-10 {
            let candidate: Vec<f64> = at.iter().zip(&step).map(|(x, d)| x + share * d).collect();
            match evaluate(&candidate) {
                Some(next) if next.value >= point.value - slack => {
                    found = Some((candidate, next));
                    break;
                }
                // The gain is smaller than the rounding error of the value.
                _ if last => break,
                _ => share *= 0.5,
            }
        }
        match found {
            Some(better) => (at, point) = better,
            None if last => {}
            None => return None,
        }
        if last {
            return Some(Maximum {
                at,
                value: point.value,
                information: point.hessian.negated(),
            });
        }
    }
    None
}

/// The step, and whether it is a plain Newton step.
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
