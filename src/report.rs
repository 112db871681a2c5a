//! Renders an analysis: terminal page, HTML report, figures, CSV tables, JSON.
//!
//! Nothing is inferred here: statistics and verdicts are looked up in the analysis,
//! and what is absent is left out. Text from the data is escaped on its way to a
//! terminal, to HTML and to a picture; CSV and JSON store it as it is.

mod answers;
mod apa;
pub mod chart;
pub mod csv;
pub mod figures;
pub mod html;
pub mod identification;
pub mod json;
mod part_answers;
mod part_tables;
pub mod picture;
pub mod plot;
pub mod power;
mod sentences;
pub mod text;
pub mod wide;

/// What was analysed, for the head of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Title of the study or name of the file. Untrusted.
    pub title: String,
    /// Id of the study; `None` for a foreign table.
    pub study: Option<String>,
    /// Version of the protocol whose rules were applied.
    pub protocol_version: Option<u32>,
    /// Path, as the user gave it. Untrusted.
    pub path: String,
}
