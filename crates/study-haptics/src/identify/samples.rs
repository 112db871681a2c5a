//! The samples of one direction of travel, and the parameter vector.

use crate::recording::{Recording, range};

/// A parameter vector θ in the order m (kg), b (N·s/mm), k (N/mm), F0 (N).
pub type Theta = [f64; 4];

/// P(0) of every recursion is this multiple of the identity matrix; its inverse is
/// the prior of the direct solutions.
pub(super) const INITIAL_COVARIANCE: f64 = 1e6;

/// The diagonal of P(0): 0 for terms that are left out, which then stay 0.
pub(super) fn initial_covariance(kept: [bool; 4]) -> [f64; 4] {
    kept.map(|kept| match kept {
        true => INITIAL_COVARIANCE,
        false => 0.0,
    })
}

/// The samples of one direction of travel in ascending order of x; samples at the
/// same x keep their order in time. All columns are equally long.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Position, mm, ascending.
    pub x_mm: Vec<f64>,
    /// Velocity, mm/s, all of one sign.
    pub v_mm_s: Vec<f64>,
    /// Acceleration, m/s².
    pub a_m_s2: Vec<f64>,
    /// Force, N.
    pub f_n: Vec<f64>,
}

/// The weight of every sample of every recording; `None`: all 1.
pub(super) type Weights<'w> = Option<&'w [Vec<f64>]>;

/// The weight of sample `i` of recording `r`.
pub(super) fn weight_of(weights: Weights<'_>, r: usize, i: usize) -> f64 {
    weights.map_or(1.0, |weights| weights[r][i])
}

impl Samples {
    /// The samples of `recordings` whose weight is not 0 and whose velocity satisfies `belongs`.
    pub(super) fn of(
        recordings: &[&Recording],
        weights: Weights<'_>,
        belongs: impl Fn(f64) -> bool,
    ) -> Self {
        // recording and sample, half as large as two words: a recording has at most 60 million rows
        let mut order: Vec<(u32, u32)> = Vec::new();
        for (k, r) in recordings.iter().enumerate() {
            let counts = |i: &usize| belongs(r.v_mm_s[*i]) && weight_of(weights, k, *i) > 0.0;
            order.extend((0..r.len()).filter(counts).map(|i| (k as u32, i as u32)));
        }
        let x_mm = |(k, i): &(u32, u32)| recordings[*k as usize].x_mm[*i as usize];
        // stable: ties keep their order in time
        order.sort_by(|a, b| x_mm(a).total_cmp(&x_mm(b)));
        let picked = |column: fn(&Recording) -> &Vec<f64>| {
            let places = order.iter();
            let of = |(k, i): &(u32, u32)| column(recordings[*k as usize])[*i as usize];
            places.map(of).collect()
        };
        Self {
            x_mm: picked(|r| &r.x_mm),
            v_mm_s: picked(|r| &r.v_mm_s),
            a_m_s2: picked(|r| &r.a_m_s2),
            f_n: picked(|r| &r.f_n),
        }
    }

    fn pick(columns: [&[f64]; 4], order: &[usize]) -> Self {
        let [x_mm, v_mm_s, a_m_s2, f_n] =
            columns.map(|column| order.iter().map(|i| column[*i]).collect());
        Self {
            x_mm,
            v_mm_s,
            a_m_s2,
            f_n,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.x_mm.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.x_mm.is_empty()
    }

    /// Lowest and highest position, mm; `None` without samples.
    pub fn range_mm(&self) -> Option<[f64; 2]> {
        (!self.is_empty()).then(|| range(&self.x_mm))
    }

    /// The samples in another order, given as indices.
    pub(super) fn reordered(&self, order: &[usize]) -> Self {
        Self::pick([&self.x_mm, &self.v_mm_s, &self.a_m_s2, &self.f_n], order)
    }

    /// Indices in descending order of x; samples at the same x keep their order in
    /// time.
    pub(super) fn descending(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by(|a, b| self.x_mm[*b].total_cmp(&self.x_mm[*a]));
        order
    }

    /// The memory L = 1 / ((1 − λ) ρ) of a forgetting factor, mm, with ρ samples per
    /// mm; `None` if it is unlimited (λ = 1) or there are no samples.
    pub fn memory_mm(&self, lambda: f64) -> Option<f64> {
        let [low, high] = self.range_mm()?;
        let per_mm = self.len() as f64 / (high - low);
        (lambda < 1.0).then(|| 1.0 / ((1.0 - lambda) * per_mm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_is_a_length_and_without_forgetting_unlimited() {
        // 200 samples over 19.9 mm
        let samples = Samples {
            x_mm: (0..200).map(|i| 0.1 * f64::from(i)).collect(),
            ..Samples::default()
        };
        let memory_mm = samples.memory_mm(0.99).unwrap();
        assert!((memory_mm - 19.9 / 200.0 * 100.0).abs() < 1e-9);
        assert_eq!(samples.memory_mm(1.0), None);
        assert_eq!(Samples::default().memory_mm(0.99), None);
    }
}
