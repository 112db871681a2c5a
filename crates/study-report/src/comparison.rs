//! How a study compares with its preregistration.

use study_analysis::preregister::Comparison;

/// How the study compares, in a sentence.
pub fn sentence(c: &Comparison) -> String {
    let first = c.first_session.map_or_else(String::new, |at| {
        format!("; the first session began on {}", at.format("%Y-%m-%d"))
    });
    let hash: String = c.sha256.chars().take(16).collect();
    let verdict = match c.deviations.is_empty() {
        true => "the study matches it".to_owned(),
        false => format!("the study deviates: {}", c.deviations.join("; ")),
    };
    format!(
        "Preregistered on {} (SHA-256 {hash}…){first}; {verdict}.",
        c.date
    )
}
