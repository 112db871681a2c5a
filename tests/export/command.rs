//! The command and what its data sets have.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::studies::{HOSTILE, IDS, TITLE, export, files, hostile, new, real_study, rehearsed};
use crate::support::{repository, study};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use study_analysis::export::{FORMATS, FormatInfo};
use study_plan::protocol::Answer;
use study_session::outcome::Event;

/// The option for telemetry, where the format has a place for it.
fn with_telemetry(format: &FormatInfo) -> &'static [&'static str] {
    match format.telemetry {
        true => &["--with-telemetry"],
        false => &[],
    }
}

fn csv(path: &Path) -> (Vec<String>, Vec<csv::StringRecord>) {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let head = reader
        .headers()
        .unwrap()
        .iter()
        .map(str::to_owned)
        .collect();
    (head, reader.records().map(Result::unwrap).collect())
}

fn column(path: &Path, name: &str) -> Vec<String> {
    let (head, rows) = csv(path);
    let at = head
        .iter()
        .position(|h| h == name)
        .unwrap_or_else(|| panic!("{name}: {head:?}"));
    rows.iter().map(|r| r[at].to_owned()).collect()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn hostile_texts_are_text_in_every_format() {
    let home = tempfile::tempdir().unwrap();
    let folder = hostile(home.path());
    // The control characters that no table can have are replaced, nothing else.
    let kept = HOSTILE.replace(['\u{0}', '\u{1b}'], "\u{fffd}");
    let flat = HOSTILE.replace("\r\n", " ").replace(char::is_control, " ");
    for (to, ratings) in [
        ("csv", "ratings.csv"),
        ("r", "ratings.csv"),
        ("frictionless", "ratings.csv"),
        ("psych-ds", "data/study-turnsignal_data.csv"),
    ] {
        let (out, _) = export(&folder, to, home.path(), to, &[]);
        let path = out.join(ratings);
        let comments = column(&path, "comment");
        assert_eq!(comments.iter().filter(|c| **c == kept).count(), 15, "{to}");
        let who: BTreeSet<String> = column(&path, "participant").into_iter().collect();
        assert_eq!(who, IDS.iter().map(|i| (*i).to_owned()).collect(), "{to}");
        let models: BTreeSet<String> = column(&path, "model").into_iter().collect();
        assert_eq!(
            models,
            ["NA", "-1", "1e5", "..", "TRUE"].map(str::to_owned).into()
        );
    }
    let (out, _) = export(&folder, "bids", home.path(), "bids", &[]);
    let table = fs::read_to_string(out.join("sub-NA/beh/sub-NA_task-turnsignal_beh.tsv")).unwrap();
    assert_eq!(table.matches(flat.trim()).count(), 3, "{table}");
    assert_eq!(json(&out.join("dataset_description.json"))["Name"], TITLE);
    let psych = json(&home.path().join("psych-ds/dataset_description.json"));
    assert_eq!(psych["name"], TITLE);
    let package = json(&home.path().join("frictionless/datapackage.json"));
    assert_eq!(package["title"], TITLE);
    assert_eq!(
        package["contributors"][1]["path"],
        "https://orcid.org/0000-0002-1825-0097"
    );
    // No text of a study is in the code.
    let script = include_str!("../../crates/study-analysis/src/export/analysis.R");
    let r = home.path().join("r");
    assert_eq!(fs::read_to_string(r.join("analysis.R")).unwrap(), script);
    assert!(
        !fs::read_to_string(r.join("analysis.qmd"))
            .unwrap()
            .contains("quit")
    );
    for name in ["csv", "r", "frictionless", "psych-ds", "bids"] {
        let readme = fs::read_to_string(home.path().join(name).join("README.md")).unwrap();
        assert!(
            !readme.contains("<script") && !readme.contains('\u{202e}'),
            "{readme}"
        );
        assert!(readme.contains("\\<"), "{readme}");
    }
}

#[test]
fn a_study_gives_the_same_bytes_and_no_path_of_this_machine() {
    let home = tempfile::tempdir().unwrap();
    let folder = hostile(home.path());
    for format in FORMATS {
        let (to, more) = (format.name, with_telemetry(format));
        let (a, _) = export(&folder, to, home.path(), &format!("{to}-a"), more);
        let (b, _) = export(&folder, to, home.path(), &format!("{to}-b"), more);
        let (a, b) = (files(&a), files(&b));
        assert!(a == b, "{to}");
        let here = home.path().to_str().unwrap();
        for (name, bytes) in &a {
            let text = String::from_utf8_lossy(bytes);
            assert!(!text.contains(here), "{to}: {name}");
        }
    }
}

#[test]
fn real_pilot_and_simulated_data_are_never_together() {
    let home = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let simulated = rehearsed(Path::new(&protocol), 2, home.path(), &[]);
    let results = simulated.to_str().unwrap();
    let arguments = ["export", results, "--to", "csv", "--out", "x"];
    let (code, _, err) = study(&arguments, home.path());
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("no trials of real participants"), "{err}");
    assert!(err.contains("--include simulated"), "{err}");
    let (code, _, err) = study(
        &[&arguments[..], &["--include", "pilot"]].concat(),
        home.path(),
    );
    assert_eq!(code, 1, "{err}");
    assert!(!home.path().join("x").exists());
    for FormatInfo { name: to, .. } in FORMATS {
        let (out, err) = export(&simulated, to, home.path(), to, &["--include", "simulated"]);
        assert!(!err.contains("interim"), "{err}");
        let readme = fs::read_to_string(out.join("README.md")).unwrap();
        assert!(readme.starts_with("# SIMULATED: "), "{readme}");
        assert!(readme.contains("**SIMULATED DATA."), "{readme}");
    }
    assert_eq!(
        column(&home.path().join("csv/ratings.csv"), "simulated"),
        vec!["true"; 30]
    );
    let name = json(&home.path().join("bids/dataset_description.json"));
    assert!(name["Name"].as_str().unwrap().starts_with("SIMULATED: "));
}

#[test]
fn comments_stay_away_if_asked() {
    let home = tempfile::tempdir().unwrap();
    let folder = hostile(home.path());
    let (_, said) = export(&folder, "csv", home.path(), "all", &[]);
    assert!(
        said.contains("--without-comments leaves them out"),
        "{said}"
    );
    assert!(said.contains("could run as a formula"), "{said}");
    assert!(
        said.contains("ratings: 0-x_ trial 1, comment: has"),
        "{said}"
    );
    for FormatInfo { name: to, .. } in FORMATS {
        let (out, said) = export(&folder, to, home.path(), to, &["--without-comments"]);
        assert!(!said.contains("may identify"), "{said}");
        for (name, bytes) in files(&out) {
            let text = String::from_utf8_lossy(&bytes);
            for gone in ["HYPERLINK", "Okafor", "simulated-1"] {
                assert!(!text.contains(gone), "{to}: {name}: {gone}");
            }
        }
        let readme = fs::read_to_string(out.join("README.md")).unwrap();
        assert!(readme.contains("free text"), "{readme}");
    }
}

#[test]
fn ids_and_times_are_replaced_and_left_out_if_asked() {
    let home = tempfile::tempdir().unwrap();
    let folder = real_study(
        Path::new(&repository("protocols/turn-signal")),
        &["Anna-7", "Bert-7", "Carl-7"],
        home.path(),
        |_, _| true,
    );
    let ratings = |out: &Path| column(&out.join("ratings.csv"), "realism");
    let (plain, _) = export(&folder, "csv", home.path(), "plain", &[]);
    for format in FORMATS {
        let (to, telemetry) = (format.name, with_telemetry(format));
        let more = ["--redact", "ids,times", "--without-comments"];
        let (out, _) = export(
            &folder,
            to,
            home.path(),
            to,
            &[&more[..], telemetry].concat(),
        );
        for (name, bytes) in files(&out) {
            let text = format!("{name} {}", String::from_utf8_lossy(&bytes));
            for gone in ["Anna", "Bert", "Carl", "2007-03-22T09", "2007-03-23T09"] {
                assert!(!text.contains(gone), "{to}: {name}: {gone}");
            }
        }
    }
    // Times alone: what tells when a session took place, and nothing else.
    let (out, _) = export(&folder, "csv", home.path(), "times", &["--redact", "times"]);
    let (all, _) = csv(&home.path().join("plain/ratings.csv"));
    let (kept, _) = csv(&out.join("ratings.csv"));
    let gone: BTreeSet<&str> = (all.iter().filter(|name| !kept.contains(name)))
        .map(String::as_str)
        .collect();
    assert_eq!(gone, ["operator", "rated_at", "started_at"].into());
    let out = home.path().join("csv");
    let (head, _) = csv(&out.join("ratings.csv"));
    assert!(!head.contains(&"row".to_owned()) && head.contains(&"exploration_s".to_owned()));
    let who = column(&out.join("participants.csv"), "participant");
    assert_eq!(who, ["P001", "P002", "P003"]);
    let sorted = |mut all: Vec<String>| {
        all.sort();
        all
    };
    assert_eq!(
        sorted(ratings(&out)),
        sorted(ratings(&plain)),
        "the same ratings"
    );
}

#[test]
fn nothing_is_overwritten_and_nothing_is_left_behind() {
    let home = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let folder = rehearsed(Path::new(&protocol), 1, home.path(), &[]);
    let results = folder.to_str().unwrap();
    let refused = |out: &str, what: &str| {
        let arguments = [
            "export",
            results,
            "--to",
            "bids",
            "--include",
            "simulated",
            "--out",
            out,
        ];
        let (code, _, err) = study(&arguments, home.path());
        assert_eq!(code, 1, "{out}: {err}");
        assert!(err.contains(what), "{out}: {err}");
    };
    fs::create_dir(home.path().join("full")).unwrap();
    fs::write(home.path().join("full/thesis.tex"), "x").unwrap();
    refused("full", "not empty");
    refused("full/thesis.tex", "a file");
    refused(&format!("{results}/dataset"), "inside the results");
    refused(
        &format!("{results}/../turn-signal/sessions/x"),
        "inside the results",
    );
    #[cfg(unix)]
    {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        fs::create_dir(home.path().join("elsewhere")).unwrap();
        symlink("elsewhere", home.path().join("link")).unwrap();
        refused("link", "symbolic link");
        let (out, _) = export(
            &folder,
            "bids",
            home.path(),
            "new/deep",
            &["--include", "simulated"],
        );
        for (name, _) in files(&out) {
            let path = out.join(&name);
            let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode() & 0o777;
            assert_eq!(mode(&path), 0o600, "{name}");
            assert_eq!(mode(path.parent().unwrap()), 0o700, "{name}");
        }
    }
    fs::create_dir(home.path().join("empty")).unwrap();
    export(
        &folder,
        "csv",
        home.path(),
        "empty",
        &["--include", "simulated"],
    );
    assert_eq!(fs::read_dir(home.path().join("full")).unwrap().count(), 1);
    let items = fs::read_dir(home.path()).unwrap();
    let names: Vec<String> = items
        .map(|i| i.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(!names.iter().any(|n| n.ends_with(".part")), "{names:?}");
}

#[test]
fn a_failed_export_leaves_no_folder() {
    let home = tempfile::tempdir().unwrap();
    let folder = real_study(
        Path::new(&repository("protocols/turn-signal")),
        &["P-1", "P1"],
        home.path(),
        |_, _| true,
    );
    let results = folder.to_str().unwrap();
    let arguments = ["export", results, "--to", "bids", "--out", "out"];
    let (code, _, err) = study(&arguments, home.path());
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("`sub-P1`") && err.contains("--redact ids"),
        "{err}"
    );
    export(
        &folder,
        "bids",
        home.path(),
        "redacted",
        &["--redact", "ids"],
    );
    // A telemetry file that is gone is found in the middle of the export.
    fs::remove_file(folder.join("sessions/P1/1/telemetry/007-a1.csv")).unwrap();
    let arguments = [
        "export",
        results,
        "--to",
        "csv",
        "--with-telemetry",
        "--out",
        "out",
    ];
    let (code, _, err) = study(&arguments, home.path());
    assert_eq!(code, 4, "{err}");
    assert!(err.contains("telemetry"), "{err}");
    let items = fs::read_dir(home.path()).unwrap();
    let names: Vec<String> = items
        .map(|i| i.unwrap().file_name().into_string().unwrap())
        .collect();
    assert!(
        !names.iter().any(|n| n == "out" || n.ends_with(".part")),
        "{names:?}"
    );
}

#[test]
fn who_withdrew_is_in_no_data_set_and_who_is_excluded_is() {
    let home = tempfile::tempdir().unwrap();
    let folder = real_study(
        Path::new(&repository("protocols/turn-signal")),
        &["P01", "P02", "P03"],
        home.path(),
        |_, _| true,
    );
    let results = folder.to_str().unwrap();
    for (id, state) in [("P02", "withdrawn"), ("P03", "excluded")] {
        let arguments = [
            "participant",
            results,
            id,
            "--state",
            state,
            "--reason",
            "asked Dr. Okafor",
        ];
        let (code, _, err) = study(&arguments, home.path());
        assert_eq!(code, 0, "{err}");
    }
    for FormatInfo { name: to, .. } in FORMATS {
        let (out, said) = export(&folder, to, home.path(), to, &[]);
        for (name, bytes) in files(&out) {
            let text = format!("{name} {}", String::from_utf8_lossy(&bytes));
            assert!(!text.contains("P02"), "{to}: {name}");
        }
        assert!(
            said.contains("participants: P03, reason: has a word with a capital"),
            "{said}"
        );
        assert!(said.contains("interim"), "{said}");
    }
    assert_eq!(
        column(&home.path().join("r/participants.csv"), "state"),
        ["done", "excluded"]
    );
    let used = column(&home.path().join("r/ratings.csv"), "included");
    assert_eq!(used, [vec!["true"; 15], vec!["false"; 15]].concat());
    // The orders are in the data set, and rows may be assigned again.
    let log = fs::read_to_string(folder.join("reveals.jsonl")).unwrap();
    assert_eq!(
        log.matches("study export of an unfinished study").count(),
        FORMATS.len(),
        "{log}"
    );
}

#[test]
fn every_column_of_every_table_is_described() {
    let home = tempfile::tempdir().unwrap();
    let pairs = rehearsed(&new("pairs", home.path()), 2, home.path(), &[]);
    let extended = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal-extended");
    let extended_study = rehearsed(Path::new(&protocol), 2, extended.path(), &["--faults"]);
    for (folder, home) in [(pairs, home.path()), (extended_study, extended.path())] {
        let more = ["--include", "simulated", "--with-practice"];
        for to in ["csv", "r"] {
            let (out, _) = export(&folder, to, home, to, &more);
            let (_, dictionary) = csv(&out.join("dictionary.csv"));
            for name in ["ratings", "participants", "realizations", "intervals"] {
                let path = out.join(format!("{name}.csv"));
                if !path.exists() {
                    assert_eq!(name, "intervals");
                    continue;
                }
                let told = dictionary.iter().filter(|r| &r[0] == name);
                let told: Vec<&str> = told.map(|r| &r[1]).collect();
                assert_eq!(csv(&path).0, told, "{name}");
            }
            assert!(
                dictionary.iter().all(|r| !r[8].is_empty()),
                "each has a meaning"
            );
        }
        let protocol = fs::read_to_string(folder.join("protocol/1/protocol.toml")).unwrap();
        let (out, _) = export(&folder, "bids", home, "bids", &more);
        for (name, bytes) in files(&out) {
            let Some(table) = name.strip_suffix("_beh.tsv") else {
                continue;
            };
            let text = String::from_utf8(bytes).unwrap();
            let (_, task) = table.split_once("_task-").unwrap();
            let about = json(&out.join(format!("task-{task}_beh.json")));
            let told = protocol.contains("instructions = ");
            assert_eq!(about["Instructions"].is_string(), told, "{name}");
            for column in text.lines().next().unwrap().split('\t') {
                assert!(about[column]["Description"].is_string(), "{name}: {column}");
            }
        }
    }
}

#[test]
fn spreadsheets_get_what_they_ask_for() {
    let home = tempfile::tempdir().unwrap();
    let folder = hostile(home.path());
    let more = [
        "--sep",
        ";",
        "--decimal",
        ",",
        "--bom",
        "--spreadsheet-safe",
    ];
    for to in ["csv", "wide"] {
        let (out, said) = export(&folder, to, home.path(), to, &more);
        assert!(!said.contains("could run as a formula"), "{said}");
        for (name, bytes) in files(&out) {
            let Some(text) = name
                .ends_with(".csv")
                .then(|| String::from_utf8(bytes).unwrap())
            else {
                continue;
            };
            let text = text.strip_prefix('\u{feff}').expect(&name);
            let mut reader = csv::ReaderBuilder::new()
                .delimiter(b';')
                .from_reader(text.as_bytes());
            for record in reader.records() {
                for cell in &record.unwrap() {
                    let number = cell.replace(',', ".").parse::<f64>().is_ok();
                    assert!(
                        number || !cell.starts_with(['=', '+', '-', '@', '\t', '\r']),
                        "{cell}"
                    );
                    assert!(
                        !number || !cell.contains('.') || cell.starts_with('\''),
                        "{name}: {cell}"
                    );
                }
            }
        }
    }
    let results = folder.to_str().unwrap();
    for (to, wrong) in [
        ("csv", &["--decimal", ","][..]),
        ("bids", &["--bom"]),
        ("r", &["--spreadsheet-safe"]),
        ("psych-ds", &["--sep", ";"]),
        ("csv", &["--sep", "x"]),
        ("bids", &["--profile", "1"]),
        ("wide", &["--with-telemetry"]),
    ] {
        let arguments = [&["export", results, "--to", to, "--out", "no"][..], wrong].concat();
        let (code, _, err) = study(&arguments, home.path());
        assert_eq!(code, 2, "{wrong:?}: {err}");
    }
}

#[test]
fn a_wide_table_has_every_rating_and_the_means() {
    let home = tempfile::tempdir().unwrap();
    let folder = hostile(home.path());
    let (out, _) = export(&folder, "wide", home.path(), "wide", &[]);
    let (long, _) = export(&folder, "csv", home.path(), "csv", &[]);
    let (head, rows) = csv(&out.join("wide.csv"));
    let (long_head, long_rows) = csv(&long.join("ratings.csv"));
    let at = |name: &str| long_head.iter().position(|h| h == name).unwrap();
    let mut found = 0;
    for row in long_rows.iter().filter(|r| !r[at("realism")].is_empty()) {
        let name = format!("realism_{}_{}", &row[at("model")], &row[at("repetition")]);
        let place = head.iter().position(|h| *h == name).expect(&name);
        let own = rows
            .iter()
            .find(|r| r[0] == row[at("participant")])
            .unwrap();
        assert_eq!(own[place], row[at("realism")]);
        found += 1;
    }
    assert!(found > 70, "{found}");
    // 1 + 2 + 3 over 3 is no other mean than that of the cells beside it.
    for row in &rows {
        for model in ["NA", "-1", "1e5", "..", "TRUE"] {
            let cell = |of: &str| {
                let place = head
                    .iter()
                    .position(|h| *h == format!("realism_{model}_{of}"));
                place.and_then(|p| row[p].parse::<f64>().ok())
            };
            let own: Vec<f64> = ["1", "2", "3"].iter().filter_map(|r| cell(r)).collect();
            let mean = own.iter().sum::<f64>() / own.len() as f64;
            assert!((cell("mean").unwrap() - mean).abs() < 1e-12);
        }
    }
    let pairs = tempfile::tempdir().unwrap();
    let folder = rehearsed(&new("pairs", pairs.path()), 1, pairs.path(), &[]);
    let results = folder.to_str().unwrap();
    let arguments = [
        "export",
        results,
        "--to",
        "wide",
        "--include",
        "simulated",
        "--out",
        "w",
    ];
    let (code, _, err) = study(&arguments, pairs.path());
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("rates no single realizations"), "{err}");
}

#[test]
fn the_headline_is_that_of_the_analysis() {
    let home = tempfile::tempdir().unwrap();
    let folder = hostile(home.path());
    let (out, _) = export(&folder, "r", home.path(), "r", &[]);
    let (code, text, err) = study(
        &["analyze", folder.to_str().unwrap(), "--json"],
        home.path(),
    );
    assert_eq!(code, 0, "{err}");
    let values: Value = serde_json::from_str(&text).unwrap();
    let (_, rows) = csv(&out.join("headline.csv"));
    assert!(rows.len() > 30, "{}", rows.len());
    for row in &rows {
        assert_eq!(
            row[1].parse().ok(),
            values["values"][&row[0]].as_f64(),
            "{}",
            &row[0]
        );
    }
    assert!(rows.iter().filter(|r| !r[1].is_empty()).count() > 30);
}

#[test]
fn ages_are_whole_years_and_not_above_89() {
    let home = tempfile::tempdir().unwrap();
    let mut ages = [93.5, 34.7, 61.0].into_iter();
    let folder = real_study(
        Path::new(&repository("protocols/turn-signal-extended")),
        &["P01", "P02", "P03"],
        home.path(),
        |_, event| {
            if let Event::Answered {
                question, answer, ..
            } = event
                && question.as_str() == "age"
            {
                *answer = Answer::Number(ages.next().unwrap());
            }
            true
        },
    );
    let (out, said) = export(&folder, "csv", home.path(), "csv", &[]);
    assert_eq!(
        column(&out.join("participants.csv"), "age"),
        ["89", "34", "61"]
    );
    assert!(said.contains("1 age above 89"), "{said}");
    assert!(said.contains("with fewer than 5 participants"), "{said}");
    let readme = fs::read_to_string(out.join("README.md")).unwrap();
    assert!(readme.contains("Ages above 89"), "{readme}");
}

/// The table of formats in docs/export.md has each format, and no other one.
#[test]
fn every_format_is_documented() {
    let text = fs::read_to_string(repository("docs/export.md")).unwrap();
    let rows = text
        .lines()
        .skip_while(|line| !line.starts_with("| format |"));
    let rows = rows.skip(2).take_while(|line| line.starts_with("| `"));
    let documented: BTreeSet<&str> = rows.filter_map(|row| row.split('`').nth(1)).collect();
    let formats: BTreeSet<&str> = FORMATS.iter().map(|format| format.name).collect();
    assert_eq!(documented, formats);
}
