//! A realization for every λ and dx, each compared with other recordings.

use super::vaf::{self, Score};
use super::{Identified, IdentifyError, Method, Training, Warning};
use crate::identify::method::Ewls;
use crate::identify::resample::Resample;
use crate::model::Realization;
use crate::model::predict::Lookup;
use crate::recording::Recording;

/// What to identify.
#[derive(Debug, Clone, PartialEq)]
pub enum Plan {
    /// The paper's method, for each λ and dx.
    Ewls {
        /// Forgetting factors.
        lambdas: Vec<f64>,
        /// Resampling increments, mm.
        dx_mm: Vec<f64>,
        /// How estimates are brought to the nodes.
        resample: Resample,
    },
    /// Mean force by position and direction, for each dx.
    Static {
        /// Resampling increments, mm.
        dx_mm: Vec<f64>,
    },
    /// One straight line.
    Spring,
}

impl Plan {
    /// How many realizations it makes.
    pub fn cells(&self) -> usize {
        match self {
            Self::Ewls { lambdas, dx_mm, .. } => lambdas.len() * dx_mm.len(),
            Self::Static { dx_mm } => dx_mm.len(),
            Self::Spring => 1,
        }
    }
}

/// One realization and how well it predicts.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// How it was identified.
    pub method: Method,
    /// With VAF by the names of the recordings; its id is empty.
    pub realization: Realization,
    /// In the order of the recordings.
    pub scores: Vec<Score>,
    /// Share of the nodes with m < 0, 0 to 1.
    pub negative_mass: f64,
    /// Share of the nodes with b < 0, 0 to 1.
    pub negative_damping: f64,
    /// What is doubtful.
    pub warnings: Vec<Warning>,
}

/// Identifies every cell, λ by λ, and scores it on `recordings`. `done` is told
/// after each cell.
///
/// # Errors
/// [`IdentifyError`] of the first cell that cannot be identified.
pub fn run(
    training: &Training<'_>,
    plan: &Plan,
    lookup: Lookup,
    recordings: &[&Recording],
    mut done: impl FnMut(),
) -> Result<Vec<Cell>, IdentifyError> {
    let mut cells = Vec::with_capacity(plan.cells());
    let mut keep = |method, identified| {
        cells.push(cell(method, identified, recordings));
        done();
    };
    match plan {
        Plan::Ewls {
            lambdas,
            dx_mm,
            resample,
        } => {
            // faults of dx before the work begins
            for dx in dx_mm {
                training.nodes(*dx)?;
            }
            for lambda in lambdas {
                let estimates = training.estimates(*lambda)?;
                let method = Method::Ewls(Ewls::paper(*lambda, *resample));
                for dx in dx_mm {
                    keep(method, training.ewls(&estimates, *dx, *resample, lookup)?);
                }
            }
        }
        Plan::Static { dx_mm } => {
            for dx in dx_mm {
                keep(Method::Static, training.static_profile(*dx, lookup)?);
            }
        }
        Plan::Spring => keep(Method::Spring, training.spring(lookup)),
    }
    Ok(cells)
}

fn cell(method: Method, identified: Identified, recordings: &[&Recording]) -> Cell {
    let [negative_mass, negative_damping] = identified.negative_shares();
    let Identified {
        mut realization,
        warnings,
    } = identified;
    let scores: Vec<Score> = recordings
        .iter()
        .map(|recording| vaf::score(&realization, recording))
        .collect();
    for (recording, score) in recordings.iter().zip(&scores) {
        let name = recording.name.clone();
        let hash = recording.sha256.clone();
        realization.provenance.recordings.insert(name.clone(), hash);
        realization.vaf.insert(name, score.vaf);
    }
    Cell {
        method,
        realization,
        scores,
        negative_mass,
        negative_damping,
        warnings,
    }
}

/// The cell with the highest mean VAF over the first `validations` recordings;
/// of equals the first.
pub fn best(cells: &[Cell], validations: usize) -> Option<usize> {
    let mean = |cell: &Cell| {
        let scores = &cell.scores[..validations.min(cell.scores.len())];
        scores.iter().map(|s| s.vaf).sum::<f64>() / scores.len() as f64
    };
    let mut best: Option<(usize, f64)> = None;
    for (i, cell) in cells.iter().enumerate() {
        let vaf = mean(cell);
        if vaf.is_finite() && best.is_none_or(|(_, highest)| vaf > highest) {
            best = Some((i, vaf));
        }
    }
    best.map(|(i, _)| i)
}
