//! What a hand finds first: how strong, how far, how tactile.

use crate::identify::repetition::WITHIN;
use crate::model::Realization;

/// Numbers by which stimuli are looked for, of the realization in slow motion, in its own units. Forces
/// are those between the shares [`WITHIN`] of the trained range: at its ends are play and stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feel {
    /// Greatest force of both directions, without its sign.
    pub peak: f64,
    /// Distance of the ends of the trained range.
    pub travel: f64,
    /// The largest fall of the force while the position increases.
    pub tactility: f64,
    /// The same as a share of the greater force before and after it, at most 1.
    pub tactility_share: f64,
}

impl Feel {
    /// The numbers of a realization.
    pub fn of(realization: &Realization) -> Self {
        let [low, high] = realization.trained.x_mm;
        let [from, to] = WITHIN.map(|share| low + share * (high - low));
        let [press, release] = at_rest(realization).map(|mut side| {
            side.retain(|(x, _)| (from..=to).contains(x));
            side
        });
        let forces = || press.iter().chain(&release).map(|(_, f)| f.abs());
        let (mut top, mut tactility, mut share) = (f64::NEG_INFINITY, 0.0, 0.0);
        for (_, f) in &press {
            top = f.max(top);
            let fall = top - f;
            if fall > tactility {
                (tactility, share) = (fall, fall / top.abs().max(f.abs()).max(fall));
            }
        }
        Self {
            peak: forces().fold(0.0, f64::max),
            travel: high - low,
            tactility,
            tactility_share: share,
        }
    }
}

/// Positions and static forces with increasing and with decreasing position, at the nodes.
pub fn at_rest(realization: &Realization) -> [Vec<(f64, f64)>; 2] {
    let r = realization;
    [&r.positive, &r.negative].map(|branch| {
        let stiffness = branch.k_n_per_mm.iter().zip(&branch.f0_n);
        let nodes = r.x_mm.iter().zip(stiffness);
        nodes.map(|(x, (k, f0))| (*x, k * x + f0)).collect()
    })
}
