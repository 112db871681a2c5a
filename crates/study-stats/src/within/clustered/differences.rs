//! Whether any realizations differ, as the analysis of variance asks it, without sphericity.

use super::{Clustered, Part, ROUNDING};
use crate::distribution::f_upper;
use crate::finite;
use crate::matrix::{Matrix, SymmetricEigen, dot};

/// The test that all realizations of a set have one mean, over all sets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Differences {
    /// F; with sphericity on `df1` and `df2` degrees of freedom.
    pub f: f64,
    /// Contrasts.
    pub df1: f64,
    /// Satterthwaite's degrees of freedom of the denominator.
    pub df2: f64,
    /// Box's ε by the clustered covariance, as Greenhouse and Geisser estimate it.
    pub epsilon_gg: f64,
    /// P(F ≥ f) with both degrees of freedom times `epsilon_gg`.
    pub p_gg: Option<f64>,
    /// Huynh and Feldt's, from `epsilon_gg` to 1.
    pub epsilon_hf: f64,
    /// P(F ≥ f) with both degrees of freedom times `epsilon_hf`.
    pub p_hf: Option<f64>,
    /// Contrasts that are left out, because one subject alone determines them.
    pub left_out: usize,
}

/// A contrast of which the working model expects at least all but this share of its variance is shown.
const SHOWN: f64 = 1e-7;

impl Clustered {
    /// Whether any linked realizations differ. With d all contrasts, uncorrelated and of the same variance by the working model, and V their clustered
    /// covariance, F is ‖d‖²/tr V; without sphericity it has Box's degrees of freedom (Box 1954, Ann. Math. Stat. 25, 484–498), ε times those under the working model, with
    /// ε̂ = (tr V)²/(q tr V²) for q contrasts and Huynh & Feldt's (1976, J. Educ. Stat. 1, 69–82) correction of it, in which Satterthwaite's degrees of freedom of tr V take the place of
    /// subjects less one. In complete tables it is the analysis of variance with both corrections.
    ///
    /// `None` without residuals, and if one subject alone determines each contrast.
    pub fn differences(&self) -> Option<Differences> {
        if !self.varies {
            return None;
        }
        let k = self.realizations.len();
        let set_ends = |i: usize| !self.sets[i + 1..].contains(&self.sets[i]);
        let next = |i: usize| (i + 1..k).find(|j| self.sets[*j] == self.sets[i]);
        let firsts: Vec<usize> = (0..k).filter(|i| !set_ends(*i)).collect();
        let neighbors = Matrix::from_fn(firsts.len(), k, |row, j| {
            let i = firsts[row];
            f64::from(u8::from(j == i)) - f64::from(u8::from(Some(j) == next(i)))
        });
        let all = self.whitened(&neighbors)?;
        let mut parts = self.parts(&all);
        let mut shown = all.clone();
        let expected = self.expected_matrix(&parts);
        if (all.rows() as f64 - expected.trace()).abs() > ROUNDING {
            let eigen = SymmetricEigen::new(expected);
            let kept: Vec<usize> = (0..all.rows())
                .filter(|i| eigen.values[*i] > 1.0 - SHOWN)
                .collect();
            if kept.is_empty() {
                return None;
            }
            let basis = Matrix::from_fn(kept.len(), all.rows(), |i, j| eigen.vectors[(kept[i], j)]);
            shown = &basis * &all;
            parts = self.parts(&shown);
        }
        let estimates = shown.times(&self.effects);
        let covariance = self.covariance(&parts)?;
        let q = shown.rows() as f64;
        let trace: f64 = (0..shown.rows()).map(|i| covariance.get(i, i)).sum();
        let squares: f64 = (0..shown.rows())
            .flat_map(|i| (0..shown.rows()).map(move |j| (i, j)))
            .map(|(i, j)| covariance.get(i, j).powi(2))
            .sum();
        let size = self
            .effects
            .iter()
            .fold(0.0f64, |most, e| most.max(e.abs()));
        let f =
            finite(dot(&estimates, &estimates) / trace).filter(|_| trace > 1e-24 * size * size)?;
        let epsilon_gg = finite((trace * trace / (q * squares)).clamp(1.0 / q, 1.0))?;
        // 2(E tr V)²/Var tr V; of it ν for each contrast.
        let total = finite(q * q / self.squares_of_products(&parts))?;
        let of_each = total / q;
        let left = of_each - q * epsilon_gg;
        let huynh_feldt = ((of_each + 1.0) * q * epsilon_gg - 2.0) / (q * left);
        let epsilon_hf = match left > ROUNDING {
            true => huynh_feldt.max(epsilon_gg).min(1.0),
            false => 1.0,
        };
        let p = |epsilon: f64| f_upper(f, q * epsilon, total * epsilon);
        Some(Differences {
            f,
            df1: q,
            df2: total,
            epsilon_gg,
            p_gg: p(epsilon_gg),
            epsilon_hf,
            p_hf: p(epsilon_hf),
            left_out: all.rows() - shown.rows(),
        })
    }

    /// The expectation of the clustered covariance of some contrasts by the working model.
    fn expected_matrix(&self, parts: &[Part]) -> Matrix {
        let q = parts.first().map_or(0, |part| part.p.rows());
        let all = self.patterns.iter().zip(parts);
        all.fold(Matrix::zeros(q, q), |sum, (pattern, part)| {
            sum + &(part.own_matrix() * pattern.residuals.len() as f64)
        })
    }

    /// Σ tr KᵢⱼKᵢⱼᵀ over all subjects i and j, with Kᵢⱼ as in `sums_of_products`: half the variance of tr V by the working model. Of different
    /// subjects Kᵢⱼ = −uᵢQuⱼᵀ, and the sum over all of them is tr (QG)², G = Σuᵢᵀuᵢ.
    fn squares_of_products(&self, parts: &[Part]) -> f64 {
        let k = self.realizations.len();
        let (mut sum, mut all) = (0.0, Matrix::zeros(k, k));
        for (pattern, part) in self.patterns.iter().zip(parts) {
            let n = pattern.residuals.len() as f64;
            let through = &part.z * &part.u;
            let own = part.own_matrix();
            sum += n * (dot(own.elements(), own.elements()) - through.trace_of_product(&through));
            all = all + &(through * n);
        }
        sum + all.trace_of_product(&all)
    }
}

impl Part {
    /// pᵢ(I − Hᵢᵢ)pᵢᵀ of all contrasts.
    fn own_matrix(&self) -> Matrix {
        &self.p * &self.p.transposed() - &(&self.u * &self.z)
    }
}
