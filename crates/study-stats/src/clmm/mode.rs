//! The mode of a subject's random intercept, given all parameters.

use crate::clm::counts::Term;
use crate::clm::logistic;

/// The search ends when a step is shorter than this share of the width 1/√H.
const PRECISION: f64 = 1e-8;

/// The mode b̂, the root of f′, starting from a guess. `None` if f′ overflows.
///
/// f′(b) = −Σ (nₖ − mₖF(aₖ)) − b/σ² decreases, and its sum lies between −Σn and
/// Σ(m − n): the root is bracketed by σ² times these. Newton's method, with bisection if
/// a step would leave the bracket, which shrinks with every step.
pub(super) fn mode(terms: &[Term], a: &[f64], precision: f64, guess: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, 0.0);
    for t in terms {
        low -= t.n / precision;
        high += (t.m - t.n) / precision;
    }
    let mut b = if guess > low && guess < high {
        guess
    } else {
        0.0f64.clamp(low, high)
    };
    for _ in 0..200 {
        let (mut first, mut second) = (-b * precision, -precision);
        for t in terms {
            let f = logistic(a[t.place] - b);
            first -= t.n - t.m * f;
            second -= t.m * f * (1.0 - f);
        }
        if !(first.is_finite() && second.is_finite()) {
            return None;
        }
        if first > 0.0 {
            low = b;
        } else {
            high = b;
        }
        let step = -first / second;
        let near = step.abs() * (-second).sqrt() < PRECISION;
        let newton = b + step;
        if near {
            return Some(newton);
        }
        b = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
    }
    Some(b)
}
