//! The command line of `study`.

use clap::Parser as _;
use std::process::ExitCode;
use study::cli::{Cli, Console, Failure, guard};

fn main() -> ExitCode {
    let mut console = Console::of_process();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return study::cli::usage(&error, &mut console),
    };
    match guard(|| study::cli::run(cli, &mut console)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console.failure(&failure);
            ExitCode::from(Failure::exit_code(&failure))
        }
    }
}
