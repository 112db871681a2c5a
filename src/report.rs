//! An analysis to bytes: the terminal page, the HTML report, figures, CSV tables,
//! one JSON document.
//!
//! Nothing is inferred here: every statistic stands in the analysis, by its
//! identifier, and what is absent is left out. Text from the data is escaped on
//! its way to a terminal, to HTML and to SVG, and stored as it is in CSV and JSON.

mod apa;
pub mod csv;
pub mod figures;
pub mod html;
pub mod identification;
pub mod json;
pub mod plot;
pub mod png;
pub mod svg;
pub mod text;

/// What was analysed, for the head of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// For people. Untrusted.
    pub title: String,
    /// Id of the study, if it is one of ours.
    pub study: Option<String>,
    /// Version of the protocol whose rules were applied.
    pub protocol_version: Option<u32>,
    /// Where it was read, as the user gave it. Untrusted.
    pub path: String,
}

/// The question as a noun. Untrusted.
fn asked(a: &crate::analyze::Analysis) -> String {
    match a.question.as_str() {
        "rating" => "the rating".to_owned(),
        other => other.to_owned(),
    }
}
