//! A small protocol without a file, for tests and examples.

use super::{Media, ModelEntry, Protocol, Role, file};
use std::collections::BTreeMap;
use study_base::text::ModelId;

const PROTOCOL: &str = r#"
format = "study-protocol/1"
study = { id = "example", title = "An example", seed = 2007 }
design = { participants = 10, repetitions = 1, order = "blocked" }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
trial = { reference = "Operate the real switch." }
models = [{ id = "A", file = "a.toml" }]
analysis = { primary = "realism", realistic_from = 5 }

[[questions]]
id = "realism"
kind = "rating"
prompt = "How realistic did it feel?"
from = 1
to = 7
labels = { 1 = "not at all realistic", 7 = "very realistic" }

[[questions]]
id = "comment"
kind = "text"
prompt = "Comment"
"#;

/// Realizations `A`, `B`, … of role test without files, rated 1–7 for `realism` with
/// an optional `comment`; order blocked.
pub fn protocol(models: usize, repetitions: u32) -> Protocol {
    let parsed = file::parse("example", PROTOCOL);
    let mut protocol = parsed.protocol.expect("the example has no fault");
    protocol.design.repetitions = repetitions;
    protocol.models = (0..models).map(|i| model(&letter(i))).collect();
    protocol
}

/// An entry of role test without a file.
pub fn model(id: &str) -> ModelEntry {
    ModelEntry {
        id: ModelId::new(id).expect("an identifier"),
        file: None,
        vaf: None,
        role: Role::Test,
        duplicate_of: None,
        device: None,
        covariates: BTreeMap::new(),
        levels: BTreeMap::new(),
        media: Media::default(),
    }
}

/// `A` … `Z`, then `A1` … `Z1` and so on.
fn letter(i: usize) -> String {
    let letter = char::from(b'A' + u8::try_from(i % 26).expect("below 26"));
    match i / 26 {
        0 => letter.to_string(),
        round => format!("{letter}{round}"),
    }
}
