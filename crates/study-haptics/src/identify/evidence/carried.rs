//! Whether a table takes a term up: whether least squares finds it, and whether it predicts.
//!
//! A table is identified by least squares on velocity and acceleration as they are. It takes a term up if, in the reference model with
//! these as regressors,
//!
//! * the regressor, after everything that the other terms explain is removed, varies by more than its own noise: the reliability
//!   κ = 1 − n σ² / S is at least [`LEAST_RELIABILITY`], with S the remaining sum of squares and σ² the noise of single samples, from third
//!   differences. Least squares finds the share κ of a term;
//! * what remains of the regressor is at least [`LEAST_SHARE`] of it: of strokes that are alike, the speed is a function of position and direction, and
//!   what is left of it says nothing of other speeds;
//! * the estimate is above [`LEAST_RATIO`] standard errors, from the sums over blocks of samples, which are allowed to be correlated;
//! * the blocks are predicted better with the term than without it when they are left out.

use super::equations::{BLOCKS, BORDER, Equations, directions, nodes, plain_rows};
use super::noise;
use crate::recording::Recording;

/// Least reliability of a regressor.
pub(super) const LEAST_RELIABILITY: f64 = 0.8;
/// Least share of the squares of a regressor that the other terms do not explain.
const LEAST_SHARE: f64 = 0.05;
/// Least ratio of an estimate to its standard error.
const LEAST_RATIO: f64 = 3.0;

/// What least squares says of a term.
#[derive(Debug, Clone, Copy)]
pub(super) struct Carried {
    /// The share of the regressor's variance, beside the other terms, that is not its noise: 0 to 1.
    pub(super) reliability: f64,
    /// The share of the regressor's squares that the other terms do not explain.
    share: f64,
    /// Estimate over standard error.
    ratio: f64,
    /// By which share the squared error on blocks left out is larger without the term.
    pub(super) gain: f64,
}

impl Carried {
    /// Whether a table takes it up.
    pub(super) fn is_carried(self) -> bool {
        self.reliability >= LEAST_RELIABILITY
            && self.share >= LEAST_SHARE
            && self.ratio > LEAST_RATIO
            && self.gain > 0.0
    }
}

/// Mass and damping, each beside the other if that one is carried; `None` if the samples do not determine the model.
pub(super) fn of(recordings: &[&Recording], range_mm: [f64; 2]) -> Option<[Carried; 2]> {
    let samples: usize = recordings.iter().map(|r| r.len()).sum();
    let nodes = nodes(recordings, range_mm);
    let reference = directions(range_mm)
        .filter_map(|rule| {
            let rows = plain_rows(recordings, &nodes, rule);
            let equations = Equations::of(rows, samples, nodes.len());
            let x = equations.solve(0, &free(&equations, [true; 2]))?;
            Some((equations.total.error(&x), equations))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?
        .1;
    let noises = [
        noise::of(recordings, |r| &r.a_m_s2),
        noise::of(recordings, |r| &r.v_mm_s),
    ];
    let with = |kept: [bool; 2], term: usize| {
        let noise = samples as f64 * noises[term];
        one(&reference, kept, term, noise)
    };
    super::each_beside_the_other(with, Carried::is_carried, |c| c.reliability * c.ratio)
}

/// Friction may differ at low speed, which would appear as damping; reversals have no column.
fn free(equations: &Equations, kept: [bool; 2]) -> Vec<bool> {
    equations.free(kept, [true, false])
}

/// A term (0: mass, 1: damping) in a model with the kept ones; `noise` is the sum of squares of the noise of its regressor.
fn one(equations: &Equations, kept: [bool; 2], term: usize, noise: f64) -> Option<Carried> {
    let free = free(equations, kept);
    let x = equations.solve(0, &free)?;
    let at = x.len() - BORDER + term;
    let mut unit = vec![0.0; x.len()];
    unit[at] = 1.0;
    let column = equations.total.normal.solve(&unit, &free)?;
    // the contribution of each block to the estimate
    let shifts = equations.blocks.iter().map(|block| {
        let product = block.normal.times(&x);
        let gradient = block.right[0].iter().zip(&product).map(|(r, p)| r - p);
        column.iter().zip(gradient).map(|(c, g)| c * g).sum::<f64>()
    });
    let variance: f64 = shifts.map(|shift| shift * shift).sum();
    let blocks = BLOCKS as f64;
    let mut without = free.clone();
    without[at] = false;
    let [with, without] = [
        equations.error_left_out(&free)?,
        equations.error_left_out(&without)?,
    ];
    Some(Carried {
        reliability: (1.0 - noise * column[at]).clamp(0.0, 1.0),
        share: 1.0 / (column[at] * equations.total.square[1 + term]),
        ratio: x[at] / (variance * blocks / (blocks - 1.0)).sqrt(),
        gain: without / with - 1.0,
    })
}
