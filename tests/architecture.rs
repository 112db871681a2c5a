//! The walls of the house: who may import whom, and how long a file may be.
//!
//! The table is design.md's. Imports are found as `crate::name` anywhere in a
//! file of `src/`, doc comments and strings left out.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const MAX_LINES: usize = 600;
/// main.rs parses, runs, reports.
const MAX_MAIN_LINES: usize = 30;

/// Layer 0, open to all.
const OPEN: [&str; 4] = ["rng", "text", "limits", "diagnostic"];

/// Module → what it may import beyond layer 0.
fn allowed() -> BTreeMap<&'static str, &'static [&'static str]> {
    let all: &[&str] = &["*"];
    BTreeMap::from([
        ("rng", &[] as &[&str]),
        ("text", &[]),
        ("limits", &[]),
        ("diagnostic", &[]),
        ("protocol", &[]),
        ("model", &[]),
        ("trajectory", &[]),
        ("recording", &[]),
        ("stats", &[]),
        ("schedule", &["protocol"]),
        ("outcome", &["protocol"]),
        ("plant", &["model", "trajectory"]),
        ("identify", &["model", "recording", "stats"]),
        ("session", &["protocol", "schedule", "outcome"]),
        ("store", &["protocol", "schedule", "outcome", "model"]),
        (
            "device",
            &["outcome", "model", "plant", "trajectory", "recording"],
        ),
        ("rater", &["protocol", "outcome", "model", "plant"]),
        ("analyze", &["protocol", "outcome", "stats", "model"]),
        (
            "runner",
            &[
                "session", "device", "store", "schedule", "outcome", "protocol", "model", "rater",
            ],
        ),
        (
            "report",
            &[
                "analyze",
                "stats",
                "identify",
                "model",
                "outcome",
                "recording",
            ],
        ),
        (
            "power",
            &[
                "protocol", "schedule", "outcome", "analyze", "stats", "rater", "model",
            ],
        ),
        ("tui", &["runner", "session", "outcome", "protocol"]),
        ("cli", all),
        ("main", all),
    ])
}

/// Modules that may touch files, clocks, terminals, processes or the network.
const WITH_IO: [&str; 8] = [
    "store",
    "tui",
    "runner",
    "cli",
    "main",
    "device/link",
    "device/serial",
    "device/process",
];
const IO: [&str; 8] = [
    "std::fs",
    "std::process",
    "std::net",
    "std::env",
    "Instant::now",
    "SystemTime::now",
    "Local::now",
    "Utc::now",
];

/// Files and modules that use nothing but `core`, `libm`, `crc` and slices.
const CORE_ONLY: [&str; 6] = [
    "model/predict.rs",
    "model/certificate.rs",
    "device/core",
    "device/frame",
    "device/handler",
    "device/wire",
];

fn sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path: PathBuf = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(&root).unwrap().to_str().unwrap();
                files.push((name.replace('\\', "/"), fs::read_to_string(&path).unwrap()));
            }
        }
    }
    files.sort();
    assert!(files.len() > 20, "the sources were not found");
    files
}

fn module_of(file: &str) -> &str {
    file.split('/').next().unwrap().trim_end_matches(".rs")
}

/// The code of a file: without comments and without its tests.
fn code(text: &str) -> String {
    let own = text.split("#[cfg(test)]\nmod tests").next().unwrap_or(text);
    own.lines()
        .map(|line| line.split("//").next().unwrap_or(line))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Every `crate::name`, also inside `use crate::{a, b::c}`.
fn imports(text: &str) -> Vec<String> {
    let code = code(text);
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut word = String::new();
            for c in group.chars() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    // the first name of each item is the module
                    ',' | ':' if depth == 0 => found.push(std::mem::take(&mut word)),
                    c if depth == 0 && (c.is_alphanumeric() || c == '_') => word.push(c),
                    _ => {}
                }
            }
            found.push(word);
        } else {
            found.push(
                rest.chars()
                    .take_while(|c| c.is_alphanumeric() || *c == '_')
                    .collect(),
            );
        }
    }
    found
}

/// What is wrong with a set of files.
fn violations(files: &[(String, String)]) -> Vec<String> {
    let allowed = allowed();
    let mut wrong = Vec::new();
    for (file, text) in files {
        let module = module_of(file);
        let lines = text.lines().count();
        let most = if file == "main.rs" {
            MAX_MAIN_LINES
        } else {
            MAX_LINES
        };
        if lines > most {
            wrong.push(format!("{file} has {lines} lines, more than {most}"));
        }
        if file.ends_with("/mod.rs") {
            wrong.push(format!("{file}: name.rs + name/, never mod.rs"));
        }
        if file == "lib.rs" {
            continue;
        }
        let Some(may) = allowed.get(module) else {
            wrong.push(format!(
                "{file}: module {module} is not in the import table"
            ));
            continue;
        };
        for import in imports(text) {
            let fine = import == module
                || OPEN.contains(&import.as_str())
                || may.contains(&"*")
                || may.contains(&import.as_str())
                // macros and re-exports at the crate root do not exist here
                || !allowed.contains_key(import.as_str());
            if !fine {
                wrong.push(format!("{file} imports {import}"));
            }
        }
        let with_io = WITH_IO.iter().any(|m| {
            module == *m || file.starts_with(&format!("{m}.")) || file.starts_with(&format!("{m}/"))
        });
        if !with_io {
            for word in IO {
                if code(text).contains(word) {
                    wrong.push(format!("{file} uses {word}"));
                }
            }
        }
        let core_only = CORE_ONLY
            .iter()
            .any(|m| file == m || *file == format!("{m}.rs") || file.starts_with(&format!("{m}/")));
        if core_only {
            for word in [
                "std::", "alloc::", "Vec<", "String", "Box<", "format!", "vec!",
            ] {
                if code(text).contains(word) {
                    wrong.push(format!("{file} uses {word}"));
                }
            }
        }
    }
    wrong
}

#[test]
fn every_module_imports_only_what_the_table_allows() {
    let wrong = violations(&sources());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_planted_violation_is_found() {
    let planted = |file: &str, text: &str| violations(&[(file.to_owned(), text.to_owned())]);
    assert_eq!(
        planted("session.rs", "use crate::device::Device;\n"),
        ["session.rs imports device"]
    );
    assert_eq!(
        planted(
            "tui/views/x.rs",
            "use crate::{outcome::Place, store::{Journal, x}};\n"
        ),
        ["tui/views/x.rs imports store"]
    );
    assert_eq!(
        planted("tui.rs", "use crate::{outcome, device};\n"),
        ["tui.rs imports device"]
    );
    assert_eq!(
        planted("analyze.rs", "fn f() { std::fs::read(\"x\"); }\n"),
        ["analyze.rs uses std::fs"]
    );
    assert_eq!(
        planted("session/clock.rs", "fn f() { let t = Instant::now(); }\n"),
        ["session/clock.rs uses Instant::now"]
    );
    assert_eq!(
        planted("model/predict.rs", "fn f() -> Vec<f64> { todo() }\n"),
        ["model/predict.rs uses Vec<"]
    );
    assert_eq!(
        planted("stats/x.rs", &"\n".repeat(601)),
        ["stats/x.rs has 601 lines, more than 600"]
    );
    assert_eq!(
        planted("stranger.rs", ""),
        ["stranger.rs: module stranger is not in the import table"]
    );
    assert!(planted("session.rs", "/// See [`crate::device`].\n").is_empty());
}
