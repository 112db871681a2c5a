//! That a study confirms what a search found.

use study_plan::protocol::Confirms;

/// The search and its result, in sentences. Untrusted.
pub fn sentence(search: &Confirms) -> String {
    let hash: String = search.pairs_sha256.chars().take(16).collect();
    let sentence = format!(
        "This study confirms, on participants who did not search, what the part {} of the study {} found to be best: {} \
         (SHA-256 of its pairs {hash}…). No answer of the search is in this analysis.",
        search.part, search.study, search.best
    );
    match searched_by(search) {
        None => sentence,
        Some(who) => format!("{sentence} {who}"),
    }
}

/// Who searched besides real participants.
fn searched_by(search: &Confirms) -> Option<&'static str> {
    match (search.simulated, search.pilot) {
        (true, true) => Some("SIMULATED participants and PILOTS are among those who searched."),
        (true, false) => Some(
            "SIMULATED participants searched: that this point is the best one is no finding about people.",
        ),
        (false, true) => Some("PILOTS are among those who searched."),
        (false, false) => None,
    }
}
