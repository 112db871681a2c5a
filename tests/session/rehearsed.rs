//! Whole studies with simulated participants, with the real binary.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{repository, study};
use std::fs;
use std::path::Path;

fn rehearse(folder: &Path, protocol: &str, more: &[&str]) -> String {
    let path = repository(protocol);
    let mut arguments = vec!["rehearse", &path, "--out", "r", "--telemetry", "20"];
    arguments.extend(more);
    let (code, out, err) = study(&arguments, folder);
    assert_eq!(code, 0, "{out}{err}");
    let (code, out, err) = study(&["verify", "r"], folder);
    assert_eq!(code, 0, "{out}{err}");
    out
}

/// Samples are mounted by simulated hands; a realization that needs a table and has none
/// is refused before anything is created.
#[test]
fn a_study_of_samples_can_be_rehearsed() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("protocol.toml");
    let text = "format = \"study-protocol/1\"\n[study]\nid = \"samples\"\ntitle = \"t\"\nseed = 4\n\
        [design]\nparticipants = 4\nrepetitions = 2\norder = \"shuffled\"\n[device]\nkind = \"manual\"\n\
        [[models]]\nid = \"soft\"\n[[models]]\nid = \"hard\"\n[[questions]]\nid = \"realism\"\n\
        kind = \"rating\"\nprompt = \"How?\"\nfrom = 1\nto = 7\n[analysis]\nprimary = \"realism\"\n";
    fs::write(&protocol, text).unwrap();
    let arguments = ["rehearse", "protocol.toml", "--participants", "2"];
    let (code, out, err) = study(&arguments, folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(
        out.starts_with("2 simulated participants, 8 rated trials"),
        "{out}"
    );
    // Nothing is added to it, least of all where a person is expected.
    let refused = |why: &str| {
        let (code, _, err) = study(&arguments, folder.path());
        assert!(code != 0 && err.contains(why), "{err}");
    };
    refused("already holds 2 rehearsed sessions");
    let set = [
        "participant",
        "rehearsal",
        "P01",
        "--state",
        "no-show",
        "--reason",
        "ill",
    ];
    let (code, _, err) = study(&set, folder.path());
    assert_eq!(code, 0, "{err}");
    refused("holds sessions of real participants");
    // So are the presentations of a program that plays no tables, unless others have one.
    let process = text.replace(
        "kind = \"manual\"",
        "kind = \"process\"\nlimits = { force_n = 9.0, velocity_mm_s = 500.0 }",
    );
    fs::write(&protocol, &process).unwrap();
    let arguments = [&arguments[..], &["--out", "sounds"]].concat();
    let (code, out, err) = study(&arguments, folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(
        out.starts_with("2 simulated participants, 8 rated trials"),
        "{out}"
    );
    let simulated = text.replace(
        "kind = \"manual\"",
        "kind = \"simulated\"\nlimits = { force_n = 9.0, velocity_mm_s = 500.0 }",
    );
    fs::write(&protocol, simulated).unwrap();
    let arguments = [&arguments[..4], &["--out", "other"]].concat();
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("model `soft` has no `file`"), "{err}");
    assert!(!folder.path().join("other").exists());
}

/// What only a study of forces has.
const FORCE: [&str; 9] = [
    "VAF", "λ", "lambda", "alistic", "alism", "force", "Force", "haptic", "switch",
];

#[test]
fn studies_of_cloths_and_of_sounds_are_rehearsed_and_analyzed_in_their_own_words() {
    for (name, word, covariate) in [
        ("cloth", "pleasantness", "roughness_um"),
        ("sounds", "loudness", "frequency_hz"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let path = format!("protocols/{name}");
        let (code, out, err) = study(&["check", &repository(&path)], folder);
        assert_eq!(code, 0, "{out}{err}");
        rehearse(folder, &path, &["--participants", "6"]);
        let (code, out, err) = study(&["analyze", "r", "--include", "simulated"], folder);
        assert_eq!(code, 0, "{err}");
        assert!(out.contains(word), "{out}");
        let against = format!("Mean rating against {covariate}: r = ");
        assert!(out.contains(&against), "{out}");
        let report = fs::read_to_string(folder.join(format!("r/{name}/analysis/report.html")));
        // What is undefined is listed at the end, with its reasons.
        let report = report.unwrap();
        let report = report.split("All statistics").next().unwrap();
        for word in FORCE {
            assert!(!out.contains(word), "{name}: {word}\n{out}");
            let at = report.find(word).unwrap_or(0);
            let around: String = report[..at].chars().rev().take(200).collect();
            let around: String = around.chars().rev().collect();
            assert!(!report.contains(word), "{name}: {word} after {around}");
        }
    }
}

#[test]
fn a_study_of_yes_and_no_is_rehearsed_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (code, out, err) = study(&["check", &repository("protocols/yes-no")], folder);
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
    rehearse(folder, "protocols/yes-no", &["--participants", "2"]);
    let (code, out, err) = study(&["analyze", "r", "--include", "simulated"], folder);
    assert_eq!(code, 0, "{err}");
    // more force, more yes: a threshold for each participant
    assert!(out.contains("yes-no") && out.contains("threshold"), "{out}");
    assert!(out.matches("friction-yes").count() >= 2, "{out}");
    assert!(!out.contains("VAF"), "{out}");
}

/// Realizations of 0.6 N over 4 mm are played, rated and compared; who measured them is credited.
#[test]
fn measured_keyboard_switches_are_rehearsed_and_analyzed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rehearse(folder, "protocols/keyboard", &["--participants", "2"]);
    let attempts = fs::read_to_string(folder.join("r/keyboard/attempts.csv")).unwrap();
    assert!(!attempts.contains("device-fault"), "{attempts}");
    let (code, out, err) = study(&["analyze", "r", "--include", "simulated"], folder);
    assert_eq!(code, 0, "{err}");
    for word in ["pleasantness", "preferred", "clickiez"] {
        assert!(out.contains(word), "{word}\n{out}");
    }
    let report = fs::read_to_string(folder.join("r/keyboard/analysis/report.html")).unwrap();
    assert!(report.contains("ThereminGoat"));
}

#[test]
fn a_study_with_a_failing_device_ends_and_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let more = ["--participants", "2", "--faults"];
    rehearse(folder, "protocols/turn-signal-extended", &more);
    let attempts = fs::read_to_string(folder.join("r/turn-signal-extended/attempts.csv")).unwrap();
    for met in [
        "device-fault",
        "the device refuses the table",
        "it no longer answers",
        "unplugged",
    ] {
        assert!(attempts.contains(met), "`{met}` was never met");
    }
    let ratings = folder.join("r/turn-signal-extended/ratings.csv");
    let mut ratings = csv::Reader::from_path(ratings).unwrap();
    let headers = ratings.headers().unwrap().clone();
    let column = |name: &str| headers.iter().position(|h| h == name).unwrap();
    for row in ratings.records() {
        let row = row.unwrap();
        assert_eq!(&row[column("simulated")], "true");
        assert!(
            ["ok", "failed"].contains(&&row[column("status")]),
            "{row:?}"
        );
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_other_ratings_in_the_same_orders() {
    let read = |seed: &str| {
        let folder = tempfile::tempdir().unwrap();
        let more = ["--participants", "2", "--seed", seed];
        rehearse(folder.path(), "protocols/turn-signal", &more);
        let study = folder.path().join("r/turn-signal");
        let journal = study.join("sessions/SIM002/1/journal.jsonl");
        let ratings = csv::Reader::from_path(study.join("ratings.csv"))
            .unwrap()
            .into_records()
            .map(|r| r.unwrap().iter().map(str::to_owned).collect::<Vec<_>>())
            .collect::<Vec<_>>();
        (fs::read(journal).unwrap(), ratings)
    };
    let (journal, ratings) = read("1");
    assert_eq!((journal.clone(), ratings.clone()), read("1"));
    let (other_journal, other_ratings) = read("2");
    assert_ne!(journal, other_journal);
    // study … trial … model: the ninth column
    let models = |rows: &[Vec<String>]| rows.iter().map(|r| r[8].clone()).collect::<Vec<_>>();
    assert_eq!(models(&ratings), models(&other_ratings));
}

#[test]
fn a_folder_with_sessions_of_people_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rehearse(folder, "protocols/turn-signal", &["--participants", "1"]);
    let path = repository("protocols/turn-signal");
    let again = ["rehearse", &path, "--participants", "1", "--out", "r"];
    let (code, _, err) = study(&again, folder);
    assert_eq!(code, 4, "{err}");
    assert!(err.contains("already holds 1 rehearsed session"), "{err}");
    let (code, out, _) = study(&["analyze", "r", "--json"], folder);
    assert_eq!(code, 0);
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["format"], "study-analysis/1");
    assert_eq!(document["values"]["design/n_ratings"], 15.0);
}
