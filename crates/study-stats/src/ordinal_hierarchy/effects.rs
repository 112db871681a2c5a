//! The effects, given latent ratings: a linear mixed model of cell means.
//!
//! The mean of n latent ratings of a cell is βxⱼ + mⱼ + uᵢ + N(0, v), v = ω² + 1/n. With θ = (u, m, β) and D the variances of its
//! prior, the posterior precision is P = D⁻¹ + Σ hhᵀ/v, h the row of a cell. The block of u is diagonal, so that only that of (m, β) is factored.

use super::Data;
use crate::matrix::{Cholesky, SymmetricMatrix, dot};
use crate::random::{RandomSource, SplitMix64};

/// A cell with latent ratings.
#[derive(Debug, Clone, Copy)]
pub(super) struct Latent {
    pub(super) participant: usize,
    pub(super) realization: usize,
    /// Number of latent ratings, at least 1.
    pub(super) n: f64,
    /// Their mean.
    pub(super) mean: f64,
}

/// Standard deviations: τ of realizations, σ of participants, ω of both.
pub(super) type Spread = [f64; 3];

/// P and Σ hy/v, with the participants taken out.
pub(super) struct Effects {
    /// Precision of each u.
    people: Vec<f64>,
    /// For each participant what links them to (m, β).
    links: Vec<Vec<f64>>,
    right_people: Vec<f64>,
    factor: Cholesky,
    /// Right side of (m, β) without the participants.
    right: Vec<f64>,
    /// ln of the density of the latent means, but for a constant.
    pub(super) log_density: f64,
}

impl Effects {
    /// `None` if the precision is not definite.
    pub(super) fn new(
        data: &Data,
        cells: &[Latent],
        spread: Spread,
        slope_sd: f64,
    ) -> Option<Self> {
        let [tau, sigma, omega] = spread;
        let (k, has_slope) = (data.realizations, !data.covariate.is_empty());
        let q = k + usize::from(has_slope);
        let row = |j: usize| (j, has_slope.then(|| data.covariate[j]));
        let mut people = vec![1.0 / (sigma * sigma); data.participants];
        let mut right_people = vec![0.0; data.participants];
        let mut links = vec![vec![0.0; q]; data.participants];
        let (mut own, mut right) = (SymmetricMatrix::zero(q), vec![0.0; q]);
        (0..k).for_each(|j| own.add(j, j, 1.0 / (tau * tau)));
        if has_slope {
            own.add(k, k, 1.0 / (slope_sd * slope_sd));
        }
        // −½ of it is the logarithm of the density.
        let mut twice = 2.0 * (k as f64 * tau.ln() + data.participants as f64 * sigma.ln());
        if has_slope {
            twice += 2.0 * slope_sd.ln();
        }
        for cell in cells {
            let v = omega * omega + 1.0 / cell.n;
            let (weight, y) = (1.0 / v, cell.mean / v);
            twice += v.ln() + cell.mean * y;
            let i = cell.participant;
            people[i] += weight;
            right_people[i] += y;
            let (j, x) = row(cell.realization);
            own.add(j, j, weight);
            links[i][j] += weight;
            right[j] += y;
            if let Some(x) = x {
                own.add(k, k, weight * x * x);
                own.add(k, j, weight * x);
                links[i][k] += weight * x;
                right[k] += y * x;
            }
        }
        for ((precision, link), y) in people.iter().zip(&links).zip(&right_people) {
            for a in 0..q {
                for b in 0..=a {
                    own.add(a, b, -link[a] * link[b] / precision);
                }
                right[a] -= link[a] * y / precision;
            }
            twice += precision.ln() - y * y / precision;
        }
        let factor = Cholesky::positive(&own)?;
        twice += factor.log_determinant() - dot(&right, &factor.solve(&right));
        Some(Self {
            people,
            links,
            right_people,
            factor,
            right,
            log_density: -0.5 * twice,
        })
    }

    /// A draw of u and of (m, β).
    pub(super) fn draw(&self, random: &mut SplitMix64) -> (Vec<f64>, Vec<f64>) {
        let mut own = self.factor.solve(&self.right);
        let noise: Vec<f64> = own.iter().map(|_| random.normal()).collect();
        // Independent numbers get the covariance P⁻¹.
        let noise = self.factor.solve_transposed(&noise);
        (own.iter_mut().zip(&noise)).for_each(|(x, e)| *x += e);
        let people = (self.people.iter().zip(&self.links)).zip(&self.right_people);
        let people = people
            .map(|((precision, link), y)| {
                (y - dot(link, &own)) / precision + random.normal() / precision.sqrt()
            })
            .collect();
        (people, own)
    }
}
