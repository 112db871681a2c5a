//! Mass and damping from elsewhere.
//!
//! A slow press and release shows the force by position and its friction, and no mass. Mass and damping come from dynamic recordings of the same
//! target, beside this force, or the experimenter states them ([`Stated`]): the mass of a moving part that was weighed, or of a handle. The table
//! of the training recordings is held. What the dynamic recordings have beside it is
//!
//! ```text
//! F − S±(x) = m a + b v + c + d z + z e(v) + sign(a) g(v)
//! ```
//!
//! with a constant c (the zero of another sensor), friction that is another one than in slow motion by d, also at low speed (e) and at reversals (g), and the direction
//! state z. Held, and not joint: rows of a force tester and samples of a fast press have other rates and other errors, and a joint fit would bend the table where the
//! fast recording is noisy or another one sticks, while the table is what the slow one was made for. The damping that the slow press had is in the table; it is
//! small in proportion to the speeds, and d takes it in the estimate.
//!
//! A term is there if the dynamic recordings show it, by the rule of [`super::evidence`]; its estimate has no bias by noise, and enters the table as it is: one mass, and one
//! damping in both directions. A term that is not shown has its bound. A stated value was not identified, and everything that is written says so.

use super::banded::Banded;
use super::evidence::{self, Evidence, Term};
use super::grid::Cell;
use super::vaf;
use super::{Estimate, IdentifyError, Warning};
use crate::model::coverage::Origin;
use crate::model::{Branch, Realization};
use crate::recording::{Recording, mean_and_variance};
use study_base::sort::SmallSort as _;

/// A share of the samples of a dynamic recording that have to be where the table is.
const LEAST_INSIDE: f64 = 0.5;
/// An estimate that is so many standard errors away from what is stated is another one (99 %).
const DIFFERENT: f64 = 2.576;
/// The force of a dynamic recording at the positions of the table is its force times a number in this range.
const SAME_TARGET: [f64; 2] = [0.2, 5.0];
/// Beyond this range a sensor of another calibration is likelier than another speed.
const ALIKE: [f64; 2] = [0.75, 1.35];
/// A quick hand: five strokes back and forth a second.
const QUICK_RAD_S: f64 = 5.0 * std::f64::consts::TAU;
/// A stated value whose force in quick strokes is so many times that by position is doubted.
const OUTWEIGHS: f64 = 3.0;
/// The share of the force of the table that motion does not explain, from which on that number says something.
const LEAST_OWN: f64 = 0.02;

/// What the experimenter states.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stated {
    /// Mass, kg.
    pub m_kg: Option<f64>,
    /// Damping, N·s/mm.
    pub b_n_s_per_mm: Option<f64>,
}

impl Stated {
    /// Of mass and damping.
    pub fn both(self) -> [Option<f64>; 2] {
        [self.m_kg, self.b_n_s_per_mm]
    }
}

/// Where mass and damping are from, if not from the training recordings.
#[derive(Debug, Clone, Default)]
pub struct Elsewhere {
    /// Dynamic recordings; where the force by position is not known, they say nothing.
    dynamic: Vec<Recording>,
    stated: Stated,
    /// Of mass and damping, whether it is from elsewhere.
    terms: [bool; 2],
}

/// Whether enough of a dynamic recording is where the force by position is known.
fn check(recording: &Recording, known_mm: [f64; 2]) -> Result<(), IdentifyError> {
    let samples = inside(recording, known_mm).count();
    let share = samples as f64 / recording.len() as f64;
    if share < LEAST_INSIDE {
        return Err(IdentifyError::DynamicRange {
            recording: recording.name.clone(),
            percent: (100.0 * share).floor(),
            known_mm,
            goes_mm: recording.range_mm(),
        });
    }
    match samples >= evidence::LEAST_SAMPLES {
        true => Ok(()),
        false => Err(IdentifyError::DynamicTooShort {
            recording: recording.name.clone(),
            samples,
        }),
    }
}

/// The samples at which the force by position is known.
fn inside(recording: &Recording, [low, high]: [f64; 2]) -> impl Iterator<Item = usize> {
    let x = &recording.x_mm;
    (0..recording.len()).filter(move |i| (low..=high).contains(&x[*i]))
}

impl Elsewhere {
    /// From dynamic recordings, and as stated. `known_mm` is where the training recordings were, and `said` what they say of mass and damping: what they show is not asked
    /// of a dynamic recording.
    ///
    /// # Errors
    /// [`IdentifyError`] if a dynamic recording went elsewhere or is too short, or if the training recordings show what is stated.
    pub fn of(
        dynamic: &[&Recording],
        stated: Stated,
        known_mm: [f64; 2],
        said: Option<&[Evidence; 2]>,
    ) -> Result<Self, IdentifyError> {
        let mut terms = [false; 2];
        for (i, stated) in stated.both().iter().enumerate() {
            let shown = said.map(|said| said[i]).filter(|said| said.found);
            if let (Some(shown), Some(_)) = (shown, stated) {
                return Err(IdentifyError::Shown(shown));
            }
            let asked = !dynamic.is_empty() && !shown.is_some_and(|shown| shown.carried);
            terms[i] = stated.is_some() || asked;
        }
        for recording in dynamic {
            check(recording, known_mm)?;
        }
        Ok(Self {
            dynamic: dynamic
                .iter()
                .map(|recording| (*recording).clone())
                .collect(),
            stated,
            terms,
        })
    }

    /// Of mass and damping, whether it is from elsewhere.
    pub fn terms(&self) -> [bool; 2] {
        self.terms
    }

    /// The dynamic recordings.
    pub fn dynamic(&self) -> &[Recording] {
        &self.dynamic
    }

    /// Puts mass and damping into a realization that was identified without them, which has scores on `recordings`. `said` is what the training recordings say.
    ///
    /// # Errors
    /// [`IdentifyError`] if the dynamic recordings are of another target.
    pub(super) fn complete(
        &self,
        cell: &mut Cell,
        said: impl FnOnce() -> Option<[Evidence; 2]>,
        recordings: &[&Recording],
    ) -> Result<(), IdentifyError> {
        if self.terms == [false; 2] {
            return Ok(());
        }
        let asks = !self.dynamic.is_empty();
        let said = match asks {
            true => {
                let (said, ratio) = beside(&cell.realization, &self.dynamic)?;
                let differs = ratio.filter(|ratio| !(ALIKE[0]..=ALIKE[1]).contains(ratio));
                (cell.warnings).extend(differs.map(|ratio| Warning::OtherForce { ratio }));
                said
            }
            false => said(),
        };
        let realization = &mut cell.realization;
        for (i, stated) in self.stated.both().into_iter().enumerate() {
            let said = said.map(|said| said[i]).filter(|_| self.terms[i]);
            if let Some(value) = stated {
                if let Some(said) = said.filter(|said| contradicts(said, value)) {
                    cell.warnings.push(Warning::Stated {
                        stated: value,
                        said,
                    });
                }
                let doubt = outweighs(Term::BOTH[i], value, realization);
                cell.warnings.extend(doubt);
                cell.terms.push(Estimate::stated(Term::BOTH[i], value));
                set(realization, Term::BOTH[i], value);
            } else if let Some(said) = said.filter(|_| asks) {
                cell.terms.push(Estimate::from(&said));
                if said.found {
                    set(realization, said.term, said.value);
                    let trained = &mut realization.trained;
                    let speeds = self.dynamic.iter().flat_map(|recording| {
                        let speed = |i: usize| recording.v_mm_s[i].abs();
                        inside(recording, trained.x_mm).map(speed)
                    });
                    let top_mm_s = speeds.fold(trained.v_mm_s, f64::max);
                    trained.v_mm_s = top_mm_s;
                } else {
                    cell.warnings.push(Warning::Without(said));
                }
            }
        }
        // mass, then damping, whatever the training recordings said first
        (cell.terms).small_sort_by_key(|term| term.name != Term::Mass.as_str());
        cell.certificate = cell.realization.certificate();
        cell.scores = (recordings.iter())
            .map(|recording| vaf::score(&cell.realization, recording))
            .collect();
        for (recording, score) in recordings.iter().zip(&cell.scores) {
            let vaf = &mut cell.realization.vaf;
            vaf.insert(recording.name.clone(), score.vaf);
        }
        Ok(())
    }
}

/// A doubt about a stated value whose force in quick strokes over the travel would be far above
/// every force by position: such as a mass in grams.
fn outweighs(term: Term, stated: f64, realization: &Realization) -> Option<Warning> {
    let [low, high] = realization.trained.x_mm;
    let amplitude_mm = 0.5 * (high - low);
    let needs_n = match term {
        Term::Mass => 1e-3 * stated * amplitude_mm * QUICK_RAD_S.powi(2),
        Term::Damping => stated * amplitude_mm * QUICK_RAD_S,
    };
    let branches = [&realization.positive, &realization.negative];
    let forces = branches.into_iter().flat_map(|branch| {
        let rows = realization.x_mm.iter().zip(&branch.k_n_per_mm);
        rows.zip(&branch.f0_n).map(|((x, k), f0)| k * x + f0)
    });
    let most_n = forces.fold(0.0, |most: f64, force| most.max(force.abs()));
    (needs_n > OUTWEIGHS * most_n).then_some(Warning::Outweighs {
        term,
        stated,
        needs_n,
        most_n,
    })
}

/// Whether recordings say something else than what is stated.
fn contradicts(said: &Evidence, stated: f64) -> bool {
    match said.found {
        true => (stated - said.value).abs() > DIFFERENT * said.standard_error,
        false => said.upper_bound.is_some_and(|bound| stated > bound),
    }
}

/// What dynamic recordings say beside the force of a realization without mass and damping, `None` if they do not determine the model; and how many times that force
/// they have, if it is clearly another one.
fn beside(
    realization: &Realization,
    dynamic: &[Recording],
) -> Result<(Option<[Evidence; 2]>, Option<f64>), IdentifyError> {
    let mut rest = dynamic.to_vec();
    for recording in &mut rest {
        let by_position: Vec<f64> = vaf::predict(realization, recording).collect();
        for (force, known) in recording.f_n.iter_mut().zip(by_position) {
            *force -= known;
        }
    }
    let [whole, rest]: [Vec<&Recording>; 2] =
        [dynamic, &rest[..]].map(|recordings| recordings.iter().collect());
    let ratio = other_force(&whole, &rest, realization.trained.x_mm);
    let [least, most] = SAME_TARGET;
    if let Some(ratio) = ratio.filter(|ratio| !(least..=most).contains(ratio)) {
        return Err(IdentifyError::OtherForce(ratio));
    }
    let said = evidence::beside(&whole, &rest, realization.trained.x_mm);
    Ok((said, ratio))
}

/// How many times the force by position a measured force has, if that is another force: beside a constant, a spring, which stands for a mass in a
/// motion like a sine, a mass and a damping.
fn other_force(whole: &[&Recording], rest: &[&Recording], known_mm: [f64; 2]) -> Option<f64> {
    const N: usize = 5;
    let rows = || {
        let pairs = whole.iter().zip(rest);
        pairs.flat_map(|(whole, rest)| {
            inside(whole, known_mm).map(|i| {
                let (a, v) = (whole.a_m_s2[i], whole.v_mm_s[i]);
                let known = whole.f_n[i] - rest.f_n[i];
                ([known, 1.0, whole.x_mm[i], a, v], whole.f_n[i])
            })
        })
    };
    let mut normal = Banded::zero(N, N - 1);
    let mut right = [0.0; N];
    for (row, force) in rows() {
        for k in 0..N {
            right[k] += row[k] * force;
            for j in 0..=k {
                normal.add(k, j, row[k] * row[j]);
            }
        }
    }
    let found = normal.solve(&right, &[true; N])?;
    let ratio = found[0];
    // the squares of the force by position that nothing else explains
    let own = 1.0 / normal.solve(&[1.0, 0.0, 0.0, 0.0, 0.0], &[true; N])?[0];
    let known: Vec<f64> = rows().map(|(row, _)| row[0]).collect();
    let (_, variance) = mean_and_variance(&known);
    let says = own > LEAST_OWN * variance * known.len() as f64;
    let error = |(row, force): ([f64; N], f64)| {
        let predicted: f64 = row.iter().zip(&found).map(|(r, x)| r * x).sum();
        (force - predicted).powi(2)
    };
    // as the same force it would leave twice the squared error at least
    let wrong = (1.0 - ratio).powi(2) * own > rows().map(error).sum();
    (says && wrong).then_some(ratio)
}

/// One value at all nodes and in both directions.
fn set(realization: &mut Realization, term: Term, value: f64) {
    for branch in [&mut realization.positive, &mut realization.negative] {
        let Branch {
            m_kg, b_n_s_per_mm, ..
        } = branch;
        let values = match term {
            Term::Mass => m_kg,
            Term::Damping => b_n_s_per_mm,
        };
        values.fill(value);
    }
}

/// Whether a term is from dynamic recordings.
pub(super) fn is_from_dynamic(terms: &[Estimate]) -> bool {
    (terms.iter()).any(|term| term.identified && term.origin == Origin::Dynamic)
}

/// A note with what is from elsewhere, for a model file of any version.
pub(super) fn note(
    note: Option<String>,
    terms: &[Estimate],
    dynamic: &[&Recording],
) -> Option<String> {
    let names: Vec<&str> = dynamic.iter().map(|r| r.name.as_str()).collect();
    let from = terms.iter().filter_map(|term| {
        let value = format!("{} {} {}", term.name, term.value, term.unit);
        match term.origin {
            Origin::Stated => Some(format!("{value} is stated, not identified")),
            Origin::Dynamic if term.identified => Some(format!(
                "{value} is from the recording {}",
                names.join(", ")
            )),
            _ => None,
        }
    });
    let all: Vec<String> = note.into_iter().chain(from).collect();
    (!all.is_empty()).then(|| all.join("; "))
}
