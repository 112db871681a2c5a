//! `docs/study-analysis-1.schema.json` describes what `study analyze --json` prints.
#![allow(clippy::unwrap_used)]

use assert_cmd::Command;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The keywords of JSON Schema that the file uses; any other one is an error.
const KEYWORDS: [&str; 15] = [
    "$schema",
    "$defs",
    "$ref",
    "title",
    "description",
    "type",
    "properties",
    "patternProperties",
    "required",
    "additionalProperties",
    "items",
    "enum",
    "const",
    "anyOf",
    "minimum",
];

pub(crate) fn schema() -> Value {
    let text = fs::read_to_string(Path::new(ROOT).join("docs/study-analysis-1.schema.json"));
    serde_json::from_str(&text.unwrap()).unwrap()
}

/// Whether an identifier has the form of a pattern of the schema, such as `^desc/[^/]+/mean$`.
pub(crate) fn fits(pattern: &str, id: &str) -> bool {
    begins(pattern, id) && id.split('/').count() == parts(pattern).split('/').count()
}

/// Whether identifiers of this form begin with these parts.
pub(crate) fn begins(pattern: &str, id: &str) -> bool {
    let part = |(wanted, given): (&str, &str)| match wanted {
        "*" => !given.is_empty(),
        "*|*" => given.split('|').filter(|name| !name.is_empty()).count() == 2,
        word => word == given,
    };
    let wanted = parts(pattern);
    id.split('/').count() <= wanted.split('/').count()
        && wanted.split('/').zip(id.split('/')).all(part)
}

/// A pattern with `*` for any name.
fn parts(pattern: &str) -> String {
    let bare = pattern.trim_start_matches('^').trim_end_matches('$');
    bare.replace(r"[^/|]+\|[^/|]+", "*|*").replace("[^/]+", "*")
}

/// The first place at which a document differs from a schema.
pub(crate) fn check(
    root: &Value,
    schema: &Value,
    value: &Value,
    place: &str,
) -> Result<(), String> {
    let fail = |why: String| Err(format!("{place}: {why}"));
    if let Some(wanted) = schema.as_bool() {
        return if wanted {
            Ok(())
        } else {
            fail("not described".to_owned())
        };
    }
    for key in schema.as_object().unwrap().keys() {
        assert!(KEYWORDS.contains(&key.as_str()), "unknown keyword {key}");
    }
    if let Some(to) = schema["$ref"].as_str() {
        return check(root, root.pointer(&to[1..]).unwrap(), value, place);
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        let fits = |choice| check(root, choice, value, place).is_ok();
        return if choices.iter().any(fits) {
            Ok(())
        } else {
            fail(format!("{value}"))
        };
    }
    let words = |given: &Value| match given {
        Value::Array(all) => all.clone(),
        Value::Null => Vec::new(),
        one => vec![one.clone()],
    };
    let is = |word: &str| match word {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("unknown type {other}"),
    };
    let types = words(&schema["type"]);
    if !types.is_empty() && !types.iter().any(|t| is(t.as_str().unwrap())) {
        return fail(format!("{value} is not {types:?}"));
    }
    if let Some(allowed) = schema["enum"].as_array()
        && !allowed.contains(value)
    {
        return fail(format!("{value} is not one of {allowed:?}"));
    }
    if let Some(wanted) = schema.get("const")
        && wanted != value
    {
        return fail(format!("{value} is not {wanted}"));
    }
    if let (Some(least), Some(number)) = (schema["minimum"].as_f64(), value.as_f64())
        && number < least
    {
        return fail(format!("{number} is below {least}"));
    }
    if let Some(object) = value.as_object() {
        for key in schema["required"].as_array().into_iter().flatten() {
            if !object.contains_key(key.as_str().unwrap()) {
                return fail(format!("{key} is missing"));
            }
        }
        for (key, value) in object {
            let patterns = schema["patternProperties"].as_object();
            let mut patterns = patterns.into_iter().flatten();
            let by_pattern = || Some(patterns.find(|(pattern, _)| fits(pattern, key))?.1);
            let own = schema["properties"].get(key).or_else(by_pattern);
            if let Some(schema) = own.or(schema.get("additionalProperties")) {
                check(root, schema, value, &format!("{place}/{key}"))?;
            }
        }
    }
    if let (Some(all), Some(schema)) = (value.as_array(), schema.get("items")) {
        for (i, value) in all.iter().enumerate() {
            check(root, schema, value, &format!("{place}/{i}"))?;
        }
    }
    Ok(())
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
    let schema = schema();
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
        let said = check(&schema, &schema, &printed(&arguments), "");
        assert_eq!(said, Ok(()), "{arguments:?}");
    }
}

#[test]
fn a_document_that_differs_from_the_schema_is_found() {
    let schema = schema();
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
