//! Passive elements: a free potential, dampers, and springs that slip, relax or break
//! ([`study_wire::elements`]), by one bounded least-squares problem.
//!
//! With given lengths and times of the springs the force is linear in all profiles, which are at
//! least 0 but for the potential. The springs come from a ladder: the one that reduces the squared
//! error most is added, one after the other, as long as that is worth it; then their lengths and
//! times are varied. A latch is looked for where the error depends on which of two positions
//! was passed last. Formulas: `docs/estimators.md`.

mod latch;
mod sums;
#[cfg(test)]
mod tests;

use super::method::{Candidacy, Claim, Declared, Estimator, Opt, Options, Setting, Terms};
use super::two_sided::MIN_WEIGHT;
use super::{Cause, Identified, IdentifyError, Training, Trials, Warning};
use crate::model::{self, Provenance, Realization, Trained};
use rayon::prelude::*;
use std::fmt;
use study_wire::elements::{MAX_SPRINGS, Spring};
use study_wire::predict::{Lookup, locate};
use sums::{Solved, Sums};

/// Slip lengths of stops that are tried, as shares of the travel.
const SLIPS: [f64; 6] = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
/// Ratio of two relaxation times that are tried, and the first in sampling intervals.
const RELAXATIONS: (f64, f64) = (3.0, 5.0);
/// Longest relaxation time, as a share of the duration.
const LONGEST: f64 = 0.1;
/// Most relaxation times.
const MOST_RELAXATIONS: usize = 7;
/// A spring reduces the squared error at least by this share.
const WORTH: f64 = 0.1;
/// Lengths and times are varied by these factors.
const VARIED: [f64; 3] = [std::f64::consts::SQRT_2, 1.19, 1.06];
/// A slip over fewer encoder counts follows their noise.
const LEAST_COUNTS: f64 = 10.0;
/// Samples that are enough to choose springs; of more, every so many-th is used.
const ENOUGH: usize = 60_000;

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
            warnings: sparse(training, &training.nodes(setting.dx_mm)?),
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

/// The elements with the springs that the recordings ask for.
fn identify(
    training: &Training<'_>,
    dx_mm: f64,
    terms: Terms,
) -> Result<model::Elements, IdentifyError> {
    let nodes = training.nodes(dx_mm)?;
    let penalty = Penalty::of(terms);
    let samples: usize = training.recordings.iter().map(|r| r.len()).sum();
    let every = samples.div_ceil(ENOUGH);
    let springs = chosen(training, &nodes, penalty, every).ok_or(IdentifyError::Undetermined)?;
    with_springs(training, &nodes, &springs, penalty).ok_or(IdentifyError::Undetermined)
}

/// The elements with given springs.
fn with_springs(
    training: &Training<'_>,
    nodes: &[f64],
    springs: &[Spring],
    penalty: Penalty,
) -> Option<model::Elements> {
    let all: Vec<usize> = (0..springs.len()).collect();
    let sums = Sums::of(training, nodes, springs, 1);
    Some(sums.solve(&all, penalty)?.elements)
}

/// The springs that are worth it.
fn chosen(
    training: &Training<'_>,
    nodes: &[f64],
    penalty: Penalty,
    every: usize,
) -> Option<Vec<Spring>> {
    let solved = |springs: &[Spring]| -> Option<Solved> {
        let all: Vec<usize> = (0..springs.len()).collect();
        Sums::of(training, nodes, springs, every).solve(&all, penalty)
    };
    let ladder = ladder(training);
    // only the latches that are already chosen differ from round to round
    let sums = Sums::of(training, nodes, &ladder, every);
    let mut best = sums.solve(&[], penalty)?;
    while best.elements.springs.len() < MAX_SPRINGS {
        let now = &best.elements.springs;
        let latched = now.iter().any(|s| matches!(s, Spring::Latch { .. }));
        let mut tried: Vec<Solved> = if latched {
            let with = |spring: &Spring| solved(&[&now[..], &[*spring]].concat());
            ladder.par_iter().filter_map(with).collect()
        } else {
            let kept: Vec<usize> = (now.iter())
                .filter_map(|spring| ladder.iter().position(|other| other == spring))
                .collect();
            let with = |k: usize| sums.solve(&[&kept[..], &[k]].concat(), penalty);
            (0..ladder.len())
                .into_par_iter()
                .filter(|k| !kept.contains(k))
                .filter_map(with)
                .collect()
        };
        let latches = latch::likely(training, &best.elements, every);
        let with = |latch: &Spring| solved(&[&now[..], &[*latch]].concat());
        tried.extend(latches.iter().filter_map(with));
        let next = (tried.into_iter()).min_by(|a, b| a.square.total_cmp(&b.square));
        match next.filter(|next| next.square < (1.0 - WORTH) * best.square) {
            Some(next) => best = next,
            None => break,
        }
    }
    let mut springs = best.elements.springs.clone();
    for factor in VARIED {
        for at in 0..springs.len() {
            for by in [factor, 1.0 / factor] {
                for varied in varied(&springs[at], by, nodes[1] - nodes[0]) {
                    let mut others = springs.clone();
                    others[at] = varied;
                    if let Some(next) = solved(&others).filter(|next| next.square < best.square) {
                        (best, springs) = (next, others);
                    }
                }
            }
        }
    }
    // what the variation of others has made superfluous
    while let Some(without) = (0..springs.len())
        .filter_map(|at| {
            let mut others = springs.clone();
            others.remove(at);
            solved(&others)
        })
        .min_by(|a, b| a.square.total_cmp(&b.square))
        .filter(|without| (1.0 - WORTH) * without.square <= best.square)
    {
        springs = without.elements.springs.clone();
        best = without;
    }
    Some(springs)
}

/// A spring with another length or time. The ends of a latch move by a part of the spacing.
fn varied(spring: &Spring, by: f64, spacing_mm: f64) -> Vec<Spring> {
    match *spring {
        Spring::Stop { slip_mm } => vec![Spring::Stop {
            slip_mm: slip_mm * by,
        }],
        Spring::Maxwell {
            slip_mm,
            relaxation_s,
        } => vec![Spring::Maxwell {
            slip_mm,
            relaxation_s: relaxation_s * by,
        }],
        Spring::Latch { rearm_mm, break_mm } => {
            let by_mm = 1.5 * (by - 1.0) * spacing_mm;
            let other = |rearm_mm: f64, break_mm: f64| Spring::Latch { rearm_mm, break_mm };
            [
                other(rearm_mm + by_mm, break_mm),
                other(rearm_mm, break_mm + by_mm),
                other(rearm_mm + by_mm, break_mm + by_mm),
            ]
            .into_iter()
            .filter(Spring::is_valid)
            .collect()
        }
    }
}

/// Stops and Maxwell branches that are tried.
fn ladder(training: &Training<'_>) -> Vec<Spring> {
    let travel_mm = training.range_mm[1] - training.range_mm[0];
    let counts = (training.recordings.iter()).filter_map(|r| r.resolution_mm());
    let least_mm = LEAST_COUNTS * counts.fold(0.0, f64::max);
    let stops = (SLIPS.iter().map(|share| share * travel_mm))
        .filter(|slip_mm| *slip_mm >= least_mm)
        .map(|slip_mm| Spring::Stop {
            slip_mm: rounded(slip_mm),
        });
    let longest =
        (training.recordings.iter()).max_by(|a, b| a.duration_s().total_cmp(&b.duration_s()));
    let (duration_s, intervals) =
        longest.map_or((0.0, 1), |r| (r.duration_s(), r.len().max(2) - 1));
    let (ratio, first) = RELAXATIONS;
    let branches = (0..MOST_RELAXATIONS)
        .map(|k| first * duration_s / intervals as f64 * ratio.powi(k as i32))
        .take_while(|relaxation_s| *relaxation_s <= LONGEST * duration_s)
        .map(|relaxation_s| Spring::Maxwell {
            // what it reaches at twice the trained speed, or over the whole travel
            slip_mm: rounded((2.0 * training.top_speed_mm_s * relaxation_s).min(travel_mm)),
            relaxation_s: rounded(relaxation_s),
        });
    stops.chain(branches).collect()
}

/// With three significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}
