//! What a session could not save is written to a file elsewhere, and named.

use crate::cli::Failure;
use serde::Serialize;
use std::path::{Path, PathBuf};
use study_session::outcome::{Event, Moment};
use study_session::session::Unsaved;
use study_session::store::disk::{Disk as _, RealDisk};
use study_session::store::plain;

/// Why no place took the file.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct NoPlace(String);

/// The file's first line.
#[derive(Serialize)]
struct Head<'a> {
    format: &'static str,
    results: &'a str,
    participant: &'a str,
    session: Option<u32>,
    why: Option<&'a str>,
}

/// One event, with the keys of a journal.
#[derive(Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    at: &'a Moment,
    #[serde(flatten)]
    event: &'a Event,
}

/// Where the unsaved events of a session may be kept: the home folder survives a
/// restart, the folder for temporary files may be on another disk.
pub(super) fn places() -> Vec<PathBuf> {
    let home = std::env::home_dir().filter(|home| home.is_absolute());
    home.into_iter().chain([std::env::temp_dir()]).collect()
}

/// Writes the events to a new file in the first of `places` that takes it, and returns
/// when they are on the medium: its path, or why each place did not take it.
pub(super) fn keep(
    unsaved: &Unsaved,
    participant: &str,
    results: &Path,
    places: &[PathBuf],
) -> Result<PathBuf, NoPlace> {
    let text = content(unsaved, participant, results);
    let mut refusals = Vec::new();
    for place in places {
        match write(place, &name(unsaved, participant, results), &text) {
            Ok(path) => return Ok(path),
            Err(e) => refusals.push(format!("{}: {}", place.display(), plain(&e))),
        }
    }
    Err(NoPlace(refusals.join("; ")))
}

/// Such as `study-unsaved-turn-signal-P01-20261122-101500`.
fn name(unsaved: &Unsaved, participant: &str, results: &Path) -> String {
    let study = results.file_name().unwrap_or_default().to_string_lossy();
    let last = unsaved.events.last();
    let when = last.map(|(at, _)| at.wall.format("-%Y%m%d-%H%M%S").to_string());
    let when = when.unwrap_or_default();
    format!("study-unsaved-{study}-{participant}{when}")
}

fn content(unsaved: &Unsaved, participant: &str, results: &Path) -> String {
    let head = Head {
        format: "study-unsaved/1",
        results: &results.display().to_string(),
        participant,
        session: unsaved.session,
        why: unsaved.why.as_deref(),
    };
    let lines = unsaved.events.iter().map(|(at, event)| Line { at, event });
    let lines = lines.map(|line| serde_json::to_string(&line));
    let all = std::iter::once(serde_json::to_string(&head)).chain(lines);
    // An event that cannot be serialized is named on the terminal.
    all.flatten().map(|line| line + "\n").collect()
}

fn write(folder: &Path, name: &str, text: &str) -> std::io::Result<PathBuf> {
    let disk = RealDisk;
    for number in 1.. {
        let suffix = match number {
            1 => String::new(),
            n => format!("-{n}"),
        };
        let path = folder.join(format!("{name}{suffix}.jsonl"));
        let mut file = match disk.create(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => continue,
            created => created?,
        };
        file.write_all(text.as_bytes())?;
        file.sync()?;
        disk.sync_folder(folder)?;
        return Ok(path);
    }
    Err(std::io::ErrorKind::AlreadyExists.into())
}

/// The message at the end of a session: what is not saved, why, and where it is kept.
pub(super) fn failure(
    unsaved: &Unsaved,
    kept: &Result<PathBuf, NoPlace>,
    folder: &Path,
    resume: &str,
) -> Failure {
    let why = match &unsaved.why {
        Some(why) => format!("saving failed: {why}"),
        None => "the disk did not answer".to_owned(),
    };
    let message = format!(
        "NOT SAVED in {}: {}; {why}",
        folder.display(),
        unsaved.what.join("; ")
    );
    let next = "repair the disk, then resume the session and enter what is asked again";
    let hint = match kept {
        Ok(path) => format!(
            "a copy of what is not saved is in {}; {next}: {resume}",
            path.display()
        ),
        Err(refusals) => format!(
            "no copy could be written ({refusals}): write down the lines above; {next}: {resume}"
        ),
    };
    Failure::results(message).hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runner::clock::{Clock as _, RealClock};

    fn unsaved() -> Unsaved {
        let at = RealClock::default().now();
        Unsaved {
            session: Some(2),
            why: Some("no".to_owned()),
            what: vec!["remark: é\u{1b}".to_owned()],
            events: vec![(at, Event::InstructionsRead), (at, Event::Paused)],
        }
    }

    #[test]
    fn the_first_place_that_takes_the_events_gets_them() {
        let home = tempfile::tempdir().unwrap();
        let (none, some) = (home.path().join("none"), home.path().to_owned());
        let results = Path::new("results/x");
        let first = keep(&unsaved(), "P01", results, &[none.clone(), some.clone()]).unwrap();
        let second = keep(&unsaved(), "P01", results, &[some]).unwrap();
        assert!(first.starts_with(home.path()));
        let text = std::fs::read_to_string(&first).unwrap();
        let lines: Vec<serde_json::Value> = text
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(lines[0]["format"], "study-unsaved/1");
        assert_eq!(lines[0]["session"], 2);
        assert_eq!(lines[1]["event"], "instructions_read");
        assert_eq!(lines[2]["event"], "paused");
        assert!(lines[2]["wall"].is_string() && lines.len() == 3);
        assert_ne!(first, second, "a file is never written twice");
        let refused = keep(&unsaved(), "P01", results, std::slice::from_ref(&none));
        let words = refused.as_ref().unwrap_err().to_string();
        assert!(words.starts_with(&none.display().to_string()), "{words}");
        let failure = failure(&unsaved(), &refused, results, "study run x");
        assert_eq!(failure.exit_code(), 4);
        let hint = failure.hint.unwrap();
        assert!(hint.contains("no copy could be written"), "{hint}");
    }

    #[cfg(unix)]
    #[test]
    fn only_the_owner_can_read_the_copy() {
        use std::os::unix::fs::PermissionsExt as _;
        let home = tempfile::tempdir().unwrap();
        let places = [home.path().to_owned()];
        let path = keep(&unsaved(), "P01", Path::new("results/x"), &places).unwrap();
        let mode = std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }
}
