//! `study preregister`: what a study states before its first session.

use super::{Console, Failure};
use chrono::NaiveDate;
use std::fs;
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_base::text::Untrusted;
use study_report::preregistration::{Options, document};

/// Arguments of `study preregister`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "`study run` freezes the document with the protocol, and the report compares."
)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it
    protocol: PathBuf,
    /// Planned participants (default: those of the protocol)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    participants: Option<u32>,
    /// The day of the document (default: today)
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<NaiveDate>,
    /// Simulated studies for the power
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(100..=10_000_000))]
    studies: Option<u64>,
    /// Folder for preregistration.md and preregistration.json (default: that of the protocol)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs `study preregister`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let loaded = load::load(&args.protocol)?;
    let protocol_folder = loaded.folder.clone();
    let options = Options {
        participants: args.participants,
        date: (args.date).unwrap_or_else(|| super::study_folder::now().wall.date_naive()),
        studies: args.studies,
    };
    let bar = super::console::progress(0, "parts of the simulation");
    let document = document(loaded, &options, &|units| {
        bar.set_length(units as u64);
        bar.inc(1);
    });
    bar.finish_and_clear();
    let document = document.map_err(|e| Failure::new(super::Kind::Bug, e))?;
    let folder = args.out.as_deref().unwrap_or(&protocol_folder);
    fs::create_dir_all(folder).map_err(|e| Failure::file(folder, &e))?;
    for (name, content) in &document.files {
        unchanged(&folder.join(name), content)?;
    }
    for (name, content) in &document.files {
        super::power::replace(&folder.join(name), content.as_bytes())?;
    }
    let (markdown, _) = &document.files[0];
    console.say(format!("written: {}", shown(&folder.join(markdown))));
    console.out(format!("{}\n", document.sha256))
}

fn shown(path: &Path) -> String {
    Untrusted(&path.display().to_string()).to_string()
}

/// A document is not replaced by another one: it may have been registered.
fn unchanged(path: &Path, content: &str) -> Result<(), Failure> {
    match fs::read_to_string(path) {
        Ok(there) if there != content => Err(Failure::input(format!(
            "{}: there is another document already",
            shown(path)
        ))
        .hint("delete it if it was not registered, or choose another folder with --out")),
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Failure::file(path, &e)),
        _ => Ok(()),
    }
}
