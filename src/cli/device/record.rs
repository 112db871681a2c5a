//! Records of the tests of a device: `devices/SERIAL/` in the results folder.
//!
//! One file for each test, named by its time. A session looks at the last check and at the
//! commissionings.

use crate::cli::device_selection::Tested;
use crate::cli::{Failure, Kind};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use study_base::sort::SmallSort as _;
use study_device::commission::{Numbers, Side};

/// `study-device-record/1`.
const FORMAT: &str = "study-device-record/1";
/// Folder of the records in a results folder.
const FOLDER: &str = "devices";
/// A record may be this much ahead of the clock, days.
const CLOCK_DAYS: f64 = 1.0 / 24.0;
/// Least share of the force limit of a study that was weighed.
const WEIGHED: f64 = 0.5;

/// Which test it is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(in crate::cli) enum RecordKind {
    /// `study device check`.
    Check,
    /// `study device commission`.
    Commission,
    /// The motor weighed itself before a session.
    #[serde(rename = "self-weighing")]
    SelfWeighing,
}

impl RecordKind {
    fn as_str(self) -> &'static str {
        match self {
            Self::Check => "check",
            Self::Commission => "commission",
            Self::SelfWeighing => "self-weighing",
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

    /// Whether a part of the test was failed, and not only left out.
    fn has_failure(&self) -> bool {
        let steps = self.parts.get("steps").unwrap_or(&self.parts).as_array();
        let failed = |step: &serde_json::Value| step.get("outcome").is_some_and(|o| o == "failed");
        // what cannot be read was not passed
        !self.pass && steps.is_none_or(|steps| steps.iter().any(failed))
    }

    /// The numbers of a commissioning; those of earlier releases have none.
    pub(in crate::cli) fn numbers(&self) -> Option<Numbers> {
        serde_json::from_value(self.parts.get("numbers")?.clone()).ok()
    }

    /// The largest force that was weighed in both directions, N; those of earlier releases weighed
    /// one.
    fn weighed_n(&self) -> Option<f64> {
        let numbers = self.numbers()?;
        let largest_n = |side| {
            let own = numbers.directions.iter().filter(|fit| fit.pushes == side);
            own.map(|fit| fit.largest_n).reduce(f64::max)
        };
        let [one_n, other_n] = Side::BOTH.map(largest_n);
        Some(one_n?.min(other_n?))
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

/// Makes the folder in which a record will be saved, before somebody works for it.
pub(in crate::cli) fn prepare(results: &Path, serial: &str) -> Result<(), Failure> {
    let folder = folder(results, serial);
    std::fs::create_dir_all(&folder).map_err(|e| Failure::file(&folder, &e))
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

/// The last record of a kind.
pub(in crate::cli) fn last(results: &Path, serial: &str, kind: RecordKind) -> Option<Record> {
    all(results, serial, kind).pop()
}

/// The records of a kind, by their time; files that are no such records are skipped.
fn all(results: &Path, serial: &str, kind: RecordKind) -> Vec<Record> {
    let Ok(items) = std::fs::read_dir(folder(results, serial)) else {
        return Vec::new();
    };
    let records = items.flatten().filter_map(|item| {
        let record: Record = serde_json::from_slice(&std::fs::read(item.path()).ok()?).ok()?;
        let own = record.format == FORMAT && record.kind == kind && record.tested.serial == serial;
        own.then_some(record)
    });
    let mut records: Vec<Record> = records.collect();
    records.small_sort_by_key(|record| record.at);
    records
}

/// The commissionings of a device, by their time; nothing was measured in those of a simulated one.
pub(in crate::cli) fn commissionings(results: &Path, tested: &Tested) -> Vec<Record> {
    let mut all = all(results, &tested.serial, RecordKind::Commission);
    all.retain(|record| record.tested.simulated == tested.simulated);
    all
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

/// Why the commissionings of a device do not speak for it, and whether this holds whatever the
/// protocol asks. All are by their time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::cli) struct CommissionDoubt {
    /// In words, after the name of the device.
    pub(in crate::cli) why: String,
    /// Whether something was found wrong, and not only missing or old.
    pub(in crate::cli) failed: bool,
}

/// What a protocol asks of a commissioning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::cli) struct Within {
    /// Days within which it was passed.
    pub(in crate::cli) days: f64,
    /// Force limit of the study, N.
    pub(in crate::cli) force_n: f64,
}

/// What speaks against a device that was commissioned like this; `None` if the last commissioning
/// was passed with its present firmware, as the protocol asks, and none failed after it.
pub(in crate::cli) fn commission_doubt(
    all: &[Record],
    firmware: Option<&str>,
    within: Option<Within>,
    now: chrono::DateTime<chrono::FixedOffset>,
) -> Option<CommissionDoubt> {
    let doubt = |failed: bool, why: String| Some(CommissionDoubt { why, failed });
    let day = |record: &Record| record.at.format("%Y-%m-%d %H:%M").to_string();
    let passed = all.iter().rposition(|record| record.pass);
    let since = passed.map_or(0, |at| at + 1);
    if let Some(failed) = all[since..].iter().rev().find(|r| r.has_failure()) {
        let why = format!(
            "its commissioning of {} FAILED: {}",
            day(failed),
            failed.summary
        );
        return doubt(true, why);
    }
    let Some(last) = passed.map(|at| &all[at]) else {
        let why = match all.last() {
            None => "it was never commissioned".to_owned(),
            Some(open) => format!(
                "in its commissioning of {} steps were left out: {}",
                day(open),
                open.summary
            ),
        };
        return doubt(false, why);
    };
    let its_last = format!("its last commissioning, of {},", day(last));
    let said = |why: String| doubt(false, format!("{its_last} {why}"));
    if last.tested.firmware.as_deref() != firmware {
        return said("was of another firmware version".to_owned());
    }
    let Some(weighed_n) = last.weighed_n() else {
        return said("was of an earlier release, which weighed one direction only".to_owned());
    };
    let Within { days, force_n } = within?;
    let age_days = (now - last.at).num_seconds() as f64 / 86_400.0;
    if age_days > days {
        return said(format!(
            "is older than the {days} days that the protocol allows"
        ));
    }
    if age_days < -CLOCK_DAYS {
        return said("is of a time to come: a clock is wrong".to_owned());
    }
    if weighed_n < WEIGHED * force_n {
        return said(format!(
            "weighed no more than {weighed_n:.1} N, and the protocol allows {force_n:.1} N: at least half is needed"
        ));
    }
    None
}

/// What is known of the commissionings of a device, in a line for people.
pub(in crate::cli) fn commissioned_line(
    results: &Path,
    tested: &Tested,
    now: chrono::DateTime<chrono::FixedOffset>,
) -> String {
    let all = commissionings(results, tested);
    match commission_doubt(&all, tested.firmware.as_deref(), None, now) {
        Some(doubt) => doubt.why,
        None => all
            .iter()
            .rev()
            .find(|r| r.pass)
            .map_or_else(String::new, |last| {
                format!("passed on {}", last.at.format("%Y-%m-%d %H:%M"))
            }),
    }
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

    /// A commissioning some days ago.
    fn commissioning(days: i64, pass: bool, outcome: &str) -> Record {
        let side = serde_json::json!({ "pushes": "+x", "forces": 3, "gain": 1.0, "gain_tolerance": 0.01,
            "offset_n": 0.0, "saturation_n": null, "largest_n": 12.0 });
        let mut other = side.clone();
        other["pushes"] = "-x".into();
        let numbers = Numbers::default();
        let mut numbers = serde_json::to_value(numbers).unwrap();
        numbers["directions"] = serde_json::json!([side, other]);
        let mut made = record(pass);
        made.kind = RecordKind::Commission;
        made.at -= chrono::Duration::days(days);
        made.parts = serde_json::json!({
            "steps": [{ "what": "ruler", "outcome": outcome }], "numbers": numbers,
        });
        made
    }

    #[test]
    fn a_commissioning_speaks_for_a_device_only_if_it_passed_lately_and_none_failed_since() {
        let passed = |days| commissioning(days, true, "passed");
        let failed = |days| commissioning(days, false, "failed");
        let open = |days| commissioning(days, false, "not-done");
        let now = record(true).at;
        let of = |all: &[Record], firmware: &str, days: Option<f64>| {
            let within = days.map(|days| Within {
                days,
                force_n: 15.0,
            });
            commission_doubt(all, Some(firmware), within, now)
        };
        assert_eq!(of(&[passed(5)], "f1", Some(30.0)), None);
        assert_eq!(of(&[failed(9), passed(5)], "f1", Some(30.0)), None);
        // steps that were left out later take nothing back
        assert_eq!(of(&[passed(5), open(2)], "f1", Some(30.0)), None);
        for (all, firmware, within, is_failed, why) in [
            (vec![], "f1", Some(30.0), false, "was never commissioned"),
            (
                vec![open(1)],
                "f1",
                Some(30.0),
                false,
                "steps were left out",
            ),
            (
                vec![passed(31)],
                "f1",
                Some(30.0),
                false,
                "older than the 30 days",
            ),
            (vec![passed(5)], "f2", Some(30.0), false, "another firmware"),
            (vec![passed(5), failed(2)], "f1", None, true, "FAILED"),
            (
                vec![passed(5), failed(2), open(1)],
                "f1",
                Some(30.0),
                true,
                "FAILED",
            ),
        ] {
            let doubt = of(&all, firmware, within).unwrap();
            assert!(doubt.why.contains(why), "{why}: {doubt:?}");
            assert_eq!(doubt.failed, is_failed, "{doubt:?}");
        }
        // what weighed one side or too little, or is of a time to come
        let mut one_side = passed(1);
        one_side.parts["numbers"]["directions"][1]["pushes"] = "+x".into();
        let mut too_little = passed(1);
        too_little.parts["numbers"]["directions"][1]["largest_n"] = 7.4.into();
        for (made, why) in [
            (one_side, "one direction only"),
            (too_little.clone(), "weighed no more than 7.4 N"),
            (passed(-1), "a time to come"),
        ] {
            let doubt = of(&[made], "f1", Some(30.0)).unwrap();
            assert!(doubt.why.contains(why), "{why}: {doubt:?}");
        }
        // which counts where the protocol asks for nothing
        assert_eq!(of(&[too_little], "f1", None), None);
        // That of an earlier release has sentences and weighed one direction.
        let mut old = passed(1);
        old.parts =
            serde_json::json!([{ "what": "weight", "seen": "gain 1.00", "outcome": "passed" }]);
        let doubt = of(std::slice::from_ref(&old), "f1", Some(30.0)).unwrap();
        assert!(doubt.why.contains("earlier release"), "{doubt:?}");
        old.pass = false;
        old.parts =
            serde_json::json!([{ "what": "weight", "seen": "gain 0.50", "outcome": "failed" }]);
        assert!(of(&[old], "f1", None).unwrap().failed);
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
