//! An analysis to bytes: the terminal page, CSV tables, one JSON document.
//!
//! Nothing is computed here: every number stands in the analysis, by its
//! identifier. Text from the data is escaped on its way to a terminal and stored
//! as it is in CSV and JSON.

pub mod csv;
pub mod identification;
pub mod json;
pub mod plot;
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
