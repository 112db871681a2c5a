//! What was analyzed, for the head of a report.

use crate::preregister::Comparison;
use study_plan::protocol::Confirms;

/// What was analyzed, for the head of a report.
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
    /// The search that the study confirms.
    pub confirms: Option<Confirms>,
}

/// A site of a pooled analysis. All text is untrusted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Site {
    /// Name, as in the statistics.
    pub name: String,
    /// Folder of its study.
    pub path: String,
    /// Participants whose ratings the table has, analyzed or not.
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
