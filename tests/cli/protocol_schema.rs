//! The JSON Schema and the reader know the same keys, and the shipped protocols
//! are valid by both.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use study_plan::protocol::file;

fn schema() -> Value {
    let output = assert_cmd::Command::cargo_bin("study")
        .unwrap()
        .arg("schema")
        .output()
        .unwrap();
    assert!(output.status.success());
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A key that resembles no other: the reader lists all known keys.
const STRANGER: &str = "zzzzzzzzzzzzzzzzzzzzzzzz";

/// The keys that the reader knows where `STRANGER` stands in `text`.
fn known(text: &str) -> BTreeSet<String> {
    let parsed = file::parse("protocol.toml", text);
    let fault = parsed
        .findings
        .faults
        .iter()
        .find(|f| f.message.contains(STRANGER))
        .unwrap_or_else(|| panic!("{text}\n{}", parsed.findings.render(false)));
    fault
        .hint
        .as_deref()
        .unwrap()
        .strip_prefix("known keys are ")
        .unwrap()
        .split(", ")
        .map(str::to_owned)
        .collect()
}

/// The keys of `properties` at a JSON pointer.
fn described(schema: &Value, pointer: &str) -> BTreeSet<String> {
    let object = schema
        .pointer(pointer)
        .unwrap_or_else(|| panic!("the schema has no {pointer}"));
    assert_eq!(object["additionalProperties"], json!(false), "{pointer}");
    let properties = object["properties"].as_object().unwrap();
    let required = object.get("required").and_then(Value::as_array);
    for key in required.into_iter().flatten() {
        assert!(
            properties.contains_key(key.as_str().unwrap()),
            "{pointer}: {key}"
        );
    }
    properties.keys().cloned().collect()
}

#[test]
fn the_schema_and_the_reader_know_the_same_keys() {
    let schema = schema();
    let mut places = vec![
        (String::new(), String::new()),
        (
            "/properties/design/properties/breaks".to_owned(),
            "[design.breaks]".to_owned(),
        ),
        (
            "/properties/design/properties/order/oneOf/1".to_owned(),
            "[design.order]".to_owned(),
        ),
        (
            "/properties/power/properties/sd".to_owned(),
            "[power.sd]".to_owned(),
        ),
        (
            "/properties/power/properties/grid".to_owned(),
            "[power.grid]".to_owned(),
        ),
        (
            "/properties/power/properties/scale/oneOf/1".to_owned(),
            "[power.scale]".to_owned(),
        ),
        (
            "/properties/device/properties/limits".to_owned(),
            "[device.limits]".to_owned(),
        ),
        (
            "/properties/device/properties/uncertified".to_owned(),
            "[device.uncertified]".to_owned(),
        ),
        (
            "/properties/models/items".to_owned(),
            "[[models]]".to_owned(),
        ),
    ];
    for section in [
        "study", "text", "consent", "design", "session", "device", "trial", "analysis", "power",
    ] {
        places.push((format!("/properties/{section}"), format!("[{section}]")));
    }
    let kinds = schema["$defs"]["questions"]["items"]["oneOf"]
        .as_array()
        .unwrap();
    assert_eq!(kinds.len(), study_plan::protocol::kinds::KINDS.len());
    for (i, kind) in kinds.iter().enumerate() {
        let kind = kind["properties"]["kind"]["const"].as_str().unwrap();
        for array in ["questions", "setup", "intake", "outro"] {
            let reference = &schema["properties"][array]["$ref"];
            assert_eq!(reference, "#/$defs/questions");
            places.push((
                format!("/$defs/questions/items/oneOf/{i}"),
                format!("[[{array}]]\nkind = \"{kind}\""),
            ));
        }
    }
    let rules = schema
        .pointer("/properties/analysis/properties/exclude/items/oneOf")
        .unwrap()
        .as_array()
        .unwrap();
    assert!(!rules.is_empty());
    for (i, rule) in rules.iter().enumerate() {
        let name = rule["properties"]["rule"]["const"].as_str().unwrap();
        places.push((
            format!("/properties/analysis/properties/exclude/items/oneOf/{i}"),
            format!("[[analysis.exclude]]\nrule = \"{name}\""),
        ));
    }
    for (pointer, head) in places {
        let text = match head.as_str() {
            "" => format!("format = \"study-protocol/1\"\n{STRANGER} = 1\n"),
            head => format!("format = \"study-protocol/1\"\n{head}\n{STRANGER} = 1\n"),
        };
        assert_eq!(known(&text), described(&schema, &pointer), "{head}");
    }
}

#[test]
fn every_word_of_the_schema_is_read_and_no_other() {
    let schema = schema();
    for (pointer, head, key) in [
        (
            "/properties/design/properties/order/oneOf/0",
            "[design]",
            "order",
        ),
        ("/properties/session/properties/entry", "[session]", "entry"),
        ("/properties/device/properties/kind", "[device]", "kind"),
        (
            "/properties/models/items/properties/role",
            "[[models]]",
            "role",
        ),
        (
            "/properties/analysis/properties/unfinished",
            "[analysis]",
            "unfinished",
        ),
    ] {
        let listed: BTreeSet<String> = schema.pointer(pointer).unwrap()["enum"]
            .as_array()
            .unwrap()
            .iter()
            .map(|word| format!("`{}`", word.as_str().unwrap()))
            .collect();
        let text = format!("format = \"study-protocol/1\"\n{head}\n{key} = \"{STRANGER}\"\n");
        let parsed = file::parse("p", &text);
        let fault = parsed
            .findings
            .faults
            .iter()
            .find(|f| f.message.contains(STRANGER))
            .unwrap();
        let read: BTreeSet<String> = fault
            .hint
            .as_deref()
            .unwrap()
            .strip_prefix("it is one of ")
            .unwrap()
            .split(", ")
            .map(str::to_owned)
            .collect();
        assert_eq!(read, listed, "{head} {key}");
    }
}

#[test]
fn the_shipped_protocols_are_valid_and_broken_ones_are_not() {
    let schema = schema();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for file in [
        "protocols/turn-signal/protocol.toml",
        "protocols/turn-signal-extended/protocol.toml",
        "protocols/turn-signal-passive/protocol.toml",
        "protocols/knob/protocol.toml",
        "src/cli/new/protocol.toml",
    ] {
        let text = std::fs::read_to_string(root.join(file)).unwrap();
        let value: toml::Value = toml::from_str(&text).unwrap();
        let value = serde_json::to_value(value).unwrap();
        assert_eq!(faults(&schema, &schema, &value, file), Vec::<String>::new());
        for (pointer, broken) in [
            ("/study/seed", json!(-1)),
            ("/study/id", json!("Not An Id")),
            ("/device/limits/force_n", json!(0)),
            ("/models/0/role", json!("tset")),
            ("/questions/0/from", json!(1.5)),
            ("/analysis", json!({})),
        ] {
            let mut value = value.clone();
            let place = match value.pointer_mut(pointer) {
                Some(place) => place,
                None => {
                    value["models"][0]["role"] = json!("test");
                    value.pointer_mut(pointer).unwrap()
                }
            };
            *place = broken;
            assert!(
                !faults(&schema, &schema, &value, file).is_empty(),
                "{pointer}"
            );
        }
    }
}

/// The templates of studies with parts, and protocols without a device of forces, are read
/// without a fault and fit the schema; of a misspelt key both say so.
#[test]
fn the_templates_of_parts_are_valid_and_broken_ones_are_not() {
    let schema = schema();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in [
        "factorial",
        "pairs",
        "constant",
        "staircase",
        "questplus",
        "magnitude",
        "mushra",
        "identification",
        "similarity",
        "ranking",
        "adjustment",
        "yesno",
        "abx",
        "search",
        "protocols/cloth/protocol.toml",
        "protocols/sounds/protocol.toml",
        "protocols/yes-no/protocol.toml",
        "protocols/designs/codec.toml",
        "protocols/designs/comfort-3x2.toml",
        "protocols/designs/cues-2x2x2.toml",
        "protocols/designs/delay.toml",
        "protocols/designs/expertise.toml",
        "protocols/designs/fitts.toml",
        "protocols/designs/icons.toml",
        "protocols/designs/materials.toml",
        "protocols/designs/patterns.toml",
        "protocols/designs/roughness.toml",
        "protocols/designs/texture-2x2.toml",
        "protocols/designs/training.toml",
    ] {
        let file = match name.contains('/') {
            true => name.to_owned(),
            false => format!("src/cli/new/{name}.toml"),
        };
        let text = std::fs::read_to_string(root.join(&file)).unwrap();
        let parsed = file::parse("p", &text);
        assert!(
            parsed.findings.faults.is_empty(),
            "{}",
            parsed.findings.render(false)
        );
        let as_json = |text: &str| {
            let value: toml::Value = toml::from_str(text).unwrap();
            serde_json::to_value(value).unwrap()
        };
        let found = |text: &str| faults(&schema, &schema, &as_json(text), &file);
        assert_eq!(found(&text), Vec::<String>::new());
        let broken = text.replacen("prompt =", "prom =", 1);
        assert!(!found(&broken).is_empty());
        assert!(file::parse("p", &broken).protocol.is_none());
    }
}

/// Validates by the part of JSON Schema that is used; another keyword fails the test.
fn faults(root: &Value, schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut say = |what: String| found.push(format!("{at}: {what}"));
    let number = value.as_f64();
    let mut inner = Vec::new();
    for (keyword, rule) in schema.as_object().unwrap() {
        match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "patternProperties" => {}
            "$ref" => {
                let pointer = rule.as_str().unwrap().strip_prefix('#').unwrap();
                inner.extend(faults(root, root.pointer(pointer).unwrap(), value, at));
            }
            "const" if value != rule => say(format!("not {rule}")),
            "enum" if !rule.as_array().unwrap().contains(value) => say(format!("not in {rule}")),
            "type" => {
                let fits = match rule.as_str().unwrap() {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "boolean" => value.is_boolean(),
                    "number" => value.is_number(),
                    "integer" => value.is_i64() || value.is_u64(),
                    other => panic!("type {other}"),
                };
                if !fits {
                    say(format!("not of type {rule}"));
                }
            }
            "required" => {
                for key in rule.as_array().unwrap() {
                    if value.get(key.as_str().unwrap()).is_none() {
                        say(format!("no {key}"));
                    }
                }
            }
            "properties" => {
                for (key, schema) in rule.as_object().unwrap() {
                    if let Some(value) = value.get(key) {
                        inner.extend(faults(root, schema, value, &format!("{at}.{key}")));
                    }
                }
            }
            "additionalProperties" => {
                let known = schema.get("properties").and_then(Value::as_object);
                let patterns = schema.get("patternProperties").and_then(Value::as_object);
                for (key, value) in value.as_object().into_iter().flatten() {
                    if known.is_some_and(|k| k.contains_key(key)) {
                        continue;
                    }
                    let pattern = patterns.and_then(|p| p.iter().find(|(p, _)| matches(p, key)));
                    match pattern {
                        Some((_, schema)) => {
                            inner.extend(faults(root, schema, value, &format!("{at}.{key}")));
                        }
                        None => say(format!("unknown key {key}")),
                    }
                }
            }
            "items" => {
                for (i, value) in value.as_array().into_iter().flatten().enumerate() {
                    inner.extend(faults(root, rule, value, &format!("{at}[{i}]")));
                }
            }
            "oneOf" => {
                let fit = rule
                    .as_array()
                    .unwrap()
                    .iter()
                    .filter(|schema| faults(root, schema, value, at).is_empty())
                    .count();
                if fit != 1 {
                    say(format!("fits {fit} of the alternatives"));
                }
            }
            "minimum" if number < rule.as_f64() => say(format!("below {rule}")),
            "maximum" if number > rule.as_f64() => say(format!("above {rule}")),
            "exclusiveMinimum" if number <= rule.as_f64() => say(format!("not above {rule}")),
            "minLength" if value.as_str() == Some("") => say("empty".to_owned()),
            "minItems" if value.as_array().is_some_and(Vec::is_empty) => say("empty".to_owned()),
            "exclusiveMaximum" if number >= rule.as_f64() => say(format!("not below {rule}")),
            "maxItems" => {
                let most = rule.as_u64().unwrap() as usize;
                if value.as_array().is_some_and(|list| list.len() > most) {
                    say(format!("more than {most}"));
                }
            }
            "pattern" => {
                if value
                    .as_str()
                    .is_some_and(|text| !matches(rule.as_str().unwrap(), text))
                {
                    say(format!("does not match {rule}"));
                }
            }
            "const" | "enum" | "minimum" | "maximum" | "exclusiveMinimum" | "minLength"
            | "minItems" | "exclusiveMaximum" => {}
            other => panic!("keyword {other}"),
        }
    }
    found.extend(inner);
    found
}

/// The patterns of the schema.
fn matches(pattern: &str, text: &str) -> bool {
    let of = |most: usize, extra: &str, upper: bool| {
        (1..=most).contains(&text.len())
            && text.chars().all(|c| {
                c.is_ascii_digit()
                    || c.is_ascii_lowercase()
                    || (upper && c.is_ascii_uppercase())
                    || extra.contains(c)
            })
    };
    match pattern {
        "^[a-z0-9-]{1,64}$" => of(64, "-", false),
        "^[A-Za-z0-9._-]{1,32}$" => of(32, "._-", true),
        "^[A-Za-z0-9_-]{1,32}$" => of(32, "_-", true),
        "^[A-Za-z0-9_-]{1,20}$" => of(20, "_-", true),
        "^(all|adjacent|versus:[A-Za-z0-9._-]{1,32})$" => {
            matches!(text, "all" | "adjacent") || text.starts_with("versus:")
        }
        "^-?[0-9]+$" => text.parse::<i64>().is_ok(),
        "^-?[0-9]+([.][0-9]+)?$" => text.parse::<f64>().is_ok(),
        // one of some names
        other => {
            let names = other.strip_prefix("^(").and_then(|p| p.strip_suffix(")$"));
            let names = names.unwrap_or_else(|| panic!("pattern {other}"));
            let plain = |c: char| c.is_ascii_lowercase() || c == '-' || c == '|';
            assert!(names.chars().all(plain), "pattern {other}");
            names.split('|').any(|name| name == text)
        }
    }
}
