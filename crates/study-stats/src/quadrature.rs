//! Nodes and weights of Gauss–Legendre quadrature.

use std::f64::consts::PI;

/// `n` nodes on [low, high] with their weights: the roots of the Legendre polynomial,
/// by Newton's method from cos(π(i − ¼)/(n + ½)). Exact for polynomials up to degree
/// 2n − 1.
pub(crate) fn gauss_legendre(n: usize, low: f64, high: f64) -> Vec<(f64, f64)> {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 1..=n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            let weight = 2.0 / ((1.0 - x * x) * slope * slope);
            (middle - half * x, half * weight)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_integrated_exactly() {
        let integral = |n: usize, f: &dyn Fn(f64) -> f64| -> f64 {
            let nodes = gauss_legendre(n, 0.0, 2.0);
            nodes.iter().map(|(x, w)| w * f(*x)).sum()
        };
        assert!((integral(3, &|x| x.powi(5)) - 64.0 / 6.0).abs() < 1e-12);
        assert!((integral(20, &|x| x.exp()) - (2f64.exp() - 1.0)).abs() < 1e-13);
        let nodes = gauss_legendre(5, -1.0, 1.0);
        assert!(nodes.windows(2).all(|w| w[0].0 < w[1].0));
        assert!((nodes[4].0 - 0.906_179_845_938_664).abs() < 1e-14);
    }
}
