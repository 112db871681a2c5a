//! The simulated device on systems without pseudo-terminals.

use crate::cli::Failure;
use study_device::link::LinkError;

/// Arguments of a command that is not supported; all are ignored.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Args {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _ignored: Vec<String>,
}

/// The error of every such command.
pub(in crate::cli) fn failure() -> Failure {
    Failure::device(LinkError::Unsupported)
        .hint("`study rehearse` and the simulated device of `study run` work on every system")
}
