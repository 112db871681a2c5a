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

/// A place for the unsaved events of a session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    folder: PathBuf,
    /// Whether it is in memory: a computer whose only disk dies has no other.
    volatile: bool,
}

impl Place {
    fn new(folder: PathBuf, volatile: bool) -> Self {
        Self { folder, volatile }
    }
}

/// Where the events may be kept: the home folder survives a restart, the folder for temporary
/// files may be on another disk, and those of Linux in memory are on none.
pub(super) fn places() -> Vec<Place> {
    let on_disk = std::env::home_dir()
        .into_iter()
        .chain([std::env::temp_dir()]);
    let of_user = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let in_memory = of_user.into_iter().chain([PathBuf::from("/dev/shm")]);
    let on_disk = on_disk.map(|folder| Place::new(folder, false));
    let all = on_disk.chain(in_memory.map(|folder| Place::new(folder, true)));
    all.filter(|place| place.folder.is_absolute()).collect()
}

/// Where a copy of the events is.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Kept {
    path: PathBuf,
    volatile: bool,
}

/// Writes the events to a new file in the first of `places` that takes it, and returns
/// when they are on the medium: where it is, or why each place did not take it.
pub(super) fn keep(
    unsaved: &Unsaved,
    participant: &str,
    results: &Path,
    places: &[Place],
) -> Result<Kept, NoPlace> {
    let text = content(unsaved, participant, results);
    let mut refusals = Vec::new();
    for Place { folder, volatile } in places {
        match write(folder, &name(unsaved, participant, results), &text) {
            Ok(path) => {
                return Ok(Kept {
                    path,
                    volatile: *volatile,
                });
            }
            Err(e) => refusals.push(format!("{}: {}", folder.display(), plain(&e))),
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
    kept: &Result<Kept, NoPlace>,
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
        Ok(Kept { path, volatile }) => {
            let lost = match volatile {
                true => " (in memory: copy it before the computer is turned off)",
                false => "",
            };
            let path = path.display();
            format!("a copy of what is not saved is in {path}{lost}; {next}: {resume}")
        }
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
        let none = Place::new(home.path().join("none"), false);
        let some = Place::new(home.path().to_owned(), false);
        let results = Path::new("results/x");
        let first = keep(&unsaved(), "P01", results, &[none.clone(), some.clone()]).unwrap();
        let second = keep(&unsaved(), "P01", results, &[some]).unwrap();
        assert!(first.path.starts_with(home.path()));
        let text = std::fs::read_to_string(&first.path).unwrap();
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
        assert!(
            words.starts_with(&none.folder.display().to_string()),
            "{words}"
        );
        let failure = failure(&unsaved(), &refused, results, "study run x");
        assert_eq!(failure.exit_code(), 4);
        let hint = failure.hint.unwrap();
        assert!(hint.contains("no copy could be written"), "{hint}");
    }

    /// A computer whose only disk dies has no other place, and a copy there ends with it.
    #[cfg(unix)]
    #[test]
    fn the_last_place_is_in_memory_and_the_message_says_so() {
        let places = places();
        let first_in_memory = places.iter().position(|place| place.volatile).unwrap();
        assert!(first_in_memory > 0 && places[first_in_memory..].iter().all(|p| p.volatile));
        let home = tempfile::tempdir().unwrap();
        let results = Path::new("results/x");
        for volatile in [false, true] {
            let places = [
                Place::new(home.path().join("none"), false),
                Place::new(home.path().to_owned(), volatile),
            ];
            let kept = keep(&unsaved(), "P01", results, &places);
            let hint = failure(&unsaved(), &kept, results, "study run x")
                .hint
                .unwrap();
            assert!(hint.contains("study-unsaved-x-P01-"), "{hint}");
            assert_eq!(
                hint.contains("before the computer is turned off"),
                volatile,
                "{hint}"
            );
        }
    }

    #[cfg(unix)]
    #[test]
    fn only_the_owner_can_read_the_copy() {
        use std::os::unix::fs::PermissionsExt as _;
        let home = tempfile::tempdir().unwrap();
        let places = [Place::new(home.path().to_owned(), false)];
        let kept = keep(&unsaved(), "P01", Path::new("results/x"), &places).unwrap();
        let mode = std::fs::metadata(kept.path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }
}
