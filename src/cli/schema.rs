//! `study schema`

use super::{Console, Failure};

/// Arguments of `study schema`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

/// Does it.
pub(super) fn run(_args: &Args, _console: &mut Console) -> Result<(), Failure> {
    Err(Failure::input("not built yet"))
}
