//! `study desk`: all participants of a study, beside its sessions.

mod text;
mod watch;

use super::{Console, Failure, device_selection, overview, study_folder};
use std::io::IsTerminal as _;
use std::path::PathBuf;

/// Format of the document.
const FORMAT: &str = "study-desk/1";

/// Arguments of `study desk`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder, or the folder of one study in it
    results: PathBuf,
    /// The copy on a second disk whose state is shown, as for `study run`
    /// (default: mirror in device.toml)
    #[arg(long, value_name = "DIR")]
    mirror: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    /// Show it in the terminal, read again every few seconds, until q is pressed
    #[arg(long, conflicts_with = "json")]
    watch: bool,
}

/// Prints who has done what and who comes when, never an order, an answer or a realization. Only reads.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mirror = match &args.mirror {
        Some(mirror) => Some(mirror.clone()),
        None => device_selection::mirror()?,
    };
    // What is wrong with the folder is said before the terminal is taken.
    let (studies, whole) = overview::of_results(&args.results, mirror.as_deref())?;
    if args.watch {
        if !console.terminal || !std::io::stdin().is_terminal() {
            return Err(Failure::usage("--watch needs a terminal")
                .hint("without --watch everything is printed once"));
        }
        return watch::watch(args.results.clone(), mirror, studies);
    }
    for study in &studies {
        study_folder::warn_of(&study.folder, &study.warnings, console);
    }
    if args.json {
        console.json(&serde_json::json!({ "format": FORMAT, "studies": studies }))?;
        return whole;
    }
    let columns = console.terminal.then_some(console.width);
    for (n, study) in studies.iter().enumerate() {
        let between = if n > 0 { "\n" } else { "" };
        console.out(format!(
            "{between}{}\n",
            text::all(study, columns).join("\n")
        ))?;
    }
    whole
}
