//! Renders an analysis: terminal page, HTML report, figures, CSV tables, JSON.
//!
//! Nothing is inferred here: statistics and verdicts are looked up in the analysis,
//! and what is absent is left out. Text from the data is escaped on its way to a
//! terminal, to HTML and to a picture; CSV and JSON store it as it is.

mod answers;
mod apa;
pub mod chart;
pub mod commission;
pub mod comparison;
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
pub mod preregistration;
mod sentences;
mod sites;
pub mod text;
pub mod wide;

use study_core::preregister::Comparison;

/// What was analysed, for the head of a report.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Source {
    /// Title of the study or name of the file. Untrusted.
    pub title: String,
    /// Id of the study; `None` for a foreign table.
    pub study: Option<String>,
    /// Version of the protocol whose rules were applied.
    pub protocol_version: Option<u32>,
    /// Path, as the user gave it. Untrusted.
    pub path: String,
    /// The sites of a pooled analysis; otherwise empty.
    pub sites: Vec<Site>,
    /// How the study compares with its preregistration, if it has one.
    pub preregistration: Option<Comparison>,
}

/// A site of a pooled analysis. All text is untrusted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Site {
    /// Name, as in the statistics.
    pub name: String,
    /// Folder of its study.
    pub path: String,
    /// Participants whose ratings the table has, analysed or not.
    pub participants: usize,
    /// Days of the first and the last session.
    pub days: Option<(String, String)>,
    /// Devices, in the order of their sessions.
    pub devices: Vec<SiteDevice>,
}

/// A device that sessions of a site were run with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SiteDevice {
    /// Kind.
    pub kind: String,
    /// What it says it is: name, serial number, firmware.
    pub id: String,
    /// Sessions.
    pub sessions: usize,
    /// The last commissioning test before the latest of them, and its age then in days.
    pub check: Option<(String, Option<i64>)>,
}
