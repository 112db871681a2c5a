//! What is minimized: the simulation error of the force, low-passed.

use super::sensitivity::{HANDLE_KG, Sensitive};
use super::{Layout, motion_between};
use crate::identify::signal::{LowPass, SignalError, sampling_interval_s};
use crate::recording::Recording;
use std::sync::{Mutex, MutexGuard, PoisonError};
use study_wire::mechanism::{MechanismView, State};

/// Samples are averaged to at most this rate before they are compared, Hz.
const COMPARED_HZ: f64 = 1000.0;
/// Of the low-passed error at least this many samples per period of the corner count.
const PER_PERIOD: f64 = 4.0;
/// Errors within this time of each other may be correlated, s: by the low-pass, by noise that
/// is not white, and by what the mechanism does not explain at one place.
const CORRELATED_S: f64 = 0.5;
/// Time from the start of a recording that does not count, because the state of the
/// mechanism is unknown there, s.
const SETTLING_S: f64 = 0.2;

/// The low-pass of the comparison.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Filter {
    /// Recorded and predicted force both pass it, with this corner, Hz.
    Both(f64),
    /// The recorded force has passed it already; the predicted one does, with this
    /// corner, Hz.
    Recorded(f64),
}

impl Filter {
    fn corner_hz(self) -> f64 {
        match self {
            Self::Both(hz) | Self::Recorded(hz) => hz,
        }
    }
}

/// A recording with its low-passed force.
#[derive(Debug)]
pub(super) struct Compared<'r> {
    recording: &'r Recording,
    /// Samples used, from the first.
    samples: usize,
    interval_s: f64,
    /// Samples that are averaged into one.
    block: usize,
    low_pass: LowPass,
    /// The measured force, averaged and low-passed, N.
    force_n: Vec<f64>,
    /// The measured force, averaged, N; `None` if it is `force_n`.
    measured_n: Option<Vec<f64>>,
    /// The averaged samples that count, and how far apart they are.
    rows: Vec<usize>,
    stride: usize,
    /// Memory of the last derivative: a new one of tens of megabytes for each sum would cost as
    /// much time as the sum.
    spare: Mutex<Vec<f64>>,
}

/// The squared error and, if asked for, its normal equations.
#[derive(Debug, Clone)]
pub(super) struct Sum {
    /// Σ of squared errors, N².
    pub(super) square: f64,
    /// Number of errors.
    pub(super) errors: usize,
    /// JᵀJ, row by row, and Jᵀe with the error F̂ − F.
    pub(super) normal: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    /// Jᵀe of each stretch of [`CORRELATED_S`].
    pub(super) scores: Vec<Vec<f64>>,
}

impl<'r> Compared<'r> {
    /// At most `longest_s` of a recording.
    ///
    /// # Errors
    /// [`SignalError`] if it is not evenly sampled or too slow for the filter.
    pub(super) fn new(
        recording: &'r Recording,
        filter: Filter,
        longest_s: f64,
    ) -> Result<Self, SignalError> {
        let corner_hz = filter.corner_hz();
        let interval_s = sampling_interval_s(recording)?;
        let samples = ((longest_s / interval_s) as usize).min(recording.len());
        let block = ((1.0 / interval_s / COMPARED_HZ).round() as usize).max(1);
        let rate_hz = 1.0 / interval_s / block as f64;
        let low_pass = LowPass::new(corner_hz, rate_hz)?;
        let force_n = averaged(&recording.f_n[..samples], block);
        let (force_n, measured_n) = match filter {
            Filter::Both(_) => (low_pass.zero_phase(&force_n), Some(force_n)),
            Filter::Recorded(_) => (force_n, None),
        };
        let stride = ((rate_hz / corner_hz / PER_PERIOD) as usize).max(1);
        Ok(Self {
            recording,
            samples,
            interval_s,
            block,
            low_pass,
            force_n,
            measured_n,
            rows: ((SETTLING_S * rate_hz) as usize..samples / block)
                .step_by(stride)
                .collect(),
            stride,
            spare: Mutex::default(),
        })
    }

    /// Only these samples of the recording count.
    pub(super) fn keep(&mut self, counts: impl Fn(usize) -> bool) {
        let block = self.block;
        self.rows.retain(|row| counts(row * block));
    }

    fn spare(&self) -> MutexGuard<'_, Vec<f64>> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Steps of the mechanism per sample so that none is longer than 1/`least_hz`.
    fn substeps(&self, least_hz: f64) -> usize {
        ((self.interval_s * least_hz).ceil() as usize).max(1)
    }

    fn start(&self, mechanism: &MechanismView<'_>) -> State {
        State::settled(mechanism, motion_between(self.recording, 0, 0.0))
    }

    /// The error of the low-passed force at the samples that count.
    fn errors<'f>(&'f self, force_n: &'f [f64]) -> impl Iterator<Item = f64> + 'f {
        (self.rows.iter()).map(move |i| force_n[*i] - self.force_n[*i])
    }

    /// The force of a mechanism before the low-pass, N.
    pub(super) fn predict(&self, mechanism: &MechanismView<'_>, least_hz: f64) -> Vec<f64> {
        let predicted = super::predict(mechanism, self.recording, self.samples, least_hz);
        averaged(&predicted, self.block)
    }

    /// The squared error of a force as [`Self::predict`] gives it, and their number.
    pub(super) fn square(&self, predicted_n: &[f64]) -> (f64, usize) {
        let low = self.low_pass.zero_phase(predicted_n);
        let errors = self.errors(&low);
        errors.fold((0.0, 0), |(square, n), e| (square + e * e, n + 1))
    }

    /// The squared error of what the mechanism predicts of the force as it was measured, at the
    /// samples that count, and their number.
    pub(super) fn square_of_measured(
        &self,
        mechanism: &MechanismView<'_>,
        least_hz: f64,
    ) -> (f64, usize) {
        let predicted = self.predict(mechanism, least_hz);
        let Some(measured_n) = &self.measured_n else {
            return self.square(&predicted);
        };
        let errors = self.rows.iter().map(|i| predicted[*i] - measured_n[*i]);
        errors.fold((0.0, 0), |(square, n), e| (square + e * e, n + 1))
    }

    /// The squared error with its normal equations.
    pub(super) fn sum(&self, mechanism: &MechanismView<'_>, layout: &Layout, least_hz: f64) -> Sum {
        let parameters = layout.parameters();
        let rows = self.force_n.len();
        // column by column, so that each is one signal
        let mut jacobian = std::mem::take(&mut *self.spare());
        jacobian.clear();
        jacobian.resize(parameters * rows, 0.0);
        let mut predicted = vec![0.0; rows];
        let mut by = vec![0.0; parameters];
        let mut state = Sensitive::new(&self.start(mechanism), parameters);
        let substeps = self.substeps(least_hz);
        let dt_s = self.interval_s / substeps as f64;
        let weight = 1.0 / self.block as f64;
        let handle_kg = mechanism.scalars.handle_kg;
        for i in 0..rows * self.block {
            let a = self.recording.a_m_s2[i];
            let mut force_n = 0.0;
            for j in 1..=substeps {
                let share = j as f64 / substeps as f64;
                let motion = motion_between(self.recording, i, share);
                let last = (j == substeps).then_some(&mut by[..]);
                force_n = state.step(mechanism, motion, dt_s, last);
            }
            by[HANDLE_KG] += a;
            let row = i / self.block;
            predicted[row] += weight * (force_n + handle_kg * a);
            for (p, by) in by.iter().enumerate() {
                jacobian[p * rows + row] += weight * by;
            }
        }
        let low = self.low_pass.zero_phase(&predicted);
        let errors: Vec<f64> = self.errors(&low).collect();
        let columns: Vec<Vec<f64>> = jacobian
            .chunks_exact(rows)
            .map(|column| {
                if column.iter().all(|v| *v == 0.0) {
                    return vec![0.0; errors.len()];
                }
                let low = self.low_pass.zero_phase(column);
                self.rows.iter().map(|i| low[*i]).collect()
            })
            .collect();
        *self.spare() = jacobian;
        let mut normal = vec![0.0; parameters * parameters];
        let mut gradient = vec![0.0; parameters];
        for (i, column) in columns.iter().enumerate() {
            gradient[i] = dot(column, &errors);
            for (j, other) in columns[..=i].iter().enumerate() {
                let product = dot(column, other);
                normal[i * parameters + j] = product;
                normal[j * parameters + i] = product;
            }
        }
        let counted_hz = 1.0 / (self.interval_s * (self.block * self.stride) as f64);
        let stretch = ((CORRELATED_S * counted_hz) as usize).max(1);
        let scores = (0..errors.len())
            .step_by(stretch)
            .map(|from| {
                let to = (from + stretch).min(errors.len());
                let of = |column: &Vec<f64>| dot(&column[from..to], &errors[from..to]);
                columns.iter().map(of).collect()
            })
            .collect();
        Sum {
            square: dot(&errors, &errors),
            errors: errors.len(),
            normal,
            gradient,
            scores,
        }
    }
}

impl Sum {
    pub(super) fn add(&mut self, other: &Self) {
        self.square += other.square;
        self.errors += other.errors;
        self.scores.extend_from_slice(&other.scores);
        for (a, b) in self.normal.iter_mut().zip(&other.normal) {
            *a += b;
        }
        for (a, b) in self.gradient.iter_mut().zip(&other.gradient) {
            *a += b;
        }
    }
}

/// Σ aᵢ bᵢ in four partial sums, which a processor adds at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = (a4.remainder().iter().zip(b4.remainder()))
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a4.zip(b4) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Means of blocks; a last block that is not full is left out.
fn averaged(values: &[f64], block: usize) -> Vec<f64> {
    if block == 1 {
        return values.to_vec();
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / block as f64;
    values.chunks_exact(block).map(mean).collect()
}
