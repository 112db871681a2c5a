//! `study schema`: the JSON Schema of the protocol file, for editors.
//!
//! Written by hand in `schema.json`; `tests/protocol_schema.rs` holds it to the
//! keys that the reader knows. What a schema cannot say (ids that collide, orders
//! that cannot be) is `study check`'s business.

use super::{Console, Failure};

const SCHEMA: &str = include_str!("schema.json");

/// Arguments of `study schema`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

/// Does it.
pub(super) fn run(_args: &Args, console: &mut Console) -> Result<(), Failure> {
    console.out(SCHEMA)
}
