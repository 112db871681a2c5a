//! `study verify`

use super::{Console, Failure, study_folder};
use std::path::PathBuf;
use study_base::text::{Untrusted, counted};
use study_core::store::{Finding, SessionData, StudyFolder, layout};

/// Arguments of `study verify`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder, or the folder of one study in it
    results: PathBuf,
    /// First write the derived tables again from the journals
    #[arg(long)]
    rebuild: bool,
    /// Let --rebuild take participants out of the tables whose journals are gone
    #[arg(long, requires = "rebuild")]
    drop_missing: bool,
}

/// Prints what was found and fails if anything of it is wrong.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut wrong = 0;
    for study in study_folder::studies(&args.results)? {
        let protocol = study_folder::frozen(&study);
        if let (true, Ok(loaded)) = (args.rebuild, &protocol) {
            study.refresh_with(&loaded.protocol, args.drop_missing)?;
        }
        let mut found = study.verify(protocol.as_ref().ok().map(|l| &l.protocol))?;
        found.extend(study_folder::frozen_versions(&study, None));
        console.out(of_study(&study, &study.sessions()?, &found))?;
        wrong += found.iter().filter(|f| f.wrong).count();
    }
    match wrong {
        0 => Ok(()),
        1 => Err(Failure::results("one thing is wrong")),
        n => Err(Failure::results(format!("{n} things are wrong"))),
    }
}

fn of_study(study: &StudyFolder, sessions: &[SessionData], found: &[Finding]) -> String {
    let path = study.path().display().to_string();
    let mut out = String::new();
    for finding in found {
        let word = if finding.wrong { "wrong" } else { "note" };
        out.push_str(&format!(
            "{word}: {}/{}: {}\n",
            Untrusted(&path),
            Untrusted(&finding.place),
            Untrusted(&finding.what)
        ));
    }
    let events: usize = sessions.iter().map(|s| s.entries.len()).sum();
    let verdict = match found.iter().filter(|f| f.wrong).count() {
        0 => "all is as it was written",
        _ => "not all is as it was written",
    };
    out.push_str(&format!(
        "{}: {}, {}: {verdict}\n",
        Untrusted(&path),
        counted(sessions.len(), "session", "sessions"),
        counted(events, "event", "events"),
    ));
    out.push_str(
        "Not checked: the numbers in telemetry files (only that the files and their lines are there) and analysis/.\n",
    );
    if found
        .iter()
        .any(|f| f.wrong && layout::TABLES.contains(&f.place.as_str()))
    {
        out.push_str("the tables are made again with --rebuild\n");
    }
    out
}
