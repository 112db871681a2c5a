//! A session on a device that has not passed its check.

use crate::support::{Terminal, changed_protocol, study};
use std::fs;
use std::path::Path;

/// A program that says hello and waits.
const CONTROLLER: &str = r#"echo '{"say":"hello","format":"study-process/1","id":"rig-2","telemetry":true,"limits":{"force_n":9,"velocity_mm_s":500}}'
while read line; do :; done
"#;

fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("c.sh"), CONTROLLER).unwrap();
    let changes = [
        ("\"simulated\"", "\"process\""),
        ("[device]\n", "[device]\ncheck_within_h = 24\n"),
    ];
    changed_protocol("turn-signal", &folder.path().join("protocol"), &changes);
    folder
}

/// The record of a check some hours ago, in the place of the last one.
fn record(folder: &Path, hours: i64, firmware: &str, pass: bool) {
    let at = chrono::Local::now() - chrono::Duration::hours(hours);
    let text = format!(
        r#"{{"format": "study-device-record/1", "kind": "check", "id": "the-check", "serial": "rig-2",
            "firmware": {firmware}, "simulated": false, "at": "{}", "pass": {pass},
            "summary": "14 of 14", "parts": {{"rendering": [{{"what": "mass alone", "result": "pass"}}]}}}}"#,
        at.to_rfc3339(),
    );
    let devices = folder.join("results/devices/rig-2");
    fs::create_dir_all(&devices).unwrap();
    fs::write(devices.join("the-check.json"), text).unwrap();
}

const RUN: [&str; 4] = ["run", "protocol", "--command", "sh c.sh"];

#[test]
fn a_device_without_a_check_that_speaks_for_it_is_refused() {
    let folder = prepared();
    let refused = |why: &str| {
        let (code, _, err) = study(&RUN, folder.path());
        assert_eq!(code, 3, "{why}: {err}");
        assert!(err.contains(why), "{why}: {err}");
        assert!(
            err.contains("study device check --save") && err.contains("--unchecked"),
            "{err}"
        );
        assert!(!folder.path().join("results/turn-signal").exists());
    };
    refused("no check of this device is on record, and the protocol asks for one");
    record(folder.path(), 30, "null", true);
    refused("is older than the 24 h that the protocol allows");
    record(folder.path(), 1, "null", false);
    refused("failed");
    record(folder.path(), 1, "\"1.0\"", true);
    refused("was of another firmware version");
    // a good one: what is missing now is a terminal
    record(folder.path(), 1, "null", true);
    let (_, _, err) = study(&RUN, folder.path());
    assert!(!err.contains("its last check"), "{err}");
    assert!(err.contains("terminal"), "{err}");
}

/// What the first event of a session records of the check.
fn recorded(folder: &Path, more: &[&str]) -> String {
    let arguments = [&RUN[..], &["--operator", "lw"], more].concat();
    let mut terminal = Terminal::start(&arguments, folder, 24, 80);
    terminal.wait_for("Who takes part?");
    terminal.keys("P01\r");
    let journal = folder.join("results/turn-signal/sessions/P01/1/journal.jsonl");
    let begun = |_: &str| fs::read_to_string(&journal).is_ok_and(|j| j.contains("device_check"));
    terminal.wait_until("the journal", begun);
    let text = fs::read_to_string(&journal).unwrap();
    let mut events =
        (text.lines()).map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let said = events.find_map(|event| Some(event["device_check"].as_str()?.to_owned()));
    said.unwrap_or_else(|| panic!("{text}"))
}

#[test]
fn a_session_records_its_check_or_that_there_was_none_by_choice() {
    let folder = prepared();
    record(folder.path(), 1, "null", true);
    assert_eq!(recorded(folder.path(), &[]), "the-check: 14 of 14");

    let folder = prepared();
    let said = recorded(folder.path(), &["--unchecked"]);
    assert!(
        said.starts_with("unchecked, by choice: no check of this device is on record"),
        "{said}"
    );

    let folder = prepared();
    record(folder.path(), 1, "null", false);
    let said = recorded(folder.path(), &["--unchecked"]);
    assert!(
        said.starts_with("unchecked, by choice: its last check, of "),
        "{said}"
    );
    assert!(said.ends_with("failed; the-check: 14 of 14"), "{said}");
}

/// A commissioning some days ago.
fn commissioning(folder: &Path, id: &str, days: i64, pass: bool) {
    let at = chrono::Local::now() - chrono::Duration::days(days);
    let outcome = if pass { "passed" } else { "failed" };
    let side = r#"{"pushes": "-x", "forces": 3, "gain": 1.0, "gain_tolerance": 0.01, "offset_n": 0.0,
                  "saturation_n": null, "largest_n": 12.0}"#;
    let other = side.replace("-x", "+x");
    let text = format!(
        r#"{{"format": "study-device-record/1", "kind": "commission", "id": "{id}", "serial": "rig-2",
            "firmware": null, "simulated": false, "at": "{}", "pass": {pass}, "summary": "ruler {outcome}",
            "parts": {{"version": "study-commissioning/2", "steps": [{{"what": "ruler", "outcome": "{outcome}"}}],
                "numbers": {{"version": "study-commissioning/2", "instrument": null, "stroke_mm": null, "ruler": null,
                    "friction_n": null, "emergency_stop": null, "weighings": [], "directions": [{side}, {other}],
                    "travels": []}}}}}}"#,
        at.to_rfc3339(),
    );
    let devices = folder.join("results/devices/rig-2");
    fs::create_dir_all(&devices).unwrap();
    fs::write(devices.join(format!("{id}.json")), text).unwrap();
}

/// `[device] commissioned_within_days`.
#[test]
fn a_device_without_a_commissioning_that_speaks_for_it_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("c.sh"), CONTROLLER).unwrap();
    let protocol = |name: &str, key: &str| {
        let changes = [
            ("study-protocol/1", "study-protocol/3"),
            ("\"simulated\"", "\"process\""),
            ("[device]\n", key),
        ];
        changed_protocol("turn-signal", &folder.path().join(name), &changes);
    };
    protocol("protocol", "[device]\ncommissioned_within_days = 30\n");
    protocol("without", "[device]\n");
    let (code, out, _) = study(&["check", "protocol"], folder.path());
    assert_eq!(code, 0);
    let said = "needs a device that passed `study device commission` within 30 days";
    assert!(out.contains(said), "{out}");
    let refused = |why: &str| {
        let (code, _, err) = study(&RUN, folder.path());
        assert_eq!(code, 3, "{why}: {err}");
        assert!(err.contains(why), "{why}: {err}");
        assert!(err.contains("study device commission --port PORT"), "{err}");
        assert!(!folder.path().join("results/turn-signal").exists());
        let command = ["device", "info", "--command", "sh c.sh"];
        study(&command, folder.path()).1
    };
    let devices = folder.path().join("results/devices/rig-2");
    // those of a simulated device and of another one say nothing
    for (id, from, to) in [
        ("simulated", "\"simulated\": false", "\"simulated\": true"),
        ("other", "\"rig-2\"", "\"rig.2\""),
    ] {
        commissioning(folder.path(), id, 1, true);
        let path = devices.join(format!("{id}.json"));
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&path, text.replace(from, to)).unwrap();
    }
    let info = refused("it was never commissioned");
    assert!(info.contains("it was never commissioned"), "{info}");
    commissioning(folder.path(), "old", 31, true);
    let info = refused("is older than the 30 days that the protocol allows");
    assert!(info.contains("passed on "), "{info}");
    commissioning(folder.path(), "failed", 2, false);
    let info = refused("FAILED: ruler failed");
    assert!(info.contains("FAILED"), "{info}");
    // a failed one is said also where nothing is asked
    let without = ["run", "without", "--command", "sh c.sh"];
    let (_, _, err) = study(&without, folder.path());
    assert!(
        err.contains("warning: rig-2: its commissioning of "),
        "{err}"
    );
    assert!(err.contains("terminal"), "{err}");
    let unchecked = [&RUN[..], &["--unchecked"]].concat();
    let (_, _, err) = study(&unchecked, folder.path());
    assert!(
        err.contains("warning: rig-2") && err.contains("terminal"),
        "{err}"
    );
    // a good one: what is missing now is a terminal
    commissioning(folder.path(), "good", 1, true);
    let (_, _, err) = study(&RUN, folder.path());
    assert!(
        !err.contains("commission") && err.contains("terminal"),
        "{err}"
    );
    let said = recorded(folder.path(), &[]);
    assert_eq!(said, "good: passed");
}
