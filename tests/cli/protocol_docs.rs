//! `docs/protocol.md` and the template of `study new` agree with the declarations of
//! the protocol's keys.
//!
//! `UPDATE_DOCS=1 cargo test --test cli protocol_docs` writes the page again.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use study_plan::protocol::file::{self, ROOT};
use study_plan::protocol::keys::{Absent, Key, Kind, Variants, Word};

const HEAD: &str = "\
# The protocol file

A study is described by a file `protocol.toml` in [TOML](https://toml.io). This page lists every key that it can
have; it is generated from the declarations that the program reads the file with. `study new DIR` writes a
commented protocol to start from, and `study check PROTOCOL` reports every fault of one.

Editors complete and check keys by a JSON Schema. `study new` writes it beside the protocol, whose first line names
it (`#:schema protocol.schema.json`), and `study schema --install PROTOCOL` does so with a protocol that has none or
an older one. Visual Studio Code with Even Better TOML and other editors with Taplo follow that line; for the others
`study schema` prints the schema. The program itself reads neither.

Reading is strict. An unknown key, a wrong type, a value out of range, an empty text and a missing key are errors,
each with its line and, where there is one, a suggestion. Paths are relative to the protocol and stay inside its
folder, so that a study can be copied as a whole. Texts can be in any language and have at most 64 KiB.

\"If absent\" says what a key means that is left out: *required* is an error, a value is the default, and — means
that the study has no such thing. `[[parts]]`, `[[families]]` and `[[tracks]]` need the format `study-protocol/2`,
and keys that say so `study-protocol/3`; every other key belongs to all formats.

Changes of the design, of models, limits and rating scales make a new study. Changes of texts, of `[analysis]`, of
the planned participants, VAFs and covariates can be made while a study runs, with `study amend`.

A whole protocol is in [protocols/turn-signal](../protocols/turn-signal/protocol.toml).
";

const MEDIA: &str = r#"
## Media: an example

A drawer is felt while its picture is seen; in one of two realizations a click is heard as well. The page shows and plays the
media of an interval when the device confirms its start ([screen.md](screen.md#pictures-videos-and-sounds)).

```toml
format = "study-protocol/3"

[trial]
media_within_ms = 60

[[models]]
id = "silent"
file = "models/drawer.toml"
picture = "media/drawer.jpg"
alt = "A drawer of dark wood, half open."

[[models]]
id = "click"
file = "models/drawer.toml"
picture = "media/drawer.jpg"
alt = "A drawer of dark wood, half open."
sound = "media/click.wav"
caption = "A click."
```

The files lie in the folder of the protocol, have at most 16 MiB each and 128 MiB together, and are frozen with it; their SHA-256 is part of
the stimulus. Their first bytes decide what they are, not their names. An SVG is refused, because it can carry programs. Realizations
that look the same need the same `alt`, and those that sound the same, too, the same `caption`: what is read must not tell them apart. A
hidden duplicate has the media of its original. Levels of families and points of spaces have none. `study run` needs `--screen`;
`study rehearse` goes on without media and says so.
"#;

fn page() -> String {
    let mut out = HEAD.to_owned();
    table(&mut out, "The top level", "", &ROOT[..1]);
    words(&mut out, &ROOT[..1]);
    let mut questions = Vec::new();
    for key in &ROOT[1..] {
        match key.kind {
            Kind::Table(keys) => section(&mut out, key, key.name, keys),
            Kind::Tables(keys) => {
                let path = format!("[[{}]]", key.name);
                table(&mut out, &format!("`{path}`"), key.effect, keys);
                words(&mut out, keys);
                nested(&mut out, key.name, keys);
            }
            Kind::Variants(variants) if std::ptr::eq(variants, file::QUESTIONS) => {
                questions.push((key, variants));
            }
            Kind::Variants(variants) => {
                let _ = writeln!(out, "\n## `[[{}]]`\n\n{}", key.name, key.effect);
                alternatives(&mut out, variants);
                words(&mut out, variants.common);
                nested(&mut out, key.name, variants.common);
                below(&mut out, key.name, variants);
            }
            _ => panic!("{}", key.name),
        }
    }
    let heads: Vec<String> = questions
        .iter()
        .map(|(key, _)| format!("`[[{}]]`", key.name))
        .collect();
    let _ = writeln!(out, "\n## {}\n", heads.join(", "));
    for (key, variants) in &questions {
        assert!(std::ptr::eq(*variants, questions[0].1));
        let _ = writeln!(out, "* `[[{}]]`: {}", key.name, key.effect);
    }
    alternatives(&mut out, questions[0].1);
    out.push_str(MEDIA);
    out
}

fn section(out: &mut String, key: &Key, path: &str, keys: &[Key]) {
    table(out, &format!("`[{path}]`"), key.effect, keys);
    words(out, keys);
    nested(out, path, keys);
}

/// The tables inside a section.
fn nested(out: &mut String, path: &str, keys: &[Key]) {
    for key in keys {
        let path = format!("{path}.{}", key.name);
        match key.kind {
            Kind::Table(keys) => {
                table(out, &format!("`{path}`"), "", keys);
                words(out, keys);
            }
            Kind::WordOrTable(_, keys) => {
                table(out, &format!("`{path}` as a table"), "", keys);
                words(out, keys);
            }
            Kind::Variants(variants) => {
                let _ = writeln!(out, "\n### `[[{path}]]`");
                alternatives(out, variants);
            }
            Kind::Variant(variants) => {
                let _ = writeln!(out, "\n### `{path}`");
                alternatives(out, variants);
                below(out, &path, variants);
            }
            Kind::Tables(keys) => table(out, &format!("`[[{path}]]`"), "", keys),
            _ => {}
        }
    }
}

/// The words and the tables of the keys of alternatives, each once.
fn below(out: &mut String, path: &str, variants: &Variants) {
    let mut seen: Vec<&str> = Vec::new();
    for key in variants.shapes.iter().flat_map(|shape| shape.keys) {
        let own = std::slice::from_ref(key);
        if !seen.contains(&key.name) {
            seen.push(key.name);
            words(out, own);
            nested(out, path, own);
        }
    }
}

fn alternatives(out: &mut String, variants: &Variants) {
    let shapes: Vec<String> = variants
        .shapes
        .iter()
        .map(|s| format!("`\"{}\"`", s.word.word))
        .collect();
    let _ = writeln!(
        out,
        "\n`{}` (required): {}, one of {}.",
        variants.tag,
        variants.effect,
        shapes.join(", ")
    );
    if !variants.common.is_empty() {
        rows(out, variants.common);
    }
    for shape in variants.shapes {
        let _ = writeln!(
            out,
            "\n### `{} = \"{}\"`\n\n{}",
            variants.tag, shape.word.word, shape.word.meaning
        );
        if !shape.keys.is_empty() {
            rows(out, shape.keys);
        }
    }
}

fn table(out: &mut String, title: &str, effect: &str, keys: &[Key]) {
    let level = if title.contains('.') { "###" } else { "##" };
    let _ = writeln!(out, "\n{level} {title}");
    if !effect.is_empty() {
        let _ = writeln!(out, "\n{effect}");
    }
    rows(out, keys);
}

fn rows(out: &mut String, keys: &[Key]) {
    out.push_str("\n| key | type | if absent | example | effect |\n|---|---|---|---|---|\n");
    for key in keys {
        let kind = match key.kind {
            Kind::Number(_, unit) if !unit.is_empty() => {
                format!("{}, in {unit}", key.kind.describe())
            }
            Kind::Table(_) => "a table, below".to_owned(),
            Kind::Variant(_) => "a table, below".to_owned(),
            Kind::Variants(_) | Kind::Tables(_) => "tables, below".to_owned(),
            Kind::Word(_) => "a word, below".to_owned(),
            Kind::WordOrTable(..) => "a word or a table, below".to_owned(),
            kind => kind.describe(),
        };
        let absent = match key.absent {
            Absent::Error => "*required*".to_owned(),
            Absent::Nothing => "—".to_owned(),
            Absent::Default(toml) => format!("`{toml}`"),
            Absent::Derived(from) => from.to_owned(),
        };
        let example = match key.example {
            "" => "below".to_owned(),
            toml => format!("`{} = {toml}`", key.name),
        };
        let row = [
            format!("`{}`", key.name),
            kind,
            absent,
            example,
            key.effect.to_owned(),
        ];
        assert!(row.iter().all(|cell| !cell.contains('|')), "{row:?}");
        let _ = writeln!(out, "| {} |", row.join(" | "));
    }
}

/// What the words of the keys mean.
fn words(out: &mut String, keys: &[Key]) {
    for key in keys {
        let words: &[Word] = match key.kind {
            Kind::Word(words) | Kind::WordOrTable(words, _) => words,
            _ => continue,
        };
        let _ = writeln!(out, "\n`{}` is one of:\n", key.name);
        for word in words {
            let _ = writeln!(out, "* `\"{}\"`: {}", word.word, word.meaning);
        }
    }
}

#[test]
fn the_reference_of_the_protocol_is_what_the_declarations_give() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/protocol.md");
    let page = page();
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&path, &page).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == page,
        "docs/protocol.md is out of date: UPDATE_DOCS=1 writes it again"
    );
}

/// Every key of the template, also those that are commented out, is declared, and
/// the sections are those of the file.
#[test]
fn the_template_of_a_new_study_has_only_declared_keys() {
    let template = include_str!("../../src/cli/new/protocol.toml");
    let mut keys = 0;
    let text: String = (template.lines())
        .map(|line| {
            let bare = line.strip_prefix("# ").unwrap_or(line);
            let word = bare.split(" =").next().unwrap_or_default();
            let key =
                bare.contains(" = ") && word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
            let head = bare.starts_with('[');
            keys += usize::from(key);
            if key || head {
                format!("{bare}\n")
            } else {
                format!("{line}\n")
            }
        })
        .collect();
    assert!(keys > 40, "{keys}");
    let parsed = file::parse("protocol.toml", &text);
    let syntax = "expected";
    for fault in &parsed.findings.faults {
        let wrong = fault.message.contains("unknown key") || fault.message.contains(syntax);
        assert!(!wrong, "{}", parsed.findings.render(false));
    }
    let misspelt = text.replace("max_run", "max_runs");
    let found = file::parse("protocol.toml", &misspelt)
        .findings
        .render(false);
    assert!(found.contains("unknown key `max_runs`"), "{found}");
}
