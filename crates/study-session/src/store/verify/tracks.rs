//! Replaying the tracks of a session from its journal.

use super::Finding;
use crate::store::sessions::SessionData;
use study_plan::procedure;
use study_plan::protocol::Protocol;

/// Compares every level that a track proposed and presented with its rule, given the
/// answers before it. The first difference of a track is a problem.
pub(super) fn verify_tracks(
    session: &SessionData,
    protocol: &Protocol,
    place: &str,
    found: &mut Vec<Finding>,
) {
    let Some(start) = session.history.start() else {
        return;
    };
    let protocol = &protocol.of(&start.assigned);
    for rules in &protocol.tracks {
        let recorded = session.history.recorded(rules);
        let what = match protocol.start(rules, start.seat) {
            Err(why) => why.to_string(),
            Ok(track) => match procedure::verify(track, &recorded) {
                Ok(()) => continue,
                Err(why) => why.to_string(),
            },
        };
        found.push(Finding::problem(
            place,
            format!("track `{}`: {what}", rules.id),
        ));
    }
}
