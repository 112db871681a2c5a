//! How precisely a study finds thresholds: sums over simulated studies.

use crate::analyze::psychophysics::decided::Estimated;
use serde::{Deserialize, Serialize};

/// A number of each of several studies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// Studies that have it.
    pub studies: u64,
    /// Its sum.
    pub sum: f64,
    /// The sum of its squares.
    pub squares: f64,
}

impl Moments {
    /// The number of a study.
    pub(super) fn add(&mut self, x: f64) {
        self.studies += 1;
        self.sum += x;
        self.squares += x * x;
    }

    fn merge(&mut self, other: &Self) {
        self.studies += other.studies;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// The mean over studies; `None` without any.
    pub fn mean(&self) -> Option<f64> {
        (self.studies > 0).then(|| self.sum / self.studies as f64)
    }

    /// The standard error of the mean over studies, the Monte Carlo error; `None` with fewer than two.
    pub fn error(&self) -> Option<f64> {
        let n = self.studies as f64;
        let mean = self.mean().filter(|_| self.studies > 1)?;
        let variance = (self.squares - n * mean * mean).max(0.0) / (n - 1.0);
        Some((variance / n).sqrt())
    }
}

/// How good the estimates of one kind are: of natural logarithms where levels have ratios, else of levels.
/// A study counts with its mean over its estimates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Square of estimate less truth.
    pub square: Moments,
    /// Estimate less truth.
    pub error: Moments,
    /// Half the 95 % interval.
    pub half: Moments,
    /// Whether the interval holds the truth.
    pub holds: Moments,
}

impl Quality {
    /// The estimates of a study with their truths. Those at or below 0 where levels have ratios have no
    /// logarithm and are left out.
    pub(super) fn add_all(&mut self, scale: Compared, of: &[(Estimated, f64)]) {
        let errors = of.iter().filter_map(|(found, truth)| {
            let error = scale.error(found.value, *truth)?;
            let half = Some(scale.half(found)).filter(|half| half.is_finite());
            let (low, high) = found.ci95;
            let holds = low <= *truth && *truth <= high;
            Some((error, half, f64::from(u8::from(holds))))
        });
        let errors: Vec<(f64, Option<f64>, f64)> = errors.collect();
        if errors.is_empty() {
            return;
        }
        let n = errors.len() as f64;
        self.square
            .add(errors.iter().map(|e| e.0 * e.0).sum::<f64>() / n);
        self.error.add(errors.iter().map(|e| e.0).sum::<f64>() / n);
        self.holds.add(errors.iter().map(|e| e.2).sum::<f64>() / n);
        let halves: Vec<f64> = errors.iter().filter_map(|e| e.1).collect();
        if !halves.is_empty() {
            self.half
                .add(halves.iter().sum::<f64>() / halves.len() as f64);
        }
    }

    /// Root of the mean square error.
    pub fn rms(&self) -> Option<f64> {
        self.square.mean().map(f64::sqrt)
    }

    /// Monte Carlo error of [`Quality::rms`], by the delta method.
    pub fn rms_error(&self) -> Option<f64> {
        let rms = self.rms().filter(|rms| *rms > 0.0)?;
        Some(self.square.error()? / (2.0 * rms))
    }

    fn merge(&mut self, other: &Self) {
        self.square.merge(&other.square);
        self.error.merge(&other.error);
        self.half.merge(&other.half);
        self.holds.merge(&other.holds);
    }
}

/// How good an analysis is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimates {
    /// Thresholds of participants in their conditions.
    pub participant: Quality,
    /// The mean threshold in the first condition.
    pub mean: Quality,
    /// The last condition against the first.
    pub contrast: Quality,
}

impl Estimates {
    fn merge(&mut self, other: &Self) {
        self.participant.merge(&other.participant);
        self.mean.merge(&other.mean);
        self.contrast.merge(&other.contrast);
    }
}

/// How precisely thresholds are found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Precision {
    /// Trials of a participant, catch and easy trials included.
    pub trials: Moments,
    /// Each function fitted by itself; the mean with its t interval, the contrast of the mixed model. This
    /// is what decides.
    pub alone: Estimates,
    /// The pooled model.
    pub together: Estimates,
    /// Studies whose pooled model has not converged.
    pub not_converged: u64,
}

impl Precision {
    /// Adds that of other studies.
    pub(super) fn merge(&mut self, other: &Self) {
        self.trials.merge(&other.trials);
        self.alone.merge(&other.alone);
        self.together.merge(&other.together);
        self.not_converged += other.not_converged;
    }
}

/// How numbers are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Compared {
    /// By the natural logarithm of their ratio, else by their difference.
    pub(super) ratios: bool,
}

impl Compared {
    /// Estimate less truth.
    fn error(self, found: f64, truth: f64) -> Option<f64> {
        let error = if self.ratios {
            (found > 0.0 && truth > 0.0).then(|| libm::log(found / truth))
        } else {
            Some(found - truth)
        };
        error.filter(|e| e.is_finite())
    }

    /// Half an interval.
    pub(super) fn half(self, found: &Estimated) -> f64 {
        let (low, high) = found.ci95;
        if self.ratios {
            libm::log(high / low) / 2.0
        } else {
            (high - low) / 2.0
        }
    }

    /// A number against another one.
    pub(super) fn contrast(self, a: f64, b: f64) -> f64 {
        if self.ratios { a / b } else { a - b }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(value: f64, low: f64, high: f64) -> Estimated {
        Estimated {
            value,
            ci95: (low, high),
        }
    }

    /// By hand: two studies, the first with errors ln 2 and 0, the second with ln ½.
    #[test]
    fn errors_are_logarithms_of_ratios() {
        let mut all = Quality::default();
        let ratios = Compared { ratios: true };
        all.add_all(
            ratios,
            &[(found(2.0, 1.0, 4.0), 1.0), (found(1.0, 0.5, 2.0), 1.0)],
        );
        all.add_all(
            ratios,
            &[(found(0.5, 0.4, 0.6), 1.0), (found(-1.0, -2.0, 0.0), 1.0)],
        );
        let l = std::f64::consts::LN_2;
        assert!((all.square.mean().unwrap() - (l * l / 2.0 + l * l) / 2.0).abs() < 1e-12);
        assert!((all.error.mean().unwrap() - (l / 2.0 - l) / 2.0).abs() < 1e-12);
        assert_eq!(all.holds.mean(), Some(0.5));
        assert!((all.half.mean().unwrap() - (l + libm::log(1.5) / 2.0) / 2.0).abs() < 1e-12);
        // Standard error of two numbers: half their difference.
        assert!((all.error.error().unwrap() - 0.75 * l).abs() < 1e-12);
        let rms = all.rms().unwrap();
        assert!((all.rms_error().unwrap() - l * l / 4.0 / (2.0 * rms)).abs() < 1e-12);
    }

    #[test]
    fn levels_without_ratios_are_compared_by_differences() {
        let mut all = Quality::default();
        let differences = Compared { ratios: false };
        all.add_all(differences, &[(found(-0.5, -1.0, 1.0), 0.25)]);
        assert_eq!(
            (all.error.mean(), all.half.mean()),
            (Some(-0.75), Some(1.0))
        );
        assert_eq!(
            (all.error.error(), differences.contrast(3.0, 1.0)),
            (None, 2.0)
        );
        let mut both = all;
        both.merge(&all);
        assert_eq!((both.error.studies, both.error.mean()), (2, Some(-0.75)));
    }
}
