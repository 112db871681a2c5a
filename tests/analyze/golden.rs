//! Every statistic is compared with two independent implementations.
//!
//! `tests/golden/data/NAME/expected.json` holds value, tolerance, class and
//! source of each identifier; all data sets are freely usable (own simulations, CC0,
//! and NIST's StRD). Only `value`, `undefined`, `tol_rel` and `tol_abs` are read. A
//! statistic without an entry is not compared.
#![allow(clippy::unwrap_used)]

use serde_json::Value as Json;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::PathBuf;
use study_analysis::analyze::{Rules, Value, Values, analyze};
use study_session::outcome::ratings::Ratings;

fn sets() -> Vec<PathBuf> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/data");
    let mut sets: Vec<PathBuf> = fs::read_dir(root)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.join("expected.json").exists())
        .collect();
    sets.sort();
    sets
}

fn values(set: &std::path::Path) -> Values {
    let file = BufReader::new(File::open(set.join("data.csv")).unwrap());
    let ratings = Ratings::read_csv("data.csv", file, None).unwrap();
    analyze(&ratings, &Rules::default()).values
}

fn numbers(json: &Json) -> Vec<f64> {
    match json {
        Json::Array(list) => list.iter().map(|v| v.as_f64().unwrap()).collect(),
        one => vec![one.as_f64().unwrap()],
    }
}

fn agrees(got: &Value, want: &Json) -> bool {
    if want["undefined"] == Json::Bool(true) {
        return matches!(got, Value::Undefined(_));
    }
    let got = match got {
        Value::Number(x) => vec![*x],
        Value::List(x) => x.clone(),
        Value::Undefined(_) => return false,
    };
    let wanted = numbers(&want["value"]);
    let absolute = want["tol_abs"].as_f64().unwrap_or(0.0);
    let relative = want["tol_rel"].as_f64().unwrap_or(0.0);
    got.len() == wanted.len()
        && got
            .iter()
            .zip(&wanted)
            .all(|(g, w)| (g - w).abs() <= absolute.max(relative * w.abs()))
}

#[test]
fn every_statistic_agrees_with_its_reference() {
    let mut wrong = Vec::new();
    let mut passed = 0;
    let sets = sets();
    assert!(sets.len() >= 15, "data sets are missing: {sets:?}");
    for set in sets {
        let name = set.file_name().unwrap().to_string_lossy().into_owned();
        let text = fs::read_to_string(set.join("expected.json")).unwrap();
        let expected: Json = serde_json::from_str(&text).unwrap();
        let values = values(&set);
        for (id, want) in expected["expected"].as_object().unwrap() {
            match values.get(id) {
                Some(got) if agrees(got, want) => passed += 1,
                got => wrong.push(format!("{name} {id}: {got:?}, not {}", want["value"])),
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} wrong:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    assert!(passed > 4500, "only {passed} were compared");
}

#[test]
fn thirty_ratings_with_sum_144_and_sum_of_squares_720_have_the_papers_mean_and_sd() {
    let mut csv = String::from("subject,model,repetition,rating,vaf\n");
    let ratings = [(3, 3), (4, 9), (5, 9), (6, 9)];
    let mut all = ratings.iter().flat_map(|&(v, n)| std::iter::repeat_n(v, n));
    for subject in 1..=10 {
        for repetition in 1..=3 {
            let rating = all.next().unwrap();
            csv += &format!("S{subject:02},lambda-0.9995,{repetition},{rating},0.79\n");
        }
    }
    let ratings = Ratings::read_csv("paper.csv", csv.as_bytes(), None).unwrap();
    let values = analyze(&ratings, &Rules::default()).values;
    let mean = values.number("desc/lambda-0.9995/mean").unwrap();
    let sd = values.number("desc/lambda-0.9995/sd").unwrap();
    assert_eq!(format!("{mean:.3} {sd:.3}"), "4.800 0.997");
}
