//! That a study confirms what a search found.

use study_plan::protocol::Confirms;

/// The search and its result, in sentences. Untrusted.
pub fn sentence(search: &Confirms) -> String {
    let hash: String = search.pairs_sha256.chars().take(16).collect();
    format!(
        "This study confirms, on participants who did not search, what the part {} of the study {} found to be best: {} \
         (SHA-256 of its pairs {hash}…). No answer of the search is in this analysis.",
        search.part, search.study, search.best
    )
}
