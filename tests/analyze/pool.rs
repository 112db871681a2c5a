//! `study analyze --pool`: several sites of one study.
#![allow(clippy::unwrap_used)]

use crate::schema::described;
use serde_json::Value as Json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

#[path = "../support/mod.rs"]
mod support;
use support::{changed_protocol, copy_folder, study};

const PARTICIPANTS: &str = "participants = 10";

/// A study of a site: a changed protocol, rehearsed.
fn site(folder: &Path, name: &str, seed: &str, n: &str, changes: &[(&str, &str)]) {
    let protocol = folder.join(format!("{name}-protocol"));
    changed_protocol("turn-signal", &protocol, changes);
    rehearsed(folder, name, seed, n);
}

fn rehearsed(folder: &Path, name: &str, seed: &str, n: &str) {
    let protocol = format!("{name}-protocol");
    let (code, _, said) = study(
        &[
            "rehearse",
            &protocol,
            "--participants",
            n,
            "--seed",
            seed,
            "--out",
            name,
        ],
        folder,
    );
    assert_eq!(code, 0, "{said}");
}

fn two_sites() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let longer = [("How realistic did", "Please tell us: how realistic did")];
    site(folder.path(), "utah", "1", "4", &[]);
    site(
        folder.path(),
        "bern",
        "2",
        "3",
        &[longer[0], (PARTICIPANTS, "participants = 6")],
    );
    folder
}

/// The pooled analysis says the same in every form, keeps participants apart, and warns.
#[test]
fn sites_are_a_factor_in_every_rendering() {
    let folder = two_sites();
    let run = |arguments: &[&str]| {
        let (code, out, said) = study(arguments, folder.path());
        assert_eq!(code, 0, "{arguments:?}: {said}");
        out
    };
    let pool = ["analyze", "--pool", "utah", "bern"];
    let json = run(&[&pool[..], &["--json"]].concat());
    let json: Json = serde_json::from_str(&json).unwrap();
    assert_eq!(described(&json), Ok(()));
    assert_eq!(json["counts"]["participants"], 7);
    assert_eq!(
        json["counts"]["planned"], 16,
        "the planned numbers are added"
    );
    let sites = json["sites"].as_array().unwrap();
    assert_eq!(sites[0]["name"], "utah");
    assert_eq!(sites[1]["participants"], 3);
    assert_eq!(sites[1]["devices"][0]["kind"], "simulated");
    assert_eq!(sites[1]["devices"][0]["check"], Json::Null);

    // Means of a site are those of its own analysis.
    for name in ["utah", "bern"] {
        let own = run(&["analyze", name, "--json"]);
        let own: Json = serde_json::from_str(&own).unwrap();
        let id = "lambda-0.9995";
        let alone = own["values"][format!("desc/{id}/subject_mean/mean")].as_f64();
        let pooled = json["values"][format!("site_mean/{name}/{id}/mean")].as_f64();
        assert!((alone.unwrap() - pooled.unwrap()).abs() < 1e-12);
        assert!(own.get("sites").is_none());
    }

    // One verdict in all renderings.
    let terminal = run(&[&pool[..], &["--out", "pooled"]].concat());
    // Lines are broken anywhere.
    let terminal = terminal.split_whitespace().collect::<Vec<_>>().join(" ");
    let page = fs::read_to_string(folder.path().join("pooled/report.html")).unwrap();
    let tests = fs::read_to_string(folder.path().join("pooled/tests.csv")).unwrap();
    let questions = [
        (
            "site-realizations",
            "Do the differences between realizations depend on the site?",
            "realizations depended on the site",
            "differences between realizations on the site was not shown",
        ),
        (
            "site-vaf",
            "Does the effect of VAF depend on the site?",
            "effect of VAF depended on the site",
            "effect of VAF on the site was not shown",
        ),
        (
            "site-level",
            "Do the sites differ in their mean rating?",
            "sites differed in their mean rating",
            "sites in their mean rating was not shown",
        ),
    ];
    for (id, heading, yes, not_shown) in questions {
        let findings = json["findings"].as_array().unwrap();
        let found = findings.iter().find(|f| f["question"] == id).unwrap();
        let verdict = found["verdict"].as_str().unwrap();
        let word = if verdict == "yes" { "Yes" } else { "Not shown" };
        let after = terminal.split(heading).nth(1).unwrap();
        assert!(after.trim_start().starts_with(word), "{id}: {after}");
        let after = page.split(heading).nth(1).unwrap();
        assert!(
            after
                .trim_start_matches("</h3><p class=\"short\">")
                .starts_with(word),
            "{id}"
        );
        let (said, other) = if verdict == "yes" {
            (yes, not_shown)
        } else {
            (not_shown, yes)
        };
        assert!(page.contains(said) && !page.contains(other), "{id}");
        let row = tests
            .lines()
            .find(|l| l.starts_with(&format!("{id},")))
            .unwrap();
        assert!(
            row.trim_end().ends_with(&format!("true,{verdict}")),
            "{row}"
        );
    }

    // Two persons with one id, and another wording.
    assert!(terminal.contains("SIM001"), "{terminal}");
    assert!(terminal.contains("different persons"));
    assert!(terminal.contains("another wording") && terminal.contains("questions[realism].prompt"));
    assert!(
        terminal.contains("no commissioning test recorded"),
        "{terminal}"
    );
    assert!(terminal.contains("Sites and their devices"));
    assert!(page.contains("Sites and their devices"));
    let used = fs::read_to_string(folder.path().join("pooled/ratings_used.csv")).unwrap();
    assert!(used.contains("utah:SIM001,") && used.contains("bern:SIM001,"));
    // The order of the sites changes no p.
    let other = run(&["analyze", "--pool", "bern", "utah", "--json"]);
    let other: Json = serde_json::from_str(&other).unwrap();
    for id in [
        "site_realizations/p_gg",
        "site_vaf/p",
        "site_level/p",
        "corr/pearson/r",
    ] {
        let [a, b] = [&json, &other].map(|d| d["values"][id].as_f64().unwrap());
        assert!((a - b).abs() < 1e-12, "{id}: {a} {b}");
    }
}

#[test]
fn what_differs_between_sites_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    site(at, "utah", "1", "1", &[]);
    site(
        at,
        "other",
        "2",
        "1",
        &[("repetitions = 3", "repetitions = 2"), ("to = 7", "to = 9")],
    );
    let protocol = at.join("table-protocol");
    changed_protocol("turn-signal", &protocol, &[]);
    let table = protocol.join("models/lambda-0.9995.toml");
    let text = fs::read_to_string(&table).unwrap();
    fs::write(&table, format!("{text}# another file\n")).unwrap();
    rehearsed(at, "table", "2", "1");
    site(
        at,
        "strict",
        "3",
        "1",
        &[("primary = ", "alpha = 0.01\nprimary = ")],
    );
    copy_folder(&at.join("utah"), &at.join("copy"));
    let refused = |sites: &[&str]| {
        let (code, out, said) = study(&[&["analyze", "--pool"], sites].concat(), at);
        assert!(out.is_empty(), "{out}");
        (code, said)
    };
    let (code, said) = refused(&["utah", "other"]);
    assert_eq!(code, 1);
    for part in [
        "stimuli",
        "design.repetitions (3 and 2)",
        "questions[realism]",
        "7",
        "9",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let (code, said) = refused(&["utah", "table"]);
    assert_eq!(code, 1);
    assert!(said.contains("models[lambda-0.9995].file"), "{said}");
    assert!(!said.contains("lambda-0.9999"), "{said}");
    let (code, said) = refused(&["utah", "strict"]);
    assert_eq!(code, 1);
    assert!(
        said.contains("analysis rules") && said.contains("alpha"),
        "{said}"
    );
    let (code, said) = refused(&["utah", "copy"]);
    assert_eq!(code, 1);
    assert!(said.contains("SIM001"), "{said}");
    let (code, said) = refused(&["utah", "utah/turn-signal"]);
    assert_eq!((code, said.contains("named twice")), (1, true), "{said}");
    assert_eq!(refused(&["utah"]).0, 2);
    assert_eq!(refused(&["utah", "utah-protocol/protocol.toml"]).0, 1);
    let (code, _, said) = study(&["analyze", "utah", "table"], at);
    assert_eq!((code, said.contains("--pool")), (2, true), "{said}");
}
