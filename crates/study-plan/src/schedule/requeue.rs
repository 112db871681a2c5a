//! Where a failed trial is inserted again.

use super::constraints::Watch;
use crate::protocol::{Design, Trial};
use std::iter::once;
use study_base::text::{ModelId, PartId};

/// What a participant has felt so far in a session.
#[derive(Debug, Clone, Default)]
pub struct Felt<'a> {
    /// One for each presentation, in order, practice included.
    pub trials: Vec<&'a Trial>,
    /// Whether the last one was stopped or interrupted. If its trial comes next, the
    /// same presentation goes on; it is not a further one.
    pub goes_on: bool,
}

/// The trials that remain after a failed attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Requeued {
    /// The remaining trials in order, the failed one among them.
    pub queue: Vec<Trial>,
    /// Whether the order violates `max_run` or `min_distance` wherever the failed trial
    /// is inserted.
    pub constraint_broken: bool,
}

/// Inserts a failed trial at the latest place of its block at which the trials to come
/// violate no constraint. If there is none, it comes at the latest of the places with
/// the fewest violations, flagged.
///
/// `rest` is the queue without the failed trial. If its block has no trial left, the
/// failed trial comes next. Practice is repeated within practice.
pub fn requeue(felt: &Felt<'_>, rest: &[Trial], failed: &Trial, design: &Design) -> Requeued {
    let same_block = |t: &Trial| {
        t.practice == failed.practice && t.block == failed.block && t.part == failed.part
    };
    let end = rest.iter().rposition(same_block).map_or(0, |last| last + 1);
    let part = failed.part.as_ref();
    let watch = watch(felt, design, part);
    let mut best = (usize::MAX, end);
    for place in (0..=end).rev() {
        let (before, after) = rest.split_at(place);
        let to_come = before.iter().chain(once(failed)).chain(after);
        let violations = violations(watch.clone(), felt, to_come, part);
        if violations < best.0 {
            best = (violations, place);
        }
        if violations == 0 {
            break;
        }
    }
    let (violations, place) = best;
    let mut queue = rest.to_vec();
    queue.insert(place, failed.clone());
    Requeued {
        queue,
        constraint_broken: violations > 0,
    }
}

/// Whether any of the trials to come, of the part that comes next, violates a constraint
/// of that part.
pub fn breaks_constraint(felt: &Felt<'_>, to_come: &[Trial], design: &Design) -> bool {
    let part = to_come.first().and_then(|t| t.part.as_ref());
    violations(watch(felt, design, part), felt, to_come.iter(), part) > 0
}

/// The constraints after what was felt.
fn watch<'a>(felt: &Felt<'a>, design: &Design, part: Option<&PartId>) -> Watch<'a> {
    let mut watch = Watch::new(design.max_run, design.min_distance);
    watch.violations(counted(felt.trials.iter().copied(), part));
    watch
}

/// Number of trials to come that violate a constraint.
fn violations<'a>(
    mut watch: Watch<'a>,
    felt: &Felt<'_>,
    to_come: impl Iterator<Item = &'a Trial>,
    part: Option<&PartId>,
) -> usize {
    let under_way = felt.trials.last().filter(|_| felt.goes_on);
    let mut to_come = to_come.peekable();
    to_come.next_if(|next| under_way.is_some_and(|t| t.trial == next.trial));
    watch.violations(counted(to_come, part))
}

/// The realizations of the trials that the constraints concern: those of one part.
fn counted<'a>(
    trials: impl Iterator<Item = &'a Trial>,
    part: Option<&PartId>,
) -> impl Iterator<Item = &'a ModelId> {
    trials
        .filter(move |t| !t.practice && t.part.as_ref() == part)
        .filter_map(Trial::model)
}
