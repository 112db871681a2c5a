//! The mode of the differences that were answered, and the curvature there.

use super::probit::of_answer;
use crate::matrix::{Cholesky, SymmetricMatrix, dot};

const MOST_STEPS: usize = 100;
/// A search ends when no difference changes by more than this, or this part of the largest; the error that is left is
/// about the square of it.
const NEAR: f64 = 1e-9;
/// Rounding errors of the logarithmic posterior, as a part of it.
const SLACK: f64 = 1e-12;

/// The mode of g with the prior covariance C.
#[derive(Debug)]
pub(super) struct Mode {
    /// The derivative of ln Φ(g/√2) for each answer, which is C⁻¹g.
    pub(super) slope: Vec<f64>,
    /// √W.
    root: Vec<f64>,
    /// The factor of B = I + √W C √W.
    factor: Cholesky,
    /// Logarithm of the evidence: −½ sᵀg + Σ ln Φ(g/√2) − ½ ln det B.
    pub(super) evidence: f64,
}

/// The likelihood at some differences.
struct Likelihood {
    log: f64,
    slope: Vec<f64>,
    curvature: Vec<f64>,
}

impl Likelihood {
    fn at(g: &[f64]) -> Self {
        let mut found = Self {
            log: 0.0,
            slope: Vec::with_capacity(g.len()),
            curvature: Vec::with_capacity(g.len()),
        };
        for g in g {
            let (log, slope, curvature) = of_answer(*g);
            found.log += log;
            found.slope.push(slope);
            found.curvature.push(curvature);
        }
        found
    }

    /// √W and the factor of I + √W C √W, whose eigenvalues are at least 1.
    fn factor(&self, c: &SymmetricMatrix) -> Option<(Vec<f64>, Cholesky)> {
        let root: Vec<f64> = self.curvature.iter().map(|w| w.sqrt()).collect();
        let b = SymmetricMatrix::from_fn(root.len(), |i, j| {
            f64::from(u8::from(i == j)) + root[i] * c.get(i, j) * root[j]
        });
        Some((root, Cholesky::positive(&b)?))
    }
}

impl Mode {
    /// Newton's method from 0 with step halving (Rasmussen & Williams 2006, algorithm 3.1). The logarithmic posterior
    /// is concave: there is one mode. `None` if numbers overflow.
    pub(super) fn of(c: &SymmetricMatrix) -> Option<Self> {
        let mut g = vec![0.0; c.size()];
        // C⁻¹g, without the inverse.
        let mut inner = g.clone();
        let mut likelihood = Likelihood::at(&g);
        let mut value = likelihood.log;
        for _ in 0..MOST_STEPS {
            let (root, factor) = likelihood.factor(c)?;
            let target = newton(c, &g, &likelihood, &root, &factor);
            let reached = times(c, &target);
            let mut share = 1.0;
            let next = loop {
                let toward = |from: &[f64], to: &[f64]| -> Vec<f64> {
                    let pairs = from.iter().zip(to);
                    pairs.map(|(a, b)| a + share * (b - a)).collect()
                };
                let (new_g, new_inner) = (toward(&g, &reached), toward(&inner, &target));
                let new = Likelihood::at(&new_g);
                let new_value = new.log - 0.5 * dot(&new_inner, &new_g);
                if new_value >= value - SLACK * value.abs() {
                    break Some((new_g, new_inner, new, new_value));
                }
                share *= 0.5;
                if share < 1e-9 {
                    break None;
                }
            };
            let (new_g, new_inner, new, new_value) = next?;
            let largest = |values: &mut dyn Iterator<Item = f64>| {
                values.fold(0.0f64, |most, value| most.max(value.abs()))
            };
            // Of the full step, which a shortened one does not make small.
            let change = largest(&mut reached.iter().zip(&g).map(|(a, b)| a - b));
            let size = largest(&mut new_g.iter().copied());
            (g, inner, likelihood, value) = (new_g, new_inner, new, new_value);
            if change <= NEAR * size.max(1.0) {
                return Self::at(c, likelihood, value);
            }
        }
        None
    }

    fn at(c: &SymmetricMatrix, likelihood: Likelihood, value: f64) -> Option<Self> {
        let (root, factor) = likelihood.factor(c)?;
        // The logarithms of `libm`: the same bits everywhere.
        let mut log_determinant = 0.0;
        for pivot in &factor.pivots {
            log_determinant += libm::log(*pivot);
        }
        let evidence = value - 0.5 * log_determinant;
        evidence.is_finite().then_some(Self {
            slope: likelihood.slope,
            root,
            factor,
            evidence,
        })
    }

    /// Replaces rows R, one for each answer, by L⁻¹ √W R with B = LLᵀ: then Rᵀ (C + W⁻¹)⁻¹ R is the sum of their
    /// squares.
    pub(super) fn whiten(&self, rows: &mut [Vec<f64>]) {
        for (row, root) in rows.iter_mut().zip(&self.root) {
            row.iter_mut().for_each(|value| *value *= root);
        }
        self.factor.solve_lower_rows(rows);
    }
}

/// C⁻¹ times the end of a full step: b − √W B⁻¹ √W C b with b = W g + slope.
fn newton(
    c: &SymmetricMatrix,
    g: &[f64],
    likelihood: &Likelihood,
    root: &[f64],
    factor: &Cholesky,
) -> Vec<f64> {
    let b: Vec<f64> = (likelihood.curvature.iter().zip(g).zip(&likelihood.slope))
        .map(|((w, g), slope)| w * g + slope)
        .collect();
    let scaled: Vec<f64> = (times(c, &b).iter().zip(root))
        .map(|(x, root)| root * x)
        .collect();
    let solved = factor.solve(&scaled);
    (b.iter().zip(root).zip(&solved))
        .map(|((b, root), x)| b - root * x)
        .collect()
}

fn times(c: &SymmetricMatrix, x: &[f64]) -> Vec<f64> {
    (0..x.len())
        .map(|i| {
            let mut sum = 0.0;
            for (j, x) in x.iter().enumerate() {
                sum += c.get(i, j) * x;
            }
            sum
        })
        .collect()
}
