//! What counts of the answers of an identification: corrections, and practice to a criterion.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::{analyzed, cells, study};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A rehearsal with two participants of the protocol of `study new`, after these changes.
fn rehearsed(folder: &Path, changes: &[(&str, &str)]) {
    let kind = "identification";
    let (code, _, err) = study(&["new", "--seed", "20261123", kind, "--kind", kind], folder);
    assert_eq!(code, 0, "{err}");
    let path = folder.join(kind).join("protocol.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = changes.iter().fold(text, |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replace(old, new)
    });
    fs::write(path, text).unwrap();
    let arguments = ["rehearse", kind, "--participants", "2", "--out", "out"];
    let (code, _, err) = study(&arguments, folder);
    assert_eq!(code, 0, "{err}");
}

fn rows(folder: &Path, columns: &[&str]) -> Vec<Vec<String>> {
    cells(&folder.join("out/identification/ratings.csv"), columns)
}

/// Corrects the first wrong answers of each participant, of practice or not, to the right label.
fn correct(folder: &Path, practice: bool, most: usize) {
    let columns = [
        "participant",
        "trial",
        "model",
        "practice",
        "correct",
        "status",
    ];
    let all = rows(folder, &columns);
    for who in ["SIM001", "SIM002"] {
        let wrong = all.iter().filter(|row| {
            row[0] == who && row[3] == practice.to_string() && row[4] == "false" && row[5] == "ok"
        });
        for row in wrong.take(most) {
            let order = ["low-soft", "low-crisp", "high-soft", "high-crisp"];
            let place = order.iter().position(|model| *model == row[2]).unwrap();
            let right = (place + 1).to_string();
            let arguments = [
                "correct",
                "out",
                who,
                "--trial",
                &row[1],
                "--question",
                "which",
                "--to",
                &right,
                "--reason",
                "a slip",
            ];
            let (code, out, err) = study(&arguments, folder);
            assert_eq!(code, 0, "{out}{err}");
        }
    }
}

fn values(folder: &Path) -> Value {
    analyzed(folder)["parts"][0]["values"].clone()
}

/// Where the right label was told after each trial, corrections change nothing but the rows.
#[test]
fn the_first_answer_counts_where_the_right_label_was_told() {
    for (feedback, told) in [("always", true), ("practice", false)] {
        let folder = tempfile::tempdir().unwrap();
        let line = format!("feedback = \"{feedback}\" ");
        rehearsed(folder.path(), &[("feedback = \"practice\" ", &line)]);
        let before = values(folder.path());
        let header = || {
            let path = folder.path().join("out/identification/ratings.csv");
            fs::read_to_string(path)
                .unwrap()
                .lines()
                .next()
                .unwrap()
                .to_owned()
        };
        assert!(!header().contains("answer_before_feedback"));
        correct(folder.path(), false, 3);
        assert_eq!(header().ends_with(",answer_before_feedback"), told);
        assert_eq!(values(folder.path()) == before, told, "{feedback}");
        let corrected = rows(folder.path(), &["corrected", "correct"]);
        let still_wrong = corrected
            .iter()
            .filter(|r| r[0] == "true" && r[1] == "false");
        assert_eq!(still_wrong.count(), if told { 6 } else { 0 });
        let (code, out, err) = study(&["verify", "out"], folder.path());
        assert_eq!(code, 0, "{out}{err}");
    }
}

/// Whether practice reached its criterion is told by the answers as they were given.
#[test]
fn a_correction_does_not_reach_a_criterion() {
    let folder = tempfile::tempdir().unwrap();
    let changes = [
        ("feedback = \"practice\" ", "feedback = \"never\" "),
        (
            "correct = 7, of = 8, rounds = 6",
            "correct = 8, of = 8, rounds = 2",
        ),
    ];
    rehearsed(folder.path(), &changes);
    let not_learned = || {
        let part = analyzed(folder.path())["parts"][0].clone();
        let all = part["warnings"].as_array().unwrap().clone();
        let own = all.iter().filter(|w| w["code"] == "not-learned");
        own.map(|w| w["text"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    let before = not_learned();
    assert_eq!(
        before,
        [
            "2 participants did not reach the criterion of practice (8 of the last 8 answers correct): SIM001, SIM002"
        ]
    );
    correct(folder.path(), true, 8);
    let practiced = rows(folder.path(), &["practice", "correct"]);
    assert!(practiced.iter().all(|r| r[0] == "false" || r[1] == "true"));
    assert_eq!(not_learned(), before);
}
