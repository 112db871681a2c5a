//! The hat table: all nodes of both directions at once, by penalized least squares.
//!
//! F = Σ_j h_j(x) (m_j a + b_j v + F_j) for each direction, combined with the weights
//! (1 ± z)/2, is exactly what [`study_wire::predict`] computes from the table: h_j is
//! the look-up, z the direction state, k = 0 and F0 = F_j. The table is therefore the
//! least-squares solution for the predicted force itself. The problem is linear in
//! the table; δ of the direction state is found by a scan.
//!
//! The cost is the squared error plus, in units of a node's mean information, ridge
//! penalties on second differences of F_j (curvature) and on first differences of m_j
//! and 60·b_j (b in N·s/mm is smaller than m in kg by about that factor). The ridges
//! interpolate over positions that were not visited; m, b ≥ 0 holds exactly at each
//! node.

use super::banded::{Banded, Bound};
use super::direction_state::BELOW_TABLE;
use super::method::{
    Candidacy, Declared, Delta, Estimator, Opt, Options, Rule, Setting, State, Terms,
};
use super::samples::{Theta, Weights, weight_of};
use super::vaf::motion;
use super::{Identified, IdentifyError, Training, Trials, method};
use crate::model::Provenance;
use crate::recording::Recording;
use std::fmt;
use study_wire::predict::{Direction, DirectionState, Lookup, locate};

/// Unknowns per node: m, b·B_SCALE, F in + and in −.
const PER_NODE: usize = 6;
/// Half-bandwidth: second differences of F reach two nodes.
const HALF: usize = 2 * PER_NODE;
/// b in N·s/mm times this is of the magnitude of m in kg.
const B_SCALE: f64 = 60.0;
/// Share of a node's information that keeps m and b at 0 where they are not excited.
const FLOOR: f64 = 1e-12;

/// Options of the hat table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hat {
    /// The direction state, in identification and in prediction.
    pub state: State,
    /// Weight of the squared second differences of F along the nodes.
    pub ridge_force: f64,
    /// Weight of the squared first differences of m and 60·b.
    pub ridge_dynamics: f64,
    /// Whether m, b ≥ 0 at every node.
    pub bounded: bool,
    /// Which of m and b the table has.
    pub terms: Terms,
}

impl Default for Hat {
    /// Play, with δ found on the training recording, and m, b ≥ 0.
    fn default() -> Self {
        Self {
            state: State::Play(Delta::Scan),
            ridge_force: 3e-3,
            ridge_dynamics: 5e-2,
            bounded: true,
            terms: Terms::default(),
        }
    }
}

impl Estimator for Hat {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let nodes = training.nodes(setting.dx_mm)?;
        let penalty = Penalty {
            ridge_force: self.ridge_force,
            ridge_dynamics: self.ridge_dynamics,
            dynamics: [self.terms.m, self.terms.b].map(|kept| {
                if kept && !self.bounded {
                    Bound::Free
                } else {
                    Bound::of_term(kept)
                }
            }),
        };
        let mut identified = training.with_state((self.state, BELOW_TABLE), |rule| {
            training.hat_with(nodes.clone(), setting.lookup, rule, penalty)
        })?;
        identified.realization.provenance = Provenance {
            dx_mm: Some(setting.dx_mm),
            ..training.provenance(*self)
        };
        Ok(identified)
    }

    fn check(&self) -> Result<(), IdentifyError> {
        self.state.check()?;
        method::not_negative("the ridge on F", self.ridge_force)?;
        method::not_negative("the ridge on m and b", self.ridge_dynamics)
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " ridge={},{}", self.ridge_force, self.ridge_dynamics)?;
        self.state.write(f)?;
        f.write_str(if self.bounded { " m,b>=0" } else { "" })?;
        self.terms.write(f, false)
    }

    fn terms_mut(&mut self) -> Option<&mut Terms> {
        Some(&mut self.terms)
    }
}

impl Declared for Hat {
    const NAMES: &'static [(&'static str, &'static str)] =
        &[("hat", "All nodes at once, with a direction state")];
    const OPTIONS: &'static [Opt] = &[
        Opt::Dx,
        Opt::Direction,
        Opt::Delta,
        Opt::Terms,
        Opt::Ridge,
        Opt::Bounds,
    ];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        let default = Self::default();
        let [ridge_force, ridge_dynamics] =
            (options.ridge).unwrap_or([default.ridge_force, default.ridge_dynamics]);
        options.each_state(Rule::Play, |state| Self {
            state,
            ridge_force,
            ridge_dynamics,
            bounded: options.bounds.unwrap_or(default.bounded),
            terms: options.kept(),
        })
    }

    /// With the direction state and the nodes of the passive table.
    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        let (state, dx_mm) = trials.table()?;
        let hat = Self {
            state,
            ..Self::default()
        };
        Ok(Candidacy::With(hat.into(), dx_mm))
    }
}

impl Training<'_> {
    /// A hat table with a direction rule.
    pub(super) fn hat_with(
        &self,
        nodes: Vec<f64>,
        lookup: Lookup,
        rule: Direction,
        penalty: Penalty,
    ) -> Result<Identified, IdentifyError> {
        let HatTable {
            positive,
            negative,
            weight,
        } = table(
            &self.recordings,
            &nodes,
            lookup,
            rule,
            penalty,
            self.weights.as_deref(),
        )
        .ok_or(IdentifyError::Undetermined)?;
        Ok(self.hats(nodes, [positive, negative], &weight, rule, lookup))
    }
}

/// Weights of the penalties and the bounds on m and b.
#[derive(Debug, Clone, Copy)]
pub(super) struct Penalty {
    pub(super) ridge_force: f64,
    pub(super) ridge_dynamics: f64,
    /// Of m and of b.
    pub(super) dynamics: [Bound; 2],
}

/// θ at the nodes and the weight of the samples behind each.
#[derive(Debug, Clone)]
pub(super) struct HatTable {
    pub(super) positive: Vec<Theta>,
    pub(super) negative: Vec<Theta>,
    /// Σ h_j (1 ± z)/2 of each node, for + and −.
    pub(super) weight: Vec<[f64; 2]>,
}

/// The table of least cost; `None` if recording and ridges leave it undetermined.
pub(super) fn table(
    recordings: &[&Recording],
    nodes: &[f64],
    lookup: Lookup,
    rule: Direction,
    penalty: Penalty,
    weights: Weights<'_>,
) -> Option<HatTable> {
    let n = nodes.len() * PER_NODE;
    let mut normal = Banded::zero(n, HALF);
    let mut right = vec![0.0; n];
    let mut weight = vec![[0.0; 2]; nodes.len()];
    let mut total = 0.0;
    let mut state = DirectionState::default();
    let samples = (recordings.iter().enumerate())
        .flat_map(|(r, recording)| (0..recording.len()).map(move |i| (r, i)));
    for (r, i) in samples {
        let recording = recordings[r];
        if i == 0 {
            state = DirectionState::default();
        }
        let motion = motion(recording, i);
        let z = state.step(rule, motion);
        let trust = weight_of(weights, r, i);
        if trust == 0.0 {
            continue;
        }
        total += trust;
        let sides = [0.5 * (1.0 + z), 0.5 * (1.0 - z)];
        let features = [motion.a_m_s2, motion.v_mm_s / B_SCALE, 1.0];
        let (left, share) = locate(nodes, lookup, motion.x_mm);
        let mut entries = [(0, 0.0); 2 * PER_NODE];
        let mut used = 0;
        for (node, hat) in [(left, 1.0 - share), (left + 1, share)] {
            if hat == 0.0 {
                continue;
            }
            for (side, part) in sides.into_iter().enumerate() {
                if part == 0.0 {
                    continue;
                }
                weight[node][side] += trust * hat * part;
                for (p, feature) in features.into_iter().enumerate() {
                    entries[used] = (node * PER_NODE + side * 3 + p, hat * part * feature);
                    used += 1;
                }
            }
        }
        let entries = &entries[..used];
        for (k, (row, one)) in entries.iter().enumerate() {
            right[*row] += trust * one * recording.f_n[i];
            for (column, other) in &entries[..=k] {
                normal.add(*row, *column, trust * one * other);
            }
        }
    }
    let information = total / nodes.len() as f64;
    add_ridges(&mut normal, nodes.len(), information, penalty);
    let [m, b] = penalty.dynamics;
    let of_node = [m, b, Bound::Free];
    let bounds = of_node.repeat(n / 3);
    let x = normal.solve_bounded(&right, &bounds)?;
    if !x.iter().all(|value| value.is_finite()) {
        return None;
    }
    let side = |side: usize| {
        let of = |node: &[f64]| {
            let p = &node[side * 3..];
            [p[0], p[1] / B_SCALE, 0.0, p[2]]
        };
        x.chunks_exact(PER_NODE).map(of).collect()
    };
    Some(HatTable {
        positive: side(0),
        negative: side(1),
        weight,
    })
}

fn add_ridges(normal: &mut Banded, nodes: usize, information: f64, penalty: Penalty) {
    let mut add = |at: &[(usize, f64)], weight: f64| {
        for (k, (row, one)) in at.iter().enumerate() {
            for (column, other) in &at[..=k] {
                normal.add(*row, *column, weight * one * other);
            }
        }
    };
    let unknown = |node: usize, side: usize, p: usize| node * PER_NODE + side * 3 + p;
    let on_force = information * penalty.ridge_force;
    let on_dynamics = information * penalty.ridge_dynamics;
    for side in 0..2 {
        for j in 0..nodes {
            for p in 0..2 {
                let own = unknown(j, side, p);
                add(&[(own, 1.0)], information * FLOOR);
                if j > 0 {
                    add(&[(unknown(j - 1, side, p), -1.0), (own, 1.0)], on_dynamics);
                }
            }
            if j > 1 {
                let second = [
                    (unknown(j - 2, side, 2), 1.0),
                    (unknown(j - 1, side, 2), -2.0),
                    (unknown(j, side, 2), 1.0),
                ];
                add(&second, on_force);
            }
        }
    }
}
