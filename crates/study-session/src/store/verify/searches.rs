//! Replaying the searches of a session from its journal.

use super::Finding;
use crate::store::sessions::SessionData;
use study_base::text::ModelId;
use study_plan::procedure::search::verify_search;
use study_plan::protocol::{Protocol, SpaceRules, Stimuli, Trial};

/// Compares every pair of points that a search presented, and their order, with its rule, given the answers before it.
/// The first difference of a search is a problem.
pub(super) fn verify_searches(
    session: &SessionData,
    protocol: &Protocol,
    place: &str,
    found: &mut Vec<Finding>,
) {
    let Some(start) = session.history.start() else {
        return;
    };
    let protocol = &protocol.of(&start.assigned);
    for part in &protocol.parts {
        let Some((space, _)) = protocol.searched(part) else {
            continue;
        };
        let search = match protocol.start_search(part, start.seat) {
            Some(Ok(search)) => search,
            Some(Err(why)) => {
                found.push(Finding::problem(
                    place,
                    format!("search `{}`: {why}", part.id),
                ));
                continue;
            }
            None => continue,
        };
        let mut trials = session.history.searched(&part.id);
        let turned = trials.find(|(trial, attempt)| !in_order(space, trial, &attempt.models));
        let what = match turned {
            Some((trial, _)) => format!(
                "trial {} does not present two points of its space in the planned order",
                trial.trial
            ),
            None => {
                let compared = session.history.compared(&part.id, space);
                let left_out = session.history.left_out(&part.id, space);
                match verify_search(search, &compared, &left_out) {
                    Ok(()) => continue,
                    Err(why) => why.to_string(),
                }
            }
        };
        let what = format!("search `{}`: {what}", part.id);
        found.push(Finding::problem(place, what));
    }
}

/// Whether the realizations are two points, the one with the higher number first if that is planned.
fn in_order(space: &SpaceRules, trial: &Trial, models: &[ModelId]) -> bool {
    let [first, second] = models else {
        return false;
    };
    let swapped = matches!(trial.stimuli, Stimuli::Search { swapped: true, .. });
    match (space.point_of(first), space.point_of(second)) {
        (Some(first), Some(second)) => first != second && (first > second) == swapped,
        _ => false,
    }
}
