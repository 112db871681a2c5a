//! Data sets of studies with groups, several sessions, failed attempts, pairs and tracks; and
//! an export that is interrupted.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::studies::{export, files, grouped, new, of_groups_and_sessions, rehearsed};
use crate::support::{keyboard_of_bundles, repository, study};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

const SIMULATED: [&str; 2] = ["--include", "simulated"];

type Row = BTreeMap<String, String>;

fn table(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let head = reader.headers().unwrap().clone();
    let row = |r: csv::StringRecord| {
        let cells = head.iter().zip(r.iter());
        cells.map(|(h, c)| (h.to_owned(), c.to_owned())).collect()
    };
    reader.records().map(|r| row(r.unwrap())).collect()
}

#[test]
fn several_sessions_have_folders_and_groups_have_a_column() {
    let home = tempfile::tempdir().unwrap();
    let folder = grouped(4, home.path());
    let results = table(&folder.join("ratings.csv"));
    for to in ["csv", "r", "frictionless", "wide"] {
        let (out, _) = export(&folder, to, home.path(), to, &SIMULATED);
        let name = if to == "wide" {
            "wide.csv"
        } else {
            "ratings.csv"
        };
        let rows = table(&out.join(name));
        if to == "wide" {
            assert_eq!(rows.len(), 4);
            continue;
        }
        assert_eq!(rows.len(), results.len(), "{to}");
        let places = |rows: &[Row]| -> BTreeSet<Vec<String>> {
            let keys = ["participant", "session", "trial", "group", "realism"];
            rows.iter()
                .map(|r| keys.iter().map(|k| r[*k].clone()).collect())
                .collect()
        };
        assert_eq!(places(&rows), places(&results), "{to}");
    }
    let more = [&SIMULATED[..], &["--with-telemetry"]].concat();
    let (out, _) = export(&folder, "bids", home.path(), "bids", &more);
    let all = files(&out);
    let named = |end: &str| -> Vec<&str> {
        let names = all.iter().map(|(name, _)| name.as_str());
        names.filter(|n| n.ends_with(end)).collect()
    };
    let tables = named("acq-trials_beh.tsv");
    assert_eq!(tables.len(), 8);
    for name in &tables {
        let parts: Vec<&str> = name.split('/').collect();
        let [subject, session, "beh", file] = parts[..] else {
            panic!("{name}");
        };
        assert!(
            file.starts_with(&format!("{subject}_{session}_task-")),
            "{name}"
        );
        assert!(["ses-1", "ses-2"].contains(&session), "{name}");
    }
    // Every recording has the clamps of its trial, that of the first trial, too.
    let recordings = named("_stim.json");
    assert_eq!(recordings.len(), results.len());
    for name in recordings {
        let about: serde_json::Value =
            serde_json::from_slice(&fs::read(out.join(name)).unwrap()).unwrap();
        assert!(about["clamp_count"].is_u64(), "{name}: {about}");
        // Counted from the first trial of its own session: the other one is a day away.
        let start_s = about["StartTime"].as_f64().unwrap();
        assert!((0.0..3600.0).contains(&start_s), "{name}: {about}");
    }
}

/// A trial that failed and was done again is one row, that of the attempt that counts.
#[test]
fn a_trial_is_one_row_however_many_attempts_it_took() {
    let home = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let folder = rehearsed(Path::new(&protocol), 4, home.path(), &["--faults"]);
    let attempts = table(&folder.join("attempts.csv"));
    let place = |row: &Row| {
        ["participant", "session", "trial"]
            .map(|key| row[key].clone())
            .to_vec()
    };
    let mut last: BTreeMap<Vec<String>, u32> = BTreeMap::new();
    for row in attempts.iter().filter(|r| !r["attempt"].is_empty()) {
        let attempt: u32 = row["attempt"].parse().unwrap();
        let most = last.entry(place(row)).or_default();
        *most = attempt.max(*most);
    }
    assert!(last.values().any(|n| *n > 1), "nothing failed");
    let (out, _) = export(&folder, "csv", home.path(), "csv", &SIMULATED);
    let rows = table(&out.join("ratings.csv"));
    let places: BTreeSet<Vec<String>> = rows.iter().map(place).collect();
    assert_eq!(places.len(), rows.len());
    for row in &rows {
        assert_eq!(
            row["attempt"].parse().ok(),
            last.get(&place(row)).copied(),
            "{row:?}"
        );
    }
    assert!(!out.join("attempts.csv").exists());
}

/// The numbers that R has to come to are those of `analyze`, and the rows that it uses are
/// marked.
#[test]
fn the_headline_of_pairs_and_tracks_is_that_of_the_analysis() {
    for (kind, part, id, n) in [
        ("pairs", "more-real", "pairs/ability/lambda-0.9995", 8),
        ("abx", "", "", 0),
        ("staircase", "more-friction", "psy_mixed/F", 3),
    ] {
        let home = tempfile::tempdir().unwrap();
        let protocol = new(kind, home.path());
        // Each track measures a condition of its own, so that thresholds can differ.
        let path = protocol.join("protocol.toml");
        let text = fs::read_to_string(&path).unwrap();
        let renamed = text.replacen("condition = \"friction\"", "condition = \"from-above\"", 1);
        fs::write(&path, renamed).unwrap();
        let folder = rehearsed(&protocol, n.max(3), home.path(), &[]);
        let (out, _) = export(&folder, "r", home.path(), "r", &SIMULATED);
        let arguments = ["analyze", folder.to_str().unwrap(), "--json"];
        let more = [&arguments[..], &SIMULATED].concat();
        let (code, text, err) = study(&more, home.path());
        assert_eq!(code, 0, "{err}");
        let analysis: serde_json::Value = serde_json::from_str(&text).unwrap();
        let headline = table(&out.join("headline.csv"));
        assert!(!headline.is_empty(), "{kind}");
        let parts = analysis["parts"].as_array().unwrap();
        let mut compared = 0;
        for row in &headline {
            let (of, id) = row["id"].split_once(':').unwrap();
            let own = parts.iter().find(|p| p["part"] == of).unwrap();
            let value = own["values"][id].as_f64();
            assert_eq!(row["value"].parse().ok(), value, "{kind} {id}");
            compared += usize::from(value.is_some());
        }
        // So few participants can lie on the boundary of the mixed model of thresholds.
        assert!(
            compared > 0 || kind == "staircase",
            "{kind}: nothing is defined"
        );
        let is_there = headline.iter().any(|r| r["id"] == format!("{part}:{id}"));
        assert!(id.is_empty() || is_there, "{headline:?}");
        let rows = table(&out.join("ratings.csv"));
        let used = rows.iter().filter(|r| r["included"] == "true").count();
        let trials = parts
            .iter()
            .map(|p| p["trials"].as_u64().unwrap())
            .sum::<u64>();
        assert_eq!(used as u64, trials, "{kind}");
        assert_eq!(out.join("thresholds.csv").exists(), kind == "staircase");
        if kind == "staircase" {
            let thresholds = table(&out.join("thresholds.csv"));
            assert_eq!(thresholds.len(), 2 * 3, "two tracks of three participants");
            for row in &thresholds {
                let id = format!(
                    "psy/{}/{}/posterior/threshold/median",
                    row["participant"], row["track"]
                );
                let own = parts.iter().find(|p| p["part"] == row["part"].as_str());
                let value = own.unwrap()["values"][&id].as_f64();
                assert_eq!(row["threshold"].parse().ok(), value, "{id}");
            }
        }
    }
}

/// So are those of groups and repeated sessions, of ratings, pairs, tracks and estimates.
#[test]
fn the_headline_of_groups_and_sessions_is_that_of_the_analysis() {
    for (kind, part, expected) in [
        (
            "ratings",
            "real",
            &[
                "groups/F",
                "groups_conditions/p_gg",
                "sessions/p",
                "groups_sessions/p_gg",
                "retest/sem",
            ][..],
        ),
        (
            "pairs",
            "more-real",
            &["groups_conditions/F", "pairs/ability/lambda-0.9995"],
        ),
        (
            "abx",
            "",
            &["groups/old|young/t", "sessions/F", "retest/icc_agreement"],
        ),
        (
            "magnitude",
            "",
            &["magnitude/exponent", "magnitude/log10_coefficient"],
        ),
        (
            "identification",
            "",
            &[
                "identification/information/corrected",
                "identification/above_guessing/p",
                "identification/pair/heavy and crisp|heavy and soft/similarity",
                "sessions/p",
            ],
        ),
        (
            "similarity",
            "",
            &[
                "similarity/agreement/kendall_w",
                "similarity/order/rms",
                "similarity/dimensions/1/classical",
                "similarity/pair/detent.1|detent.2/rescaled",
            ],
        ),
        (
            "ranking",
            "",
            &[
                "ranking/agreement/w",
                "ranking/realization/spring/mean_rank",
                "ranking/pair/lambda-0.9991|spring/above",
            ],
        ),
        (
            "adjustment",
            "",
            &[
                "adjustment/pse",
                "adjustment/error/p",
                "adjustment/start/t",
                "adjustment/spread/sd",
            ],
        ),
    ] {
        let home = tempfile::tempdir().unwrap();
        let folder = match kind {
            "ratings" => grouped(4, home.path()),
            _ => rehearsed(
                &of_groups_and_sessions(kind, home.path()),
                4,
                home.path(),
                &[],
            ),
        };
        let (out, _) = export(&folder, "r", home.path(), "r", &SIMULATED);
        let arguments = ["analyze", folder.to_str().unwrap(), "--json"];
        let (code, text, err) = study(&[&arguments[..], &SIMULATED].concat(), home.path());
        assert_eq!(code, 0, "{err}");
        let analysis: serde_json::Value = serde_json::from_str(&text).unwrap();
        let parts = analysis["parts"].as_array().unwrap();
        let own = &parts
            .iter()
            .find(|p| part.is_empty() || p["part"] == part)
            .unwrap()["values"];
        let headline = table(&out.join("headline.csv"));
        let mut compared = 0;
        for row in &headline {
            let Some((_, id)) = row["id"].split_once(':') else {
                continue;
            };
            assert_eq!(row["value"].parse().ok(), own[id].as_f64(), "{kind} {id}");
            compared += usize::from(!row["value"].is_empty());
        }
        assert!(compared > 1, "{kind}: {headline:?}");
        for id in expected {
            let ends = |row: &&Row| row["id"].ends_with(&format!(":{id}"));
            assert!(
                headline.iter().any(|r| ends(&r)),
                "{kind} {id}: {headline:?}"
            );
        }
    }
}

/// A killed export leaves no data set, says so the next time, and is repeated whole.
#[cfg(unix)]
#[test]
fn an_interrupted_export_is_repeated_whole() {
    let home = tempfile::tempdir().unwrap();
    let folder = grouped(4, home.path());
    let more = [&SIMULATED[..], &["--with-telemetry"]].concat();
    let (whole, _) = export(&folder, "bids", home.path(), "whole", &more);
    let left = || -> Vec<String> {
        let items = fs::read_dir(home.path()).unwrap();
        let names = items.map(|i| i.unwrap().file_name().into_string().unwrap());
        names.filter(|n| n.ends_with(".part")).collect()
    };
    let mut interrupted = 0;
    for _ in 0..50 {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_study"))
            .args([
                "export",
                folder.to_str().unwrap(),
                "--to",
                "bids",
                "--out",
                "again",
            ])
            .args(&more)
            .current_dir(home.path())
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        while left().len() == interrupted && child.try_wait().unwrap().is_none() {}
        child.kill().unwrap();
        child.wait().unwrap();
        if home.path().join("again").exists() {
            fs::remove_dir_all(home.path().join("again")).unwrap();
        }
        interrupted = left().len();
        if interrupted > 0 {
            break;
        }
    }
    assert_eq!(interrupted, 1, "no export was interrupted");
    let (again, said) = export(&folder, "bids", home.path(), "again", &more);
    assert!(
        said.contains(&left()[0]) && said.contains("interrupted"),
        "{said}"
    );
    assert!(files(&again) == files(&whole));
}

/// The same sessions, whether the realizations come from bundles or from model files: every table of every
/// format is the same. The bundles are frozen with the study, which needs their folder no more, and a bundle
/// that was changed afterwards is found.
#[test]
fn a_study_with_bundles_is_exported_like_one_with_model_files() {
    let home = tempfile::tempdir().unwrap();
    let place = |name: &str| home.path().join(name);
    for name in ["bundles", "files", "protocol"] {
        fs::create_dir(place(name)).unwrap();
    }
    let addresses = keyboard_of_bundles(&place("protocol"));
    let with_bundles = rehearsed(&place("protocol"), 1, &place("bundles"), &[]);
    let keyboard = repository("protocols/keyboard");
    let with_files = rehearsed(Path::new(&keyboard), 1, &place("files"), &[]);
    fs::remove_dir_all(place("protocol")).unwrap();
    for to in ["csv", "wide", "bids", "psych-ds", "frictionless", "r"] {
        let [(one, _), (other, _)] = [(&with_bundles, "bundles"), (&with_files, "files")]
            .map(|(folder, name)| export(folder, to, &place(name), to, &SIMULATED));
        let tables = |folder: &Path| -> BTreeMap<String, Vec<u8>> {
            let is_table = |path: &str| path.ends_with(".csv") || path.ends_with(".tsv");
            let all = files(folder).into_iter();
            all.filter(|(path, _)| is_table(path)).collect()
        };
        let (one, other) = (tables(&one), tables(&other));
        assert!(!one.is_empty(), "{to}");
        assert_eq!(
            one.keys().collect::<Vec<_>>(),
            other.keys().collect::<Vec<_>>(),
            "{to}"
        );
        for (path, bytes) in &one {
            assert!(*bytes == other[path], "{to}: {path} differs");
        }
    }
    let verified = || study(&["verify", with_bundles.to_str().unwrap()], home.path());
    let (code, _, told) = verified();
    assert_eq!(code, 0, "{told}");
    let address = addresses["clickiez"].trim_start_matches("sha256:");
    let frozen = with_bundles.join(format!("protocol/1/bundles/{address}.tar"));
    let mut bytes = fs::read(&frozen).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&frozen, bytes).unwrap();
    let (code, out, told) = verified();
    assert_ne!(code, 0, "{out}");
    assert!((out + &told).contains(address), "{told}");
}
