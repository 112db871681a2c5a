//! `study run`

use super::{Console, Failure};

/// Arguments of `study run`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

/// Does it.
pub(super) fn run(_args: &Args, _console: &mut Console) -> Result<(), Failure> {
    Err(Failure::input("not built yet"))
}
