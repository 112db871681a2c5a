//! The passive table: a hat table that meets the certificate by construction.
//!
//! F = m a + Σ_j h_j(x) (b±_j v (1 ± z)/2 + C_j + z D_j) with one mass m ≥ 0, b±_j ≥ 0 and
//! D_j ≥ 0. A mass that changes neither with x nor with the direction needs no damping,
//! and S⁺ − S⁻ = 2 D: the three conditions of the certificate are the bounds. The derivation is
//! in `docs/estimators.md`.
//!
//! The cost is the squared error plus, in units of a node's mean information, ridges on
//! the second differences of C and D and on the first differences of b±, multiplied by
//! the rms speed, so that all of them are forces and no weight depends on a unit.

use super::banded::{Banded, Bound};
use super::direction_state::BELOW_TABLE;
use super::hat::HatTable;
use super::method::{
    Candidacy, Claim, Declared, Delta, Estimator, Opt, Options, Rule, Setting, State, Terms,
};
use super::samples::{Weights, weight_of};
use super::vaf::{self, motion};
use super::{Identified, IdentifyError, Training, Trials, method};
use crate::model::Provenance;
use crate::recording::Recording;
use std::fmt;
use study_wire::predict::{Direction, DirectionState, Lookup, locate};

/// Unknowns per node: C, D, b in + and in −.
const PER_NODE: usize = 4;
/// Half-bandwidth: second differences reach two nodes.
const HALF: usize = 2 * PER_NODE;
/// Share of a node's information that keeps unknowns at 0 where they are not excited.
const FLOOR: f64 = 1e-12;

/// Errors above this many standard deviations are large: 95 % efficient with normal errors.
const HUBER: f64 = 1.345;
/// Standard deviation over median of the size, with normal errors.
const SIGMA_PER_MAD: f64 = 1.4826;
/// Weighted solutions, each with the weights of the one before.
const HUBER_STEPS: usize = 4;

/// Options of the passive table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passive {
    /// The direction state, in identification and in prediction.
    pub state: State,
    /// Weight of the squared second differences of F⁺ and F⁻ along the nodes.
    pub ridge_force: f64,
    /// Weight of the squared first differences of b times the rms speed.
    pub ridge_damping: f64,
    /// Which of m and b the table has.
    pub terms: Terms,
    /// Whether outliers have limited influence: Huber's (1964) weights with k = 1.345.
    pub huber: bool,
}

impl Default for Passive {
    /// Play, with δ found on the training recordings.
    fn default() -> Self {
        Self {
            state: State::Play(Delta::Scan),
            ridge_force: 3e-3,
            ridge_damping: 6e-2,
            terms: Terms::default(),
            huber: false,
        }
    }
}

impl Estimator for Passive {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let (lookup, dx_mm) = (setting.lookup, setting.dx_mm);
        let nodes = training.nodes(dx_mm)?;
        let penalty = Penalty {
            ridge_force: self.ridge_force,
            ridge_damping: self.ridge_damping,
            terms: self.terms,
        };
        let weighted = |rule, weights: Weights<'_>| -> Result<Identified, IdentifyError> {
            let HatTable {
                positive,
                negative,
                weight,
            } = table(&training.recordings, &nodes, lookup, rule, penalty, weights)
                .ok_or(IdentifyError::Undetermined)?;
            Ok(training.hats(nodes.clone(), [positive, negative], &weight, rule, lookup))
        };
        let mut identified = training.with_state((self.state, BELOW_TABLE), |rule| {
            let mut identified = weighted(rule, training.weights.as_deref())?;
            for _ in 0..if self.huber { HUBER_STEPS } else { 0 } {
                let weights = huber(&training.recordings, &identified);
                identified = weighted(rule, Some(&weights))?;
            }
            Ok(identified)
        })?;
        identified.realization.provenance = Provenance {
            dx_mm: Some(dx_mm),
            ..training.provenance(*self)
        };
        Ok(identified)
    }

    fn check(&self) -> Result<(), IdentifyError> {
        self.state.check()?;
        method::not_negative("the ridge on F", self.ridge_force)?;
        method::not_negative("the ridge on b", self.ridge_damping)
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " ridge={},{}", self.ridge_force, self.ridge_damping)?;
        self.state.write(f)?;
        f.write_str(if self.huber { " huber" } else { "" })?;
        self.terms.write(f, false)
    }

    fn claim(&self) -> Claim {
        Claim::Passive
    }

    fn terms_mut(&mut self) -> Option<&mut Terms> {
        Some(&mut self.terms)
    }
}

impl Declared for Passive {
    const NAMES: &'static [(&'static str, &'static str)] = &[(
        "passive",
        "A hat table with one mass and bounds: passes its certificate by construction",
    )];
    const OPTIONS: &'static [Opt] = &[
        Opt::Dx,
        Opt::Direction,
        Opt::Delta,
        Opt::Terms,
        Opt::Huber,
        Opt::Ridge,
    ];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        let default = Self::default();
        let [ridge_force, ridge_damping] =
            (options.ridge).unwrap_or([default.ridge_force, default.ridge_damping]);
        options.each_state(Rule::Play, |state| Self {
            state,
            ridge_force,
            ridge_damping,
            terms: options.kept(),
            huber: options.huber,
        })
    }

    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        let (state, dx_mm) = trials.table()?;
        let passive = Self {
            state,
            ..Self::default()
        };
        Ok(Candidacy::With(passive.into(), dx_mm))
    }
}

/// Huber's weights of all samples: 1 up to [`HUBER`] robust standard deviations of the
/// error, then in inverse proportion to it.
fn huber(recordings: &[&Recording], of: &Identified) -> Vec<Vec<f64>> {
    let errors: Vec<Vec<f64>> = (recordings.iter())
        .map(|recording| vaf::errors(&of.realization, recording))
        .collect();
    let mut sizes: Vec<f64> = errors.iter().flatten().map(|e| e.abs()).collect();
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    let most = HUBER * SIGMA_PER_MAD * *median;
    let weight = |e: &f64| if e.abs() > most { most / e.abs() } else { 1.0 };
    errors
        .iter()
        .map(|e| e.iter().map(weight).collect())
        .collect()
}

/// Weights of the penalties, and the terms that the table has.
#[derive(Debug, Clone, Copy)]
struct Penalty {
    ridge_force: f64,
    ridge_damping: f64,
    terms: Terms,
}

/// The table of least cost; `None` if recordings and ridges leave it undetermined.
fn table(
    recordings: &[&Recording],
    nodes: &[f64],
    lookup: Lookup,
    rule: Direction,
    penalty: Penalty,
    weights: Weights<'_>,
) -> Option<HatTable> {
    let n = nodes.len() * PER_NODE;
    let mass = n;
    let mut normal = Banded::bordered(n, HALF, 1);
    let mut right = vec![0.0; n + 1];
    let mut weight = vec![[0.0; 2]; nodes.len()];
    let (mut samples, mut speed) = (0.0, 0.0);
    for (r, recording) in recordings.iter().enumerate() {
        let mut state = DirectionState::default();
        for i in 0..recording.len() {
            let motion = motion(recording, i);
            let z = state.step(rule, motion);
            let trust = weight_of(weights, r, i);
            if trust == 0.0 {
                continue;
            }
            let sides = [0.5 * (1.0 + z), 0.5 * (1.0 - z)];
            let (left, share) = locate(nodes, lookup, motion.x_mm);
            let mut entries = [(0, 0.0); 2 * PER_NODE + 1];
            let mut used = 0;
            for (node, hat) in [(left, 1.0 - share), (left + 1, share)] {
                if hat == 0.0 {
                    continue;
                }
                let v = motion.v_mm_s;
                for (p, value) in [1.0, z, v * sides[0], v * sides[1]].into_iter().enumerate() {
                    entries[used] = (node * PER_NODE + p, hat * value);
                    used += 1;
                }
                for (of_side, part) in weight[node].iter_mut().zip(sides) {
                    *of_side += trust * hat * part;
                }
            }
            entries[used] = (mass, motion.a_m_s2);
            let entries = &entries[..=used];
            for (k, (row, one)) in entries.iter().enumerate() {
                right[*row] += trust * one * recording.f_n[i];
                for (column, other) in &entries[..=k] {
                    normal.add(*row, *column, trust * one * other);
                }
            }
            samples += trust;
            speed += trust * motion.v_mm_s * motion.v_mm_s;
        }
    }
    let information = samples / nodes.len() as f64;
    let mean_square = (speed / samples).max(f64::MIN_POSITIVE);
    add_ridges(&mut normal, nodes.len(), information, mean_square, penalty);
    let terms = penalty.terms;
    let of_node = [
        Bound::Free,
        Bound::NotNegative,
        Bound::of_term(terms.b),
        Bound::of_term(terms.b),
    ];
    let mut bounds = of_node.repeat(nodes.len());
    bounds.push(Bound::of_term(terms.m));
    normal.add(mass, mass, FLOOR * samples);
    let x = normal.solve_bounded(&right, &bounds)?;
    if !x.iter().all(|value| value.is_finite()) {
        return None;
    }
    let m = x[mass].max(0.0);
    let side = |sign: f64, b: usize| {
        let of = |node: &[f64]| [m, node[b].max(0.0), 0.0, node[0] + sign * node[1]];
        x[..n].chunks_exact(PER_NODE).map(of).collect()
    };
    Some(HatTable {
        positive: side(1.0, 2),
        negative: side(-1.0, 3),
        weight,
    })
}

fn add_ridges(
    normal: &mut Banded,
    nodes: usize,
    information: f64,
    speed_squared: f64,
    penalty: Penalty,
) {
    let mut add = |at: &[(usize, f64)], weight: f64| {
        for (k, (row, one)) in at.iter().enumerate() {
            for (column, other) in &at[..=k] {
                normal.add(*row, *column, weight * one * other);
            }
        }
    };
    // the squares of C + D and C − D sum to twice those of C and D
    let on_force = 2.0 * information * penalty.ridge_force;
    let on_damping = information * penalty.ridge_damping * speed_squared;
    for j in 0..nodes {
        for p in 0..PER_NODE {
            let unknown = |back: usize| (j - back) * PER_NODE + p;
            let scale = if p < 2 { 1.0 } else { speed_squared };
            add(&[(unknown(0), 1.0)], information * FLOOR * scale);
            if p < 2 && j > 1 {
                let second = [(unknown(2), 1.0), (unknown(1), -2.0), (unknown(0), 1.0)];
                add(&second, on_force);
            }
            if p >= 2 && j > 0 {
                add(&[(unknown(1), -1.0), (unknown(0), 1.0)], on_damping);
            }
        }
    }
}
