//! Runs the shipped code on a file of reference cases and prints `{"values": …}`.
//!
//! `cargo run --release --example golden -- FILE.json`
//!
//! | file | values |
//! |---|---|
//! | `"format": "study-power-golden/1"` | `<case id>/<path in expected>` |
//! | a `kind`, as the files of `tests/golden/psychophysics` | identifiers of docs/statistics-psychophysics.md |

#![allow(clippy::print_stdout, clippy::print_stderr)]

mod power;
mod psychophysics;

use serde_json::{Map, Value, json};
use std::process::ExitCode;

/// Why there are no values.
#[derive(Debug, thiserror::Error)]
enum GoldenError {
    #[error("usage: golden FILE.json")]
    Usage,
    #[error(transparent)]
    File(#[from] std::io::Error),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error("no format that this example knows")]
    Format,
    #[error("{case}: {what}")]
    Case { case: String, what: String },
    #[error(transparent)]
    Psychophysics(#[from] psychophysics::Error),
}

fn values() -> Result<Map<String, Value>, GoldenError> {
    let path = std::env::args_os().nth(1).ok_or(GoldenError::Usage)?;
    let text = std::fs::read_to_string(path)?;
    let document: Value = serde_json::from_str(&text)?;
    match document["format"].as_str() {
        Some("study-power-golden/1") => power::values(&document),
        None if document["kind"].is_string() => Ok(psychophysics::values(&text)?),
        _ => Err(GoldenError::Format),
    }
}

fn main() -> ExitCode {
    match values() {
        Ok(values) => {
            println!("{:#}", json!({ "values": values }));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
