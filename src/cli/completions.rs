//! `study completions` and `study man`: shell completions and manual pages.

use super::{Cli, Console, Failure, Kind};
use clap::CommandFactory as _;
use std::path::PathBuf;

/// Arguments of `study completions`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The shell
    shell: clap_complete::Shell,
}

/// Arguments of `study man`.
#[derive(Debug, clap::Args)]
pub(super) struct ManArgs {
    /// Folder for the pages: study.1 and one page for each command
    dir: PathBuf,
}

/// Prints the completions for a shell.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "study", &mut script);
    let script = String::from_utf8(script)
        .map_err(|e| Failure::new(Kind::Bug, format!("completions: {e}")))?;
    console.out(script)
}

/// Writes the manual pages.
pub(super) fn man(args: &ManArgs, console: &mut Console) -> Result<(), Failure> {
    std::fs::create_dir_all(&args.dir).map_err(|e| Failure::file(&args.dir, &e))?;
    clap_mangen::generate_to(Cli::command(), &args.dir)
        .map_err(|e| Failure::file(&args.dir, &e))?;
    console.out(format!("manual pages in {}\n", args.dir.display()))
}
