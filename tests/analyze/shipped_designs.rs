//! The designs of protocols/designs: each is checked, rehearsed by few participants, analyzed and reported.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts::study;
use std::fs;
use std::path::Path;

/// Each design: its file, and what its analysis has to ask or name.
const DESIGNS: [(&str, &[&str]); 12] = [
    (
        "texture-2x2",
        &[
            "Does the effect of friction depend on vibration?",
            "Equivalence within ± 0.5 points",
            "load",
        ],
    ),
    (
        "fitts",
        &[
            "Does difficulty matter?",
            "Does the effect of feedback depend on difficulty?",
            "movement",
            "misses",
        ],
    ),
    (
        "training",
        &[
            "Do the sessions differ?",
            "Do the changes from session to session depend on the group?",
        ],
    ),
    ("comfort-3x2", &["Does actuator matter?", "annoyance"]),
    ("delay", &["Does delay matter?", "completion", "force"]),
    (
        "expertise",
        &[
            "Does group matter?",
            "Does the effect of stiffness depend on group?",
        ],
    ),
    (
        "cues-2x2x2",
        &[
            "Does touch matter?",
            "Does the effect of sound depend on touch?",
        ],
    ),
    (
        "roughness",
        &["Do the estimates differ between realizations?"],
    ),
    ("patterns", &["Is a realization preferred to another?"]),
    (
        "icons",
        &["Is the right label given more often than by guessing?"],
    ),
    (
        "materials",
        &["Is there a structure that a map shows better than chance?"],
    ),
    ("codec", &["quality"]),
];

/// Participants of each rehearsal: two of each group, and lines of a Williams design.
const PARTICIPANTS: &str = "4";

/// Without the ends of lines, where a page wraps its sentences.
fn flowing(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_shipped_design_is_checked_rehearsed_analyzed_and_reported() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/designs");
    let mut shipped: Vec<String> = fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    shipped.sort();
    let mut listed: Vec<String> = DESIGNS
        .iter()
        .map(|(name, _)| format!("{name}.toml"))
        .collect();
    listed.sort();
    assert_eq!(shipped, listed);

    for (name, expected) in DESIGNS {
        let path = folder.join(format!("{name}.toml"));
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.lines().count() < 40, "{name} has 40 lines or more");
        let home = tempfile::tempdir().unwrap();
        let path = path.to_str().unwrap();
        let run = |arguments: &[&str]| {
            let (code, out, err) = study(arguments, home.path());
            assert_eq!(code, 0, "{name} {arguments:?}: {out}{err}");
            out
        };
        run(&["check", path]);
        let rehearse = [
            "rehearse",
            path,
            "--participants",
            PARTICIPANTS,
            "--out",
            "out",
        ];
        run(&rehearse);
        run(&["verify", "out"]);
        let page = flowing(&run(&["analyze", "out"]));
        let report = home
            .path()
            .join("out")
            .join(name)
            .join("analysis/report.html");
        let report = flowing(&fs::read_to_string(report).unwrap());
        for told in expected {
            assert!(page.contains(told), "{name}: {told}\n{page}");
            assert!(report.contains(told), "{name}: {told} in the report");
        }
    }
}

/// The numbers that the program of a task sends are in the table, in the export and in the analysis.
#[test]
fn numbers_of_a_task_reach_table_export_and_analysis() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols/designs/fitts.toml");
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let (code, out, err) = study(arguments, home.path());
        assert_eq!(code, 0, "{arguments:?}: {out}{err}");
        out
    };
    let path = path.to_str().unwrap();
    run(&["rehearse", path, "--participants", "4", "--out", "out"]);
    let mut table = csv::Reader::from_path(home.path().join("out/fitts/ratings.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let place = |name: &str| header.iter().position(|column| column == name).unwrap();
    let [movement, misses] = ["movement", "misses"].map(place);
    let (mut logs, mut count) = (0.0, 0.0);
    for row in table.records().map(Result::unwrap) {
        let (time_s, missed): (f64, f64) =
            (row[movement].parse().unwrap(), row[misses].parse().unwrap());
        assert!(time_s > 0.0 && missed >= 0.0 && missed.fract() == 0.0);
        (logs, count) = (logs + time_s.ln(), count + 1.0);
    }
    let document: serde_json::Value =
        serde_json::from_str(&run(&["analyze", "out", "--json"])).unwrap();
    let values = &document["values"];
    assert_eq!(values["outcomes/movement/n"].as_f64(), Some(count));
    assert_eq!(values["outcomes/misses/n_missing"].as_f64(), Some(0.0));
    let of_realizations: Vec<f64> = values
        .as_object()
        .unwrap()
        .iter()
        .filter(|(id, _)| {
            id.starts_with("outcomes/movement/desc/") && id.ends_with("/geometric_mean")
        })
        .map(|(_, value)| value.as_f64().unwrap().ln())
        .collect();
    // Each realization has as many trials: the mean of the logarithms is that of all.
    assert_eq!(of_realizations.len(), 6);
    let mean = of_realizations.iter().sum::<f64>() / 6.0;
    assert!((mean - logs / count).abs() < 1e-9, "{mean}");
    run(&[
        "export",
        "out/fitts",
        "--to",
        "frictionless",
        "--out",
        "data",
        "--include",
        "simulated",
    ]);
    let package = fs::read_to_string(home.path().join("data/datapackage.json")).unwrap();
    assert!(
        package.contains("time that the controller program sent"),
        "{package}"
    );
}
