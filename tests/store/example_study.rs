//! The example study of the repository: complete, marked as simulated, and what the
//! present program produces.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{copy_folder, repository, study};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A copy, because an analysis writes into the folder.
fn copied(to: &Path) -> PathBuf {
    let folder = to.join("results/turn-signal-example");
    copy_folder(
        Path::new(&repository("results/turn-signal-example")),
        &folder,
    );
    folder
}

/// Every row of a table as a map from column to field.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

#[test]
fn the_example_verifies_and_is_marked_as_simulated() {
    let home = tempfile::tempdir().unwrap();
    let folder = copied(home.path());
    let (code, out, err) = study(&["verify", "results"], home.path());
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("10 sessions"), "{out}");
    assert!(out.contains("no problems found"), "{out}");
    let (code, out, err) = study(&["analyze", "results"], home.path());
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("NO PARTICIPANTS: only 10 simulated"), "{out}");
    assert!(out.contains("150 ratings"), "{out}");
    for row in rows(&folder.join("ratings.csv")) {
        assert_eq!(row["simulated"], "true");
        assert_eq!(row["pilot"], "false");
        assert!(row["participant"].starts_with("SIM"));
    }
    for session in fs::read_dir(folder.join("sessions")).unwrap() {
        let journal = session.unwrap().path().join("1/journal.jsonl");
        let claim = fs::read_to_string(journal).unwrap();
        let claim = claim.lines().next().unwrap();
        assert!(claim.contains("simulated"), "{claim}");
    }
    let readme = fs::read_to_string(folder.join("README.md")).unwrap();
    assert!(readme.contains("no evidence"), "{readme}");
}

#[test]
fn a_rehearsal_reproduces_the_example() {
    let home = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let arguments = ["rehearse", &protocol, "--participants", "10"];
    let options = ["--telemetry", "20", "--out", "again"];
    let (code, out, err) = study(&[&arguments[..], &options].concat(), home.path());
    assert_eq!(code, 0, "{out}{err}");
    let example = PathBuf::from(repository("results/turn-signal-example"));
    let ratings = |folder: &Path| -> Vec<[String; 6]> {
        rows(&folder.join("ratings.csv"))
            .iter()
            .map(|row| {
                [
                    "participant",
                    "trial",
                    "model",
                    "realism",
                    "comment",
                    "status",
                ]
                .map(|column| row[column].clone())
            })
            .collect()
    };
    assert_eq!(
        ratings(&home.path().join("again/turn-signal")),
        ratings(&example)
    );
}
