//! `study schema`: the JSON Schema of the protocol file, for editors.

use super::{Console, Failure, Kind};
use study_core::protocol::schema::json_schema;

/// Arguments of `study schema`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

/// Runs `study schema`.
pub(super) fn run(_args: &Args, console: &mut Console) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(&json_schema())
        .map_err(|e| Failure::new(Kind::Bug, format!("the schema: {e}")))?;
    console.out(text + "\n")
}
