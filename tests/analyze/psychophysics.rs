//! Statistics of thresholds and comparisons are compared with two implementations each.
//!
//! `tests/golden/psychophysics/NAME.json` holds input, and value and tolerance of each
//! identifier; all cases are simulated or constructed, and free (CC0). Published cases
//! are in the unit tests of `study-stats` and of `procedure`.
#![allow(clippy::unwrap_used)]

#[path = "../../examples/golden/psychophysics.rs"]
mod golden_file;

use serde_json::Value as Json;
use std::fs;
use std::path::PathBuf;

fn numbers(json: &Json) -> Option<Vec<f64>> {
    match json {
        Json::Array(list) => list.iter().map(Json::as_f64).collect(),
        one => one.as_f64().map(|x| vec![x]),
    }
}

fn agrees(got: &Json, want: &Json) -> bool {
    if want["undefined"] == Json::Bool(true) {
        return got.is_null();
    }
    let (absolute, relative) = (want["tol_abs"].as_f64(), want["tol_rel"].as_f64());
    let limit = |w: f64| absolute.unwrap().max(relative.unwrap() * w.abs());
    let (Some(got), Some(want)) = (numbers(got), numbers(&want["value"])) else {
        return false;
    };
    got.len() == want.len()
        && got
            .iter()
            .zip(&want)
            .all(|(g, w)| (g - w).abs() <= limit(*w))
}

#[test]
fn every_case_agrees_with_its_reference() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/psychophysics");
    let mut wrong = Vec::new();
    let mut compared = 0;
    for file in fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let values = golden_file::values(&text).unwrap();
        let document: Json = serde_json::from_str(&text).unwrap();
        for (id, want) in document["expected"].as_object().unwrap() {
            compared += 1;
            if !values.get(id).is_some_and(|got| agrees(got, want)) {
                wrong.push(format!(
                    "{}: {id} is {:?}, not {want}",
                    path.display(),
                    values.get(id)
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(compared > 400, "{compared}");
}

/// A file with two dimensions and a function of its own, as text: a threshold that
/// rises with a frequency (the formula of Watson 2017, example 4).
#[test]
fn a_function_of_two_dimensions_is_read_from_its_formula() {
    let file = r#"{"kind": "questplus", "input": {
        "participant": "P01", "track": "A",
        "stimulus": {"contrast": [-50, -40, -30, -20, -10, 0], "frequency": [0, 10, 20]},
        "parameters": {"floor": [-40, -30], "start": [-60, -50, -40], "rise": [1, 1.5],
                       "slope": [3], "gamma": [0.5], "lambda": [0.01]},
        "function": "csf", "prior": "uniform",
        "formula": "psi = gamma + (1-gamma-lambda)(1 - exp(-10^(slope (contrast - t)/20))), t = max(floor, start + rise frequency)",
        "presented": [[-30, 0], [-20, 20], [-20, 10]], "responses": [1, 0, 1]}}"#;
    let values = golden_file::values(file).unwrap();
    let proposed = |name: &str| numbers(&values[&format!("track/P01/A/proposed/{name}")]).unwrap();
    assert_eq!(proposed("contrast").len(), 3);
    assert!(proposed("contrast").iter().all(|x| x % 10.0 == 0.0));
    assert!(
        proposed("frequency")
            .iter()
            .all(|x| [0.0, 10.0, 20.0].contains(x))
    );
    let entropy = numbers(&values["track/P01/A/expected_entropy"]).unwrap();
    assert!(entropy[2] < entropy[0] && entropy[0] < 12f64.ln());
    assert!(golden_file::values(&file.replace("rise freq", "rose freq")).is_err());
}

#[test]
fn a_bad_file_says_what_is_missing() {
    let error = |file: &str| golden_file::values(file).unwrap_err().to_string();
    assert_eq!(error(r#"{"kind": "x"}"#), "the kind `x` is not known");
    assert_eq!(
        error(r#"{"kind": "sdt", "input": {"task": "abx"}}"#),
        "columns is missing or is no list"
    );
    assert_eq!(error("{}"), "kind is missing or is no text");
}
