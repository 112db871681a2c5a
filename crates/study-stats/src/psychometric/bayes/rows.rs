//! The beta-binomial term of a level, and its table.

use crate::psychometric::Level;

/// Σ_{i<k} ln(ψ + iθ) + Σ_{i<n−k} ln(1 − ψ + iθ) − Σ_{i<n} ln(1 + iθ) with
/// θ = η²/(1 − η²): sums, because differences of lnΓ lose all digits at small θ.
pub(super) fn row_term(k: f64, n: f64, p: f64, theta: f64) -> f64 {
    let sum = |base: f64, count: f64| last_of(base, theta, &[count as usize]);
    sum(p, k) + sum(1.0 - p, n - k) - sum(1.0, n)
}

fn last_of(base: f64, theta: f64, counts: &[usize]) -> f64 {
    let mut value = 0.0;
    partial_sums(base, theta, counts, |_, sum| value = sum);
    value
}

/// Σ_{i<m} ln(base + iθ) for each of the rising `counts`.
fn partial_sums(base: f64, theta: f64, counts: &[usize], mut found: impl FnMut(usize, f64)) {
    let (mut product, mut sum, mut i) = (1.0f64, 0.0, 0usize);
    for (place, count) in counts.iter().enumerate() {
        while i < *count {
            product *= base + i as f64 * theta;
            i += 1;
            if !(1e-200..1e200).contains(&product) {
                sum += product.ln();
                product = 1.0;
            }
        }
        found(place, if i == 0 { 0.0 } else { sum + product.ln() });
    }
}

/// Weights of the nodes i − 1 … i + 2 at i + t: Lagrange's polynomial through them.
pub(super) fn cubic(t: f64) -> [f64; 4] {
    [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -(t + 1.0) * t * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    ]
}

/// Number of values of η of a table.
pub(super) const ETAS: usize = 8;
/// Distance of the nodes in ln(ψ/(1 − ψ)), and their number on each side of 0.
const STEP: f64 = 0.125;
const SIDE: usize = 128;

/// The terms of all levels, as functions of the logit of ψ, for some values of η.
pub(super) struct Table {
    /// By level, then by node.
    nodes: Vec<[f64; ETAS]>,
}

impl Table {
    pub(super) fn new(levels: &[Level], etas: &[f64; ETAS]) -> Self {
        let width = 2 * SIDE + 1;
        let mut counts: Vec<usize> = (levels.iter())
            .flat_map(|l| [l.positive as usize, (l.trials - l.positive) as usize])
            .collect();
        counts.sort_unstable();
        counts.dedup();
        let place = |count: f64| counts.binary_search(&(count as usize)).unwrap_or_default();
        let mut nodes = vec![[0.0; ETAS]; levels.len() * width];
        let mut sums = vec![vec![0.0; counts.len()]; width];
        for (e, eta) in etas.iter().enumerate() {
            let theta = eta * eta / (1.0 - eta * eta);
            for (i, sums) in sums.iter_mut().enumerate() {
                let logit = (i as f64 - SIDE as f64) * STEP;
                let p = 1.0 / (1.0 + (-logit).exp());
                partial_sums(p, theta, &counts, |place, sum| sums[place] = sum);
            }
            for (row, l) in levels.iter().enumerate() {
                let (hits, misses) = (place(l.positive), place(l.trials - l.positive));
                let all = last_of(1.0, theta, &[l.trials as usize]);
                for i in 0..width {
                    // 1 − ψ is ψ at the opposite logit.
                    let term = sums[i][hits] + sums[width - 1 - i][misses] - all;
                    nodes[row * width + i][e] = term;
                }
            }
        }
        Self { nodes }
    }

    /// Adds the terms of level `row` at ψ, by cubic interpolation.
    pub(super) fn add(&self, row: usize, p: f64, to: &mut [f64; ETAS]) {
        let logit = (p / (1.0 - p)).ln();
        let most = SIDE as f64 - 1.001;
        let x = (logit / STEP).clamp(-most, most) + SIDE as f64;
        let i = x as usize;
        let t = x - i as f64;
        let weights = cubic(t);
        let from = row * (2 * SIDE + 1) + i - 1;
        for (node, weight) in self.nodes[from..from + 4].iter().zip(weights) {
            for (sum, value) in to.iter_mut().zip(node) {
                *sum += weight * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand for n = 2, k = 1: ln ψ + ln(1 − ψ) − ln(1 + θ); binomial at θ = 0.
    #[test]
    fn terms_are_beta_binomial() {
        let found = row_term(1.0, 2.0, 0.3, 0.5);
        assert!((found - (0.3f64 * 0.7 / 1.5).ln()).abs() < 1e-14);
        let binomial = 4.0 * 0.3f64.ln() + 3.0 * 0.7f64.ln();
        assert!((row_term(4.0, 7.0, 0.3, 0.0) - binomial).abs() < 1e-13);
        let tiny = row_term(400.0, 700.0, 0.3, 1e-18);
        assert!((tiny - 100.0 * binomial).abs() < 1e-10);
    }

    #[test]
    fn the_table_agrees_with_the_sums() {
        let levels = [(45.0, 90.0), (0.0, 90.0), (87.0, 90.0)].map(|(positive, trials)| Level {
            level: 0.0,
            positive,
            trials,
        });
        let etas = [0.001, 0.01, 0.05, 0.1, 0.2, 0.4, 0.6, 0.9];
        let table = Table::new(&levels, &etas);
        for p in [1e-5, 0.013, 0.37, 0.5, 0.71, 0.93, 0.9999] {
            for (row, l) in levels.iter().enumerate() {
                let mut found = [0.0; ETAS];
                table.add(row, p, &mut found);
                for (eta, found) in etas.iter().zip(found) {
                    let theta = eta * eta / (1.0 - eta * eta);
                    let exact = row_term(l.positive, l.trials, p, theta);
                    assert!((found - exact).abs() < 1e-4, "{p} {eta}: {found} {exact}");
                }
            }
        }
    }
}
