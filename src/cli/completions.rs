//! `study completions` and `study man`: shell completions and manual pages.

use super::{Console, Failure, Kind, help};
use clap_complete::env::Shells;
use clap_complete::{ArgValueCompleter, CompletionCandidate};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use study_base::sort::SmallSort as _;

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

/// The environment variable by which the shell asks for candidates.
const ASKS: &str = "COMPLETE";

/// Prints the script that makes a shell ask `study` for completions.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let bug = |what: String| Failure::new(Kind::Bug, format!("completions: {what}"));
    let shells = Shells::builtins();
    let name = args.shell.to_string();
    let shell = shells.completer(&name).ok_or_else(|| bug(name))?;
    let mut script = Vec::new();
    shell
        .write_registration(ASKS, "study", "study", "study", &mut script)
        .map_err(|e| bug(e.to_string()))?;
    console.out(String::from_utf8(script).map_err(|e| bug(e.to_string()))?)
}

/// Answers a shell that asks for completions, and then ends the program.
pub fn answer_shell() {
    clap_complete::CompleteEnv::with_factory(help::command).complete();
}

/// Participants with a session in the results of the working folder.
pub(super) fn participants() -> ArgValueCompleter {
    ArgValueCompleter::new(|typed: &OsStr| {
        let typed = typed.to_string_lossy();
        let mut ids = ids(Path::new("results"));
        ids.retain(|id| id.starts_with(&*typed));
        ids.into_iter().map(CompletionCandidate::new).collect()
    })
}

fn ids(results: &Path) -> Vec<String> {
    let entries = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let studies = entries(results).into_iter();
    let sessions = studies.flat_map(|study| entries(&study.join("sessions")));
    let names = sessions.filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()));
    let mut ids: Vec<String> = names.collect();
    ids.small_sort();
    ids.dedup();
    ids
}

/// Writes the manual pages.
pub(super) fn man(args: &ManArgs, console: &mut Console) -> Result<(), Failure> {
    std::fs::create_dir_all(&args.dir).map_err(|e| Failure::file(&args.dir, &e))?;
    help::write_pages(&args.dir)?;
    console.out(format!("manual pages in {}\n", args.dir.display()))
}
