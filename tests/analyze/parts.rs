//! The analysis of a study's pairs and tracks, against the same statistics of a table.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The range of the shipped protocol of a threshold, and the same as an option.
const LADDER: (&str, &str) = ("range = [0.05, 2.0] ", "0.05..2:0.04875");

/// Runs `study`: exit code, standard output, standard error.
fn study(arguments: &[&str], folder: &Path) -> (i32, String, String) {
    let mut command = Command::cargo_bin("study").unwrap();
    let output = command
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (code, text(output.stdout), text(output.stderr))
}

/// Rehearses the protocol of `study new --kind KIND`; the analysis of its only part, and
/// the study's folder.
fn rehearsed(folder: &Path, kind: &str) -> Value {
    for arguments in [
        vec!["new", kind, "--kind", kind],
        vec!["rehearse", kind, "--participants", "2", "--out", "out"],
    ] {
        let (code, _, err) = study(&arguments, folder);
        assert_eq!(code, 0, "{err}");
    }
    let (code, out, err) = study(&["analyze", "out", "--json"], folder);
    assert_eq!(code, 0, "{err}");
    let document: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["format"], "study-parts/1");
    let part = document["parts"][0].clone();
    assert_eq!(part["simulated"], true);
    part
}

/// The values of a table of trials.
fn of_table(folder: &Path, table: &str, arguments: &[&str]) -> Value {
    fs::write(folder.join("table.csv"), table).unwrap();
    let mut all = vec!["analyze", "table.csv", "--json", "--task"];
    all.extend(arguments);
    let (code, out, err) = study(&all, folder);
    assert_eq!(code, 0, "{err}");
    let document: Value = serde_json::from_str(&out).unwrap();
    document["values"].clone()
}

/// The cells of some columns, by row.
fn cells(path: &Path, columns: &[&str]) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let at = |name: &&str| header.iter().position(|h| h == *name).unwrap();
    let at: Vec<usize> = columns.iter().map(at).collect();
    let row = |r: csv::StringRecord| at.iter().map(|i| r[*i].to_owned()).collect();
    reader.records().map(|r| row(r.unwrap())).collect()
}

#[test]
fn pairs_of_a_study_give_the_abilities_of_their_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "pairs");
    let results = folder.path().join("out/pairs");
    let answers = cells(
        &results.join("ratings.csv"),
        &["participant", "trial", "attempt", "more-real"],
    );
    let felt = cells(
        &results.join("intervals.csv"),
        &["participant", "trial", "attempt", "interval", "model"],
    );
    let mut table = "participant,first,second,answer\n".to_owned();
    for answer in &answers {
        let model = |interval: &str| {
            let it = felt
                .iter()
                .find(|f| f[..3] == answer[..3] && f[3] == interval);
            it.unwrap()[4].clone()
        };
        table += &format!(
            "{},{},{},{}\n",
            answer[0],
            model("1"),
            model("2"),
            answer[3]
        );
    }
    assert_eq!(part["trials"], answers.len());
    assert_eq!(part["values"], of_table(folder.path(), &table, &["pairs"]));

    // Whoever is excluded does not count.
    let exclude = [
        "participant",
        "out/pairs",
        "SIM001",
        "--state",
        "excluded",
        "--reason",
        "ill",
    ];
    let (code, _, err) = study(&exclude, folder.path());
    assert_eq!(code, 0, "{err}");
    let (_, out, _) = study(&["analyze", "out", "--json"], folder.path());
    let document: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(document["parts"][0]["trials"], answers.len() / 2);
}

#[test]
fn a_track_of_a_study_gives_the_threshold_of_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let part = rehearsed(folder.path(), "questplus");
    let results = folder.path().join("out/questplus");
    let columns = ["participant", "track", "level", "correct"];
    let trials = cells(&results.join("ratings.csv"), &columns);
    let mut table = "participant,condition,level,positive\n".to_owned();
    for t in &trials {
        table += &format!("{},{},{},{}\n", t[0], t[1], t[2], u8::from(t[3] == "true"));
    }
    assert_eq!(part["trials"], trials.len());
    assert!(trials.len() > 60);
    let protocol = fs::read_to_string(folder.path().join("questplus/protocol.toml")).unwrap();
    assert!(protocol.contains(LADDER.0), "{protocol}");
    let table = of_table(folder.path(), &table, &["2ifc", "--ladder", LADDER.1]);
    let values = part["values"].as_object().unwrap();
    assert!(values.len() > 10);
    for (id, value) in values {
        let (a, b) = (value.as_f64(), table[id].as_f64());
        let close = a
            .zip(b)
            .is_none_or(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        assert!(
            a.is_some() == b.is_some() && close,
            "{id}: {value} {}",
            table[id]
        );
    }
}
