//! Laplace's method with exact first and second derivatives.
//!
//! A subject contributes l = f(b̂) − ½ ln H, with f a function of b and φ = (θ, β,
//! τ = ln σ). With subscripts for partial derivatives at the mode, v = f_bφ/H = ∂b̂/∂φ, u = f_bbφ,
//! t = f_bbbφ, w = u + f_bbb v = −∂H/∂φ. Differentiating f_b(b̂(φ), φ) = 0 once and
//! twice,
//!
//! ```text
//! ∂l  = f_φ + ½ w/H
//! ∂²l = f_φφ + ½/H · (f_bbφφ + f_bbb/H · f_bφφ) + vyᵀ + yvᵀ + ½ wwᵀ/H²
//! y   = ½Hv + ½/H · (t + ½ f_bbbb v + f_bbb/H · (u + ½ f_bbb v))
//! ```
//!
//! The matrices f_φφ, f_bφφ, f_bbφφ are sums over the terms, so their weights are
//! accumulated by place over all subjects before the matrices are formed.

use super::common_part;
use super::mode::mode;
use crate::clm::counts::{CategoryCounts, Term};
use crate::clm::newton::Evaluation;
use crate::clm::{logistic, softplus};

/// Derivatives of the terms of one subject at its mode.
#[derive(Default)]
struct Weights {
    first: Vec<f64>,
    second: Vec<f64>,
    third: Vec<f64>,
    fourth: Vec<f64>,
}

/// Value, gradient and Hessian of the approximate log-likelihood at (θ, β, ln σ). `modes`
/// are the starting points of the search for the modes, and are updated.
pub(super) fn evaluate(
    table: &CategoryCounts,
    at: &[f64],
    modes: &mut [f64],
) -> Option<Evaluation> {
    let size = table.parameters() + 1;
    let (precision, mut point, a) = common_part(table, at)?;
    let mut first = vec![0.0; a.len()];
    let mut second = vec![0.0; a.len()];
    let mut k = Weights::default();
    let (mut v, mut u, mut t) = (vec![0.0; size], vec![0.0; size], vec![0.0; size]);
    let (mut y, mut w) = (vec![0.0; size], vec![0.0; size]);
    for (terms, start) in table.by_subject().zip(modes) {
        let b = mode(terms, &a, precision, *start)?;
        *start = b;
        let q = b * b * precision;
        let (value, sums) = k.set(terms, &a, b);
        let h = precision - sums[0];
        let (bbb, bbbb) = (-sums[1], sums[2]);
        point.value += value - 0.5 * q - at[size - 1] - 0.5 * h.ln();
        for (vector, weights) in [(&mut v, &k.second), (&mut u, &k.third), (&mut t, &k.fourth)] {
            vector.fill(0.0);
            table.add_terms(terms, weights, vector);
        }
        let tau = size - 1;
        v.iter_mut().for_each(|x| *x = -*x / h);
        t.iter_mut().for_each(|x| *x = -*x);
        v[tau] = 2.0 * b * precision / h;
        u[tau] = 2.0 * precision;
        for i in 0..size {
            w[i] = u[i] + bbb * v[i];
            let inner = u[i] + 0.5 * bbb * v[i];
            y[i] = 0.5 * h * v[i] + 0.5 / h * (t[i] + 0.5 * bbbb * v[i] + bbb / h * inner);
            point.gradient[i] += 0.5 * w[i] / h;
        }
        point.gradient[tau] += q - 1.0;
        for (i, term) in terms.iter().enumerate() {
            let place = term.place;
            first[place] += k.first[i];
            second[place] += k.second[i] + 0.5 / h * (k.fourth[i] - bbb / h * k.third[i]);
        }
        point.hessian.add_mixed(&v, &y);
        point.hessian.add_outer(0.5 / (h * h), &w);
        let own = -2.0 * q - 0.5 / h * (4.0 * precision + bbb / h * 4.0 * b * precision);
        point.hessian.add(tau, tau, own);
    }
    table.add_gradient(&first, &mut point.gradient);
    table.add_hessian(&second, &mut point.hessian);
    point.value.is_finite().then_some(point)
}

impl Weights {
    /// Sets the first four derivatives of each term in a. Returns the value without the
    /// prior, and the sums of the second to fourth derivatives.
    fn set(&mut self, terms: &[Term], a: &[f64], b: f64) -> (f64, [f64; 3]) {
        for list in [
            &mut self.first,
            &mut self.second,
            &mut self.third,
            &mut self.fourth,
        ] {
            list.clear();
        }
        let (mut value, mut sums) = (0.0, [0.0; 3]);
        for term in terms {
            let x = a[term.place] - b;
            let f = logistic(x);
            let spread = f * (1.0 - f);
            value += term.n * x - term.m * softplus(x);
            let second = -term.m * spread;
            let third = second * (1.0 - 2.0 * f);
            let fourth = second * (1.0 - 6.0 * spread);
            sums[0] += second;
            sums[1] += third;
            sums[2] += fourth;
            self.first.push(term.n - term.m * f);
            self.second.push(second);
            self.third.push(third);
            self.fourth.push(fourth);
        }
        (value, sums)
    }
}
