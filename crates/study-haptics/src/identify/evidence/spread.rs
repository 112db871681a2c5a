//! How far an estimate may be from the truth, and what the truth is at most.

/// The bound is so many errors above the estimate: a confidence of 99.5 % if errors are normal.
pub(super) const ONE_SIDED: f64 = 2.576;
/// The product of a regressor with its instrument is at least so many times what its noise could make: with
/// less than [`ONE_SIDED`], Fieller's limit does not exist.
const LEAST_RELEVANCE: f64 = 2.7;
/// Quantile .97 of the normal distribution.
const NEARLY_ALWAYS: f64 = 1.881;
/// The error of the model beside a term that is found may be so many times that beside none.
const DOUBT: f64 = 2.0;
/// Cyclic shifts of the residual against the instrument.
const SHIFTS: usize = 100;

/// An upper bound, and whether twice as much would be found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    pub(super) value: f64,
    pub(super) shows: bool,
}

/// The variance of Σ w (F − m a) as a function of m: [`Self::variance`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    /// Of the force, of force and regressor, of the regressor.
    moments: [f64; 3],
}

impl Spread {
    /// From cyclic shifts of what is left of force and regressor, divided by the local scales.
    pub(super) fn of(instrument: &[f64], left: [&[f64]; 2], scales: &[f64], inflated: f64) -> Self {
        let n = instrument.len();
        let scaled = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(scales).map(|(v, s)| v / s).collect()
        };
        let [force, regressor] = left.map(scaled);
        let weight: Vec<f64> = instrument.iter().zip(scales).map(|(w, s)| w * s).collect();
        let sum = |values: &[f64], shift: usize| -> f64 {
            let (head, tail) = values.split_at(shift);
            let shifted = tail.iter().chain(head);
            weight.iter().zip(shifted).map(|(w, v)| w * v).sum()
        };
        let mut moments = [0.0; 3];
        for k in 0..SHIFTS {
            let shift = (2 * k + 1) * n / (2 * SHIFTS);
            let (f, r) = (sum(&force, shift), sum(&regressor, shift));
            for (moment, product) in moments.iter_mut().zip([f * f, f * r, r * r]) {
                *moment += inflated * product / SHIFTS as f64;
            }
        }
        Self { moments }
    }

    /// If the term is `theta`.
    pub(super) fn variance(&self, theta: f64) -> f64 {
        let [force, mixed, regressor] = self.moments;
        (force - 2.0 * theta * mixed + theta * theta * regressor).max(0.0)
    }

    /// The largest value that is not rejected beside the estimate, or half the value that is found in
    /// 97 % of repetitions, because it exceeds `least_ratio` errors, if that is larger.
    pub(super) fn upper_bound(
        &self,
        estimate: f64,
        model_error: f64,
        least_ratio: f64,
    ) -> Option<Bound> {
        let [force, mixed, regressor] = self.moments;
        let t = ONE_SIDED.powi(2);
        let square = 1.0 - t * regressor;
        // false for NaN
        let exists = regressor * LEAST_RELEVANCE.powi(2) < 1.0;
        if !exists {
            return None;
        }
        let linear = estimate - t * mixed;
        let constant = estimate * estimate - t * (force + model_error * model_error);
        let not_rejected =
            (linear + (linear * linear - square * constant).max(0.0).sqrt()) / square;
        // what is found: found² = (least_ratio + NEARLY_ALWAYS)² (V(found) + (DOUBT model_error)²)
        let t = (least_ratio + NEARLY_ALWAYS).powi(2);
        let square = 1.0 - t * regressor;
        let error = t * (force + (DOUBT * model_error).powi(2));
        let found = ((t * mixed).powi(2) + square * error).max(0.0).sqrt() - t * mixed;
        let shows = square > 0.0;
        Some(Bound {
            value: if shows {
                not_rejected.max(0.5 * found / square)
            } else {
                not_rejected
            },
            shows,
        })
    }
}
