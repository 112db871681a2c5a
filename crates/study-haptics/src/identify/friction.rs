//! The friction model: F = m a + b v + F_c z + F_0 with m, b, F_c ≥ 0 and a direction state z.
//!
//! It has no position. Of a joint or a damper, whose force hardly depends on the position,
//! it predicts more than a table with hundreds of parameters. Its table has two nodes with
//! equal parameters and passes its certificate by construction: S⁺ − S⁻ = 2 F_c.

use super::banded::{Banded, Bound};
use super::direction_state::BELOW_FRICTION;
use super::method::{
    Candidacy, Claim, Declared, Delta, Estimator, Opt, Options, Rule, Setting, State, Terms,
};
use super::samples::{Theta, Weights, weight_of};
use super::vaf::motion;
use super::{Identified, IdentifyError, Training, Trials};
use crate::recording::Recording;
use std::fmt;
use study_wire::predict::{Direction, DirectionState};

/// m, b, F_c, F_0.
const UNKNOWNS: usize = 4;

/// Options of the friction model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// The direction state, in identification and in prediction.
    pub state: State,
    /// Which of m and b it has.
    pub terms: Terms,
}

impl Default for Friction {
    /// Dahl, with δ found on the training recordings.
    fn default() -> Self {
        Self {
            state: State::Dahl(Delta::Scan),
            terms: Terms::default(),
        }
    }
}

impl Estimator for Friction {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let samples: usize = training.recordings.iter().map(|r| r.len()).sum();
        let weight = [[0.5 * samples as f64; 2]; 2];
        let mut identified = training.with_state((self.state, BELOW_FRICTION), |rule| {
            let weights = training.weights.as_deref();
            let sides = parameters(&training.recordings, rule, self.terms, weights)
                .ok_or(IdentifyError::Undetermined)?
                .map(|theta| vec![theta; 2]);
            let nodes = training.range_mm.to_vec();
            Ok(training.hats(nodes, sides, &weight, rule, setting.lookup))
        })?;
        identified.realization.provenance = training.provenance(*self);
        Ok(identified)
    }

    fn check(&self) -> Result<(), IdentifyError> {
        self.state.check()
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.state.write(f)?;
        self.terms.write(f, false)
    }

    fn has_dx(&self) -> bool {
        false
    }

    fn claim(&self) -> Claim {
        Claim::Passive
    }

    fn terms_mut(&mut self) -> Option<&mut Terms> {
        Some(&mut self.terms)
    }
}

impl Declared for Friction {
    const NAMES: &'static [(&'static str, &'static str)] = &[(
        "friction",
        "Mass, damping and friction that do not depend on the position",
    )];
    const OPTIONS: &'static [Opt] = &[Opt::Direction, Opt::Delta, Opt::Terms];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        options.each_state(Rule::Dahl, |state| Self {
            state,
            terms: options.kept(),
        })
    }

    /// With the length that suits all recordings.
    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        let delta_mm = trials.delta_mm(Self::default().into(), 0.0)?;
        let friction = Self {
            state: State::Dahl(Delta::Mm(delta_mm)),
            ..Self::default()
        };
        Ok(Candidacy::With(friction.into(), 0.0))
    }
}

/// The parameters of either direction of least squared error; `None` if the recordings leave
/// them undetermined.
fn parameters(
    recordings: &[&Recording],
    rule: Direction,
    terms: Terms,
    weights: Weights<'_>,
) -> Option<[Theta; 2]> {
    let mut normal = Banded::zero(UNKNOWNS, UNKNOWNS - 1);
    let mut right = [0.0; UNKNOWNS];
    for (r, recording) in recordings.iter().enumerate() {
        let mut state = DirectionState::default();
        for i in 0..recording.len() {
            let motion = motion(recording, i);
            let z = state.step(rule, motion);
            let trust = weight_of(weights, r, i);
            let features = [motion.a_m_s2, motion.v_mm_s, z, 1.0];
            for (row, one) in features.into_iter().enumerate() {
                right[row] += trust * one * recording.f_n[i];
                for (column, other) in features[..=row].iter().enumerate() {
                    normal.add(row, column, trust * one * other);
                }
            }
        }
    }
    let bounds = [
        Bound::of_term(terms.m),
        Bound::of_term(terms.b),
        Bound::NotNegative,
        Bound::Free,
    ];
    let found = normal.solve_bounded(&right, &bounds)?;
    let [m, b, coulomb_n, offset_n] = *found.first_chunk::<UNKNOWNS>()?;
    let finite = found.iter().all(|value| value.is_finite());
    let side = |sign: f64| [m, b, 0.0, offset_n + sign * coulomb_n];
    finite.then(|| [side(1.0), side(-1.0)])
}
