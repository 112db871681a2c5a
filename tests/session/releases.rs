//! A study that was begun with an earlier release goes on: `tests/golden/release_*`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::{play_to_end, play_until, quit};
use crate::support::{Terminal, copy_folder, repository, study};
use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// A study as a release left it.
struct Begun {
    /// Its folder in tests/golden: `study`, `results` and `analysis.json`.
    golden: &'static str,
    /// Its id.
    id: &'static str,
    /// The trials of the session that was left, all and those that were done.
    trials: (u32, u32),
    /// Ratings of the finished sessions and, at the end, of that one.
    rated: u32,
}

/// Rated on the simulated device.
const RELEASE_0_1: Begun = Begun {
    golden: "tests/golden/release_0_1",
    id: "begun-with-0-1",
    trials: (6, 3),
    rated: 12,
};

/// Two parts, ratings of crossed factors and pairs, on samples that are mounted by hand; one answer was corrected.
const RELEASE_0_2: Begun = Begun {
    golden: "tests/golden/release_0_2",
    id: "begun-with-0-2",
    trials: (12, 3),
    rated: 24,
};

/// The participant whose session was left.
const LEFT: &str = "G03";

/// The analysis of the pilots.
fn analysis(folder: &Path) -> Json {
    let arguments = ["analyze", "results", "--include", "pilot", "--json"];
    let (code, out, err) = study(&arguments, folder);
    assert_eq!(code, 0, "{err}");
    serde_json::from_str(&out).unwrap()
}

/// The cells of `ratings.csv` by participant and trial, each with its column.
fn rows(folder: &Path, id: &str) -> BTreeMap<(String, String), BTreeMap<String, String>> {
    let path = folder.join(format!("results/{id}/ratings.csv"));
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

/// The numbers of a document by their paths, without those that belong to a day or a version.
fn numbers(document: &Json) -> BTreeMap<String, f64> {
    fn collect(value: &Json, path: &str, found: &mut BTreeMap<String, f64>) {
        match value {
            Json::Object(map) => {
                for (key, value) in map {
                    collect(value, &format!("{path}/{key}"), found);
                }
            }
            _ => found.extend(value.as_f64().map(|number| (path.to_owned(), number))),
        }
    }
    let mut found = BTreeMap::new();
    collect(&document["values"], "values", &mut found);
    collect(&document["parts"], "parts", &mut found);
    found
}

/// The analysis is that of the release, and the session that was left goes on.
fn goes_on(begun: &Begun) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    copy_folder(Path::new(&repository(begun.golden)), folder);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");

    // The same rows, exclusions and statistics as that release.
    let text = fs::read_to_string(folder.join("analysis.json")).unwrap();
    let (old, new): (Json, Json) = (serde_json::from_str(&text).unwrap(), analysis(folder));
    assert_eq!(new["counts"], old["counts"]);
    assert_eq!(new["exclusions"], old["exclusions"]);
    let (then, now) = (numbers(&old), numbers(&new));
    for (id, value) in &then {
        let now = now.get(id).unwrap_or_else(|| panic!("{id} is gone"));
        let close = (now - value).abs() <= 1e-9 * value.abs().max(1.0);
        assert!(close, "{id}: {now}, was {value}");
    }
    assert!(then.len() > 100, "{}", then.len());

    // The unfinished session goes on where it was.
    let before = rows(folder, begun.id);
    let arguments = [
        "run",
        "study",
        "--operator",
        "lw",
        "--participant",
        LEFT,
        "--pilot",
    ];
    let mut terminal = Terminal::start(&arguments, folder, 24, 80);
    // The files say when it was left: more than the four hours after which somebody chooses.
    play_until(&mut terminal, LEFT, "c  continue where it stopped");
    terminal.keys("c");
    terminal.wait_until("the choice", |s| {
        !s.contains("This session was not finished")
    });
    play_to_end(&mut terminal, LEFT);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    let after = rows(folder, begun.id);
    assert_eq!(before.len(), after.len());
    for (key, row) in &before {
        let was_open = key.0 == LEFT && key.1.parse::<u32>().unwrap() > begun.trials.1;
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
    assert_eq!(now["counts"]["rated"], begun.rated);
}

#[test]
fn a_study_of_the_first_release_has_the_same_analysis_and_its_session_resumes() {
    goes_on(&RELEASE_0_1);
}

#[test]
fn a_study_of_release_0_2_has_the_same_analysis_and_its_session_resumes() {
    goes_on(&RELEASE_0_2);
}

/// Plays what tests/golden/release_0_2 has, into target/golden; by the binary of that release only.
#[test]
#[ignore = "writes the study of a release"]
fn a_study_of_this_release_is_written() {
    let folder = repository("target/golden");
    let folder = Path::new(&folder);
    let begun = &RELEASE_0_2;
    fs::create_dir_all(folder).unwrap();
    copy_folder(
        Path::new(&repository(begun.golden)).join("study").as_path(),
        &folder.join("study"),
    );
    for who in ["G01", "G02", LEFT] {
        let arguments = [
            "run",
            "study",
            "--operator",
            "lw",
            "--participant",
            who,
            "--pilot",
        ];
        let mut terminal = Terminal::start(&arguments, folder, 24, 80);
        if who == LEFT {
            let next = format!("trial {} of {}", begun.trials.1 + 1, begun.trials.0);
            play_until(&mut terminal, who, &next);
            quit(&mut terminal);
        } else {
            play_to_end(&mut terminal, who);
        }
    }
    let correct = "correct results G02 --trial 2 --question pleasantness --to 7 --reason misread";
    let correct: Vec<&str> = correct.split(' ').collect();
    let (code, _, err) = study(&correct, folder);
    assert_eq!(code, 0, "{err}");
    let text = format!("{:#}\n", analysis(folder));
    fs::write(folder.join("analysis.json"), text).unwrap();
}
