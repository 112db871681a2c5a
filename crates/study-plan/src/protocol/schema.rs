//! The JSON Schema of a protocol file, from the declarations of its keys.
//!
//! What a schema cannot express (ids that collide, orders that are infeasible) is
//! checked by the reader and by `study check`.

use super::file::ROOT;
use super::keys::{Absent, Id, Key, Kind, NumberRange, Shape, Variants, Word};
use serde_json::{Map, Value, json};
use std::ops::Bound;

/// What tells this schema from those of other files.
pub const TITLE: &str = "study protocol";

/// The JSON Schema, draft 2020-12.
///
/// ```
/// # use study_plan::protocol::schema::json_schema;
/// let schema = json_schema();
/// assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
/// assert!(schema["properties"]["design"]["properties"]["repetitions"].is_object());
/// ```
pub fn json_schema() -> Value {
    let mut schema = object(ROOT);
    let mut questions = None;
    for key in ROOT {
        // The kinds of question are the same in four places.
        if let Kind::Variants(variants) = key.kind
            && std::ptr::eq(variants, super::file::QUESTIONS)
        {
            questions.get_or_insert_with(|| array_of(variants));
            schema["properties"][key.name] =
                json!({ "$ref": "#/$defs/questions", "description": key.effect });
        }
    }
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!(TITLE);
    schema["description"] = json!(format!(
        "The protocol file of a study, {}, {} or {}.",
        super::FORMAT,
        super::FORMAT_2,
        super::FORMAT_3
    ));
    schema["$defs"] = json!({ "questions": questions });
    schema
}

fn object(keys: &[Key]) -> Value {
    let required = keys.iter().filter(|key| key.absent == Absent::Error);
    let required: Vec<&str> = required.map(|key| key.name).collect();
    let mut schema = json!({
        "type": "object",
        "additionalProperties": false,
        "properties": Map::from_iter(keys.iter().map(property)),
    });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

fn property(key: &Key) -> (String, Value) {
    let mut schema = of(key.kind);
    schema["description"] = json!(key.effect);
    // A study without realizations is refused, although the key is an array.
    if matches!(key.kind, Kind::Tables(_)) {
        schema["minItems"] = json!(1);
    }
    (key.name.to_owned(), schema)
}

fn of(kind: Kind) -> Value {
    let text = json!({ "type": "string", "minLength": 1 });
    match kind {
        Kind::Text | Kind::Path => text,
        Kind::Texts(0) => json!({ "type": "array", "items": text }),
        Kind::Texts(least) => json!({ "type": "array", "minItems": least, "items": text }),
        Kind::Id(id) => json!({ "type": "string", "pattern": id.pattern() }),
        Kind::ModelIds => of(Kind::Ids(Id::Model)),
        Kind::Ids(id) => json!({ "type": "array", "items": of(Kind::Id(id)) }),
        Kind::NumberList => {
            json!({ "type": "array", "minItems": 1, "items": { "type": "number" } })
        }
        Kind::Pairs => {
            let pair = json!({ "type": "array", "minItems": 2, "maxItems": 2, "items": of(Kind::Id(Id::Model)) });
            json!({ "oneOf": [
                { "type": "string", "pattern": "^(all|adjacent|versus:[A-Za-z0-9._-]{1,32})$" },
                { "type": "array", "minItems": 1, "items": pair },
            ] })
        }
        Kind::Whole(least, most) => whole(least, most),
        Kind::Number(range, _) => number(range),
        Kind::WholeList(least, most) => json!({ "type": "array", "items": whole(least, most) }),
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Word(words) => one_of(words),
        Kind::WordOrTable(words, keys) => json!({ "oneOf": [one_of(words), object(keys)] }),
        Kind::WholeLabels => map("^-?[0-9]+$", text),
        Kind::NumberLabels => map("^-?[0-9]+([.][0-9]+)?$", text),
        Kind::Numbers => map(Id::Question.pattern(), json!({ "type": "number" })),
        Kind::TextsByName => map(Id::Question.pattern(), text),
        Kind::Sentences => {
            let keys = super::phrases::Phrase::ALL.iter().map(|p| p.key());
            map(&format!("^({})$", keys.collect::<Vec<_>>().join("|")), text)
        }
        Kind::Table(keys) => object(keys),
        Kind::Tables(keys) => json!({ "type": "array", "items": object(keys) }),
        Kind::Variants(variants) => array_of(variants),
        Kind::Variant(variants) => one_shape(variants),
    }
}

fn whole(least: i64, most: i64) -> Value {
    let mut schema = json!({ "type": "integer" });
    if least > i64::MIN {
        schema["minimum"] = json!(least);
    }
    if most < i64::from(u32::MAX) {
        schema["maximum"] = json!(most);
    }
    schema
}

fn number((low, high): NumberRange) -> Value {
    let mut schema = json!({ "type": "number" });
    for (bound, included, excluded) in [
        (low, "minimum", "exclusiveMinimum"),
        (high, "maximum", "exclusiveMaximum"),
    ] {
        match bound {
            Bound::Included(number) => schema[included] = json!(number),
            Bound::Excluded(number) => schema[excluded] = json!(number),
            Bound::Unbounded => {}
        }
    }
    schema
}

fn one_of(words: &[Word]) -> Value {
    json!({ "enum": words.iter().map(|word| word.word).collect::<Vec<_>>() })
}

/// A table with arbitrary keys.
fn map(keys: &str, value: Value) -> Value {
    json!({ "type": "object", "patternProperties": { keys: value }, "additionalProperties": false })
}

fn array_of(variants: &Variants) -> Value {
    json!({ "type": "array", "items": one_shape(variants) })
}

/// One of the alternatives.
fn one_shape(variants: &Variants) -> Value {
    let shape = |shape: &Shape| {
        let keys: Vec<Key> = variants.common.iter().chain(shape.keys).copied().collect();
        let mut schema = object(&keys);
        let mut required = vec![json!(variants.tag)];
        required.extend(schema["required"].as_array().into_iter().flatten().cloned());
        schema["required"] = Value::Array(required);
        schema["properties"][variants.tag] = json!({ "const": shape.word.word });
        schema["description"] = json!(shape.word.meaning);
        schema
    };
    let shapes: Vec<Value> = variants.shapes.iter().map(shape).collect();
    json!({ "oneOf": shapes })
}
