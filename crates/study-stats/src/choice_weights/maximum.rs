//! The weights with the largest penalized likelihood.

use super::SIZE;
use crate::matrix::SymmetricMatrix;
use crate::preference_gp::probit::of_answer;

const MOST_STEPS: usize = 100;
const MOST_SWEEPS: usize = 10_000;
/// A search ends when no weight changes by more than this, or this part of the largest.
const NEAR: f64 = 1e-9;
/// Rounding errors of the objective, as a part of it.
const SLACK: f64 = 1e-12;

/// The penalty ½ λ Σ (w − w̄)² + ½ ε Σ w² + Σ s w.
pub(super) struct Terms {
    lambda: f64,
    size: f64,
    slopes: Vec<f64>,
}

impl Terms {
    pub(super) fn of(components: usize, lambda: f64) -> Self {
        Self {
            lambda,
            size: SIZE,
            slopes: vec![0.0; components],
        }
    }

    /// Without λ, and with these slopes s.
    pub(super) fn with(slopes: Vec<f64>) -> Self {
        Self {
            slopes,
            ..Self::of(1, 0.0)
        }
    }

    /// That of a single weight in place of so many equal ones.
    pub(super) fn of_equal(components: usize) -> Self {
        Self {
            size: SIZE * components as f64,
            ..Self::of(1, 0.0)
        }
    }
}

/// Minus the logarithm of the likelihood, with the penalty, and its derivatives.
struct Objective {
    value: f64,
    gradient: Vec<f64>,
    curvature: SymmetricMatrix,
}

impl Objective {
    fn at(w: &[f64], rows: &[Vec<f64>], counts: &[f64], terms: &Terms) -> Self {
        let k = w.len();
        let (lambda, size) = (terms.lambda, terms.size);
        let mean = w.iter().sum::<f64>() / k as f64;
        let apart = |w: &f64| lambda * (w - mean).powi(2) + size * w * w;
        let each = w.iter().zip(&terms.slopes);
        let mut found = Self {
            value: 0.5 * w.iter().map(apart).sum::<f64>() + advantage(&terms.slopes, w),
            gradient: (each.map(|(w, slope)| lambda * (w - mean) + size * w + slope)).collect(),
            curvature: SymmetricMatrix::from_fn(k, |i, j| {
                let same = f64::from(u8::from(i == j));
                lambda * (same - 1.0 / k as f64) + size * same
            }),
        };
        for (row, n) in rows.iter().zip(counts).filter(|(_, n)| **n > 0.0) {
            let (log, slope, curvature) = of_answer(advantage(row, w));
            found.value -= n * log;
            for (g, d) in found.gradient.iter_mut().zip(row) {
                *g -= n * slope * d;
            }
            found.curvature.add_outer(n * curvature, row);
        }
        found
    }

    /// The step to the smallest value of the quadratic around `w` over weights of at least `least`, by coordinate descent.
    fn step(&self, w: &[f64], least: f64) -> Vec<f64> {
        let mut step = vec![0.0; w.len()];
        for _ in 0..MOST_SWEEPS {
            let (mut change, mut size) = (0.0f64, 0.0f64);
            for (i, own) in w.iter().enumerate() {
                let others: f64 = (step.iter().enumerate())
                    .map(|(j, s)| self.curvature.get(i, j) * s)
                    .sum();
                let slope = self.gradient[i] + others;
                let to = (step[i] - slope / self.curvature.get(i, i)).max(least - own);
                change = change.max((to - step[i]).abs());
                size = size.max((own + to).abs());
                step[i] = to;
            }
            if change <= 0.01 * NEAR * size.max(1.0) {
                break;
            }
        }
        step
    }
}

/// u of the preferred stimulus less that of the other one.
pub(super) fn advantage(row: &[f64], w: &[f64]) -> f64 {
    row.iter().zip(w).map(|(d, w)| d * w).sum()
}

/// The weights of at least `least` with the largest penalized likelihood, by Newton's method with step halving. `None` if
/// numbers overflow.
pub(super) fn maximum(
    rows: &[Vec<f64>],
    counts: &[f64],
    terms: &Terms,
    least: f64,
) -> Option<Vec<f64>> {
    let mut w = vec![0.0; rows.first()?.len()];
    let mut now = Objective::at(&w, rows, counts, terms);
    for _ in 0..MOST_STEPS {
        let step = now.step(&w, least);
        let mut share = 1.0;
        let (to, new) = loop {
            let moved = w.iter().zip(&step).map(|(w, s)| (w + share * s).max(least));
            let to: Vec<f64> = moved.collect();
            let new = Objective::at(&to, rows, counts, terms);
            if new.value <= now.value + SLACK * now.value.abs() {
                break (to, new);
            }
            share *= 0.5;
            // Also if a number is not finite.
            if share < 1e-9 {
                return None;
            }
        };
        // Of the full step, which a shortened one does not make small.
        let change = step.iter().fold(0.0f64, |most, s| most.max(s.abs()));
        let size = to.iter().fold(1.0f64, |most, w| most.max(w.abs()));
        (w, now) = (to, new);
        if change <= NEAR * size {
            return Some(w);
        }
    }
    None
}
