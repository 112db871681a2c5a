//! Identification: from a recording to a realization.
//!
//! A [`Training`] groups a recording by direction of travel and sorts each group by
//! position, once. All estimators share one call:
//!
//! ```text
//! Training::new(&recording)?.identify(method, dx_mm, lookup)? → Identified
//! ```
//!
//! * [`Method`]: the estimator with its options. Model files keep its `Display`.
//! * [`Identified`]: a [`Realization`] without id and VAF, and the warnings about it.
//!   The same for all methods.
//! * [`IdentifyError`]: why identification failed.
//!
//! [`Training::estimates`] and [`Training::ewls`] are the two halves of the EWLS
//! family: one recursion serves many dx. [`grid::run`] identifies a realization for
//! every λ and dx and validates each on other recordings.
//!
//! Samples with v = 0 belong to no direction and are left out, except by the hat
//! table, whose direction state is defined for them; prediction assigns them the
//! direction of the previous sample. The nodes are the multiples of dx in the range
//! that both directions cover. Recordings are used unfiltered: [`signal`] has the
//! filters. Formulas and results: `docs/estimators.md`.
//!
//! Reference: Colton & Hollerbach, World Haptics 2007, equation 1 and section 4.

mod banded;
pub mod compare;
pub mod constrained;
pub mod coverage;
pub mod delivery;
mod direction_state;
pub mod elsewhere;
pub mod evidence;
mod features;
pub mod folds;
pub mod forecast;
pub mod grid;
pub mod identification;
pub mod lanes;
pub mod method;
pub mod perceptual;
pub mod plan;
mod problem;
pub mod repetition;
pub mod resample;
pub mod samples;
pub mod signal;
pub mod vaf;
pub mod validation;

method::estimators! {
    /// Mass, damping and friction that do not depend on the position.
    friction: Friction(Friction),
    /// The hat table with one mass and bounds that make it passive.
    passive: Passive(Passive),
    /// Baseline: mean force by position and direction.
    static_profile: Static(Static),
    /// The paper's method: exponentially weighted least squares along x.
    ewls: Ewls(Ewls),
    /// All nodes at once, by penalized least squares, with a direction state.
    hat: Hat(Hat),
    /// A potential with dampers and springs that slip, relax or break.
    elements: Elements(Elements),
    /// A virtual mechanism, by the simulation error of the force.
    mechanism: Mechanism(mechanism::Options),
    /// Least squares around each node, with weights that decrease to both sides.
    two_sided: TwoSided(TwoSided),
    /// Baseline: force by direction, piecewise linear between few nodes.
    segments: Segments(Segments),
    /// Baseline: one straight line.
    spring: Spring(Spring),
}

pub use elements::Elements;
pub use ewls::{Estimates, Ewls};
pub use friction::Friction;
pub use hat::Hat;
pub use mechanism::Fitted;
pub use method::Estimator;
pub use passive::Passive;
pub use problem::{Cause, Estimate, IdentifyError, Warning};
pub use samples::{Samples, Theta};
pub use segments::Segments;
pub use spring::Spring;
pub use static_profile::Static;
pub use two_sided::{TwoSided, Width};

use crate::model::{Branch, Provenance, Realization, Trained};
use crate::recording::{Recording, range};
use compare::Trials;
use elsewhere::Elsewhere;
use evidence::{Evidence, Term};
use method::Setting;
use resample::Resampled;
use std::sync::OnceLock;
use study_wire::predict::{Direction, Lookup};

/// One or more recordings of a target, prepared for identification.
#[derive(Debug)]
pub struct Training<'r> {
    recordings: Vec<&'r Recording>,
    /// Of their samples, where they are not all 1.
    weights: Option<Vec<Vec<f64>>>,
    positive: Samples,
    negative: Samples,
    /// Where both directions have samples, mm.
    range_mm: [f64; 2],
    // every table of a grid needs these two
    force_range_n: [f64; 2],
    top_speed_mm_s: f64,
    /// Of mass and damping, computed when first asked for.
    evidence: OnceLock<Option<[Evidence; 2]>>,
    /// Where mass and damping are from, if not from these recordings.
    elsewhere: Elsewhere,
}

impl<'r> Training<'r> {
    /// One recording: see [`Self::of`].
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn new(recording: &'r Recording) -> Result<Self, IdentifyError> {
        Self::of(&[recording])
    }

    /// Groups the samples of all recordings by the sign of v and sorts each group by x.
    /// A direction state starts anew in each recording.
    ///
    /// # Errors
    /// [`IdentifyError`] if a direction has no samples or the directions do not
    /// overlap in x.
    pub fn of(recordings: &[&'r Recording]) -> Result<Self, IdentifyError> {
        Self::weighted(recordings, None)
    }

    /// [`Self::of`] samples with weights: those of weight 0 are left out. Only methods that sum over
    /// samples in order of time use other weights than 0 and 1.
    fn weighted(
        recordings: &[&'r Recording],
        weights: Option<Vec<Vec<f64>>>,
    ) -> Result<Self, IdentifyError> {
        let positive = Samples::of(recordings, weights.as_deref(), |v| v > 0.0);
        let negative = Samples::of(recordings, weights.as_deref(), |v| v < 0.0);
        let names: Vec<&str> = recordings.iter().map(|r| r.name.as_str()).collect();
        let names = names.join(", ");
        let range_of = |samples: &Samples, positive| {
            (samples.range_mm()).ok_or_else(|| IdentifyError::OneDirection {
                recording: names.clone(),
                positive,
            })
        };
        let (plus, minus) = (range_of(&positive, true)?, range_of(&negative, false)?);
        let low = plus[0].max(minus[0]);
        let high = plus[1].min(minus[1]);
        if low >= high {
            return Err(IdentifyError::NoOverlap(names));
        }
        let forces = recordings.iter().map(|r| range(&r.f_n));
        Ok(Self {
            recordings: recordings.to_vec(),
            weights,
            positive,
            negative,
            range_mm: [low, high],
            force_range_n: forces.fold([f64::INFINITY, f64::NEG_INFINITY], |all, one| {
                [all[0].min(one[0]), all[1].max(one[1])]
            }),
            top_speed_mm_s: (recordings.iter().map(|r| r.top_speed_mm_s())).fold(0.0, f64::max),
            evidence: OnceLock::new(),
            elsewhere: Elsewhere::default(),
        })
    }

    /// With mass and damping from elsewhere, which [`grid::run`] puts into each realization.
    #[must_use]
    pub fn with_elsewhere(self, elsewhere: Elsewhere) -> Self {
        Self { elsewhere, ..self }
    }

    /// The recordings.
    pub fn recordings(&self) -> &[&'r Recording] {
        &self.recordings
    }

    /// The samples with v > 0 and those with v < 0.
    pub fn directions(&self) -> [&Samples; 2] {
        [&self.positive, &self.negative]
    }

    /// The memory L of a forgetting factor, mm: the smaller of the two directions.
    /// `None` if it is unlimited (λ = 1).
    pub fn memory_mm(&self, lambda: f64) -> Option<f64> {
        let [plus, minus] = self.directions().map(|samples| samples.memory_mm(lambda));
        Some(plus?.min(minus?))
    }

    /// Where both directions have samples, mm: there a table has nodes.
    pub fn range_mm(&self) -> [f64; 2] {
        self.range_mm
    }

    /// What the recordings say about mass and damping; `None` if they are too short.
    pub fn evidence(&self) -> Option<&[Evidence; 2]> {
        let of = || evidence::of(&self.recordings, self.range_mm);
        self.evidence.get_or_init(of).as_ref()
    }

    /// The method without the terms that the recordings do not carry, if it asks for that, and without those from elsewhere; and
    /// what the recordings say of each term that it has, or that a table without dynamics does not have.
    fn carried(&self, mut method: Method) -> (Method, Vec<Evidence>) {
        let [mass, damping] = self.elsewhere.terms();
        let mut asked = Vec::new();
        if method.is_static() {
            let all = self.evidence().into_iter().flatten();
            let here = all
                .zip(self.elsewhere.terms())
                .filter(|(_, elsewhere)| !elsewhere);
            asked.extend(here.map(|(evidence, _)| Evidence {
                carried: false,
                ..*evidence
            }));
        }
        if let Some(terms) = method.terms_mut() {
            terms.m &= !mass;
            terms.b &= !damping;
        }
        if let Some(terms) = method.terms_mut().filter(|terms| terms.only_carried) {
            terms.only_carried = false;
            for evidence in self.evidence().into_iter().flatten() {
                let kept = match evidence.term {
                    Term::Mass => &mut terms.m,
                    Term::Damping => &mut terms.b,
                };
                if *kept {
                    *kept = evidence.carried;
                    asked.push(*evidence);
                }
            }
        }
        (method, asked)
    }

    /// Identifies a realization. Methods without dx ignore `dx_mm`, see
    /// [`Estimator::has_dx`].
    ///
    /// # Errors
    /// [`IdentifyError`] if an option is out of range or the recording does not
    /// suit the method.
    pub fn identify(
        &self,
        method: impl Into<Method>,
        dx_mm: f64,
        lookup: Lookup,
    ) -> Result<Identified, IdentifyError> {
        self.identify_at(method.into(), Setting::new(dx_mm, lookup))
    }

    /// The same; a simulation reports its steps.
    ///
    /// # Errors
    /// As [`Self::identify`].
    pub fn identify_at(
        &self,
        method: Method,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        method.check()?;
        let (carried, terms) = self.carried(method);
        let mut identified = carried.identify(self, setting)?;
        identified.add_terms(carried, terms);
        Ok(identified)
    }

    /// The positions of a table's nodes, mm.
    ///
    /// # Errors
    /// [`IdentifyError`] if dx does not suit the recording.
    pub fn nodes(&self, dx_mm: f64) -> Result<Vec<f64>, IdentifyError> {
        let [low, high] = self.range_mm;
        if !(dx_mm.is_finite() && dx_mm > 0.0) {
            return Err(IdentifyError::Dx(dx_mm));
        }
        if (high - low) / dx_mm >= resample::MAX_NODES as f64 {
            return Err(IdentifyError::TooFine { dx_mm, low, high });
        }
        let nodes = resample::nodes(low, high, dx_mm);
        if nodes.len() < 2 {
            return Err(IdentifyError::TooCoarse {
                dx_mm,
                nodes: nodes.len(),
                low,
                high,
            });
        }
        Ok(nodes)
    }

    /// What model files say about the recording, and the method.
    fn provenance(&self, method: impl Into<Method>) -> Provenance {
        Provenance {
            method: method.into().to_string(),
            filter: Some(match self.recordings[0].filter() {
                Some(description) => format!("as recorded: {description}"),
                None => "as recorded".into(),
            }),
            recordings: (self.recordings.iter())
                .map(|r| (r.name.clone(), r.sha256.clone()))
                .collect(),
            // `study record` writes there what was recorded and whether it is simulated
            note: self.recordings[0].header.first().cloned(),
            ..Provenance::default()
        }
    }

    /// A table with the direction rule `sign` from the parameters at its nodes;
    /// `cause` is why nodes were filled, if some were.
    fn table(
        &self,
        nodes: Vec<f64>,
        positive: Resampled,
        negative: Resampled,
        cause: Cause,
        lookup: Lookup,
    ) -> Identified {
        let mut warnings = Vec::new();
        if positive.filled + negative.filled > 0 {
            warnings.push(Warning::Filled {
                cause,
                positive: positive.filled,
                negative: negative.filled,
                of: nodes.len(),
            });
        }
        let branches = [&positive.theta, &negative.theta];
        warnings.extend(problem::implausible(self.force_range_n, &nodes, branches));
        Identified {
            realization: Realization {
                id: String::new(),
                provenance: Provenance::default(),
                vaf: std::collections::BTreeMap::new(),
                lookup,
                direction: Direction::Sign,
                trained: Trained {
                    x_mm: self.range_mm,
                    v_mm_s: self.top_speed_mm_s,
                },
                x_mm: nodes,
                positive: branch(&positive.theta),
                negative: branch(&negative.theta),
                mechanism: None,
                elements: None,
                units: crate::model::Units::Linear,
            },
            warnings,
            terms: Vec::new(),
            fitted: None,
        }
    }
}

/// An identified realization; its id and VAF are empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// The table or mechanism.
    pub realization: Realization,
    /// What is doubtful about it.
    pub warnings: Vec<Warning>,
    /// What was found of each term, of an estimator that asks whether the recordings carry it.
    pub terms: Vec<Estimate>,
    /// How a mechanism was fitted.
    pub fitted: Option<Box<Fitted>>,
}

impl Identified {
    /// What the recordings say of terms, and a warning for each that is left out, or that is there without being shown.
    fn add_terms(&mut self, method: Method, evidence: Vec<Evidence>) {
        self.terms.extend(evidence.iter().map(Estimate::from));
        let warning = |evidence: Evidence| match (evidence.carried, evidence.found) {
            _ if method.is_static() => Some(Warning::Without(evidence)),
            (true, true) => None,
            (true, false) => Some(Warning::Ambiguous(evidence)),
            (false, _) => Some(Warning::LeftOut(evidence)),
        };
        let masses = || {
            self.realization
                .positive
                .m_kg
                .iter()
                .chain(&self.realization.negative.m_kg)
        };
        let one = masses()
            .next()
            .filter(|first| masses().all(|kg| kg == *first))
            .copied();
        let other = |said: &Evidence| {
            let reach = said.upper_bound? - said.value;
            let is_mass = said.term == Term::Mass && said.found && said.carried;
            let table_kg = one.filter(|kg| is_mass && (kg - said.value).abs() > reach)?;
            Some(Warning::OtherMass {
                table_kg,
                said: *said,
            })
        };
        let other: Vec<Warning> = evidence.iter().filter_map(other).collect();
        self.warnings.extend(other);
        self.warnings
            .extend(evidence.into_iter().filter_map(warning));
    }
}

impl Method {
    /// The name in arguments and model files.
    pub fn as_str(self) -> &'static str {
        self.name()
    }
}

fn branch(theta: &[Theta]) -> Branch {
    let pick = |i: usize| theta.iter().map(|t| t[i]).collect();
    Branch {
        m_kg: pick(0),
        b_n_s_per_mm: pick(1),
        k_n_per_mm: pick(2),
        f0_n: pick(3),
    }
}
