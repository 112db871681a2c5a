//! `study verify`

use super::{Console, Failure};
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_base::text::{Untrusted, counted};
use study_session::store::{self, Finding, SessionData, StudyFolder, layout};

/// Arguments of `study verify`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Results folder, or the folder of one study in it
    results: PathBuf,
    /// First derive the tables again from the journals
    #[arg(long)]
    rebuild: bool,
    /// Let --rebuild remove participants without a journal from the tables
    #[arg(long, requires = "rebuild")]
    drop_missing: bool,
    /// Also compare every file with a copy, such as the mirror of `study run --mirror`
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
}

/// Prints the findings and fails if there is a problem.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let mut problems = 0;
    for study in store::studies(&args.results)? {
        let protocol = load::frozen(&study);
        if let (true, Ok(loaded)) = (args.rebuild, &protocol) {
            study.refresh_with(&loaded.protocol, args.drop_missing)?;
        }
        let mut found = study.verify(protocol.as_ref().ok().map(|l| &l.protocol))?;
        found.extend(load::frozen_versions(&study, None));
        if let Some(copy) = &args.against {
            found.extend(study.verify_against(&copy_of(&study, copy)?)?);
        }
        let sessions = study.sessions()?;
        let not_checked = study.not_checked(&sessions, protocol.is_ok());
        console.out(of_study(&study, &sessions, &found, &not_checked))?;
        problems += count_problems(&found);
    }
    match problems {
        0 => Ok(()),
        n => Err(Failure::results(problems_found(n))),
    }
}

/// The folder of a study's copy: DIR, or the study's folder in it.
fn copy_of(study: &StudyFolder, dir: &Path) -> Result<PathBuf, Failure> {
    let inside = dir.join(&study.manifest().study);
    let folders = [dir.to_owned(), inside];
    let mut copies = folders.into_iter();
    let copy = copies.find(|folder| folder.join(layout::MANIFEST).exists());
    copy.ok_or_else(|| {
        let none = format!(
            "{}: contains no copy of the study `{}`",
            dir.display(),
            Untrusted(&study.manifest().study)
        );
        Failure::results(none)
            .hint("--against names the folder given as --mirror, or a copy of the study's folder")
    })
}

fn of_study(
    study: &StudyFolder,
    sessions: &[SessionData],
    found: &[Finding],
    not_checked: &[String],
) -> String {
    let path = study.path().display().to_string();
    let mut out = String::new();
    for finding in found {
        let word = if finding.is_problem {
            "problem"
        } else {
            "note"
        };
        out.push_str(&format!(
            "{word}: {}/{}: {}\n",
            Untrusted(&path),
            Untrusted(&finding.place),
            Untrusted(&finding.what)
        ));
    }
    let events: usize = sessions.iter().map(|s| s.entries.len()).sum();
    let verdict = problems_found(count_problems(found));
    out.push_str(&format!(
        "{}: {}, {}: {verdict}\n",
        Untrusted(&path),
        counted(sessions.len(), "session", "sessions"),
        counted(events, "event", "events"),
    ));
    for what in not_checked {
        out.push_str(&format!("Not checked: {what}.\n"));
    }
    if found
        .iter()
        .any(|f| f.is_problem && layout::TABLES.contains(&f.place.as_str()))
    {
        out.push_str("Use --rebuild to derive the tables again.\n");
    }
    out
}

fn count_problems(found: &[Finding]) -> usize {
    found.iter().filter(|f| f.is_problem).count()
}

fn problems_found(problems: usize) -> String {
    match problems {
        0 => "no problems found".to_owned(),
        n => format!("{} found", counted(n, "problem", "problems")),
    }
}
