//! Adaptive Gauss–Hermite quadrature over the levels of one factor (Liu & Pierce 1994).
//!
//! As in `clmm/quadrature.rs`: the nodes lie around the mode of each level, u_r = û + √2 z_r/√H, and the
//! terms of the sum, scaled to 1, are the posterior of u, over which the score is averaged (Fisher's
//! identity).

use super::data::{GlmmData, Row};
use super::family::Term;
use crate::clmm::hermite::{Node, rule};
use crate::matrix::dot;
use std::f64::consts::{PI, SQRT_2};

/// Number of nodes.
const NODES: usize = 25;

/// The search for a mode ends when a step is shorter than this share of the width 1/√H.
const PRECISION: f64 = 1e-8;

/// A likelihood of one random factor.
pub(super) struct Adaptive<'a> {
    data: &'a GlmmData,
    /// The rows of each level.
    levels: Vec<Vec<&'a Row>>,
    rule: Vec<Node>,
    modes: Vec<f64>,
}

/// What depends on the parameters, of a level.
struct Level<'a> {
    data: &'a GlmmData,
    rows: &'a [&'a Row],
    fixed: Vec<f64>,
    sd: f64,
    shape: f64,
}

impl<'a> Adaptive<'a> {
    /// Of data with one factor.
    pub(super) fn new(data: &'a GlmmData) -> Self {
        let mut levels = vec![Vec::new(); data.owner.len()];
        for row in &data.rows {
            levels[row.levels[0]].push(row);
        }
        Self {
            data,
            modes: vec![0.0; levels.len()],
            levels,
            rule: rule(NODES),
        }
    }

    /// The log-likelihood and its gradient; `None` if the parameters are not admissible.
    pub(super) fn gradient(&mut self, at: &[f64]) -> Option<(f64, Vec<f64>)> {
        let data = self.data;
        let (beta, sd, shape) = data.parts(at);
        let p = beta.len();
        let (mut value, by_shape) = data.common(shape);
        let mut gradient = vec![0.0; at.len()];
        for (rows, mode) in self.levels.iter().zip(&mut self.modes) {
            let level = Level {
                data,
                rows,
                fixed: rows.iter().map(|row| dot(&row.x, beta)).collect(),
                sd: sd[0],
                shape,
            };
            let (center, h) = level.mode(*mode)?;
            *mode = center;
            let width = SQRT_2 / h.sqrt();
            let nodes: Vec<f64> = self.rule.iter().map(|n| center + width * n.z).collect();
            let terms: Vec<Vec<Term>> = nodes.iter().map(|&u| level.terms(u)).collect();
            let weighed = |((u, terms), node): ((&f64, &Vec<Term>), &Node)| {
                node.ln_weight - 0.5 * u * u + terms.iter().map(|t| t.value).sum::<f64>()
            };
            let logs: Vec<f64> = (nodes.iter().zip(&terms).zip(&self.rule))
                .map(weighed)
                .collect();
            let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let total = top + logs.iter().map(|l| (l - top).exp()).sum::<f64>().ln();
            value += total - 0.5 * (h * PI).ln();
            for ((u, terms), log) in nodes.iter().zip(&terms).zip(&logs) {
                let share = (log - total).exp();
                for (row, term) in rows.iter().zip(terms) {
                    for (g, x) in gradient.iter_mut().zip(&row.x) {
                        *g += share * term.score * x;
                    }
                    gradient[p] += share * term.score * u;
                    if let Some(last) = gradient.get_mut(p + 1) {
                        *last += share * term.value;
                    }
                }
            }
        }
        if let Some(last) = gradient.get_mut(p + 1) {
            *last += by_shape;
        }
        let finite = value.is_finite() && gradient.iter().all(|g| g.is_finite());
        finite.then_some((value, gradient))
    }
}

impl Level<'_> {
    fn terms(&self, u: f64) -> Vec<Term> {
        let family = self.data.family;
        let rows = self.rows.iter().zip(&self.fixed);
        rows.map(|(row, eta)| family.term(row.sums, eta + self.sd * u, self.shape))
            .collect()
    }

    /// The mode and the curvature there, by Newton's method with halved steps.
    fn mode(&self, start: f64) -> Option<(f64, f64)> {
        let f = |u: f64| {
            let terms = self.terms(u);
            let value = terms.iter().map(|t| t.value).sum::<f64>() - 0.5 * u * u;
            let slope = terms.iter().map(|t| self.sd * t.score).sum::<f64>() - u;
            let weight: f64 = terms.iter().map(|t| t.weight).sum();
            (value, slope, 1.0 + self.sd * self.sd * weight)
        };
        let mut u = if f(start).0.is_finite() { start } else { 0.0 };
        let (mut value, mut slope, mut h) = f(u);
        for _ in 0..200 {
            let step = slope / h;
            if !(value.is_finite() && step.is_finite()) {
                return None;
            }
            let last = step.abs() * h.sqrt() < PRECISION;
            let mut share = 1.0;
            loop {
                let next = f(u + share * step);
                if last || next.0 >= value || share < 1e-8 {
                    u += share * step;
                    (value, slope, h) = next;
                    break;
                }
                share *= 0.5;
            }
            if last {
                return h.is_finite().then_some((u, h));
            }
        }
        None
    }
}
