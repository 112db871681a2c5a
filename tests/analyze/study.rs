//! The analysis of a study folder.
#![allow(clippy::unwrap_used)]

use crate::world::{at, fingerprints, real, session};
use assert_cmd::Command;
use std::fs;
use std::path::{Path, PathBuf};
use study_plan::protocol::fingerprint::Fingerprints;
use study_session::outcome::Event;
use study_session::store::{Frozen, StudyFolder};

const PROTOCOL: &str = r#"
format = "study-protocol/1"
[study]
id = "ID"
title = "A small study"
seed = 2007
[design]
participants = 4
repetitions = 1
order = "blocked"
[device]
kind = "manual"
[[models]]
id = "A"
vaf = 0.5
[[models]]
id = "B"
vaf = 0.6
[[models]]
id = "C"
vaf = 0.7
[[questions]]
id = "realism"
kind = "rating"
prompt = "How realistic?"
from = 1
to = 7
[[questions]]
id = "comment"
kind = "text"
prompt = "Comment"
[[intake]]
id = "age"
kind = "text"
prompt = "Age"
[analysis]
primary = "realism"
"#;

/// A study in `results` with one finished session, as another process left it.
fn study(results: &Path, id: &str) -> PathBuf {
    study_with(results, id, &[])
}

/// The same, with these events in the session.
fn study_with(results: &Path, id: &str, more: &[Event]) -> PathBuf {
    let text = PROTOCOL.replace("ID", id);
    let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
    let protocol = parsed
        .protocol
        .unwrap_or_else(|| panic!("{}", parsed.findings.render(false)));
    let files = vec![("protocol.toml".to_owned(), text.clone().into_bytes())];
    let fingerprints: Fingerprints = fingerprints();
    let frozen = Frozen {
        protocol: &protocol,
        files: &files,
        fingerprints: &fingerprints,
    };
    let folder = StudyFolder::open_or_create(results, &frozen, at(0)).unwrap();
    let mut claimed = folder.claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let mut all = session("P01", 1, claimed.seat);
    all.splice(3..3, more.iter().cloned());
    for (n, event) in all.iter().enumerate() {
        let mut event = event.clone();
        if let Event::SessionStarted(start) = &mut event {
            id.clone_into(&mut start.study);
        }
        journal.append(at(n as u64), &event).unwrap();
    }
    folder.refresh(&protocol).unwrap();
    results.join(id)
}

fn analyze(path: &Path) -> Command {
    let mut command = Command::cargo_bin("study").unwrap();
    command.env("NO_COLOR", "1").arg("analyze").arg(path);
    command
}

fn said(command: &mut Command) -> String {
    let done = command.assert().success();
    String::from_utf8(done.get_output().stdout.clone()).unwrap()
}

#[test]
fn a_results_folder_gets_its_page_and_its_tables() {
    let dir = tempfile::tempdir().unwrap();
    let folder = study(dir.path(), "small");
    let text = said(&mut analyze(dir.path()));
    assert!(text.contains("A small study"), "{text}");
    assert!(
        text.contains("small · protocol 1 · 1 of 4 participants"),
        "{text}"
    );
    assert!(
        text.contains("interim: 1 of 4 planned participants"),
        "{text}"
    );
    assert!(!text.contains('\u{1b}'), "{text}");
    let used = fs::read_to_string(folder.join("analysis/ratings_used.csv")).unwrap();
    assert_eq!(used.lines().count(), 4, "{used}");
    let comments = said(analyze(dir.path()).arg("--comments"));
    assert!(comments.contains("\\u{1b}[2J"), "{comments}");
}

#[test]
fn json_of_a_study_writes_nothing_and_agrees_with_its_own_table() {
    let dir = tempfile::tempdir().unwrap();
    let folder = study(dir.path(), "small");
    let values = |text: &str| -> serde_json::Value {
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        json["values"].clone()
    };
    let of_study = values(&said(analyze(&folder).arg("--json")));
    assert!(!folder.join("analysis").exists());
    assert_eq!(of_study["design/n_models"], 3.0);
    // a table does not state its scale
    let table = folder.join("ratings.csv");
    let of_table = values(&said(analyze(&table).args(["--json", "--scale", "1..7"])));
    assert_eq!(of_study, of_table);
}

/// Dates that are wrong are said, and those that a time server corrected are not.
#[test]
fn a_clock_that_jumped_is_warned_of() {
    for (by_s, warned) in [(172_800.0, true), (-1.728e9, true), (-2.5, false)] {
        let dir = tempfile::tempdir().unwrap();
        let folder = study_with(dir.path(), "small", &[Event::ClockStepped { by_s }]);
        let json = said(analyze(&folder).arg("--json"));
        assert_eq!(json.contains("clock-jumped"), warned, "{by_s}: {json}");
        let page = said(&mut analyze(&folder));
        let words: Vec<&str> = page.split_whitespace().collect();
        let told = words.join(" ").contains("clock of the computer jumped");
        assert_eq!(told, warned, "{by_s}: {page}");
    }
}

#[test]
fn several_studies_come_in_turn_and_json_takes_one() {
    let dir = tempfile::tempdir().unwrap();
    study(dir.path(), "one");
    study(dir.path(), "two");
    let text = said(&mut analyze(dir.path()));
    let (first, second) = (text.find("one ·").unwrap(), text.find("two ·").unwrap());
    assert!(first < second);
    // each into a folder of its own
    let out = dir.path().join("out");
    analyze(dir.path())
        .arg("--out")
        .arg(&out)
        .assert()
        .success();
    for id in ["one", "two"] {
        let own = fs::read_to_string(out.join(id).join("report.html")).unwrap();
        assert!(own.contains(&format!("<dd>{id}</dd>")), "{id}");
    }
    analyze(dir.path()).arg("--json").assert().code(1);
    analyze(&dir.path().join("two"))
        .arg("--json")
        .assert()
        .success();
}

#[test]
fn a_folder_of_a_newer_format_and_an_unknown_question_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let folder = study(dir.path(), "small");
    analyze(&folder)
        .args(["--question", "comment"])
        .assert()
        .code(1);
    let manifest = folder.join("study.json");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(
        &manifest,
        text.replace("study-results/1", "study-results/9"),
    )
    .unwrap();
    let done = analyze(&folder).assert().code(4);
    let said = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(said.contains("study-results/9"), "{said}");
}
