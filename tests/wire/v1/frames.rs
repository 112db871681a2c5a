//! The golden bytes as a file for tests in other languages: docs/wire-frames.json.
//! `UPDATE_DOCS=1 cargo test --test wire frames` writes it.

use super::*;
use serde_json::{Value, json};

fn entries<M>(list: &[Golden<M>]) -> Vec<Value> {
    let entry = |golden: &Golden<M>| {
        let fields = golden
            .body
            .iter()
            .map(|(bytes, meaning)| json!({ "bytes": bytes, "meaning": meaning }));
        json!({
            "name": golden.name,
            "sequence": golden.sequence,
            "fields": fields.collect::<Vec<_>>(),
            "crc": golden.crc,
            "frame": golden.frame,
        })
    };
    list.iter().map(entry).collect()
}

#[test]
fn the_file_of_golden_frames_is_current() {
    let document = json!({
        "format": "study-wire-frames/1",
        "crc": { "of": hex(b"123456789"), "is": "2639f4cb" },
        "to_device": entries(&requests()),
        "to_host": entries(&replies()),
    });
    let wanted = format!("{:#}\n", document);
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/wire-frames.json");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &wanted).unwrap();
    }
    assert!(
        std::fs::read_to_string(&path).unwrap() == wanted,
        "docs/wire-frames.json is out of date: \
         `UPDATE_DOCS=1 cargo test --test wire frames` writes it again"
    );
}
