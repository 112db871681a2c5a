//! `study amend`

use super::{Console, Failure, study_folder};
use std::path::PathBuf;
use study_analysis::load;
use study_base::text::Untrusted;
use study_session::store::{self, Frozen};

/// Arguments of `study amend`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder, or the folder of one study in it
    results: PathBuf,
    /// The amended protocol.toml or the folder that contains it
    protocol: PathBuf,
    /// Reason; it is recorded
    #[arg(long, value_name = "TEXT")]
    reason: String,
}

/// Freezes a new version of wording or analysis.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let reason = study_folder::reason(&args.reason)?;
    let loaded = load::load_for(&args.protocol, &args.results)?;
    console.warnings_in_short(&loaded.findings, &args.protocol);
    let id = &loaded.protocol.study.id;
    let mut studies = store::studies(&args.results)?;
    studies.retain(|s| s.manifest().study == *id);
    let Some(mut study) = studies.pop() else {
        let none = format!("{}: contains no study `{id}`", args.results.display());
        return Err(Failure::input(none).hint("a protocol with another id is another study"));
    };
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let changes = load::changes(&study, &loaded)?;
    let version = study
        .amend(&frozen, reason, study_folder::now())
        .map_err(|error| study_folder::refused(error, &loaded))?;
    console.out(format!(
        "{id}: froze version {version} of the protocol. New sessions use it.\n"
    ))?;
    for change in &changes {
        let values = study_folder::values(change);
        console.out(format!(
            "  {}\n",
            Untrusted(&format!("{}: {values}", change.key))
        ))?;
    }
    study_folder::refresh(&study, console)
}
