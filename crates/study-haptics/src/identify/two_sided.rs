//! Weighted least squares around each node, with samples on both sides of it.
//!
//! A recursion along x uses only the samples behind it, so its table lags by its
//! memory L. Here the weights decrease with the distance from the node to both sides.
//! Exponential weights e^(−|x − node|/L) are the sum of a forward and a backward EWLS,
//! so λ has the same meaning, L = 1/((1 − λ)ρ). Tricube weights (1 − |u|³)³,
//! u = (x − node)/(3L), have a finite support.
//!
//! φ = [a v (x − node) 1], so the solution contains k and the force at the node for
//! any origin of x, and F0 = F − k·node. The prior is that of EWLS, 10⁻⁶ I. Reversing
//! the order of the samples does not change the table.

use super::constrained;
use super::method::{self, Declared, Estimator, Opt, Options, Setting, Terms, Window};
use super::resample::{self, Resampled};
use super::samples::{INITIAL_COVARIANCE, Samples, Theta};
use super::{Cause, Identified, IdentifyError, Training};
use crate::model::Provenance;
use std::fmt;

/// Support of tricube weights in multiples of L; the effective width is then about
/// that of exponential weights.
const TRICUBE_SUPPORT: f64 = 3.0;

/// Least sum of weights for four parameters: two samples each.
pub(super) const MIN_WEIGHT: f64 = 8.0;

/// Options of two-sided least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoSided {
    /// Shape of the weights.
    pub window: Window,
    /// Width L of the weights.
    pub width: Width,
    /// Whether m, b ≥ 0 at every node.
    pub bounded: bool,
    /// The terms that are estimated.
    pub terms: Terms,
}

/// The width L of two-sided weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Width {
    /// The memory of EWLS with this λ: L = 1 / ((1 − λ) ρ), with the sample density ρ
    /// of each direction.
    Lambda(f64),
    /// A length, mm.
    Mm(f64),
}

impl Estimator for TwoSided {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let (options, dx_mm) = (*self, setting.dx_mm);
        let nodes = training.nodes(dx_mm)?;
        let [l_plus, l_minus] = training.directions().map(|samples| match options.width {
            Width::Mm(mm) => Ok(mm),
            Width::Lambda(lambda) => {
                (samples.memory_mm(lambda)).ok_or(IdentifyError::Lambda(lambda))
            }
        });
        let (l_plus, l_minus) = (l_plus?, l_minus?);
        let estimate = |samples: &Samples, width_mm| {
            let of = (options.bounded, options.terms);
            at_nodes(samples, &nodes, options.window, width_mm, of)
                .ok_or(IdentifyError::Narrow { width_mm })
        };
        let positive = estimate(&training.positive, l_plus)?;
        let negative = estimate(&training.negative, l_minus)?;
        let mut identified =
            training.table(nodes, positive, negative, Cause::FewSamples, setting.lookup);
        identified.realization.provenance = Provenance {
            lambda: self.lambda(),
            memory_mm: Some(l_plus.min(l_minus)),
            dx_mm: Some(dx_mm),
            ..training.provenance(options)
        };
        Ok(identified)
    }

    fn check(&self) -> Result<(), IdentifyError> {
        match self.width {
            Width::Mm(mm) => method::positive("the width of two-sided weights", mm),
            // without forgetting there would be a single θ for all positions
            Width::Lambda(1.0) => Err(IdentifyError::Lambda(1.0)),
            Width::Lambda(lambda) => method::forgetting(lambda),
        }
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " window={}", self.window.as_str())?;
        if let Width::Mm(mm) = self.width {
            write!(f, " width={mm}")?;
        }
        f.write_str(if self.bounded { " m,b>=0" } else { "" })?;
        self.terms.write(f, true)
    }

    fn lambda(&self) -> Option<f64> {
        match self.width {
            Width::Lambda(lambda) => Some(lambda),
            Width::Mm(_) => None,
        }
    }

    fn terms_mut(&mut self) -> Option<&mut Terms> {
        Some(&mut self.terms)
    }

    fn id_template(&self, _several_deltas: bool) -> String {
        match self.width {
            Width::Lambda(_) => "two-sided-{lambda}-dx-{dx}".to_owned(),
            Width::Mm(_) => "two-sided-dx-{dx}".to_owned(),
        }
    }
}

impl Declared for TwoSided {
    const NAMES: &'static [(&'static str, &'static str)] =
        &[("two-sided", "Weighted least squares around each node")];
    const OPTIONS: &'static [Opt] = &[
        Opt::Lambda,
        Opt::Dx,
        Opt::Window,
        Opt::Width,
        Opt::Terms,
        Opt::Stiffness,
        Opt::Bounds,
    ];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        let of = |width| Self {
            window: options.window.unwrap_or(Window::Tricube),
            width,
            bounded: options.bounds.unwrap_or(false),
            terms: options.kept(),
        };
        match options.width_mm {
            Some(mm) => vec![of(Width::Mm(mm))],
            None => options.each_lambda(|lambda| of(Width::Lambda(lambda))),
        }
    }
}

/// θ at the nodes from the samples of one direction, with weights of width `l_mm`.
/// Nodes with too few samples around them are interpolated between their neighbors;
/// `None` if all nodes have too few.
pub fn at_nodes(
    samples: &Samples,
    nodes: &[f64],
    window: Window,
    l_mm: f64,
    (bounded, terms): (bool, Terms),
) -> Option<Resampled> {
    let around = match window {
        Window::Exponential => exponential(samples, nodes, l_mm),
        Window::Tricube => tricube(samples, nodes, TRICUBE_SUPPORT * l_mm),
    };
    let own: Vec<Option<Theta>> = nodes
        .iter()
        .zip(&around)
        .map(|(node, sums)| {
            let [m, b, k, force] = sums.with(terms).solve(bounded)?;
            Some([m, b, k, force - k * node])
        })
        .collect();
    resample::filled(nodes, &own)
}

/// The normal equations around a position.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Σ w φ φᵀ, both triangles; its last entry is Σ w.
    r: [[f64; 4]; 4],
    /// Σ w φ F.
    y: [f64; 4],
}

impl Sums {
    /// Adds sample `i` of `samples`, with x relative to `origin_mm`.
    fn add(&mut self, samples: &Samples, i: usize, origin_mm: f64, weight: f64) {
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

    /// The same samples with the origin moved by `by_mm` and weights times `factor`.
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

    /// Only the terms that are estimated: the prior keeps the others at 0.
    fn with(mut self, terms: Terms) -> Self {
        let left_out = (terms.kept().into_iter().enumerate()).filter(|(_, kept)| !kept);
        for (i, _) in left_out {
            self.r[i] = [0.0; 4];
            self.r.iter_mut().for_each(|row| row[i] = 0.0);
            self.y[i] = 0.0;
        }
        self
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

    /// [m b k F] with F the force at the origin; `None` if there are too few samples.
    fn solve(&self, bounded: bool) -> Option<Theta> {
        if self.r[3][3] < MIN_WEIGHT {
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

/// (R + I/[`INITIAL_COVARIANCE`])⁻¹ by Gauss–Jordan elimination on the scaled matrix;
/// `None` if it is singular.
fn inverse(r: &[[f64; 4]; 4]) -> Option<[[f64; 4]; 4]> {
    let scale: [f64; 4] =
        std::array::from_fn(|i| (r[i][i] + 1.0 / INITIAL_COVARIANCE).sqrt().recip());
    let mut left: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| r[i][j] * scale[i] * scale[j]));
    let mut right = [[0.0; 4]; 4];
    for i in 0..4 {
        left[i][i] = 1.0;
        right[i][i] = 1.0;
    }
    // positive definite with unit diagonal: no pivoting needed
    for p in 0..4 {
        let pivot = left[p][p];
        // false for NaN
        let regular = pivot > 1e-14;
        if !regular {
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

/// Sums with exponential weights at each node: one pass up and one down, each node's
/// sums following from its neighbor's.
fn exponential(samples: &Samples, nodes: &[f64], l_mm: f64) -> Vec<Sums> {
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

/// Sums with tricube weights at each node, which end at `reach_mm`.
fn tricube(samples: &Samples, nodes: &[f64], reach_mm: f64) -> Vec<Sums> {
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
    use crate::identify::Ewls;
    use crate::identify::ewls;

    /// Samples of a nonlinear force, 100 per mm.
    fn samples() -> Samples {
        let mut s = Samples::default();
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

    /// The samples of a probe with the opposite axis and its origin at the other end.
    fn mirrored(s: &Samples) -> Samples {
        let minus = |column: &[f64]| column.iter().rev().map(|p| 0.0 - p).collect();
        Samples {
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
                let here =
                    at_nodes(&samples(), &nodes, window, 0.8, (bounded, Terms::default())).unwrap();
                let there = at_nodes(
                    &mirrored(&samples()),
                    &nodes,
                    window,
                    0.8,
                    (bounded, Terms::default()),
                )
                .unwrap();
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

    /// All samples lie below the node, so the forward pass is all there is.
    #[test]
    fn at_the_upper_end_exponential_weights_are_those_of_ewls() {
        let s = samples();
        // the last of the samples, 100 per mm
        let node = s.x_mm[1999];
        let lambda: f64 = 0.99;
        let options = Ewls::paper(lambda, resample::Resample::Point);
        let recursion = *ewls::estimate(&s, &options, false).last().unwrap();
        let l_mm = -0.01 / lambda.ln();
        let both = at_nodes(
            &s,
            &[node],
            Window::Exponential,
            l_mm,
            (false, Terms::default()),
        )
        .unwrap();
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
            let at = at_nodes(
                &s,
                &[3.0, 10.0, 17.0],
                window,
                0.3,
                (false, Terms::default()),
            )
            .unwrap();
            assert_eq!(at.filled, 1, "{window:?}");
            let middle = 0.5 * (at.theta[0][3] + at.theta[2][3]);
            assert!((at.theta[1][3] - middle).abs() < 1e-12);
            assert!(at_nodes(&s, &[10.0], window, 0.3, (false, Terms::default())).is_none());
        }
    }
}
