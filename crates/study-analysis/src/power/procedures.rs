//! Tracks with other procedures and numbers of trials, to be compared in the analysis that will be used.

use super::part_plan::meant;
use super::{Overrides, Plan, PlanError};
use study_plan::protocol::parts::{Part, Task};
use study_plan::protocol::procedures::Procedure;
use study_plan::protocol::{Protocol, check};

/// Studies of each design whose thresholds are also learned together, where nobody says otherwise.
pub const POOLED: u64 = 40;

/// A procedure with a number of trials.
#[derive(Debug, Clone)]
pub struct Alternative {
    /// The procedure.
    pub procedure: Procedure,
    /// Trials of each track; `None`: as the procedure of the protocol has them.
    pub asked: Option<u32>,
    /// Its plan.
    pub plan: Plan,
    /// Minutes of the part for each trial of a participant.
    pub trial_min: f64,
}

impl Alternative {
    /// Minutes of a participant in the part, after so many trials.
    pub fn minutes(&self, trials: f64) -> f64 {
        trials * self.trial_min
    }
}

/// The plans of a protocol with each of these procedures and numbers of trials; without any of them, with
/// the trials of the protocol. The same participants take part in all of them.
///
/// # Errors
/// As [`Plan::of`], or if the part has no tracks with levels, or a ladder does not allow a procedure.
pub fn alternatives(
    protocol: &Protocol,
    flags: &Overrides,
    procedures: &[Procedure],
    trials: &[u32],
) -> Result<Vec<Alternative>, PlanError> {
    let part = meant(protocol, flags.part.as_ref())?.ok_or(PlanError::NoTracks)?;
    let Task::Discrimination { tracks } = &part.task else {
        return Err(PlanError::NoThresholds(part.id.clone()));
    };
    let has_levels = |id| protocol.track(id).is_some_and(|t| t.family().is_some());
    if !tracks.iter().any(has_levels) {
        return Err(PlanError::NoThresholds(part.id.clone()));
    }
    let numbers: Vec<Option<u32>> = match trials {
        [] => vec![None],
        trials => trials.iter().copied().map(Some).collect(),
    };
    let mut found = Vec::new();
    for asked in numbers {
        for procedure in procedures.iter().copied() {
            let changed = protocol.with_procedure(part, procedure, asked);
            let changed = changed.map_err(|why| PlanError::Procedure(procedure, why))?;
            found.push(Alternative {
                procedure,
                asked,
                plan: Plan::of(&changed, flags)?,
                trial_min: trial_minutes(&changed, part),
            });
        }
    }
    Ok(found)
}

/// Minutes of a trial of a part, by the estimate of `study check`.
fn trial_minutes(protocol: &Protocol, part: &Part) -> f64 {
    let mut without = protocol.clone();
    for other in without.parts.iter_mut().filter(|p| p.id == part.id) {
        other.task = Task::Discrimination { tracks: Vec::new() };
    }
    // Breaks depend on all trials and are nobody's of the part.
    let minutes = |protocol: &Protocol| {
        let mut protocol = protocol.clone();
        protocol.design.breaks = None;
        (
            check::minutes(&protocol),
            f64::from(check::trials(&protocol)),
        )
    };
    let ((all, trials), (rest, others)) = (minutes(protocol), minutes(&without));
    (all - rest) / (trials - others).max(1.0)
}

#[cfg(test)]
mod tests;
