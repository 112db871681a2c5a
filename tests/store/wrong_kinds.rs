//! Links and files in the place of folders: every command names them.

#![allow(clippy::unwrap_used)]

use crate::commands::turn_signal;
use crate::world::{Kept, at, real};
use assert_cmd::Command;
use predicates::prelude::*;
use std::os::unix::fs::symlink;
use std::path::Path;
use study_session::store::{StoreError, StudyFolder};

fn study_command() -> Command {
    Command::cargo_bin("study").unwrap()
}

/// Moves a file or folder elsewhere and leaves a link.
fn link(path: &Path, elsewhere: &Path) {
    std::fs::rename(path, elsewhere).unwrap();
    symlink(elsewhere, path).unwrap();
}

/// The commands that read the study and those that change it.
fn each_names(results: &Path, place: &str, what: &str) {
    let protocol = "protocols/turn-signal";
    let out = tempfile::tempdir().unwrap();
    let results = results.to_str().unwrap();
    let export = [
        "export",
        results,
        "--to",
        "csv",
        "--out",
        out.path().to_str().unwrap(),
    ];
    let excluded = ["--state", "excluded", "--reason", "x"];
    let withdrawn = ["--state", "withdrawn", "--reason", "x", "--erase", "--yes"];
    for arguments in [
        &["status", results][..],
        &["analyze", results],
        &["analyze", "--pool", results, "results/turn-signal-example"],
        &["verify", results],
        &["verify", results, "--rebuild"],
        &export,
        &["power", protocol, "--from", results],
        &["amend", results, protocol, "--reason", "x"],
        &["run", protocol, "--results", results, "--plain"],
        &[&["participant", results, "P01"], &excluded[..]].concat(),
        &[&["participant", results, "P01"], &withdrawn[..]].concat(),
    ] {
        study_command()
            .args(arguments)
            .assert()
            .code(4)
            .stderr(predicate::str::contains(place))
            .stderr(predicate::str::contains(what));
    }
}

#[test]
fn a_link_in_the_place_of_a_folder_or_journal_is_named_by_every_command() {
    for place in [
        "sessions",
        "sessions/P01",
        "sessions/P01/1",
        "sessions/P01/1/journal.jsonl",
        "sessions/P01/1/head.json",
        "sessions/P01/1/telemetry",
        "protocol",
    ] {
        let results = tempfile::tempdir().unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        let folder = turn_signal(results.path());
        link(&folder.join(place), &elsewhere.path().join("x"));
        each_names(results.path(), place, "a symbolic link");
    }
}

#[test]
fn a_link_or_folder_in_the_place_of_a_file_is_named_with_what_to_do() {
    for place in ["study.json", "sessions/P01/1/journal.jsonl"] {
        let results = tempfile::tempdir().unwrap();
        let file = turn_signal(results.path()).join(place);
        std::fs::remove_file(&file).unwrap();
        symlink("nowhere", &file).unwrap();
        each_names(results.path(), place, "replace the link by the file");
        std::fs::remove_file(&file).unwrap();
        std::fs::create_dir(&file).unwrap();
        each_names(results.path(), place, "a folder in the place of a file");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("results");
    std::fs::write(&file, "x").unwrap();
    for command in ["status", "verify"] {
        let asserted = study_command().arg(command).arg(&file).assert().code(4);
        asserted.stderr(predicate::str::contains("a file, not a results folder"));
    }
}

/// A frozen protocol behind a link is read, and reported.
#[test]
fn a_linked_version_of_the_protocol_is_reported() {
    let results = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    link(&folder.join("protocol/1"), &elsewhere.path().join("x"));
    for command in ["status", "analyze", "verify"] {
        let done = study_command().arg(command).arg(results.path()).assert();
        let output = done.get_output().clone();
        let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        let named = "protocol/1/protocol.toml: a symbolic link in the place of a folder";
        assert!(said.contains(named), "{command}: {said}");
    }
}

/// What a link leads to would not be erased, and single ratings are not written through
/// one.
#[test]
fn nothing_is_analyzed_into_a_link_or_erased_beside_one() {
    let results = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let folder = turn_signal(results.path());
    let analysis = folder.join("analysis");
    symlink(elsewhere.path(), &analysis).unwrap();
    let analyzed = study_command().arg("analyze").arg(&folder).assert();
    analyzed
        .success()
        .stderr(predicate::str::contains("analysis: a symbolic link"));
    assert_eq!(std::fs::read_dir(elsewhere.path()).unwrap().count(), 0);
    let erase = || {
        let mut command = study_command();
        command.arg("participant").arg(&folder);
        command.args(["P01", "--state", "withdrawn", "--reason", "x"]);
        command.args(["--erase", "--yes"]);
        command.assert()
    };
    erase()
        .code(4)
        .stderr(predicate::str::contains("analysis: a symbolic link"));
    std::fs::remove_file(&analysis).unwrap();
    erase().success();
}

#[test]
fn a_file_in_the_place_of_a_folder_is_named_by_every_command() {
    for place in ["sessions/P03", "sessions/P01/2", "sessions/P01/1/telemetry"] {
        let results = tempfile::tempdir().unwrap();
        let folder = turn_signal(results.path());
        let _ = std::fs::remove_dir_all(folder.join(place));
        std::fs::write(folder.join(place), "x").unwrap();
        each_names(results.path(), place, "a file in the place of a folder");
    }
}

#[test]
fn telemetry_is_not_written_through_a_link() {
    let results = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let study = StudyFolder::open_or_create(results.path(), &Kept::new().frozen(), at(0)).unwrap();
    let claimed = study.claim(&real("P01")).unwrap();
    symlink(elsewhere.path(), claimed.folder.path().join("telemetry")).unwrap();
    let refused = claimed.folder.telemetry(1, 1);
    assert!(
        matches!(refused, Err(StoreError::WrongKind { .. })),
        "{refused:?}"
    );
    assert_eq!(std::fs::read_dir(elsewhere.path()).unwrap().count(), 0);
    let refused = study.sessions();
    assert!(
        matches!(refused, Err(StoreError::WrongKind { .. })),
        "{refused:?}"
    );
}
