//! t and F tests with Satterthwaite's (1946) degrees of freedom.
//!
//! With f(φ) = l'C(φ)l the variance of an estimate, C the covariance of the fixed
//! effects, φ the coordinates off the boundary and log σ², g = ∂f/∂φ, H the
//! Hessian of the REML deviance: var φ = 2H⁻¹, and ν = 2f²/(g'2H⁻¹g). A variance
//! on the boundary is treated as known. F over several contrasts: those of lmerTest,
//! rotated to be uncorrelated (Kuznetsova et al. 2017, §2.3): tₘ² = (l̃ₘ'β)²/dₘ,
//! F = mean tₘ², E = Σ νₘ/(νₘ − 2), ν = 2E/(E − q).

use super::data::FixedEffects;
use super::differences::{first, second};
use super::fit::{LmmFit, weight};
use super::profile::profile;
use crate::distribution::{f_upper, t_quantile, t_two_sided};
use crate::finite;
use crate::matrix::{Matrix, SymmetricEigen, dot};

/// A t test of one contrast of the fixed effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContrastT {
    /// The contrast Σ lᵢβᵢ.
    pub estimate: f64,
    /// Standard error of the contrast.
    pub se: f64,
    /// estimate/se; `None` if it overflows.
    pub t: Option<f64>,
    /// Degrees of freedom, Satterthwaite's or Kenward and Roger's; `None` if the criterion
    /// has no curvature.
    pub df: Option<f64>,
    /// Two-sided p of t.
    pub p: Option<f64>,
    /// 95 % t interval.
    pub ci95: Option<(f64, f64)>,
}

/// An F test that several contrasts are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContrastF {
    /// F on `df1` and `df2` degrees of freedom.
    pub f: f64,
    /// Number of contrasts.
    pub df1: f64,
    /// Denominator degrees of freedom; `None` if the criterion has no curvature.
    pub df2: Option<f64>,
    /// P(F ≥ f).
    pub p: Option<f64>,
}

/// Covariance of the fixed effects, its derivatives, and H⁻¹, in standardized units.
struct Uncertainty {
    covariance: Matrix,
    /// With respect to the free coordinates, then log σ².
    derivatives: Vec<Matrix>,
    /// H⁻¹ over the same coordinates.
    inverse: Matrix,
}

impl Uncertainty {
    fn df(&self, l: &[f64]) -> Option<f64> {
        let f = quadratic(&self.covariance, l);
        let g: Vec<f64> = self.derivatives.iter().map(|d| quadratic(d, l)).collect();
        let spread = dot(&g, &self.inverse.times(&g));
        finite(f * f / spread).filter(|df| spread > 0.0 && *df > 0.0)
    }
}

/// l'Al; a contrast has few elements that are not 0.
pub(super) fn quadratic(a: &Matrix, l: &[f64]) -> f64 {
    let used: Vec<usize> = (0..l.len()).filter(|&i| l[i] != 0.0).collect();
    let row = |i: usize| l[i] * used.iter().map(|&j| a[(i, j)] * l[j]).sum::<f64>();
    used.iter().map(|&i| row(i)).sum()
}

/// The t test of a contrast with its standard error and degrees of freedom.
pub(super) fn contrast(estimate: f64, se: f64, df: Option<f64>) -> ContrastT {
    let t = finite(estimate / se);
    let half = df.and_then(|df| t_quantile(0.975, df)).map(|q| q * se);
    ContrastT {
        estimate,
        se,
        t,
        df,
        p: t.zip(df).and_then(|(t, df)| t_two_sided(t, df)),
        ci95: half.map(|h| (estimate - h, estimate + h)),
    }
}

impl LmmFit<'_> {
    /// Tests Σ lᵢβᵢ = 0; `l` has an element for each fixed effect.
    pub fn t_test(&self, l: &[f64]) -> ContrastT {
        self.t_tests(&[l.to_vec()])[0]
    }

    /// Tests each of several contrasts.
    pub fn t_tests(&self, contrasts: &[Vec<f64>]) -> Vec<ContrastT> {
        let covariance = self.profile.inverse() * self.sigma2;
        let u = self.uncertainty();
        contrasts
            .iter()
            .map(|l| self.t_with(l, &covariance, u.as_ref()))
            .collect()
    }

    /// The contrast, applied to standardized effects.
    pub(super) fn scaled(&self, l: &[f64]) -> Vec<f64> {
        let units = self.units();
        units.iter().zip(l).map(|((unit, _), l)| l * unit).collect()
    }

    fn t_with(&self, l: &[f64], covariance: &Matrix, u: Option<&Uncertainty>) -> ContrastT {
        let scaled = self.scaled(l);
        let se = quadratic(covariance, &scaled).max(0.0).sqrt();
        contrast(self.estimate(l), se, u.and_then(|u| u.df(&scaled)))
    }

    /// Tests that the means of all realizations are equal. `None` unless the model has
    /// [`super::FixedEffects::Realizations`] and two realizations or more.
    pub fn f_test(&self) -> Option<ContrastF> {
        let p = self.table.columns();
        let of_realizations = matches!(self.table.fixed, FixedEffects::Realizations);
        let q = p.checked_sub(1).filter(|q| of_realizations && *q > 0)?;
        let l = sequential(&self.table.ratings_by_realization());
        let covariance = self.profile.inverse() * self.sigma2;
        let eigen = SymmetricEigen::new(&l * &covariance * &l.transposed());
        let rotated = &eigen.vectors * &l;
        let values = rotated.times(&self.profile.beta);
        let squares = values.iter().zip(&eigen.values).map(|(v, d)| v * v / d);
        let f = squares.sum::<f64>() / q as f64;
        let f = finite(f)?;
        let df2 = self.uncertainty().and_then(|u| {
            let dfs: Option<Vec<f64>> = (0..q).map(|m| u.df(rotated.row(m))).collect();
            pooled(&dfs?)
        });
        Some(ContrastF {
            f,
            df1: q as f64,
            df2,
            p: df2.and_then(|df2| f_upper(f, q as f64, df2)),
        })
    }

    /// `None` if the criterion has no curvature.
    fn uncertainty(&self) -> Option<Uncertainty> {
        let (table, random) = (self.table, self.coordinates.random);
        let profile_at = |free: &[f64]| {
            let mut at = self.at.clone();
            for (&i, v) in self.free.iter().zip(free) {
                at[i] = *v;
            }
            profile(table, random, &self.coordinates.ratios(&at))
        };
        let at: Vec<f64> = self.free.iter().map(|&i| self.at[i]).collect();
        let all: Vec<usize> = (0..at.len()).collect();
        let p = table.columns();
        // At the fitted σ²; REML for either criterion of the fit.
        let value = |x: &[f64]| {
            let p = profile_at(x)?;
            Some(p.log_det_z + p.log_det_x + p.rss / self.sigma2)
        };
        let (_, curvature) = second(&value, &at, &all)?;
        let parts = |x: &[f64]| {
            let found = profile_at(x)?;
            Some([found.inverse().elements(), &[found.rss]].concat())
        };
        let d = at.len();
        let mut hessian = Matrix::zeros(d + 1, d + 1);
        for (i, j) in (0..d).flat_map(|i| (0..d).map(move |j| (i, j))) {
            hessian[(i, j)] = curvature[(i, j)];
        }
        hessian[(d, d)] = weight(table, self.criterion);
        let covariance = self.profile.inverse() * self.sigma2;
        let mut derivatives = Vec::with_capacity(d + 1);
        for i in 0..d {
            let by = first(&parts, &at, i)?;
            let cross = -by[p * p] / self.sigma2;
            hessian[(i, d)] = cross;
            hessian[(d, i)] = cross;
            derivatives.push(Matrix::from_fn(p, p, |r, c| by[r * p + c] * self.sigma2));
        }
        derivatives.push(covariance.clone());
        let eigen = SymmetricEigen::new(hessian);
        let floor = 1e-8 * eigen.largest();
        let mut inverse = Matrix::zeros(d + 1, d + 1);
        for (k, value) in eigen.values.iter().enumerate() {
            if *value > floor {
                let q = eigen.vectors.row(k);
                inverse = inverse + &Matrix::from_fn(d + 1, d + 1, |i, j| q[i] * q[j] / value);
            }
        }
        Some(Uncertainty {
            covariance,
            derivatives,
            inverse,
        })
    }
}

/// The contrasts of a sequential decomposition (lmerTest's for one factor): each level
/// but the first against the ratings of the first and of all later ones. F does not
/// depend on the basis; its degrees of freedom do if the numbers of ratings are unequal.
fn sequential(ratings: &[f64]) -> Matrix {
    let p = ratings.len();
    let others = |i: usize| ratings[0] + ratings[i + 2..].iter().sum::<f64>();
    Matrix::from_fn(p - 1, p, |i, j| match j {
        j if j == i + 1 => 1.0,
        j if j == 0 || j > i + 1 => -ratings[j] / others(i),
        _ => 0.0,
    })
}

/// Denominator degrees of freedom of F from those of its contrasts.
fn pooled(dfs: &[f64]) -> Option<f64> {
    let q = dfs.len() as f64;
    let mean = dfs.iter().sum::<f64>() / q;
    if dfs.iter().all(|v| (v - mean).abs() < 1e-6 * mean) {
        return finite(mean);
    }
    if dfs.iter().any(|v| *v <= 2.0) {
        return Some(2.0);
    }
    let e: f64 = dfs.iter().map(|v| v / (v - 2.0)).sum();
    finite(2.0 * e / (e - q))
}
