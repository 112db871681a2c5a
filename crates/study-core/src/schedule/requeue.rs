//! Where a failed trial is inserted again.

use super::constraints::keeps;
use crate::protocol::{Design, Trial};
use study_base::text::ModelId;

/// The trials that remain after a failed attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Requeued {
    /// The remaining trials in order, the failed one among them.
    pub queue: Vec<Trial>,
    /// Whether no place satisfied `max_run` and `min_distance`.
    pub constraint_broken: bool,
}

/// Inserts a failed trial at the end of its block; if that violates a constraint, at
/// the latest place in the rest of the block that violates none; if there is none, at
/// the end, flagged.
///
/// `presented` are the attempts so far in the order of presentation, the failed one
/// included; `rest` is the queue without it. If its block has no trial left, the
/// failed trial comes next. Practice is repeated within practice, where no constraint
/// holds. Only distances to the failed trial can become smaller.
pub fn requeue(presented: &[&Trial], rest: &[Trial], failed: &Trial, design: &Design) -> Requeued {
    let same_block = |t: &Trial| t.practice == failed.practice && t.block == failed.block;
    let end = rest.iter().rposition(same_block).map_or(0, |last| last + 1);
    let mut models: Vec<&ModelId> = presented
        .iter()
        .filter(|t| !t.practice)
        .map(|t| &t.model)
        .collect();
    let so_far = models.len();
    models.extend(rest.iter().filter(|t| !t.practice).map(|t| &t.model));

    let keeps_at = |place: &usize| {
        let at = so_far + rest[..*place].iter().filter(|t| !t.practice).count();
        let mut models = models.clone();
        models.insert(at, &failed.model);
        keeps(&models, at, design.max_run, design.min_distance)
    };
    let good = (0..=end)
        .rev()
        .find(|place| failed.practice || keeps_at(place));
    let mut queue = rest.to_vec();
    queue.insert(good.unwrap_or(end), failed.clone());
    Requeued {
        queue,
        constraint_broken: good.is_none(),
    }
}
