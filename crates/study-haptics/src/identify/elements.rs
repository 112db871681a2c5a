//! Passive elements: a free potential, dampers, and springs that slip, relax or break
//! ([`study_wire::elements`]), by one bounded least-squares problem.
//!
//! With given lengths and times of the springs the force is linear in all profiles, which are at
//! least 0 but for the potential. `choice` finds the springs. What those that relax hold at the
//! first sample comes from a motion that nobody recorded: `start` estimates it. Formulas:
//! `docs/estimators.md`.

mod choice;
mod latch;
mod start;
mod sums;
#[cfg(test)]
mod tests;

use super::method::{Candidacy, Claim, Declared, Estimator, Opt, Options, Setting, Terms};
use super::two_sided::MIN_WEIGHT;
use super::{Cause, Identified, IdentifyError, Training, Trials, Warning};
use crate::model::{self, Provenance, Realization, Trained};
use crate::recording::Recording;
use choice::Problem;
pub(super) use start::of as start_of;
use std::fmt;
use study_wire::elements::Spring;
use study_wire::predict::{Lookup, locate};
use sums::Sums;

/// Alternations between the profiles and the state in which springs enter the recordings.
const ALTERNATIONS: usize = 2;

/// Options of passive elements.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Elements {
    /// Which of m and b they have.
    pub terms: Terms,
}

impl Estimator for Elements {
    fn name(&self) -> &'static str {
        Self::NAMES[0].0
    }

    fn identify(
        &self,
        training: &Training<'_>,
        setting: Setting<'_>,
    ) -> Result<Identified, IdentifyError> {
        let elements = identify(training, setting.dx_mm, self.terms)?;
        let provenance = Provenance {
            dx_mm: Some(setting.dx_mm),
            ..training.provenance(*self)
        };
        let trained = Trained {
            x_mm: training.range_mm,
            v_mm_s: training.top_speed_mm_s,
        };
        let (id, vaf) = (String::new(), std::collections::BTreeMap::new());
        Ok(Identified {
            realization: Realization::of_elements(id, provenance, vaf, trained, elements),
            warnings: sparse(training, &nodes(training, setting.dx_mm)?),
            terms: Vec::new(),
            fitted: None,
        })
    }

    fn write_options(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.terms.write(f, false)
    }

    fn is_table(&self) -> bool {
        false
    }

    fn claim(&self) -> Claim {
        Claim::Passive
    }

    fn terms_mut(&mut self) -> Option<&mut Terms> {
        Some(&mut self.terms)
    }
}

impl Declared for Elements {
    const NAMES: &'static [(&'static str, &'static str)] = &[(
        "elements",
        "A potential with dampers and springs that slip, relax or break",
    )];
    const OPTIONS: &'static [Opt] = &[Opt::Dx, Opt::Terms];

    fn asked(_name: &str, options: &Options) -> Vec<Self> {
        vec![Self {
            terms: options.kept(),
        }]
    }

    /// With the nodes of the passive table.
    fn candidate(trials: &Trials<'_, '_>) -> Result<Candidacy, IdentifyError> {
        if !trials.whole_strokes() {
            // a slow loop has neither speeds nor partial strokes
            return Ok(Candidacy::NotTried("too few strokes".to_owned()));
        }
        let (_, dx_mm) = trials.table()?;
        Ok(Candidacy::With(Self::default().into(), dx_mm))
    }
}

/// Weights of the penalties, and the terms beside the springs.
#[derive(Debug, Clone, Copy)]
struct Penalty {
    ridge_force: f64,
    ridge_damping: f64,
    terms: Terms,
}

impl Penalty {
    /// Those of the passive table.
    fn of(terms: Terms) -> Self {
        Self {
            ridge_force: 3e-3,
            ridge_damping: 6e-2,
            terms,
        }
    }
}

/// A warning if nodes have too few samples around them in a direction, as of a table.
fn sparse(training: &Training<'_>, nodes: &[f64]) -> Vec<Warning> {
    let [positive, negative] = training.directions().map(|samples| {
        let mut weight = vec![0.0; nodes.len()];
        for x_mm in &samples.x_mm {
            let (left, share) = locate(nodes, Lookup::Linear, *x_mm);
            weight[left] += 1.0 - share;
            if share > 0.0 {
                weight[left + 1] += share;
            }
        }
        weight.iter().filter(|w| **w < MIN_WEIGHT).count()
    });
    let found = (positive + negative > 0).then_some(Warning::Filled {
        cause: Cause::FewSamples,
        positive,
        negative,
        of: nodes.len(),
    });
    found.into_iter().collect()
}

/// The nodes of a table, and the ends of its range in place of those within half a dx of them. Beyond
/// the outermost nodes forces are held, and what is recorded there would bend the profiles.
fn nodes(training: &Training<'_>, dx_mm: f64) -> Result<Vec<f64>, IdentifyError> {
    let [low, high] = training.range_mm;
    let inside = |x: &f64| (x - low).min(high - x) > 0.5 * dx_mm;
    let between = training.nodes(dx_mm)?.into_iter().filter(inside);
    Ok([low].into_iter().chain(between).chain([high]).collect())
}

/// The elements with the springs that the recordings ask for.
fn identify(
    training: &Training<'_>,
    dx_mm: f64,
    terms: Terms,
) -> Result<model::Elements, IdentifyError> {
    let nodes = nodes(training, dx_mm)?;
    let penalty = Penalty::of(terms);
    let problem = Problem::new(training, &nodes, penalty);
    let springs = choice::springs(&problem).ok_or(IdentifyError::Undetermined)?;
    with_springs(training, &nodes, &springs, penalty).ok_or(IdentifyError::Undetermined)
}

/// The elements with given springs. Profiles and the state in which the springs enter are
/// estimated in turn, the profiles at first without the beginnings of the recordings.
fn with_springs(
    training: &Training<'_>,
    nodes: &[f64],
    springs: &[Spring],
    penalty: Penalty,
) -> Option<model::Elements> {
    let all: Vec<usize> = (0..springs.len()).collect();
    let of = |starts: Option<&start::Starts>| -> Option<model::Elements> {
        let sums = Sums::of(training, nodes, springs, starts, 1);
        Some(sums.solve(&all, penalty)?.elements)
    };
    let relaxes = |spring: &Spring| matches!(spring, Spring::Maxwell { .. });
    if !springs.iter().any(relaxes) {
        return of(Some(&start::settled(training, springs)));
    }
    let mut elements = of(None)?;
    for _ in 0..ALTERNATIONS {
        elements = of(Some(&start::all(training, &elements)))?;
    }
    Some(elements)
}

/// The force of elements at a sample with z of the springs, N.
fn force_n(elements: &model::Elements, recording: &Recording, i: usize, z: &[f64]) -> f64 {
    let (x, v) = (recording.x_mm[i], recording.v_mm_s[i]);
    let (left, share) = locate(&elements.x_mm, Lookup::Linear, x);
    let at = |profile: &[f64]| between(profile, left, share);
    let side = usize::from(v < 0.0);
    let springs = elements.spring_n.iter().zip(z);
    at(&elements.force_n)
        + v * at(&elements.damping_n_s_per_mm[side])
        + elements.mass_kg * recording.a_m_s2[i]
        + springs.map(|(profile, z)| z * at(profile)).sum::<f64>()
}

/// A profile between two nodes.
fn between(profile: &[f64], left: usize, share: f64) -> f64 {
    match profile.get(left + 1) {
        Some(next) => profile[left] + share * (next - profile[left]),
        None => profile[left],
    }
}
