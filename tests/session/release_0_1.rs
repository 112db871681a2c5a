//! A study that was begun with release 0.1 goes on: `tests/golden/release_0_1`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::{play_to_end, play_until};
use crate::support::{Terminal, copy_folder, repository, study};
use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// The analysis of the pilots.
fn analysis(folder: &Path) -> Json {
    let arguments = ["analyze", "results", "--include", "pilot", "--json"];
    let (code, out, err) = study(&arguments, folder);
    assert_eq!(code, 0, "{err}");
    serde_json::from_str(&out).unwrap()
}

/// The cells of `ratings.csv` by participant and trial, each with its column.
fn rows(folder: &Path) -> BTreeMap<(String, String), BTreeMap<String, String>> {
    let path = folder.join("results/begun-with-0-1/ratings.csv");
    let mut table = csv::Reader::from_path(path).unwrap();
    let at = |name: &str, header: &csv::StringRecord| header.iter().position(|h| h == name);
    let header = table.headers().unwrap().clone();
    let (who, trial) = (
        at("participant", &header).unwrap(),
        at("trial", &header).unwrap(),
    );
    let record = |r: Result<csv::StringRecord, csv::Error>| {
        let r = r.unwrap();
        let cells = header.iter().zip(r.iter());
        let cells = cells.map(|(name, cell)| (name.to_owned(), cell.to_owned()));
        ((r[who].to_owned(), r[trial].to_owned()), cells.collect())
    };
    table.records().map(record).collect()
}

#[test]
fn a_study_of_the_first_release_has_the_same_analysis_and_its_session_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_folder(Path::new(&repository("tests/golden/release_0_1")), folder);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");

    // The same rows, exclusions and statistics as that release.
    let text = fs::read_to_string(folder.join("analysis.json")).unwrap();
    let (old, new): (Json, Json) = (serde_json::from_str(&text).unwrap(), analysis(folder));
    assert_eq!(new["counts"], old["counts"]);
    assert_eq!(new["exclusions"], old["exclusions"]);
    let mut compared = 0;
    for (id, value) in old["values"].as_object().unwrap() {
        let (Some(value), now) = (value.as_f64(), &new["values"][id]) else {
            continue;
        };
        let now = now.as_f64().unwrap_or_else(|| panic!("{id} is gone"));
        let close = (now - value).abs() <= 1e-9 * value.abs().max(1.0);
        assert!(close, "{id}: {now}, was {value}");
        compared += 1;
    }
    assert!(compared > 100, "{compared}");

    // The unfinished session goes on where it was.
    let before = rows(folder);
    let arguments = ["run", "study", "--operator", "lw", "--participant", "G03"];
    let mut terminal = Terminal::start(&arguments, folder, 24, 80);
    // The files say when it was left: more than the four hours after which somebody chooses.
    play_until(&mut terminal, "G03", "c  continue where it stopped");
    terminal.keys("c");
    terminal.wait_until("the choice", |s| {
        !s.contains("This session was not finished")
    });
    play_to_end(&mut terminal, "G03");
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    let after = rows(folder);
    assert_eq!(before.len(), after.len());
    for (key, row) in &before {
        let was_open = key.0 == "G03" && key.1.parse::<u32>().unwrap() > 3;
        // Later releases have further columns.
        let changed: Vec<&String> = (row.iter())
            .filter(|(column, cell)| after[key][*column] != **cell)
            .map(|(column, _)| column)
            .collect();
        assert_eq!(changed.is_empty(), !was_open, "{key:?}: {changed:?}");
    }
    let now = analysis(folder);
    assert_eq!(now["exclusions"], old["exclusions"]);
    assert_eq!(now["counts"]["missing"], 0);
    assert_eq!(now["counts"]["rated"], 12);
}
