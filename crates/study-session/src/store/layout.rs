//! Names of the files and folders of a results folder.

use std::path::{Path, PathBuf};
use study_base::text::ParticipantId;

/// The study and the versions of its protocol.
pub const MANIFEST: &str = "study.json";
/// Folder of the frozen copies of the protocol, by version.
pub const PROTOCOLS: &str = "protocol";
/// The protocol file in each copy.
pub const PROTOCOL: &str = "protocol.toml";
/// Folder with one folder for each participant, each with one for each session.
pub const SESSIONS: &str = "sessions";
/// Record of a participant whose data were erased.
pub const TOMBSTONE: &str = "tombstone.json";
/// The last acknowledged record of a session's journal.
pub const HEAD: &str = "head.json";
/// Written when a session is left: its last record.
pub const RECEIPT: &str = "receipt.json";
/// The participant's copy of the consent document, with initials if they typed some.
pub const CONSENT: &str = "consent.txt";
/// Folder of a session's telemetry, one file for each attempt.
pub const TELEMETRY: &str = "telemetry";
/// File that reserves disk space for the last records of a session.
pub const RESERVE: &str = "reserve";
/// The same file before the session is claimed.
pub const PROBE: &str = ".probe";
/// Log of the orders that were shown during the study.
pub const REVEALS: &str = "reveals.jsonl";
/// Derived: one row for each trial.
pub const RATINGS: &str = "ratings.csv";
/// Derived: every attempt, answer, correction and failure.
pub const ATTEMPTS: &str = "attempts.csv";
/// Derived, in a study with parts: every presentation.
pub const INTERVALS: &str = "intervals.csv";
/// Derived: one row for each participant.
pub const PARTICIPANTS: &str = "participants.csv";

/// Folder of the records of `study doctor`, which nothing is derived from.
pub const DOCTOR: &str = "doctor";
/// Folder in which a disk is tried.
pub const TRIAL: &str = ".study-doctor.tmp";

/// What a session's folder contains beside the segments of its journal.
pub const OF_SESSION: [&str; 7] = [
    HEAD,
    ".head.json.tmp",
    RECEIPT,
    TELEMETRY,
    RESERVE,
    CONSENT,
    ".consent.txt.tmp",
];

/// The derived tables.
pub const TABLES: [&str; 4] = [RATINGS, ATTEMPTS, PARTICIPANTS, INTERVALS];
/// Derived by `study analyze`: the results of the analysis.
pub const ANALYSIS: &str = "analysis";

/// Whether a file is needed only for a while: by an open session, or until it is
/// renamed.
pub fn is_passing(name: &str) -> bool {
    let hidden = name.starts_with('.');
    name == RESERVE || name == PROBE || (hidden && name.ends_with(".tmp"))
}

/// Folder of the frozen copy of a version of the protocol.
pub fn protocol(study: &Path, version: u32) -> PathBuf {
    study.join(PROTOCOLS).join(version.to_string())
}

/// A participant's folder.
pub fn participant(study: &Path, id: &ParticipantId) -> PathBuf {
    study.join(SESSIONS).join(id.as_str())
}

/// A session's folder.
pub fn session(study: &Path, id: &ParticipantId, session: u32) -> PathBuf {
    participant(study, id).join(session.to_string())
}

/// File name of a segment of a journal, from 1.
pub fn segment(number: u32) -> String {
    if number == 1 {
        "journal.jsonl".to_owned()
    } else {
        format!("journal-{number}.jsonl")
    }
}

/// Number of the journal segment with this file name.
pub fn segment_number(name: &str) -> Option<u32> {
    let number = match name.strip_prefix("journal")?.strip_suffix(".jsonl")? {
        "" => 1,
        rest => rest.strip_prefix('-')?.parse().ok()?,
    };
    (segment(number) == name).then_some(number)
}

/// File name of the copy of an incomplete last line, from 1.
pub fn torn(number: u32) -> String {
    format!("torn-{number}.bin")
}

/// Whether a file name is one of [`torn`].
pub fn is_torn(name: &str) -> bool {
    name.strip_prefix("torn-")
        .and_then(|n| n.strip_suffix(".bin"))
        .is_some_and(|n| n.parse::<u32>().is_ok())
}

/// File name of the telemetry of an attempt; `copy`, from 1, distinguishes files of
/// the same attempt.
pub fn telemetry(trial: u32, attempt: u32, copy: u32) -> String {
    if copy == 1 {
        format!("{trial:03}-a{attempt}.csv")
    } else {
        format!("{trial:03}-a{attempt}-{copy}.csv")
    }
}

/// The same for an interval, if the trial has several.
pub fn telemetry_of(trial: u32, attempt: u32, interval: Option<u32>, copy: u32) -> String {
    let Some(interval) = interval else {
        return telemetry(trial, attempt, copy);
    };
    let copy = match copy {
        1 => String::new(),
        copy => format!("-{copy}"),
    };
    format!("{trial:03}-a{attempt}-i{interval}{copy}.csv")
}

/// Parses a number from 1 without leading zeros.
pub fn number(name: &str) -> Option<u32> {
    let n: u32 = name.parse().ok()?;
    (n > 0 && n.to_string() == name).then_some(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_has_one_name_and_a_name_one_segment() {
        for n in 1..12 {
            assert_eq!(segment_number(&segment(n)), Some(n));
        }
        for other in [
            "journal-1.jsonl",
            "journal-02.jsonl",
            "journal.json",
            "journal-x.jsonl",
        ] {
            assert_eq!(segment_number(other), None, "{other}");
        }
    }

    #[test]
    fn the_design_names_the_telemetry() {
        assert_eq!(telemetry(7, 1, 1), "007-a1.csv");
        assert_eq!(telemetry(7, 1, 2), "007-a1-2.csv");
        assert_eq!(telemetry_of(7, 1, Some(2), 1), "007-a1-i2.csv");
        assert_eq!(telemetry_of(7, 1, Some(2), 3), "007-a1-i2-3.csv");
    }

    #[test]
    fn only_a_plain_number_names_a_session() {
        assert_eq!(number("12"), Some(12));
        for bad in ["0", "01", "+1", "1 ", "", "x"] {
            assert_eq!(number(bad), None, "{bad}");
        }
    }
}
