//! `study schema`: the JSON Schema of the protocol file, for editors.

use super::{Console, Failure};
use study_plan::protocol::schema::json_schema;

/// Arguments of `study schema`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

/// Runs `study schema`.
pub(super) fn run(_args: &Args, console: &mut Console) -> Result<(), Failure> {
    console.json(&json_schema())
}
