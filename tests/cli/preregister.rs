//! `study preregister`, and what the report says of it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{changed_protocol, study};
use serde_json::Value as Json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const DATED: [&str; 4] = ["--date", "2026-03-01", "--studies", "200"];

/// A protocol of six participants, in the folder `p`.
fn protocol() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let six = [("participants = 10", "participants = 6")];
    changed_protocol("turn-signal", &folder.path().join("p"), &six);
    folder
}

fn preregister(folder: &Path, more: &[&str]) -> (i32, String, String) {
    study(&[&["preregister", "p"], &DATED[..], more].concat(), folder)
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn the_document_is_reproducible_and_not_replaced() {
    let folder = protocol();
    let at = folder.path();
    let (code, hash, said) = preregister(at, &[]);
    assert_eq!(code, 0, "{said}");
    let (text, facts) = (
        read(at, "p/preregistration.md"),
        read(at, "p/preregistration.json"),
    );
    let json: Json = serde_json::from_str(&facts).unwrap();
    assert_eq!(json["format"], "study-preregistration/1");
    assert_eq!(json["sha256"], hash.trim());
    assert!(text.contains(hash.trim()));
    for part in [
        "# Preregistration: Realism of identified turn-signal switch models",
        "6 participants, 3 repetitions of each realization.",
        "seed 2007",
        "`realism`: “How realistic did it feel?” (rating from 1 to 7, primary)",
        "No exclusion rule.",
        "α = .05",
        "Whether the realizations differ: repeated-measures analysis of variance, \
         Greenhouse–Geisser correction, level .05.",
        "permutation test, exact, level .05",
        "In 200 simulated studies",
        "With 5 realizations, VAF and the true mean ratings have to correlate at .885",
        "This design finds with 80 %",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    // Again the same bytes, and nothing is replaced by something else.
    assert_eq!(preregister(at, &[]).1, hash);
    assert_eq!(read(at, "p/preregistration.json"), facts);
    let (code, _, said) = preregister(at, &["--participants", "20"]);
    assert_eq!(
        (code, said.contains("another document")),
        (1, true),
        "{said}"
    );
    assert_eq!(read(at, "p/preregistration.md"), text);
    let (code, other, said) = preregister(at, &["--participants", "20", "--out", "other"]);
    assert_eq!(code, 0, "{said}");
    assert_ne!(other, hash);
    assert!(read(at, "other/preregistration.md").contains("20 participants"));
}

/// The document is frozen with the protocol, and every form of the report compares.
#[test]
fn the_report_compares_the_study_with_its_document() {
    let folder = protocol();
    let at = folder.path();
    let run = |arguments: &[&str]| {
        let (code, out, said) = study(arguments, at);
        assert_eq!(code, 0, "{arguments:?}: {said}");
        out
    };
    assert_eq!(preregister(at, &[]).0, 0);
    run(&["rehearse", "p", "--participants", "6", "--out", "results"]);
    run(&["verify", "results"]);
    let terminal = run(&["analyze", "results"]);
    assert!(
        terminal.contains("Preregistered on 2026-03-01"),
        "{terminal}"
    );
    assert!(terminal.contains("the study matches it"), "{terminal}");
    let json: Json = serde_json::from_str(&run(&["analyze", "results", "--json"])).unwrap();
    assert_eq!(json["preregistration"]["matches"], true);
    assert_eq!(
        json["preregistration"]["first_session"],
        Json::Null,
        "only simulated"
    );
    let page = "results/turn-signal/analysis/report.html";
    assert!(read(at, page).contains("the study matches it"));

    // Another level and a new rule, later: named everywhere, and no longer a match.
    let text = read(at, "p/protocol.toml").replace("primary = ", "alpha = 0.01\nprimary = ");
    let text = text + "\n[[analysis.exclude]]\nrule = \"constant-rater\"\n";
    fs::write(at.join("p/protocol.toml"), text).unwrap();
    run(&["amend", "results", "p", "--reason", "stricter"]);
    let terminal = run(&["analyze", "results"]);
    assert!(terminal.contains("the study deviates:"), "{terminal}");
    let json: Json = serde_json::from_str(&run(&["analyze", "results", "--json"])).unwrap();
    assert_eq!(json["preregistration"]["matches"], false);
    let deviations = json["preregistration"]["deviations"].to_string();
    for part in [
        "alpha: none → 0.01",
        "constant-rater",
        "`vaf`: p is held against 0.01",
    ] {
        assert!(deviations.contains(part), "{part}: {deviations}");
    }
    let warnings = json["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|w| w["code"] == "preregistration"));
    let html = read(at, page);
    assert!(html.contains("the study deviates") && !html.contains("the study matches"));
}

/// A protocol that was changed after the document, before the first session.
#[test]
fn a_changed_protocol_is_noticed() {
    let folder = protocol();
    let at = folder.path();
    assert_eq!(preregister(at, &[]).0, 0);
    let text = read(at, "p/protocol.toml").replace("repetitions = 3", "repetitions = 2");
    fs::write(at.join("p/protocol.toml"), text).unwrap();
    let run = |arguments: &[&str]| study(arguments, at).1;
    run(&["rehearse", "p", "--participants", "1", "--out", "results"]);
    let said = run(&["analyze", "results", "--json"]);
    assert!(said.contains("design.repetitions: 3 → 2"), "{said}");
    assert!(said.contains("\"matches\": false"));
}

/// A new study of a kind with two groups and two sessions, in the folder `p`.
fn of_parts(kind: &str, folder: &Path, participants: u32) {
    let (code, _, said) = study(&["new", "--seed", "20261123", "p", "--kind", kind], folder);
    assert_eq!(code, 0, "{said}");
    let mut text = read(folder, "p/protocol.toml");
    for (key, value) in [("participants", participants), ("seed", 7)] {
        let start = format!("{key} = ");
        let line = text
            .lines()
            .find(|l| l.starts_with(&start))
            .unwrap()
            .to_owned();
        text = text.replace(&line, &format!("{start}{value}"));
    }
    let text = text
        + "\n[groups]\n[[groups.list]]\nid = \"young\"\n[[groups.list]]\nid = \"old\"\n\n\
           [[sessions]]\nid = \"one\"\n[[sessions]]\nid = \"two\"\n";
    fs::write(folder.join("p/protocol.toml"), text).unwrap();
}

/// Questions, deciding tests, planned number and power of pairs, and the comparison of a study
/// without ratings, which a changed rule breaks.
#[test]
fn pairs_of_groups_and_sessions_are_declared_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    of_parts("pairs", at, 12);
    let (code, _, said) = preregister(at, &[]);
    assert_eq!(code, 0, "{said}");
    let text = read(at, "p/preregistration.md");
    for part in [
        "* 12 participants.",
        "Groups: `young` (share 1), `old` (share 1); assigned by row in permuted blocks.",
        "Sessions of each participant: `one`, `two`.",
        "Part `more-real`: 3 pairs of realizations, 2 trials each, in both orders in turn, “no difference” is an answer.",
        "(choice of 3, primary)",
        "α = .05",
        "Part `more-real`: Is a realization preferred to another? Decided by: t test, participants as \
         clusters, Holm's correction over 3 pairs; level .05.",
        "Does VAF predict which is preferred? Decided by: permutation test, exact; level .05.",
        "In 200 simulated studies (seed ",
        "`preferred` at α = .050 was a yes in",
        "Groups and sessions are not simulated",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    let facts: Json = serde_json::from_str(&read(at, "p/preregistration.json")).unwrap();
    let tests = facts["tests"].as_array().unwrap();
    let declared = |question: &str| tests.iter().find(|t| t["question"] == question).unwrap();
    assert_eq!(declared("preferred")["part"], "more-real");
    assert_eq!(declared("preferred")["comparisons"], 3);
    assert_eq!(declared("groups-conditions")["test"], "between-within");
    assert!(
        facts["power"]["design"]["tests"]["preferred"]["power"].is_f64(),
        "{}",
        facts["power"]
    );

    let run = |arguments: &[&str]| {
        let (code, out, said) = study(arguments, at);
        assert_eq!(code, 0, "{arguments:?}: {said}");
        out
    };
    run(&["rehearse", "p", "--participants", "12", "--out", "results"]);
    let json =
        || -> Json { serde_json::from_str(&run(&["analyze", "results", "--json"])).unwrap() };
    let found = json();
    assert_eq!(
        found["preregistration"]["matches"], true,
        "{}",
        found["preregistration"]
    );
    assert_eq!(found["preregistration"]["sha256"], facts["sha256"]);
    let terminal = run(&["analyze", "results"]);
    assert!(terminal.contains("the study matches it"), "{terminal}");
    let page = "results/p/analysis/report.html";
    assert!(read(at, page).contains("the study matches it"));
    let text = read(at, "p/protocol.toml").replace("primary = ", "alpha = 0.01\nprimary = ");
    fs::write(at.join("p/protocol.toml"), text).unwrap();
    run(&["amend", "results", "p", "--reason", "stricter"]);
    let deviations = json()["preregistration"]["deviations"].to_string();
    for part in [
        "alpha: none → 0.01",
        "part `more-real`, `preferred`: p is held against 0.01; 0.05 was declared",
    ] {
        assert!(deviations.contains(part), "{part}: {deviations}");
    }
    run(&["analyze", "results"]);
    assert!(read(at, page).contains("the study deviates"));
}

/// Tracks are described with their rule, and their tests are those of a complete study.
#[test]
fn tracks_and_estimates_are_declared() {
    for (kind, sentences) in [
        (
            "staircase",
            &[
                "Part `more-friction`: tracks `",
                "Track low (2ifc): friction at ",
                "down staircase that stops after",
                "Do thresholds differ between the conditions? Decided by: linear mixed model",
                "Do the groups differ? Decided by: Welch's",
                "Do the sessions differ? Decided by: linear mixed model",
                "`thresholds` at α = .050 was a yes in",
            ][..],
        ),
        (
            "abx",
            &[
                "abx@one: are standard and comparison told apart? Decided by: t test over participants",
            ],
        ),
        (
            "magnitude",
            &["magnitude estimation of ", "Power was not computed:"],
        ),
        (
            "identification",
            &[
                "identification of 4 realizations, 6 trials each, order shuffled, each is given one of 4 labels, after practice until 7 of the last 8 answers are correct (at most 24 trials, each drawn on its own), the right label is told after each practice trial",
                "Part `which`: Is the right label given more often than by guessing? Decided by: t test over participants",
                "Do the sessions differ? Decided by: linear mixed model",
                "In 100 simulated studies (seed ",
                "`identified` at α = .050 was a yes in",
            ],
        ),
        (
            "similarity",
            &[
                "ratings of difference from 0 to 100 of all 15 pairs of 6 levels and of each with itself, 2 trials each, in both orders in turn, order blocked",
                "Part `difference`: Is there a structure that a map shows better than chance? Decided by: permutation test within participants",
                "Part `difference`: Does it take more than one dimension? Decided by: t test over participants",
                "Part `difference`: Does the map follow the level? Decided by: permutation test, exact",
                "In 100 simulated studies (seed ",
                "`map-follows` at α = .050 was a yes in",
            ],
        ),
        (
            "ranking",
            &[
                "rankings of 4 realizations, all felt one after another, 2 trials, order williams, no ties",
                "Part `order`: Do participants rank the realizations alike? Decided by: permutation test of the ranks within participants",
                "Part `order`: Is one realization ranked above each other one? Decided by: t test, participants as clusters, Holm's correction over 6 pairs",
                "In 100 simulated studies (seed ",
                "`ranked-alike` at α = .050 was a yes in",
            ],
        ),
        (
            "adjustment",
            &[
                "a level of `detent` is set 3 times from below and as often from above, one step of its 21 levels at a time, until it feels equal to 1; where it starts is drawn",
                "Part `equal`: Do settings differ from the standard? Decided by: t test over participants",
                "Part `equal`: Do settings depend on the side from which they start? Decided by: t test over participants",
                "In 100 simulated studies (seed ",
                "`adjusted` at α = .050 was a yes in",
            ],
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        of_parts(kind, at, 4);
        // Two conditions, so that thresholds can differ.
        let protocol = read(at, "p/protocol.toml");
        let apart = protocol.replace("condition = \"friction\"", "");
        fs::write(at.join("p/protocol.toml"), apart).unwrap();
        let arguments = [
            "preregister",
            "p",
            "--date",
            "2026-03-01",
            "--studies",
            "100",
        ];
        let (code, _, said) = study(&arguments, at);
        assert_eq!(code, 0, "{said}");
        let text = read(at, "p/preregistration.md");
        for part in sentences {
            assert!(text.contains(part), "{part}\n{text}");
        }
    }
}
