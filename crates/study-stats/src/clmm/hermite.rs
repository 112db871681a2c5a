//! Nodes and weights of Gauss–Hermite quadrature.
//!
//! The nodes are the eigenvalues of the Jacobi matrix with a zero diagonal and the
//! off-diagonal elements √(k/2) (Golub & Welsch 1969), separated by bisection with Sturm
//! sequences and found by Newton's method. The weights are Christoffel's, 1/Σ p_k(z)² over the orthonormal
//! polynomials, which are accurate also for the smallest weights.

use std::f64::consts::PI;

/// A node with the logarithm of its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node {
    /// Node of ∫ e^(−z²) g(z) dz.
    pub(crate) z: f64,
    /// ln w + z²: logarithm of the weight in ∫ h(z) dz.
    pub(crate) ln_weight: f64,
}

/// The rule with n nodes, ascending; exact for polynomials up to degree 2n − 1.
pub(crate) fn rule(n: usize) -> Vec<Node> {
    let node = |z| Node {
        z,
        ln_weight: ln_weight(n, z),
    };
    let mut nodes: Vec<Node> = (0..n / 2).map(|i| node(root(n, i))).collect();
    if n % 2 == 1 {
        nodes.push(node(0.0));
    }
    for i in (0..n / 2).rev() {
        let twin = nodes[i];
        nodes.push(Node { z: -twin.z, ..twin });
    }
    nodes
}

/// The i-th root, ascending.
fn root(n: usize, i: usize) -> f64 {
    // All roots lie within ±√(2n).
    let (mut low, mut high) = (-(2.0 * n as f64).sqrt() - 1.0, 0.0);
    // The smallest distance of two roots is above π/√(2n + 1).
    let alone = 0.1 / (2.0 * n as f64 + 1.0).sqrt();
    while high - low > alone {
        let middle = 0.5 * (low + high);
        if roots_below(n, middle) > i {
            high = middle;
        } else {
            low = middle;
        }
    }
    let mut z = 0.5 * (low + high);
    for _ in 0..6 {
        z -= step(n, z);
    }
    z
}

/// Newton's step pₙ/pₙ′ at z, with pₙ′ = √(2n) pₙ₋₁.
fn step(n: usize, z: f64) -> f64 {
    let (mut before, mut value) = (0.0, 1.0);
    for k in 0..n {
        (before, value) = (value, next(k, z, value, before));
    }
    value / ((2.0 * n as f64).sqrt() * before)
}

/// pₖ₊₁ from pₖ and pₖ₋₁, orthonormal polynomials.
fn next(k: usize, z: f64, value: f64, before: f64) -> f64 {
    let k = k as f64;
    (2.0 / (k + 1.0)).sqrt() * z * value - (k / (k + 1.0)).sqrt() * before
}

/// Number of eigenvalues below x: that of the negative pivots of J − xI (Sturm).
fn roots_below(n: usize, x: f64) -> usize {
    let mut pivot = 1.0;
    let mut negative = 0;
    for k in 0..n {
        pivot = -x - if k == 0 { 0.0 } else { 0.5 * k as f64 / pivot };
        if pivot == 0.0 {
            pivot = -1e-300;
        }
        if pivot < 0.0 {
            negative += 1;
        }
    }
    negative
}

/// −ln Σ (p_k(z) e^(−z²/2))², k < n: Hermite functions by their recurrence.
fn ln_weight(n: usize, z: f64) -> f64 {
    let mut before = 0.0;
    let mut value = PI.powf(-0.25) * (-0.5 * z * z).exp();
    let mut sum = 0.0;
    for k in 0..n {
        sum += value * value;
        (before, value) = (value, next(k, z, value, before));
    }
    -sum.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ z^2k e^(−z²) dz = Γ(k + ½).
    #[test]
    fn a_rule_integrates_powers_exactly() {
        for n in [1, 2, 7, 12, 60] {
            let nodes = rule(n);
            assert_eq!(nodes.len(), n);
            assert!(nodes.windows(2).all(|w| w[0].z < w[1].z));
            for k in 0..n.min(30) {
                let sum: f64 = nodes
                    .iter()
                    .map(|v| (v.ln_weight - v.z * v.z).exp() * v.z.powi(2 * k as i32))
                    .sum();
                let exact = statrs::function::gamma::gamma(k as f64 + 0.5);
                assert!((sum / exact - 1.0).abs() < 1e-12, "{n} {k}: {sum} {exact}");
            }
        }
    }

    /// Abramowitz & Stegun (1964), table 25.10, n = 5.
    #[test]
    fn five_nodes_agree_with_printed_tables() {
        let nodes = rule(5);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        near(nodes[4].z, 2.020_182_870_456);
        near(nodes[3].z, 0.958_572_464_614);
        near(nodes[2].z, 0.0);
        near(nodes[2].ln_weight.exp(), 0.945_308_720_483);
        near(nodes[3].ln_weight.exp(), 0.986_580_996_751);
    }
}
