//! Kenward & Roger's (1997) F and t tests of realization means in a model with a subject
//! intercept.
//!
//! V = σ²I + τ²J within a subject with n ratings.
//! With e = 1/(1 + nγ): V⁻ᵏ = (I − (1 − eᵏ)/n·J)/σ²ᵏ and J V⁻¹ = e/σ² J. For
//! the parameters τ² (G₁ = J) and σ² (G₂ = I):
//!
//! * Φ = (X'V⁻¹X)⁻¹; Pᵢ = −X'V⁻¹GᵢV⁻¹X; Qᵢⱼ = X'V⁻¹GᵢV⁻¹GⱼV⁻¹X;
//! * W = 2I⁻¹, Iᵢⱼ = tr V⁻¹GᵢV⁻¹Gⱼ − 2 tr ΦQᵢⱼ + tr ΦPᵢΦPⱼ;
//! * Φ_A = Φ + 2Φ{Σ Wᵢⱼ(Qᵢⱼ − PᵢΦPⱼ)}Φ;
//! * Θ = L'(LΦL')⁻¹L, A₁ = Σ Wᵢⱼ tr ΘΦPᵢΦ tr ΘΦPⱼΦ, A₂ = Σ Wᵢⱼ tr ΘΦPᵢΦΘΦPⱼΦ,
//!   B = (A₁ + 6A₂)/2q, g = ((q+1)A₁ − (q+4)A₂)/((q+2)A₂),
//!   d = 3q + 2(1 − g), c₁ = g/d, c₂ = (q − g)/d, c₃ = (q + 2 − g)/d,
//!   E = 1/(1 − A₂/q), V = (2/q)(1 + c₁B)/((1 − c₂B)²(1 − c₃B)), ρ = V/2E²,
//!   m = 4 + (q + 2)/(qρ − 1), λ = m/(E(m − 2)), F = (λ/q) β'L'(LΦ_AL')⁻¹Lβ.

use super::RandomEffects;
use super::data::FixedEffects;
use super::fit::{Criterion, LmmFit};
use super::satterthwaite::{ContrastF, ContrastT, contrast, quadratic};
use crate::distribution::f_upper;
use crate::finite;
use crate::matrix::{Cholesky, Matrix, SymmetricMatrix, dot};

/// The quantities of the model that no contrast changes, with σ² = 1: it cancels in F and
/// its degrees of freedom.
struct Adjustment {
    phi: Matrix,
    /// Φ_A.
    adjusted: Matrix,
    /// ΦPᵢΦ.
    sandwich: [Matrix; 2],
    w: [[f64; 2]; 2],
}

/// The two variances cannot be told apart if the correlation of their estimates is within
/// this of ±1.
const SEPARATE: f64 = 1e-9;

impl Adjustment {
    fn of(fit: &LmmFit<'_>) -> Option<Self> {
        let table = fit.table;
        let wanted = table.fixed == FixedEffects::Realizations
            && fit.coordinates.random == RandomEffects::default()
            && fit.criterion == Criterion::Reml;
        let p = Some(table.columns()).filter(|_| wanted)?;
        let gamma = fit.coordinates.ratios(&fit.at).intercept;
        let zero = || Matrix::zeros(p, p);
        let mut information = zero();
        let mut p_of = [zero(), zero()];
        let mut q_of = [zero(), zero(), zero()];
        let mut traces = [0.0; 3];
        for pattern in &table.patterns {
            let k = pattern.subjects;
            let n: f64 = pattern.units.iter().map(|u| u.n).sum();
            let e = 1.0 / (1.0 + n * gamma);
            let less = |power: i32| (1.0 - e.powi(power)) / n;
            traces[0] += k * (n * e).powi(2);
            traces[1] += k * n * e * e;
            traces[2] += k * (n - 1.0 + e * e);
            for a in &pattern.units {
                let i = a.realization;
                information[(i, i)] += k * a.n;
                p_of[1][(i, i)] -= k * a.n;
                q_of[2][(i, i)] += k * a.n;
                for b in &pattern.units {
                    let j = b.realization;
                    let both = k * a.n * b.n;
                    information[(i, j)] -= both * less(1);
                    p_of[0][(i, j)] -= both * e * e;
                    p_of[1][(i, j)] += both * less(2);
                    q_of[0][(i, j)] += both * n * e.powi(3);
                    q_of[1][(i, j)] += both * e.powi(3);
                    q_of[2][(i, j)] -= both * less(3);
                }
            }
        }
        let phi = inverse(&information)?;
        let phi_p = [&phi * &p_of[0], &phi * &p_of[1]];
        let both = |i: usize, j: usize| i + j;
        let expected = |i: usize, j: usize| {
            traces[both(i, j)] - 2.0 * phi.trace_of_product(&q_of[both(i, j)])
                + phi_p[i].trace_of_product(&phi_p[j])
        };
        let [first, mixed, second] = [expected(0, 0), expected(0, 1), expected(1, 1)];
        let determinant = first * second - mixed * mixed;
        let separate = determinant > SEPARATE * first * second;
        let scale = Some(2.0 / determinant).filter(|_| separate)?;
        let w = [
            [second * scale, -mixed * scale],
            [-mixed * scale, first * scale],
        ];
        let mut inner = zero();
        for i in 0..2 {
            for j in 0..2 {
                let excess = q_of[both(i, j)].clone() - &(&p_of[i] * &phi_p[j]);
                inner = inner + &(excess * w[i][j]);
            }
        }
        Some(Self {
            adjusted: &phi * &inner * &phi * 2.0 + &phi,
            sandwich: phi_p.map(|phi_p| phi_p * &phi),
            phi,
            w,
        })
    }

    /// The sum of Wᵢⱼ times `term` of i and j.
    fn weighted(&self, term: impl Fn(usize, usize) -> f64) -> f64 {
        let pairs = [(0, 0), (0, 1), (1, 0), (1, 1)];
        pairs.iter().map(|&(i, j)| self.w[i][j] * term(i, j)).sum()
    }
}

/// The Cholesky factor of a symmetric matrix; `None` unless it is positive definite.
fn factor(a: &Matrix) -> Option<Cholesky> {
    Cholesky::positive(&SymmetricMatrix::from_fn(a.rows(), |i, j| a[(i, j)]))
}

fn inverse(a: &Matrix) -> Option<Matrix> {
    Some(factor(a)?.inverse())
}

/// Tests that all realizations have the same mean. `None` unless the model was fitted by
/// REML with [`FixedEffects::Realizations`] and a subject intercept only, or if the
/// adjustment is not defined.
pub fn kenward_roger(fit: &LmmFit<'_>) -> Option<ContrastF> {
    let found = Adjustment::of(fit)?;
    let p = fit.table.columns();
    let q = p.checked_sub(1).filter(|q| *q > 0)?;
    let l = Matrix::from_fn(q, p, |i, j| {
        f64::from(i8::from(j == i + 1) - i8::from(j == 0))
    });
    let columns = l.transposed();
    let theta = &columns * &inverse(&(&l * &found.phi * &columns))? * &l;
    let tpp = [0, 1].map(|i| &theta * &found.sandwich[i]);
    let a1 = found.weighted(|i, j| tpp[i].trace() * tpp[j].trace());
    let a2 = found.weighted(|i, j| tpp[i].trace_of_product(&tpp[j]));
    let (df2, lambda) = scaled(a1, a2, q as f64)?;
    let values = l.times(&fit.profile.beta);
    let middle = factor(&(&l * &found.adjusted * &columns))?;
    let wald = dot(&values, &middle.solve(&values)) / fit.sigma2;
    let f = finite(lambda * wald / q as f64)?;
    Some(ContrastF {
        f,
        df1: q as f64,
        df2: Some(df2),
        p: f_upper(f, q as f64, df2),
    })
}

/// Tests each of several contrasts Σ lᵢβᵢ. Here q = 1, so that A₁ = A₂ = A, λ = 1 and
/// m = 2/A; the standard error is that of Φ_A. `None` as in [`kenward_roger`].
pub fn kenward_roger_t(fit: &LmmFit<'_>, contrasts: &[Vec<f64>]) -> Option<Vec<ContrastT>> {
    let found = Adjustment::of(fit)?;
    let test = |l: &Vec<f64>| {
        let scaled = fit.scaled(l);
        let variance = quadratic(&found.phi, &scaled);
        let share = |i: usize| quadratic(&found.sandwich[i], &scaled) / variance;
        let a = found.weighted(|i, j| share(i) * share(j));
        let se = (quadratic(&found.adjusted, &scaled) * fit.sigma2)
            .max(0.0)
            .sqrt();
        contrast(fit.estimate(l), se, finite(2.0 / a).filter(|df| *df > 0.0))
    };
    Some(contrasts.iter().map(test).collect())
}

/// The denominator degrees of freedom m and the scale λ.
fn scaled(a1: f64, a2: f64, q: f64) -> Option<(f64, f64)> {
    let b = (a1 + 6.0 * a2) / (2.0 * q);
    let g = ((q + 1.0) * a1 - (q + 4.0) * a2) / ((q + 2.0) * a2);
    let d = 3.0 * q + 2.0 * (1.0 - g);
    let (c1, c2, c3) = (g / d, (q - g) / d, (q + 2.0 - g) / d);
    let e = 1.0 / (1.0 - a2 / q);
    let v = 2.0 / q * (1.0 + c1 * b) / ((1.0 - c2 * b).powi(2) * (1.0 - c3 * b));
    let rho = v / (2.0 * e * e);
    let m = finite(4.0 + (q + 2.0) / (q * rho - 1.0)).filter(|m| *m > 0.0)?;
    let lambda = finite(m / (e * (m - 2.0))).filter(|l| *l > 0.0)?;
    Some((m, lambda))
}
