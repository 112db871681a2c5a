//! What is said after a session.

use crate::cli::Failure;
use std::path::Path;
use study_session::outcome::ParticipantRow;
use study_session::store::{Derived, StoreError};

/// The failure to report if the tables could not be written after a session.
pub(super) fn unwritten(why: &StoreError, folder: &Path) -> Failure {
    let rebuild = format!("`study verify {} --rebuild`", folder.display());
    let failure = Failure::results(format!(
        "the answers are safe in the journals; the tables could not be written: {why}"
    ));
    failure.hint(match why {
        e if e.is_full() => format!("free some disk space, then run {rebuild}"),
        e => match e.hint() {
            Some(hint) => hint,
            None => format!("resolve this, then run {rebuild}"),
        },
    })
}

/// A warning if the force was wrong in some of `all` trials of the session. The participant
/// may read it: it does not say in which.
pub(super) fn wrong_forces([wrong, all]: [usize; 2]) -> Option<String> {
    (wrong > 0).then(|| {
        format!(
            "warning: in {wrong} of {all} trials the force was not what the device was told; before the \
             next session, `study device check` shows what it does wrong"
        )
    })
}

/// What `study analyze` has to be told to find data in a study without a participant.
pub(super) fn included(derived: &Derived) -> &'static str {
    let any = |what: fn(&ParticipantRow) -> bool| derived.participants.iter().any(what);
    match (any(|p| !p.pilot && !p.simulated), any(|p| p.pilot)) {
        (true, _) => "",
        (false, true) => " --include pilot",
        (false, false) => " --include simulated",
    }
}
