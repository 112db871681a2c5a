//! Least squares around each node, with samples on both sides of it.
//!
//! A recursion that passes along x knows only what lies behind it, so its table
//! lags by its memory L. Here the weights fall with the distance from the node to
//! both sides. Exponential weights e^(−|x − node|/L) are what an EWLS forward and
//! one backward sum up to, so that λ means what it means there, L = 1/((1 − λ)ρ).
//! Tricube weights (1 − |u|³)³, u = (x − node)/(3L), end.
//!
//! φ = [a v (x − node) 1], so k and the force at the node come out directly,
//! whatever the origin of x, and F0 = F − k·node. The prior is that of EWLS, 10⁻⁶ I.
//! Passed in the other direction, the same samples give the same table.

use super::constrained;
use super::ewls::{START, Sorted, Theta};
use super::method::Window;
use super::resample::{self, Resampled};

/// Tricube weights end at so many L: they then hold the samples about as close as
/// exponential ones.
const TRICUBE_REACH: f64 = 3.0;

/// Sum of weights that four parameters rest on: two samples each.
pub(super) const LEAST_WEIGHT: f64 = 8.0;

/// θ at the nodes from samples of one direction, those with too little around them
/// filled from their neighbours; `None` if all have.
pub fn at_nodes(
    samples: &Sorted,
    nodes: &[f64],
    window: Window,
    l_mm: f64,
    bounded: bool,
) -> Option<Resampled> {
    let around = match window {
        Window::Exponential => exponential(samples, nodes, l_mm),
        Window::Tricube => tricube(samples, nodes, TRICUBE_REACH * l_mm),
    };
    let own: Vec<Option<Theta>> = nodes
        .iter()
        .zip(&around)
        .map(|(node, sums)| {
            let [m, b, k, force] = sums.solve(bounded)?;
            Some([m, b, k, force - k * node])
        })
        .collect();
    resample::filled(nodes, &own)
}

/// Σ w φ φᵀ, whose last entry is Σ w, and Σ w φ F around a place.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Both triangles.
    r: [[f64; 4]; 4],
    y: [f64; 4],
}

impl Sums {
    /// Takes in sample `i` of `samples`, seen from `origin_mm`.
    fn add(&mut self, samples: &Sorted, i: usize, origin_mm: f64, weight: f64) {
        let phi = [
            samples.a_m_s2[i],
            samples.v_mm_s[i],
            samples.x_mm[i] - origin_mm,
            1.0,
        ];
        for (row, p) in self.r.iter_mut().zip(phi) {
            for (r, q) in row.iter_mut().zip(phi) {
                *r += weight * p * q;
            }
        }
        for (y, p) in self.y.iter_mut().zip(phi) {
            *y += weight * p * samples.f_n[i];
        }
    }

    /// The same samples with weights `factor` times, seen from `by_mm` further on.
    fn moved(mut self, by_mm: f64, factor: f64) -> Self {
        for j in 0..4 {
            self.r[2][j] -= by_mm * self.r[3][j];
        }
        for i in 0..4 {
            self.r[i][2] -= by_mm * self.r[i][3];
        }
        self.y[2] -= by_mm * self.y[3];
        self.scaled(factor)
    }

    fn scaled(mut self, factor: f64) -> Self {
        for value in self.r.iter_mut().flatten().chain(&mut self.y) {
            *value *= factor;
        }
        self
    }

    fn plus(mut self, other: &Self) -> Self {
        let others = other.r.iter().flatten().chain(&other.y);
        for (value, more) in self.r.iter_mut().flatten().chain(&mut self.y).zip(others) {
            *value += more;
        }
        self
    }

    /// [m b k F], F the force at the origin; `None` if it rests on too little.
    fn solve(&self, bounded: bool) -> Option<Theta> {
        if self.r[3][3] < LEAST_WEIGHT {
            return None;
        }
        let p = inverse(&self.r)?;
        let theta: Theta =
            std::array::from_fn(|i| p[i].iter().zip(&self.y).map(|(p, y)| p * y).sum());
        if !theta.iter().all(|p| p.is_finite()) {
            return None;
        }
        // P is symmetric: its rows are its columns
        Some(if bounded {
            constrained::bounded(theta, p[0], p[1])
        } else {
            theta
        })
    }
}

/// (R + I/START)⁻¹ by Gauss–Jordan on the scaled matrix; `None` if it has no rank.
fn inverse(r: &[[f64; 4]; 4]) -> Option<[[f64; 4]; 4]> {
    let scale: [f64; 4] = std::array::from_fn(|i| (r[i][i] + 1.0 / START).sqrt().recip());
    let mut left: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| r[i][j] * scale[i] * scale[j]));
    let mut right = [[0.0; 4]; 4];
    for i in 0..4 {
        left[i][i] = 1.0;
        right[i][i] = 1.0;
    }
    // positive definite with a diagonal of ones: no pivoting needed
    for p in 0..4 {
        let pivot = left[p][p];
        // false for a NaN
        let has_rank = pivot > 1e-14;
        if !has_rank {
            return None;
        }
        let (row, unit) = (
            left[p].map(|value| value / pivot),
            right[p].map(|value| value / pivot),
        );
        for q in 0..4 {
            let factor = if q == p { 0.0 } else { left[q][p] };
            for j in 0..4 {
                left[q][j] -= factor * row[j];
                right[q][j] -= factor * unit[j];
            }
        }
        (left[p], right[p]) = (row, unit);
    }
    Some(std::array::from_fn(|i| {
        std::array::from_fn(|j| right[i][j] * scale[i] * scale[j])
    }))
}

/// One pass up and one down: each node's sums come from its neighbour's.
fn exponential(samples: &Sorted, nodes: &[f64], l_mm: f64) -> Vec<Sums> {
    let mut around: Vec<Sums> = Vec::with_capacity(nodes.len());
    let mut sums = Sums::default();
    let mut i = 0;
    let mut last = nodes[0];
    for node in nodes {
        sums = sums.moved(node - last, (-(node - last) / l_mm).exp());
        last = *node;
        while i < samples.len() && samples.x_mm[i] <= *node {
            let weight = (-(node - samples.x_mm[i]) / l_mm).exp();
            sums.add(samples, i, *node, weight);
            i += 1;
        }
        around.push(sums);
    }
    sums = Sums::default();
    i = samples.len();
    for (node, below) in nodes.iter().zip(&mut around).rev() {
        sums = sums.moved(node - last, (-(last - node) / l_mm).exp());
        last = *node;
        while i > 0 && samples.x_mm[i - 1] > *node {
            i -= 1;
            let weight = (-(samples.x_mm[i] - node) / l_mm).exp();
            sums.add(samples, i, *node, weight);
        }
        *below = below.plus(&sums);
    }
    around
}

fn tricube(samples: &Sorted, nodes: &[f64], reach_mm: f64) -> Vec<Sums> {
    let x = &samples.x_mm;
    nodes
        .iter()
        .map(|node| {
            let first = x.partition_point(|x| *x <= node - reach_mm);
            let end = x.partition_point(|x| *x < node + reach_mm);
            let mut sums = Sums::default();
            for (i, x) in x.iter().enumerate().take(end).skip(first) {
                let u = ((x - node) / reach_mm).abs();
                let bow = (1.0 - u * u * u).max(0.0);
                sums.add(samples, i, *node, bow * bow * bow);
            }
            sums
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::ewls;

    /// Samples of a force that no straight line fits, 100 per mm.
    fn samples() -> Sorted {
        let mut s = Sorted::default();
        for i in 0..2000 {
            let i = f64::from(i);
            let (x, v, a) = (0.01 * i, 20.0 + 7.0 * (1.3 * i).sin(), (0.7 * i).cos());
            s.x_mm.push(x);
            s.v_mm_s.push(v);
            s.a_m_s2.push(a);
            s.f_n.push(0.2 * a + 0.01 * v + 3.0 * (0.4 * x).sin());
        }
        s
    }

    /// What a probe that moved in the other direction measures, origin at the
    /// other end.
    fn mirrored(s: &Sorted) -> Sorted {
        let minus = |column: &[f64]| column.iter().rev().map(|p| 0.0 - p).collect();
        Sorted {
            x_mm: s.x_mm.iter().rev().map(|x| 20.0 - x).collect(),
            v_mm_s: minus(&s.v_mm_s),
            a_m_s2: minus(&s.a_m_s2),
            f_n: minus(&s.f_n),
        }
    }

    fn force(at: &Resampled, node: usize, x_mm: f64) -> f64 {
        at.theta[node][2] * x_mm + at.theta[node][3]
    }

    #[test]
    fn a_reversal_of_the_axis_reverses_the_table_and_nothing_else() {
        let nodes: Vec<f64> = (0..=20).map(f64::from).collect();
        for window in [Window::Exponential, Window::Tricube] {
            for bounded in [false, true] {
                let here = at_nodes(&samples(), &nodes, window, 0.8, bounded).unwrap();
                let there = at_nodes(&mirrored(&samples()), &nodes, window, 0.8, bounded).unwrap();
                for (j, node) in nodes.iter().enumerate() {
                    let (t, u) = (here.theta[j], there.theta[20 - j]);
                    for i in 0..3 {
                        assert!((t[i] - u[i]).abs() < 1e-9, "{window:?} {t:?} {u:?}");
                    }
                    let (f, g) = (force(&here, j, *node), force(&there, 20 - j, 20.0 - node));
                    assert!((f + g).abs() < 1e-9, "{f} {g}");
                }
            }
        }
    }

    /// A recursion over samples that all lie below the node is the forward half.
    #[test]
    fn at_the_upper_end_exponential_weights_are_those_of_ewls() {
        let s = samples();
        // the last of the samples, 100 per mm
        let node = s.x_mm[1999];
        let lambda: f64 = 0.99;
        let recursion = *ewls::estimate(&s, lambda).last().unwrap();
        let l_mm = -0.01 / lambda.ln();
        let both = at_nodes(&s, &[node], Window::Exponential, l_mm, false).unwrap();
        for (one, other) in both.theta[0].iter().zip(recursion) {
            assert!((one - other).abs() < 1e-5, "{both:?} {recursion:?}");
        }
    }

    #[test]
    fn a_node_far_from_all_samples_is_filled_and_counted() {
        let mut s = samples();
        // 5 to 15 mm are missing
        let keep: Vec<bool> = s.x_mm.iter().map(|x| *x < 5.0 || *x > 15.0).collect();
        for column in [&mut s.x_mm, &mut s.v_mm_s, &mut s.a_m_s2, &mut s.f_n] {
            let mut kept = keep.iter();
            column.retain(|_| *kept.next().unwrap());
        }
        for window in [Window::Exponential, Window::Tricube] {
            let at = at_nodes(&s, &[3.0, 10.0, 17.0], window, 0.3, false).unwrap();
            assert_eq!(at.empty, 1, "{window:?}");
            let middle = 0.5 * (at.theta[0][3] + at.theta[2][3]);
            assert!((at.theta[1][3] - middle).abs() < 1e-12);
            assert!(at_nodes(&s, &[10.0], window, 0.3, false).is_none());
        }
    }
}
