//! Two groups in two sessions: rehearsed, and by keys in a pseudo-terminal of 80×24.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::{correct_newest, mark_bad, play_to_end, play_until, quit};
use crate::support::{Terminal, changed_protocol, study};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The realizations of a rating in two groups, of which the second rates fewer, and in two
/// sessions.
fn protocol(folder: &Path) -> PathBuf {
    let to = folder.join("protocol");
    let parts = r#"
[[parts]]
id = "real"
kind = "rating"
repetitions = 2

[groups]
[[groups.list]]
id = "all"
[[groups.list]]
id = "few"
models = ["lambda-0.9991", "lambda-0.9995"]

[[sessions]]
id = "one"
[[sessions]]
id = "two"
max_gap_h = 72

[[intake]]
id = "age"
kind = "number"
prompt = "Age"
min = 18
max = 99

# Asked after"#;
    let changes = [
        ("study-protocol/1", "study-protocol/2"),
        ("repetitions = 3\n", "max_attempts = 50\n"),
        ("order = \"blocked\"\n", ""),
        ("# Asked after", parts),
    ];
    changed_protocol("turn-signal", &to, &changes);
    to
}

/// The rows of a table of the only study, by column.
fn table(folder: &Path, name: &str) -> Vec<BTreeMap<String, String>> {
    rows(&folder.join("turn-signal").join(name))
}

/// The rows of a table, by column.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let row = |r: csv::StringRecord| {
        let cells = header.iter().zip(r.iter());
        cells.map(|(h, c)| (h.to_owned(), c.to_owned())).collect()
    };
    reader.records().map(|r| row(r.unwrap())).collect()
}

#[test]
fn rehearsed_participants_come_twice_in_their_group_with_other_orders() {
    let folder = tempfile::tempdir().unwrap();
    let to = protocol(folder.path());
    let path = to.to_str().unwrap();
    let (code, out, err) = study(
        &["rehearse", path, "--participants", "6", "--out", "out"],
        folder.path(),
    );
    assert_eq!(code, 0, "{out}{err}");
    let results = folder.path().join("out");
    let participants = table(&results, "participants.csv");
    let groups: Vec<&str> = participants.iter().map(|p| p["group"].as_str()).collect();
    assert_eq!(
        groups.iter().filter(|g| **g == "few").count(),
        3,
        "{groups:?}"
    );
    for p in &participants {
        assert_eq!(
            (p["session"].as_str(), p["session_id"].as_str()),
            ("2", "two")
        );
        // What is asked once was asked in the first session.
        assert!(!p["age"].is_empty());
        // Halfway between 0 and 72 h.
        assert!(
            (p["gap_h"].parse::<f64>().unwrap() - 36.0).abs() < 0.1,
            "{}",
            p["gap_h"]
        );
    }
    let mut orders: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for row in table(&results, "ratings.csv") {
        let key = (row["participant"].clone(), row["session_id"].clone());
        orders.entry(key).or_default().push(row["model"].clone());
        let own = participants
            .iter()
            .find(|p| p["participant"] == row["participant"]);
        assert_eq!(row["group"], own.unwrap()["group"]);
    }
    for p in &participants {
        let of = |session: &str| &orders[&(p["participant"].clone(), session.to_owned())];
        let few = p["group"] == "few";
        assert_eq!(of("one").len(), if few { 4 } else { 10 });
        let distinct: BTreeSet<&String> = of("one").iter().collect();
        assert_eq!(distinct.len(), if few { 2 } else { 5 });
        assert!(few || of("one") != of("two"), "the order repeats");
    }
    for command in ["verify", "status"] {
        let (code, out, err) = study(&[command, "out"], folder.path());
        assert_eq!(code, 0, "{out}{err}");
        assert!(command == "verify" || out.contains("Group few: 3"), "{out}");
    }
    let (code, out, err) = study(
        &["schedule", path, "--session", "two", "--csv"],
        folder.path(),
    );
    assert_eq!(code, 0, "{err}");
    assert!(out.lines().count() > 40, "{out}");
    analyzed(folder.path());
}

/// Groups are compared over the two realizations that both have, sessions with their ICC.
fn analyzed(folder: &Path) {
    let (code, out, err) = study(&["analyze", "out", "--json"], folder);
    assert_eq!(code, 0, "{err}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    let part = &document["parts"][0];
    assert_eq!(part["task"], "rating");
    let number = |id: &str| {
        part["values"][id]
            .as_f64()
            .unwrap_or_else(|| panic!("{id}"))
    };
    // Two realizations in two sessions.
    assert_eq!(number("groups/n_cells"), 4.0);
    let mut means: BTreeMap<String, BTreeMap<String, Vec<f64>>> = BTreeMap::new();
    for row in table(&folder.join("out"), "ratings.csv") {
        if ["lambda-0.9991", "lambda-0.9995"].contains(&row["model"].as_str()) {
            let rating = row["realism"].parse().unwrap();
            let group = means.entry(row["group"].clone()).or_default();
            group
                .entry(row["participant"].clone())
                .or_default()
                .push(rating);
        }
    }
    let of = |group: &str| -> Vec<f64> {
        let own = means[group].values();
        own.map(|x| x.iter().sum::<f64>() / x.len() as f64)
            .collect()
    };
    let test = study_stats::between::welch::difference(&of("all"), &of("few")).unwrap();
    assert!((number("groups/all|few/difference") - test.difference).abs() < 1e-9);
    assert!((number("groups/p") - test.p.unwrap()).abs() < 1e-9);
    assert_eq!(number("retest/n"), 6.0);
    assert!(number("retest/icc_agreement") <= 1.0 && number("sessions/p") <= 1.0);
    let questions = part["findings"].as_array().unwrap();
    let asked: Vec<&str> = questions
        .iter()
        .map(|f| f["question"].as_str().unwrap())
        .collect();
    assert_eq!(
        asked,
        ["groups", "groups-conditions", "sessions", "groups-sessions"]
    );
    // The interaction of two groups and two sessions is the t test of the participants' changes.
    let mut change: BTreeMap<String, BTreeMap<String, f64>> = BTreeMap::new();
    for row in table(&folder.join("out"), "ratings.csv") {
        if ["lambda-0.9991", "lambda-0.9995"].contains(&row["model"].as_str()) {
            let rating: f64 = row["realism"].parse().unwrap();
            let sign = if row["session"] == "1" { -1.0 } else { 1.0 };
            let group = change.entry(row["group"].clone()).or_default();
            *group.entry(row["participant"].clone()).or_default() += sign * rating;
        }
    }
    let of = |group: &str| -> Vec<f64> { change[group].values().copied().collect() };
    let test = study_stats::between::difference(&of("all"), &of("few")).unwrap();
    assert!((number("groups_sessions/F") - test.t * test.t).abs() < 1e-9);
    assert!((number("groups_sessions/p_gg") - test.p.unwrap()).abs() < 1e-9);
    assert_eq!(number("groups_conditions/n_conditions"), 2.0);
    assert_eq!(number("groups_conditions/df2"), 4.0);
    let (code, page, err) = study(&["analyze", "out"], folder);
    assert_eq!(code, 0, "{err}");
    assert!(
        page.contains("Do the groups differ?") && page.contains("Test–retest reliability"),
        "{page}"
    );
}

#[test]
fn two_sessions_by_keys_with_a_failed_playback_a_correction_a_quit_and_a_resume() {
    let folder = tempfile::tempdir().unwrap();
    let to = protocol(folder.path());
    let start = || {
        let path = to.to_str().unwrap();
        let mut terminal =
            Terminal::start(&["run", path, "--operator", "lw"], folder.path(), 24, 80);
        terminal.wait_for("Who takes part?");
        // A key that comes with the page is not meant for it.
        std::thread::sleep(std::time::Duration::from_millis(300));
        terminal
    };
    let mut terminal = start();
    play_until(&mut terminal, "P01", "Enter: rate");
    mark_bad(&mut terminal, "somebody came in");
    play_until(&mut terminal, "P01", "trial 3 of");
    correct_newest(&mut terminal, "3", "mistyped");
    quit(&mut terminal);
    let mut terminal = start();
    play_to_end(&mut terminal, "P01");

    // The first screen says that a session follows, and it has no intake.
    let mut terminal = start();
    terminal.keys("P01");
    terminal.wait_for("┃ P01");
    terminal.wait_for("next: session two, one of 2");
    terminal.keys("\u{15}");
    terminal.wait_until("the empty field", |s| !s.contains("┃ P01"));
    let pages = play_to_end(&mut terminal, "P01");
    assert!(
        pages.iter().all(|page| !page.contains("Age")),
        "asked again"
    );
    let mut terminal = start();
    terminal.keys("P01");
    terminal.wait_for("finished");
    quit(&mut terminal);

    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let results = folder.path().join("results");
    let rows = table(&results, "ratings.csv");
    let of = |session: &str| rows.iter().filter(|r| r["session_id"] == session).count();
    assert_eq!(of("one"), of("two"));
    let groups: BTreeSet<&String> = rows.iter().map(|r| &r["group"]).collect();
    assert_eq!(groups.len(), 1);
    assert!(rows.iter().all(|r| r["status"] == "ok"));
    assert_eq!(rows.iter().filter(|r| r["corrected"] == "true").count(), 1);
    let participants = table(&results, "participants.csv");
    assert_eq!(participants.len(), 1);
    assert!(!participants[0]["age"].is_empty());
}

/// A track of two sessions is a track of its own in each, `TRACK@SESSION`; compared are the
/// tracks, whatever the order in which they are declared.
#[test]
fn tracks_of_two_sessions_have_a_threshold_in_each_and_one_contrast() {
    let folder = tempfile::tempdir().unwrap();
    let (code, _, err) = study(
        &["new", "--seed", "20261123", "t", "--kind", "staircase"],
        folder.path(),
    );
    assert_eq!(code, 0, "{err}");
    let path = folder.path().join("t/protocol.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let sessions = "[[sessions]]\nid = \"one\"\n[[sessions]]\nid = \"two\"\n[analysis]";
    // Each track measures a condition of its own.
    let text = text
        .replace("\"low\"", "\"even\"")
        .replace("condition = \"friction\"", "")
        .replace("max_trials = 60", "max_trials = 20")
        .replace("[analysis]", sessions);
    std::fs::write(&path, text).unwrap();
    let arguments = ["rehearse", "t", "--participants", "3", "--out", "out"];
    let (code, _, err) = study(&arguments, folder.path());
    assert_eq!(code, 0, "{err}");
    let (code, out, err) = study(&["verify", "out"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let (code, out, err) = study(&["analyze", "out", "--json"], folder.path());
    assert_eq!(code, 0, "{err}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    let values = document["parts"][0]["values"].as_object().unwrap();
    let trials = rows(&folder.path().join("out/t/ratings.csv"));
    let logarithms = ["even", "high"].map(|track| {
        let mut own = Vec::new();
        for participant in ["SIM001", "SIM002", "SIM003"] {
            for session in ["one", "two"] {
                let of = |r: &&BTreeMap<String, String>| {
                    r["participant"] == participant
                        && r["session_id"] == session
                        && r["track"] == track
                };
                let trials = trials.iter().filter(of).count() as f64;
                let id = format!("psy/{participant}/{track}@{session}");
                assert_eq!(values[&format!("{id}/n_trials")], trials, "{id}");
                let threshold = values[&format!("{id}/posterior/threshold/median")].as_f64();
                own.push(threshold.unwrap().ln());
            }
        }
        own
    });
    // Two sessions of a participant are two tracks.
    assert!(logarithms[0].chunks(2).any(|own| own[0] != own[1]));
    // Everybody has both tracks in both sessions: the contrast is that of the means.
    let [even, high] = logarithms.map(|own| own.iter().sum::<f64>() / own.len() as f64);
    let ratio = values["psy_mixed/even|high/ratio"].as_f64().unwrap();
    assert!((ratio.ln() - (even - high)).abs() < 1e-6 && even != high);
    assert_eq!(values["psy_mixed/n_participants"], 3.0);
    let findings = document["parts"][0]["findings"].as_array().unwrap();
    let compared = findings.iter().find(|f| f["question"] == "thresholds");
    assert_eq!(compared.unwrap()["n_realizations"], 2);
    let pairs = values
        .keys()
        .filter(|id| id.starts_with("psy_mixed/") && id.ends_with("/p_holm"));
    assert_eq!(pairs.count(), 1);
    let sessions = values
        .get("sessions/p")
        .or(document["parts"][0]["undefined"].get("sessions/p"));
    assert!(sessions.is_some());
    assert!(
        values
            .keys()
            .any(|id| id.starts_with("track/SIM001/high@two/"))
    );
}
