//! Adaptive Gauss–Hermite quadrature (Liu & Pierce 1994; Pinheiro & Bates 1995).
//!
//! With the nodes placed around the mode, b_r = b̂ + √2 z_r/√H,
//!
//! ```text
//! ln ∫ e^f db/√(2π) ≈ f(b̂) − ½ ln H + ln Σ_r w_r e^(z_r²) e^(f(b_r) − f(b̂)) / √π
//! ```
//!
//! One node is Laplace's method. The terms, scaled to sum to 1, are the posterior
//! π_r of b. By the identities of Fisher and Louis (1982), with s the derivative of f
//! in the parameters, the gradient is E s and the Hessian E ∂²f + E ssᵀ − E s E sᵀ.

use super::common_part;
use super::hermite::Node;
use super::mode::mode;
use crate::clm::counts::{CategoryCounts, Term};
use crate::clm::logistic;
use crate::clm::newton::Evaluation;
use std::f64::consts::{PI, SQRT_2};

/// A node with a smaller share of the integral is left out of the derivatives.
const NEGLIGIBLE: f64 = 1e-17;

/// Value, gradient and Hessian of the log-likelihood at (θ, β, ln σ), with the nodes of
/// `rule`. `modes` are the starting points of the search for the modes, and are updated.
pub(super) fn evaluate(
    table: &CategoryCounts,
    at: &[f64],
    rule: &[Node],
    modes: &mut [f64],
) -> Option<Evaluation> {
    let size = table.parameters() + 1;
    let tau = size - 1;
    let (precision, mut point, a) = common_part(table, at)?;
    let mut first = vec![0.0; a.len()];
    let mut second = vec![0.0; a.len()];
    let mut ln_share = vec![0.0; rule.len()];
    let odds = Odds::of(&a);
    // F of every node and term.
    let mut below_all = Vec::new();
    let (mut residual, mut mean_residual) = (Vec::new(), Vec::new());
    let (mut score, mut mean) = (vec![0.0; size], vec![0.0; size]);
    for (terms, start) in table.by_subject().zip(modes) {
        let center = mode(terms, &a, precision, *start)?;
        *start = center;
        let mut h = precision;
        for t in terms {
            let f = logistic(a[t.place] - center);
            h += t.m * f * (1.0 - f);
        }
        let width = SQRT_2 / h.sqrt();
        let linear: f64 = terms.iter().map(|t| t.n * a[t.place]).sum();
        let successes: f64 = terms.iter().map(|t| t.n).sum();
        below_all.clear();
        for (share, node) in ln_share.iter_mut().zip(rule) {
            let b = center + width * node.z;
            let at_node = odds.at(terms, b, &mut below_all);
            *share = node.ln_weight - 0.5 * b * b * precision + linear - successes * b - at_node;
        }
        let top = ln_share.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let total: f64 = ln_share.iter().map(|s| (s - top).exp()).sum();
        let ln_total = top + total.ln();
        point.value += ln_total - 0.5 * (h * PI).ln() - at[tau];
        mean_residual.clear();
        mean_residual.resize(terms.len(), 0.0);
        mean.fill(0.0);
        for (r, (ln_share, node)) in ln_share.iter().zip(rule).enumerate() {
            let share = (ln_share - ln_total).exp();
            if share < NEGLIGIBLE {
                continue;
            }
            let b = center + width * node.z;
            residual.clear();
            let below = &below_all[r * terms.len()..];
            for (i, (t, &f)) in terms.iter().zip(below).enumerate() {
                let place = t.place;
                let r = t.n - t.m * f;
                residual.push(r);
                mean_residual[i] += share * r;
                second[place] -= share * t.m * f * (1.0 - f);
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
            first[t.place] += r;
        }
        point.gradient[tau] += mean[tau];
        point.hessian.add_outer(-1.0, &mean);
    }
    table.add_gradient(&first, &mut point.gradient);
    table.add_hessian(&second, &mut point.hessian);
    point.value.is_finite().then_some(point)
}

/// e^a of every place, so that e^(a−b) is a product instead of an exponential.
struct Odds<'a> {
    a: &'a [f64],
    exp: Vec<f64>,
    /// Whether their products with a moderate e^−b cannot overflow.
    moderate: bool,
}

/// Largest |a| and |b| whose exponentials are multiplied.
const MODERATE: f64 = 300.0;

impl<'a> Odds<'a> {
    fn of(a: &'a [f64]) -> Self {
        Self {
            a,
            exp: a.iter().map(|a| a.exp()).collect(),
            moderate: a.iter().all(|a| a.abs() < MODERATE),
        }
    }

    /// Σ mₖs(aₖ − b); appends F(aₖ − b) of each term to `below`. With G = max(F, 1 − F),
    /// s(x) = max(x, 0) − ln G; one logarithm of the product of many G suffices.
    fn at(&self, terms: &[Term], b: f64, below: &mut Vec<f64>) -> f64 {
        let shared = (self.moderate && b.abs() < MODERATE).then(|| (-b).exp());
        let (mut sum, mut product) = (0.0, 1.0);
        for t in terms {
            let place = t.place;
            let x = self.a[place] - b;
            let f = match shared {
                Some(e) => {
                    let odds = self.exp[place] * e;
                    odds / (1.0 + odds)
                }
                None => logistic(x),
            };
            below.push(f);
            if x > 0.0 {
                sum += t.m * x;
            }
            let larger = f.max(1.0 - f);
            if t.m <= 8.0 {
                // At least 2^−8 per term.
                for _ in 0..t.m as u32 {
                    product *= larger;
                }
                if product < 1e-200 {
                    sum -= product.ln();
                    product = 1.0;
                }
            } else {
                sum -= t.m * larger.ln();
            }
        }
        sum - product.ln()
    }
}
