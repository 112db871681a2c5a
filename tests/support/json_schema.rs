//! The part of JSON Schema that the schemas of this project use.

#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use serde_json::Value;

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
