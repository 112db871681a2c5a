//! Preferences over a space of stimuli: a Gaussian process learned from paired comparisons, and the pair to compare
//! next.
//!
//! Each point of the space has a utility f, in units of the noise of one impression. Of two points the one whose
//! impression is better is preferred: P(a over b) = Φ((f_a − f_b)/√2), Thurstone's Case V. Before any answer f is a
//! Gaussian process with mean 0 and a Matérn covariance ([`Kernel`]; Chu & Ghahramani 2005, ICML). The posterior is
//! Laplace's approximation: normal around the mode, with the curvature there (Rasmussen & Williams 2006, sections 3.4
//! and 3.5).
//!
//! The likelihood depends on f only through the differences g = Df of the compared points, one for each answer. The
//! mode is therefore searched among these, and the posterior at all points is
//!
//! ```text
//! mean        K Dᵀ s                       s: derivative of ln Φ(g/√2) at the mode, for each answer
//! covariance  K − K Dᵀ (C + W⁻¹)⁻¹ D K     C = D K Dᵀ, W: minus the second derivatives (diagonal)
//! ```
//!
//! which needs no inverse of K, and nothing added to its diagonal.
//!
//! The pair to compare next has the largest expected utility of the best option, E max(f_a, f_b) (EUBO; Lin et al.
//! 2022, AISTATS), which for normal f has a closed form: [`Posterior::expected_best`].
//!
//! # The same bits everywhere
//!
//! A proposal has to be the same on every machine. Only +, −, ×, ÷ and square roots are used, which IEEE 754 defines
//! to the bit, and `libm`, whose code is part of the program. Sums have a fixed order; nothing is parallel. Pairs
//! whose value differs by less than [`TIE`] are tied, and the first one is taken, so that another program with other
//! rounding errors proposes the same.

mod best;
mod kernel;
mod mode;
pub(crate) mod probit;

pub use kernel::{Candidate, Kernel, MAX_POINTS, candidates};

use super::matrix::SymmetricMatrix;
use mode::Mode;
use thiserror::Error;

/// Expected utilities that differ by less than this, or this part of the largest, are tied.
pub const TIE: f64 = 1e-9;

/// The most answers that are learned from.
pub const MAX_CHOICES: usize = 1000;

/// An answer: of two points, one was preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// Index of the point that was preferred.
    pub preferred: usize,
    /// Index of the other one.
    pub other: usize,
}

/// Why there is no posterior.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NoPosterior {
    /// No point, or more than [`MAX_POINTS`].
    #[error("{found} points; there have to be 1 to {MAX_POINTS}")]
    Points {
        /// How many there are.
        found: usize,
    },
    /// A point with another number of coordinates than the kernel has lengths, or one that is not finite.
    #[error("point {point} does not have {dimensions} finite coordinates")]
    Coordinates {
        /// Its index.
        point: usize,
        /// How many lengths the kernel has.
        dimensions: usize,
    },
    /// A standard deviation or a length that is not above 0, or no kernel.
    #[error("a kernel needs a standard deviation and lengths above 0")]
    Kernel,
    /// More than [`MAX_CHOICES`] answers.
    #[error("{found} answers; there can be {MAX_CHOICES}")]
    TooManyChoices {
        /// How many there are.
        found: usize,
    },
    /// An answer about a point that there is not, or about a point and itself.
    #[error("answer {choice} does not compare two of the points")]
    Choice {
        /// Its index.
        choice: usize,
    },
    /// The search found no mode.
    #[error("the posterior has no mode that was found")]
    NotFound,
}

/// The utilities of all points after some answers: approximately normal.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    mean: Vec<f64>,
    covariance: SymmetricMatrix,
    evidence: f64,
}

impl Posterior {
    /// The posterior of one kernel at `points` after `choices`.
    ///
    /// # Errors
    /// [`NoPosterior`].
    ///
    /// ```
    /// # use study_stats::preference_gp::{Choice, Kernel, NoPosterior, Posterior};
    /// let points: Vec<Vec<f64>> = (0..5).map(|i| vec![f64::from(i) / 4.0]).collect();
    /// let kernel = Kernel { sd: 2.0, lengths: vec![0.4] };
    /// // The middle is preferred to both ends.
    /// let choices = [Choice { preferred: 2, other: 0 }, Choice { preferred: 2, other: 4 }];
    /// let posterior = Posterior::new(&points, &kernel, &choices)?;
    /// assert_eq!(posterior.best_point(|_| true), Some(2));
    /// # Ok::<(), NoPosterior>(())
    /// ```
    pub fn new(
        points: &[Vec<f64>],
        kernel: &Kernel,
        choices: &[Choice],
    ) -> Result<Self, NoPosterior> {
        check(points, kernel, choices)?;
        let mode =
            Mode::of(&kernel.of_differences(points, choices)).ok_or(NoPosterior::NotFound)?;
        let mut covariance = kernel.of_points(points);
        // Row i: the prior covariance of the difference of answer i with every point.
        let mut rows: Vec<Vec<f64>> = (choices.iter())
            .map(|choice| {
                (0..points.len())
                    .map(|j| covariance.get(choice.preferred, j) - covariance.get(choice.other, j))
                    .collect()
            })
            .collect();
        let mut mean = vec![0.0; points.len()];
        for (row, slope) in rows.iter().zip(&mode.slope) {
            add_scaled(&mut mean, *slope, row);
        }
        mode.whiten(&mut rows);
        for i in 0..points.len() {
            let own = covariance.row_mut(i);
            for row in &rows {
                add_scaled(own, -row[i], row);
            }
        }
        Ok(Self {
            mean,
            covariance,
            evidence: mode.evidence,
        })
    }

    /// The posterior of the most probable of `candidates`, and its index: the first one with the largest sum of
    /// logarithmic evidence and logarithmic prior weight.
    ///
    /// # Errors
    /// [`NoPosterior`].
    pub fn most_probable(
        points: &[Vec<f64>],
        candidates: &[Candidate],
        choices: &[Choice],
    ) -> Result<(usize, Self), NoPosterior> {
        let mut best: Option<(usize, f64)> = None;
        for (i, candidate) in candidates.iter().enumerate() {
            check(points, &candidate.kernel, choices)?;
            let mode = Mode::of(&candidate.kernel.of_differences(points, choices))
                .ok_or(NoPosterior::NotFound)?;
            let value = mode.evidence + candidate.log_weight;
            if best.is_none_or(|(_, known)| value > known + TIE) {
                best = Some((i, value));
            }
        }
        let (at, _) = best.ok_or(NoPosterior::Kernel)?;
        Ok((at, Self::new(points, &candidates[at].kernel, choices)?))
    }

    /// The mean utility of each point. Utilities are differences: their zero is that of the prior.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The covariance of the utilities of two points.
    ///
    /// # Panics
    /// If there is no such point.
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance.get(a, b)
    }

    /// The standard deviation of the utility of a point.
    ///
    /// # Panics
    /// If there is no such point.
    pub fn sd(&self, point: usize) -> f64 {
        self.covariance.get(point, point).max(0.0).sqrt()
    }

    /// The logarithm of the probability of the answers, by Laplace's approximation.
    pub fn evidence(&self) -> f64 {
        self.evidence
    }
}

/// Adds c times `row`, as far as `to` reaches.
fn add_scaled(to: &mut [f64], c: f64, row: &[f64]) {
    for (sum, value) in to.iter_mut().zip(row) {
        *sum += c * value;
    }
}

fn check(points: &[Vec<f64>], kernel: &Kernel, choices: &[Choice]) -> Result<(), NoPosterior> {
    let positive = |value: &f64| *value > 0.0 && value.is_finite();
    if kernel.lengths.is_empty() || !kernel.lengths.iter().all(positive) || !positive(&kernel.sd) {
        return Err(NoPosterior::Kernel);
    }
    if points.is_empty() || points.len() > MAX_POINTS {
        return Err(NoPosterior::Points {
            found: points.len(),
        });
    }
    let dimensions = kernel.lengths.len();
    let wrong = |point: &Vec<f64>| {
        point.len() != dimensions || !point.iter().all(|coordinate| coordinate.is_finite())
    };
    if let Some(point) = points.iter().position(wrong) {
        return Err(NoPosterior::Coordinates { point, dimensions });
    }
    if choices.len() > MAX_CHOICES {
        return Err(NoPosterior::TooManyChoices {
            found: choices.len(),
        });
    }
    let wrong = |choice: &Choice| {
        choice.preferred == choice.other || choice.preferred.max(choice.other) >= points.len()
    };
    match choices.iter().position(wrong) {
        Some(choice) => Err(NoPosterior::Choice { choice }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
