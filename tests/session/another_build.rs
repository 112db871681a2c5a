//! Sessions of the build that `STUDY_TEST_PROGRAM` names, such as that of Windows under Wine. `.ci/wine` runs these tests.

use crate::devices::ratings;
use crate::plain::{Lines, events_of, last_answers};
use crate::support::{HURRY, PATIENT, changed_protocol, program, repository, study};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::path::Path;

/// What shortens a protocol of the repository.
const SHORT: [(&str, &str); 12] = [
    PATIENT,
    ("max_attempts = 3", "max_attempts = 50"),
    ("repetitions = 3", "repetitions = 1"),
    ("repetitions = 2\n", "repetitions = 1\n"),
    ("repetitions = 20", "repetitions = 1"),
    ("at_least_s = 60", "at_least_s = 1"),
    ("reference_min_s = 3", "reference_min_s = 0"),
    ("minimum_strokes = 2", "minimum_strokes = 1"),
    ("min_s = 1, max_s = 6", "min_s = 0.2, max_s = 0.4"),
    ("min_s = 4", "min_s = 0.2"),
    ("trials = 60, start = 12", "trials = 8, start = 5"),
    ("trials = 40, start = 8", "trials = 8, start = 5"),
];

/// A short copy of a protocol of the repository.
fn shortened(name: &str, to: &Path) {
    let text = fs::read_to_string(repository(&format!("protocols/{name}/protocol.toml"))).unwrap();
    let applied: Vec<_> = (SHORT.into_iter())
        .filter(|(old, _)| text.contains(old))
        .filter(|&change| change != PATIENT || !text.contains("max_attempts"))
        .collect();
    changed_protocol(name, to, &applied);
}

/// Plays a session in lines to its end.
fn played(build: OsString, folder: &Path, run: &[&str], variable: Option<(&str, &str)>) {
    let mut lines = Lines::of(build, folder, run, variable);
    let end = lines.play(None);
    assert!(
        end.starts_with("The session is finished"),
        "{run:?}: {}",
        lines.seen
    );
    lines.child.wait().unwrap();
}

/// That build and the one that was built with the tests, by the same answers, with every protocol of
/// the repository but `sounds`, whose device is a program in Python.
#[test]
#[ignore = "compares with another build: .ci/wine runs it"]
fn it_writes_the_same_journals() {
    let own = OsString::from(env!("CARGO_BIN_EXE_study"));
    assert_ne!(program(), own, "STUDY_TEST_PROGRAM names the other build");
    for (name, more) in [
        ("cloth", &["--pilot"][..]),
        ("turn-signal", &[]),
        ("turn-signal-extended", &[]),
        ("turn-signal-passive", &[]),
        ("knob", &[]),
        ("keyboard", &[]),
        ("yes-no", &[]),
        ("realism-search", &[]),
        ("keyboard-search", &[]),
    ] {
        let home = tempfile::tempdir().unwrap();
        let protocol = home.path().join("protocol");
        shortened(name, &protocol);
        let run = [&["run", protocol.to_str().unwrap(), "--plain"], more].concat();
        let [here, there] = [own.clone(), program()].map(|build| {
            let folder = tempfile::tempdir().unwrap();
            // Samples that are laid by hand have no clock of a device to hurry.
            let pace = Some(HURRY).filter(|_| name != "cloth");
            played(build, folder.path(), &run, pace);
            events_of(folder.path(), name)
        });
        assert!(here.len() > 20, "{name}");
        // A busy machine can lose a playback: its trial is then repeated at another place.
        let lost = |events: &[Value]| events.iter().any(|e| e["event"] == "attempt_failed");
        if lost(&here) || lost(&there) {
            assert_eq!(last_answers(&here), last_answers(&there), "{name}");
        } else {
            assert_eq!(here, there, "{name}");
        }
    }
}

/// A session on the serial port that `STUDY_TEST_PORT` names, with a device that somebody else
/// started, and whose force is judged.
#[test]
#[ignore = "needs a port and a device at its end: .ci/wine runs it"]
fn it_plays_on_a_serial_port() {
    let port = std::env::var("STUDY_TEST_PORT").expect("STUDY_TEST_PORT names a port");
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("protocol");
    shortened("turn-signal", &protocol);
    let protocol = protocol.to_str().unwrap();
    let serial = ["--device", "serial", "--port", &port];
    let run = [&["run", protocol, "--plain"], &serial[..]].concat();
    played(program(), folder.path(), &run, None);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let rows = ratings(&folder.path().join("results/turn-signal/ratings.csv"));
    assert_eq!(rows.len(), 5);
    for row in rows {
        assert_eq!(row["status"], "ok", "{row:?}");
        assert_eq!(row["device_kind"], "serial", "{row:?}");
        let judged = matches!(&*row["rendering"], "ok" | "too-little");
        assert!(judged, "{row:?}");
    }
}
