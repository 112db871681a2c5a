//! Records of the tests of a device: `devices/SERIAL/` in the results folder.
//!
//! One file for each test, named by its time. A session looks at the last check.

use crate::cli::device_selection::{Tested, commissioned};
use crate::cli::{Console, Failure, Kind};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use study_base::text::Untrusted;
use study_device::Device;
use study_plan::protocol::DeviceKind;

/// `study-device-record/1`.
const FORMAT: &str = "study-device-record/1";
/// Folder of the records in a results folder.
const FOLDER: &str = "devices";

/// Which test it is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(in crate::cli) enum RecordKind {
    /// `study device check`.
    Check,
    /// `study device commission`.
    Commission,
}

impl RecordKind {
    fn as_str(self) -> &'static str {
        match self {
            Self::Check => "check",
            Self::Commission => "commission",
        }
    }
}

/// A record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::cli) struct Record {
    format: String,
    pub(in crate::cli) kind: RecordKind,
    /// File name without ending.
    pub(in crate::cli) id: String,
    #[serde(flatten)]
    pub(in crate::cli) tested: Tested,
    /// RFC 3339.
    pub(in crate::cli) at: chrono::DateTime<chrono::FixedOffset>,
    /// Whether every part of the test was passed.
    pub(in crate::cli) pass: bool,
    pub(in crate::cli) summary: String,
    /// The parts of the test.
    pub(in crate::cli) parts: serde_json::Value,
}

impl Record {
    /// A record of a test that has just ended.
    pub(in crate::cli) fn new(
        kind: RecordKind,
        tested: Tested,
        pass: bool,
        summary: String,
        parts: serde_json::Value,
    ) -> Self {
        let at = chrono::Local::now().fixed_offset();
        Self {
            format: FORMAT.to_owned(),
            kind,
            id: format!("{}-{}", at.format("%Y%m%d-%H%M%S"), kind.as_str()),
            tested,
            at,
            pass,
            summary,
            parts,
        }
    }

    /// Whether the rendering was judged, and not only the clauses of the wire format.
    fn judged_rendering(&self) -> bool {
        let lines = self
            .parts
            .get("rendering")
            .and_then(|lines| lines.as_array());
        lines.is_some_and(|lines| !lines.is_empty())
    }

    /// Writes it below a results folder; returns its path.
    pub(in crate::cli) fn save(&self, results: &Path) -> Result<PathBuf, Failure> {
        let folder = folder(results, &self.tested.serial);
        std::fs::create_dir_all(&folder).map_err(|e| Failure::file(&folder, &e))?;
        let path = folder.join(format!("{}.json", self.id));
        let text = serde_json::to_string_pretty(self).map_err(|e| Failure::new(Kind::Bug, e))?;
        std::fs::write(&path, text + "\n").map_err(|e| Failure::file(&path, &e))?;
        Ok(path)
    }
}

/// The folder of a device; its serial number is text of the device.
fn folder(results: &Path, serial: &str) -> PathBuf {
    let plain = |c: char| match c {
        'a'..='z' | 'A'..='Z' | '0'..='9' | '-' | '_' => c,
        _ => '_',
    };
    let name: String = serial.chars().take(64).map(plain).collect();
    results.join(FOLDER).join(name)
}

/// The last record of a kind; files that are no such records are skipped.
pub(in crate::cli) fn last(results: &Path, serial: &str, kind: RecordKind) -> Option<Record> {
    let items = std::fs::read_dir(folder(results, serial)).ok()?;
    let records = items.flatten().filter_map(|item| {
        let record: Record = serde_json::from_slice(&std::fs::read(item.path()).ok()?).ok()?;
        let own = record.format == FORMAT && record.kind == kind && record.tested.serial == serial;
        own.then_some(record)
    });
    records.max_by_key(|record| record.at)
}

/// Why the last check does not count: it failed, is of another firmware or,
/// if the protocol says within how many hours, is missing or older or did not judge the rendering.
/// `None` if it does.
pub(in crate::cli) fn doubt(
    last: Option<&Record>,
    firmware: Option<&str>,
    within_h: Option<f64>,
    now: chrono::DateTime<chrono::FixedOffset>,
) -> Option<String> {
    let Some(last) = last else {
        let why = "no check of this device is on record, and the protocol asks for one";
        return within_h.map(|_| why.to_owned());
    };
    let at = last.at.format("%Y-%m-%d %H:%M");
    if !last.pass {
        return Some(format!("its last check, of {at}, failed"));
    }
    if last.tested.firmware.as_deref() != firmware {
        return Some(format!(
            "its last check, of {at}, was of another firmware version"
        ));
    }
    if within_h.is_some() && !last.judged_rendering() {
        return Some(format!(
            "its last check, of {at}, did not judge its rendering, and the protocol asks for one that did"
        ));
    }
    let age_h = (now - last.at).num_seconds() as f64 / 3600.0;
    let within_h = within_h.filter(|h| age_h > *h)?;
    Some(format!(
        "its last check, of {at}, is older than the {within_h} h that the protocol allows"
    ))
}

/// What the session records of the last check of a device of this kind.
///
/// # Errors
/// [`Failure`] if the check does not count, and the user did not give `--unchecked`.
pub(in crate::cli) fn checked(
    device: &dyn Device,
    results: &Path,
    (kind, within_h, unchecked): (DeviceKind, Option<f64>, bool),
    now: chrono::DateTime<chrono::FixedOffset>,
    console: &mut Console,
) -> Result<Option<String>, Failure> {
    if matches!(kind, DeviceKind::Simulated | DeviceKind::Manual) {
        return Ok(None);
    }
    let tested = Tested::of(device);
    let found = last(results, &tested.serial, RecordKind::Check);
    let doubt = doubt(found.as_ref(), tested.firmware.as_deref(), within_h, now);
    let said = match found {
        Some(last) => Some(format!("{}: {}", last.id, last.summary)),
        None => commissioned(&tested.serial, console),
    };
    let Some(doubt) = doubt else {
        return Ok(said);
    };
    if !unchecked {
        let serial = Untrusted(&tested.serial);
        return Err(Failure::device(format!("{serial}: {doubt}")).hint(
            "`study device check --save --port PORT` checks it; with --unchecked the session goes on, \
             and its records say so",
        ));
    }
    let said = said.map_or_else(String::new, |said| format!("; {said}"));
    Ok(Some(format!("unchecked, by choice: {doubt}{said}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(pass: bool) -> Record {
        let tested = Tested {
            serial: "A/1".to_owned(),
            firmware: Some("f1".to_owned()),
            simulated: false,
        };
        Record::new(
            RecordKind::Check,
            tested,
            pass,
            "s".to_owned(),
            serde_json::json!({ "rendering": [{ "what": "mass alone", "result": "pass" }] }),
        )
    }

    #[test]
    fn the_last_record_of_a_device_is_found() {
        let home = tempfile::tempdir().unwrap();
        assert_eq!(last(home.path(), "A/1", RecordKind::Check), None);
        let mut first = record(true);
        first.at -= chrono::Duration::hours(3);
        first.id = "first".to_owned();
        first.save(home.path()).unwrap();
        let second = record(false);
        let path = second.save(home.path()).unwrap();
        assert!(path.starts_with(home.path().join("devices/A_1")));
        std::fs::write(path.with_file_name("other.json"), "{}").unwrap();
        let found = last(home.path(), "A/1", RecordKind::Check).unwrap();
        assert_eq!((found.id, found.pass), (second.id, false));
        assert_eq!(last(home.path(), "A/1", RecordKind::Commission), None);
        // The same folder, but another device.
        assert_eq!(last(home.path(), "A.1", RecordKind::Check), None);
    }

    #[test]
    fn a_check_speaks_for_a_device_only_if_it_passed_lately_with_this_firmware() {
        let (good, bad) = (record(true), record(false));
        let now = good.at + chrono::Duration::hours(5);
        let of = |last, firmware, within| doubt(last, Some(firmware), within, now);
        assert_eq!(of(Some(&good), "f1", Some(6.0)), None);
        assert_eq!(of(Some(&good), "f1", None), None);
        assert_eq!(of(None, "f1", None), None);
        for (last, firmware, within, word) in [
            (Some(&good), "f1", Some(4.0), "older than the 4 h"),
            (Some(&good), "f2", None, "another firmware"),
            (Some(&bad), "f1", None, "failed"),
            (None, "f1", Some(4.0), "no check"),
        ] {
            let why = of(last, firmware, within).unwrap();
            assert!(why.contains(word), "{why}");
        }
        for parts in [
            serde_json::json!({}),
            serde_json::json!({ "rendering": null }),
            serde_json::json!({ "rendering": [] }),
        ] {
            let clauses_alone = Record {
                parts,
                ..record(true)
            };
            let of = |last, within| doubt(Some(last), Some("f1"), within, now);
            let why = of(&clauses_alone, Some(6.0)).unwrap();
            assert!(why.contains("did not judge its rendering"), "{why}");
            // Where the protocol asks for nothing it counts.
            assert_eq!(of(&clauses_alone, None), None);
        }
    }
}
