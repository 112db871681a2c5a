//! `docs/study-analysis-1.schema.json` and `docs/study-parts-1.schema.json` describe what
//! `study analyze --json` prints.
#![allow(clippy::unwrap_used)]

use crate::json_schema::check;
use assert_cmd::Command;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The schema of a document by its format.
fn schema_of(format: &str) -> Value {
    let name = format!("docs/{}.schema.json", format.replace('/', "-"));
    let text = fs::read_to_string(Path::new(ROOT).join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Whether a document is as the schema of its format describes it.
pub(crate) fn described(document: &Value) -> Result<(), String> {
    let schema = schema_of(document["format"].as_str().unwrap());
    check(&schema, &schema, document, "")
}

/// What `analyze --json` prints.
fn printed(arguments: &[&str]) -> Value {
    let mut study = Command::cargo_bin("study").unwrap();
    study.current_dir(ROOT).args(["analyze", "--json"]);
    let output = study.args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_schema_describes_what_is_printed() {
    let example = ["results/turn-signal-example", "--include", "simulated"];
    let tables = [
        "sim_paper",
        "sim_all_equal",
        "sim_single_subject",
        "sim_unbalanced_reps",
    ]
    .map(|name| format!("tests/golden/data/{name}/data.csv"));
    let mut runs: Vec<Vec<&str>> = vec![example.to_vec()];
    runs.extend(tables.iter().map(|path| vec![path.as_str()]));
    for arguments in runs {
        assert_eq!(described(&printed(&arguments)), Ok(()), "{arguments:?}");
    }
}

/// Outcomes, factors and their levels have the names that a study gives them.
#[test]
fn the_schema_describes_factors_and_outcomes() {
    let mut document = printed(&["tests/golden/data/sim_paper/data.csv"]);
    let values = document["values"].as_object_mut().unwrap();
    for id in [
        "factorial/friction:detent/F",
        "factorial_mean/friction=low/mean",
        "factorial_contrast/friction=high|low@detent=soft/p",
        "outcomes/time/model/sd/friction",
        "outcomes/time/model/effect/friction:detent/chi2",
        "outcomes/errors/factorial_mean/detent=crisp/mean",
    ] {
        values.insert(id.to_owned(), json!(0.5));
    }
    assert_eq!(described(&document), Ok(()));
}

#[test]
fn a_document_that_differs_from_the_schema_is_found() {
    let schema = schema_of("study-analysis/1");
    let good = printed(&["tests/golden/data/sim_paper/data.csv"]);
    let said = |change: fn(&mut Value)| {
        let mut document = good.clone();
        change(&mut document);
        check(&schema, &schema, &document, "").unwrap_err()
    };
    assert!(said(|d| d["format"] = json!("study-analysis/2")).starts_with("/format: "));
    assert!(said(|d| d["extra"] = json!(1)).starts_with("/extra: not described"));
    assert!(said(|d| drop(d.as_object_mut().unwrap().remove("alpha"))).contains("alpha"));
    assert!(said(|d| d["counts"]["rows"] = json!(-1)).starts_with("/counts/rows: "));
    assert!(said(|d| d["findings"][0]["verdict"] = json!("no")).contains("/verdict: "));
    assert!(said(|d| d["findings"][0]["test"]["p"] = json!("1")).contains("/test: "));
    assert!(said(|d| d["values"]["corr/pearson/r"] = json!("1")).starts_with("/values/corr"));
    assert!(said(|d| d["values"]["corr/pearson/s"] = json!(1)).contains("not described"));
}
