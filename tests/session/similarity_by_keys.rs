//! A whole session of similarity in a pseudo-terminal, by keys alone, as in `parts_by_keys`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts_by_keys::{PROMPT, eventful, models, written_newest};
use crate::support::study;
use serde_json::Value as Json;

/// Differences on a slider, by its keys; identical pairs are among them.
#[test]
fn similarity_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let part = format!(
        r#"{}[[parts]]
id = "answer"
kind = "similarity"
prompt = "{PROMPT}"
same = "alike"
different = "as different as can be"
models = ["l9991", "l9995", "l9997", "l9999"]
repetitions = 1
identical = true
practice = 1
"#,
        models()
    );
    written_newest(folder.path(), &part);
    // Places that are farther apart are rated higher.
    let rates = |attempt: &Json| {
        let places = ["l9991", "l9995", "l9997", "l9999"];
        let place = |interval: usize| {
            let felt = attempt["intervals"][interval].as_str().unwrap();
            places.iter().position(|p| *p == felt).unwrap()
        };
        let apart = place(0).abs_diff(place(1));
        ((20 * apart + 10).to_string(), (20 * apart).to_string())
    };
    let rows = eventful(folder.path(), rates);
    assert_eq!(rows.len(), 1 + 6 + 4);
    let arguments = ["analyze", "results", "--include", "pilot", "--json"];
    let (_, out, _) = study(&arguments, folder.path());
    let document: Json = serde_json::from_str(&out).unwrap();
    let part = &document["parts"][0];
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"similarity".into(), &10.into())
    );
    let values = &part["values"];
    assert_eq!(values["similarity/n"], 6.0);
    assert!(values["similarity/map/l9991/x"].is_number());
    let mean = |pair: &str| {
        let id = format!("similarity/pair/{pair}/mean");
        values[id].as_f64().unwrap()
    };
    assert!(mean("l9991|l9999") > mean("l9991|l9997"));
    let verdict = &part["findings"][1];
    assert_eq!(verdict["question"], "dimensions");
    assert_eq!(
        verdict["undefined_because"],
        "there are fewer than six realizations"
    );
}
