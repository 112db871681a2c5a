//! Where a failed trial comes back.

use super::constraints::keeps;
use crate::protocol::{Design, Trial};
use study_base::text::ModelId;

/// What is still to come after an attempt has failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Requeued {
    /// The trials to come, first the next, the failed one among them.
    pub queue: Vec<Trial>,
    /// Whether no place was left that keeps `max_run` and `min_distance`.
    pub constraint_broken: bool,
}

/// Puts a failed trial back at the end of its block; where that breaks a
/// constraint, at the latest place in the rest of the block that breaks none; if
/// there is none, at the end all the same, and says so.
///
/// `felt` are the attempts so far in the order in which the hand felt them, the
/// failed one included; `rest` is the queue without it. A trial whose block has
/// nothing left comes right away. Practice comes back within practice, where no
/// constraint holds. Only pairs with the failed trial can become worse: the
/// others move apart or stay.
pub fn requeue(felt: &[&Trial], rest: &[Trial], failed: &Trial, design: &Design) -> Requeued {
    let same_block = |t: &Trial| t.practice == failed.practice && t.block == failed.block;
    let end = rest.iter().rposition(same_block).map_or(0, |last| last + 1);
    let mut models: Vec<&ModelId> = felt
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
