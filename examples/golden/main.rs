//! Runs the shipped code on a file of reference cases and prints `{"values": …}`.
//!
//! `cargo run --release --example golden -- FILE.json`
//!
//! | file | values |
//! |---|---|
//! | `"format": "study-power-golden/1"` | `<case id>/<path in expected>` |

#![allow(clippy::print_stdout, clippy::print_stderr)]

mod power;

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
}

fn values() -> Result<Map<String, Value>, GoldenError> {
    let path = std::env::args_os().nth(1).ok_or(GoldenError::Usage)?;
    let document: Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    match document["format"].as_str() {
        Some("study-power-golden/1") => power::values(&document),
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
