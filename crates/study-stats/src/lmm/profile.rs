//! The profiled criterion at given variance ratios.
//!
//! With the variances Γ (2 × 2) of the subject, γ_m of the realization and γ_c of the
//! cell, all relative to σ²:
//!
//! * cells: the weight of a mean of n ratings is w = n/(1 + nγ_c); determinant 1 + nγ_c;
//! * subjects: with z = (1, x), S = Σwzz': M = W − WZ Γ(I + SΓ)⁻¹ Z'W;
//!   determinant |I + SΓ|;
//! * realizations: B = Z_m'MZ_m, Ω = M − γ_m MZ_m(I + γ_mB)⁻¹Z_m'M;
//!   determinant |I + γ_mB|.
//!
//! Then A = X'ΩX, β = A⁻¹X'Ωy, r² = y'Ωy − β'X'Ωy + within. The criterion
//! contains no root of a variance and is therefore smooth through the boundary 0.

use super::RandomEffects;
use super::data::{FixedEffects, LmmData};
use crate::matrix::{Cholesky, Matrix, SymmetricMatrix, dot};

/// Variances relative to σ², on the standardized scales.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Ratios {
    pub(super) intercept: f64,
    pub(super) covariance: f64,
    pub(super) slope: f64,
    pub(super) realization: f64,
    pub(super) cell: f64,
}

/// The parts of the criterion.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    /// Log-determinant of the random part.
    pub(super) log_det_z: f64,
    /// log|A|.
    pub(super) log_det_x: f64,
    /// Penalized residual sum of squares.
    pub(super) rss: f64,
    pub(super) beta: Vec<f64>,
    pub(super) factor: Cholesky,
}

impl Profile {
    /// A⁻¹: the covariance of β over σ².
    pub(super) fn inverse(&self) -> Matrix {
        self.factor.inverse()
    }
}

/// The sums [C, y]'M[C, y], with C the columns of the realizations (if random) and then
/// those of X.
struct Sums {
    matrix: SymmetricMatrix,
    y: Vec<f64>,
    yy: f64,
    log_det: f64,
}

/// Evaluates the criterion's parts; `None` if a determinant is not positive or a sum
/// overflows.
pub(super) fn profile(table: &LmmData, random: RandomEffects, ratios: &Ratios) -> Option<Profile> {
    let levels = if random.realization {
        table.realizations.len()
    } else {
        0
    };
    let p = table.columns();
    let mut sums = sums(table, random, ratios, levels)?;
    if levels > 0 && ratios.realization != 0.0 {
        let g = ratios.realization;
        let inner = SymmetricMatrix::from_fn(levels, |i, j| {
            g * sums.matrix.get(i, j) + f64::from(u8::from(i == j))
        });
        let factor = Cholesky::positive(&inner)?;
        sums.log_det += factor.log_determinant();
        // The cross products of the realizations with X and, last, with y, divided by L.
        let cross = |j: usize| -> Vec<f64> {
            let with_x = |m| sums.matrix.get(levels + j, m);
            let mut cross = if j == p {
                sums.y[..levels].to_vec()
            } else {
                (0..levels).map(with_x).collect()
            };
            factor.solve_lower(&mut cross);
            cross
        };
        let solved: Vec<Vec<f64>> = (0..=p).map(cross).collect();
        let less = |i: usize, j: usize| g * dot(&solved[i], &solved[j]);
        for i in 0..p {
            for j in 0..=i {
                sums.matrix.add(levels + i, levels + j, -less(i, j));
            }
            sums.y[levels + i] -= less(i, p);
        }
        sums.yy -= less(p, p);
    }
    let a = SymmetricMatrix::from_fn(p, |i, j| sums.matrix.get(levels + i, levels + j));
    let b = &sums.y[levels..];
    let factor = Cholesky::positive(&a)?;
    let beta = factor.solve(b);
    let rss = sums.yy - dot(&beta, b) + table.within;
    let log_det_x = factor.log_determinant();
    (rss.is_finite() && sums.log_det.is_finite() && log_det_x.is_finite()).then_some(Profile {
        log_det_z: sums.log_det,
        log_det_x,
        rss,
        beta,
        factor,
    })
}

/// `levels` is the number of columns of the realizations, 0 unless they are random.
fn sums(table: &LmmData, random: RandomEffects, ratios: &Ratios, levels: usize) -> Option<Sums> {
    let width = levels + table.columns();
    let mut sums = Sums {
        matrix: SymmetricMatrix::zero(width),
        y: vec![0.0; width],
        yy: 0.0,
        log_det: 0.0,
    };
    // The products of the columns with w and with wx.
    let mut one = vec![0.0; width];
    let mut slope = vec![0.0; width];
    for pattern in &table.patterns {
        let k = pattern.subjects;
        one.fill(0.0);
        slope.fill(0.0);
        let (mut s11, mut s12, mut s22) = (0.0, 0.0, 0.0);
        let (mut sum1, mut sum2) = (0.0, 0.0);
        let mut weights = Vec::with_capacity(pattern.units.len());
        for (unit, &sum) in pattern.units.iter().zip(&pattern.sum) {
            let det = 1.0 + unit.n * ratios.cell;
            if det <= 0.0 {
                return None;
            }
            sums.log_det += k * det.ln();
            let w = unit.n / det;
            weights.push(w);
            s11 += w;
            s12 += w * unit.x;
            s22 += w * unit.x * unit.x;
            sum1 += w * sum;
            sum2 += w * unit.x * sum;
            // A design row has at most three non-zero entries.
            let fixed: [(usize, f64); 2] = match table.fixed {
                FixedEffects::Intercept => [(levels, 1.0), (levels, 0.0)],
                FixedEffects::Covariate { .. } => [(levels, 1.0), (levels + 1, unit.x)],
                FixedEffects::Realizations => [(levels + unit.realization, 1.0), (levels, 0.0)],
            };
            let entries = [
                if levels > 0 {
                    (unit.realization, 1.0)
                } else {
                    (0, 0.0)
                },
                fixed[0],
                fixed[1],
            ];
            for (a, &(i, u)) in entries.iter().enumerate() {
                if u == 0.0 {
                    continue;
                }
                one[i] += w * u;
                slope[i] += w * u * unit.x;
                sums.y[i] += w * u * sum;
                for &(j, v) in &entries[..=a] {
                    if v != 0.0 {
                        sums.matrix.add(i, j, k * w * u * v);
                    }
                }
            }
        }
        let phi = inner(ratios, random, s11, s12, s22)?;
        sums.log_det += k * phi.log_det;
        for i in 0..width {
            let left1 = phi.p11 * one[i] + phi.p12 * slope[i];
            let left2 = phi.p12 * one[i] + phi.p22 * slope[i];
            if left1 == 0.0 && left2 == 0.0 {
                continue;
            }
            sums.y[i] -= left1 * sum1 + left2 * sum2;
            let row = sums.matrix.row_mut(i).iter_mut();
            for ((element, one), slope) in row.zip(&one).zip(&slope) {
                *element -= k * (left1 * one + left2 * slope);
            }
        }
        for row in &pattern.rows {
            let (mut t1, mut t2) = (0.0, 0.0);
            for ((unit, w), y) in pattern.units.iter().zip(&weights).zip(row) {
                sums.yy += w * y * y;
                t1 += w * y;
                t2 += w * unit.x * y;
            }
            sums.yy -= phi.p11 * t1 * t1 + 2.0 * phi.p12 * t1 * t2 + phi.p22 * t2 * t2;
        }
    }
    Some(sums)
}

/// Φ = Γ(I + SΓ)⁻¹, which is symmetric, and log|I + SΓ|.
struct Inner {
    p11: f64,
    p12: f64,
    p22: f64,
    log_det: f64,
}

fn inner(ratios: &Ratios, random: RandomEffects, s11: f64, s12: f64, s22: f64) -> Option<Inner> {
    let (a, b, c) = (ratios.intercept, ratios.slope, ratios.covariance);
    if !random.slope {
        let det = 1.0 + a * s11;
        return (det > 0.0).then(|| Inner {
            p11: a / det,
            p12: 0.0,
            p22: 0.0,
            log_det: det.ln(),
        });
    }
    // |I + SΓ| = 1 + tr SΓ + |S||Γ|; Γ(I + SΓ)⁻¹ = (Γ + |Γ| adj S)/|I + SΓ|.
    let gamma = a * b - c * c;
    let det = 1.0 + a * s11 + 2.0 * c * s12 + b * s22 + gamma * (s11 * s22 - s12 * s12);
    (det > 0.0).then(|| Inner {
        p11: (a + gamma * s22) / det,
        p12: (c - gamma * s12) / det,
        p22: (b + gamma * s11) / det,
        log_det: det.ln(),
    })
}
