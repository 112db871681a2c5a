//! The command line of `study`.

use std::process::ExitCode;
use study::cli::{Console, Failure, guard};

fn main() -> ExitCode {
    study::cli::answer_shell();
    let mut console = Console::of_process();
    let cli = match study::cli::parse() {
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
