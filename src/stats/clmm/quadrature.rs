//! Adaptive Gauss–Hermite quadrature (Liu & Pierce 1994; Pinheiro & Bates 1995).
//!
//! With the nodes laid about the mode, b_r = b̂ + √2 z_r/√H,
//!
//! ```text
//! ln ∫ e^f db/√(2π) ≈ f(b̂) − ½ ln H + ln Σ_r w_r e^(z_r²) e^(f(b_r) − f(b̂)) / √π
//! ```
//!
//! One node is Laplace's method. The terms, scaled to sum to 1, are the posterior
//! π_r of b; by Fisher's and Louis's (1982) identities, with s the derivative of f
//! in the parameters, the gradient is E s and the Hessian E ∂²f + E ssᵀ − E s E sᵀ.

use super::hermite::Node;
use super::mode::mode;
use crate::stats::clm::counts::Table;
use crate::stats::clm::logistic;
use crate::stats::clm::newton::Point;
use crate::stats::clm::softplus;
use std::f64::consts::{PI, SQRT_2};

/// A node whose share of the integral is smaller adds nothing to a derivative.
const NEGLIGIBLE: f64 = 1e-17;

/// Value, gradient and Hessian of the likelihood at (θ, β, ln σ).
pub(super) fn point(
    table: &Table,
    at: &[f64],
    rule: &[Node],
    modes: &mut [f64],
) -> Option<Point> {
    let size = table.parameters() + 1;
    let tau = size - 1;
    let precision = (-2.0 * at[tau]).exp();
    if !(precision.is_finite() && precision > 0.0) {
        return None;
    }
    let mut point = table.spacing(at, size)?;
    let a = table.linear(at);
    let mut flat = vec![0.0; a.len()];
    let mut curved = vec![0.0; a.len()];
    let mut ln_share = vec![0.0; rule.len()];
    let (mut residual, mut mean_residual) = (Vec::new(), Vec::new());
    let (mut score, mut mean) = (vec![0.0; size], vec![0.0; size]);
    for (terms, start) in table.by_subject().zip(modes) {
        let centre = mode(terms, &a, precision, *start)?;
        *start = centre;
        let mut h = precision;
        for t in terms {
            let f = logistic(a[t.place as usize] - centre);
            h += t.m * f * (1.0 - f);
        }
        let width = SQRT_2 / h.sqrt();
        for (share, node) in ln_share.iter_mut().zip(rule) {
            let b = centre + width * node.z;
            let mut value = node.ln_weight - 0.5 * b * b * precision;
            for t in terms {
                let x = a[t.place as usize] - b;
                value += t.n * x - t.m * softplus(x);
            }
            *share = value;
        }
        let top = ln_share.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let total: f64 = ln_share.iter().map(|s| (s - top).exp()).sum();
        let ln_total = top + total.ln();
        point.value += ln_total - 0.5 * (h * PI).ln() - at[tau];
        mean_residual.clear();
        mean_residual.resize(terms.len(), 0.0);
        mean.fill(0.0);
        for (ln_share, node) in ln_share.iter().zip(rule) {
            let share = (ln_share - ln_total).exp();
            if share < NEGLIGIBLE {
                continue;
            }
            let b = centre + width * node.z;
            residual.clear();
            for (i, t) in terms.iter().enumerate() {
                let place = t.place as usize;
                let f = logistic(a[place] - b);
                let r = t.n - t.m * f;
                residual.push(r);
                mean_residual[i] += share * r;
                curved[place] -= share * t.m * f * (1.0 - f);
            }
            let q = b * b * precision;
            score.fill(0.0);
            table.add_terms(terms, &residual, &mut score);
            score[tau] = q - 1.0;
            for (m, s) in mean.iter_mut().zip(&score) {
                *m += share * s;
            }
            point.hessian.add_outer(share, &score);
            point.hessian.add(tau, tau, -2.0 * share * q);
        }
        for (t, r) in terms.iter().zip(&mean_residual) {
            flat[t.place as usize] += r;
        }
        point.gradient[tau] += mean[tau];
        point.hessian.add_outer(-1.0, &mean);
    }
    table.add_gradient(&flat, &mut point.gradient);
    table.add_hessian(&curved, &mut point.hessian);
    point.value.is_finite().then_some(point)
}
