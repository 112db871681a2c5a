//! The covariance of utilities before any answer, and how probable its parameters are.

use super::Choice;
use crate::matrix::SymmetricMatrix;

/// The most points of a space: the covariance of 1000 has 4 MB.
pub const MAX_POINTS: usize = 1000;

/// The Matérn covariance with ν = 5/2, σ² (1 + r + r²/3) exp(−r) with r² = 5 Σ ((a_k − b_k)/ℓ_k)².
#[derive(Debug, Clone, PartialEq)]
pub struct Kernel {
    /// σ: the standard deviation of a utility, in units of the noise of one impression.
    pub sd: f64,
    /// ℓ: the length of each dimension, in units of its coordinates.
    pub lengths: Vec<f64>,
}

impl Kernel {
    /// The covariance of two points.
    pub fn covariance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut squares = 0.0;
        for ((a, b), length) in a.iter().zip(b).zip(&self.lengths) {
            let along = (a - b) / length;
            squares += along * along;
        }
        let r = (5.0 * squares).sqrt();
        self.sd * self.sd * (1.0 + r + r * r / 3.0) * libm::exp(-r)
    }

    /// K.
    pub(super) fn of_points(&self, points: &[Vec<f64>]) -> SymmetricMatrix {
        SymmetricMatrix::from_fn(points.len(), |i, j| self.covariance(&points[i], &points[j]))
    }

    /// C = D K Dᵀ: the covariance of preferred minus other of each two answers.
    pub(super) fn of_differences(
        &self,
        points: &[Vec<f64>],
        choices: &[Choice],
    ) -> SymmetricMatrix {
        let of = |a: usize, b: usize| self.covariance(&points[a], &points[b]);
        SymmetricMatrix::from_fn(choices.len(), |i, j| {
            let (a, b) = (choices[i], choices[j]);
            (of(a.preferred, b.preferred) - of(a.preferred, b.other))
                - (of(a.other, b.preferred) - of(a.other, b.other))
        })
    }
}

/// A kernel and how probable it is before any answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The kernel.
    pub kernel: Kernel,
    /// The logarithm of its weight; a common constant does not matter.
    pub log_weight: f64,
}

/// Lengths in two dimensions, in shares of the range of a dimension.
const LENGTHS: [f64; 3] = [0.2, 0.4, 0.8];
/// Standard deviations of a utility.
const SDS: [f64; 3] = [1.0, 2.0, 4.0];

/// The nine kernels of a space with so many dimensions, whose coordinates go from 0 to 1: lengths of 0.2, 0.4 and
/// 0.8 times √(d/2), the same in all dimensions, with standard deviations of 1, 2 and 4. The weights are those of two
/// log-normal densities around 0.4 √(d/2) and 2, which at half and twice of these are exp(−½) of what they are there.
///
/// Distances in a cube grow with the root of its dimensions, and so do the lengths.
pub fn candidates(dimensions: usize) -> Vec<Candidate> {
    let root = (dimensions as f64 / 2.0).sqrt();
    let mut found = Vec::new();
    for (i, length) in LENGTHS.into_iter().enumerate() {
        for (j, sd) in SDS.into_iter().enumerate() {
            let away = usize::from(i != 1) + usize::from(j != 1);
            found.push(Candidate {
                kernel: Kernel {
                    sd,
                    lengths: vec![length * root; dimensions],
                },
                log_weight: -0.5 * away as f64,
            });
        }
    }
    found
}
