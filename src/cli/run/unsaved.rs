//! What a session could not save is written to a file elsewhere, and named.

use crate::cli::Failure;
use serde::Serialize;
use std::path::{Path, PathBuf};
use study_session::outcome::{Event, Moment};
use study_session::session::Unsaved;
use study_session::store::disk::{Disk as _, RealDisk};
use study_session::store::{layout, plain};

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

/// Where a copy is.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Kept {
    path: PathBuf,
    volatile: bool,
}

impl Kept {
    fn words(&self) -> String {
        let lost = match self.volatile {
            true => " (in memory: copy it before the computer is turned off)",
            false => "",
        };
        format!("{}{lost}", self.path.display())
    }
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
    let name = name(unsaved, participant, results);
    take(places, (&name, "jsonl"), &text)
}

/// The same of the participant's copy of the consent document, in a file of its own: what was typed as a signature is in
/// none with answers. `None` if it is on disk, or there is none.
pub(super) fn keep_copy(
    unsaved: &Unsaved,
    participant: &str,
    results: &Path,
    places: &[Place],
) -> Option<Result<Kept, NoPlace>> {
    let copy = unsaved.copy.as_ref()?;
    let name = format!("{}-consent", name(unsaved, participant, results));
    Some(take(places, (&name, "txt"), copy))
}

/// Writes a text to a new file in the first of the places that takes it.
fn take(places: &[Place], (name, extension): (&str, &str), text: &str) -> Result<Kept, NoPlace> {
    let mut refusals = Vec::new();
    for Place { folder, volatile } in places {
        match write(folder, (name, extension), text) {
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

fn write(folder: &Path, (name, extension): (&str, &str), text: &str) -> std::io::Result<PathBuf> {
    let disk = RealDisk;
    for number in 1.. {
        let suffix = match number {
            1 => String::new(),
            n => format!("-{n}"),
        };
        let path = folder.join(format!("{name}{suffix}.{extension}"));
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
    copy: Option<&Result<Kept, NoPlace>>,
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
        Ok(kept) => format!(
            "a copy of what is not saved is in {}; {next}: {resume}",
            kept.words()
        ),
        Err(refusals) => format!(
            "no copy could be written ({refusals}): write down the lines above; {next}: {resume}"
        ),
    };
    let hint = match copy {
        None => hint,
        Some(Ok(kept)) => format!(
            "{hint}; the participant's copy of the consent document is in {}: keep it apart from the answers, and delete it \
             once the folder of the session has its {}",
            kept.words(),
            layout::CONSENT
        ),
        Some(Err(refusals)) => format!(
            "{hint}; the participant's copy of the consent document is lost ({refusals}): consent is asked again"
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
            copy: None,
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
        let failure = failure(&unsaved(), &refused, None, results, "study run x");
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
            let hint = failure(&unsaved(), &kept, None, results, "study run x")
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

    /// What was typed as a signature is in no file with answers, and is not printed.
    #[test]
    fn the_copy_of_the_consent_document_is_kept_apart_or_said_to_be_lost() {
        let home = tempfile::tempdir().unwrap();
        let results = Path::new("results/x");
        let signed = Unsaved {
            copy: Some("Information\n\nQXJ\n".to_owned()),
            ..unsaved()
        };
        assert!(keep_copy(&unsaved(), "P01", results, &places()).is_none());
        let some = [Place::new(home.path().to_owned(), false)];
        let none = [Place::new(home.path().join("none"), false)];
        let kept = keep(&signed, "P01", results, &some);
        let copy = keep_copy(&signed, "P01", results, &some).unwrap();
        let path = |kept: &Result<Kept, NoPlace>| kept.as_ref().unwrap().path.clone();
        let read = |path: PathBuf| std::fs::read_to_string(path).unwrap();
        assert_eq!(read(path(&copy)), "Information\n\nQXJ\n");
        assert!(!read(path(&kept)).contains("QXJ"));
        let said = |copy: &Result<Kept, NoPlace>| {
            let failure = failure(&signed, &kept, Some(copy), results, "study run x");
            let hint = failure.hint.unwrap();
            assert!(!format!("{} {hint}", failure.message).contains("QXJ"));
            hint
        };
        let hint = said(&copy);
        let name = path(&copy).display().to_string();
        assert!(
            name.ends_with("-consent.txt") && hint.contains(&name),
            "{hint}"
        );
        let lost = keep_copy(&signed, "P01", results, &none).unwrap();
        let hint = said(&lost);
        assert!(hint.contains("consent document is lost"), "{hint}");
        assert!(hint.contains("consent is asked again"), "{hint}");
    }

    #[cfg(unix)]
    #[test]
    fn only_the_owner_can_read_the_copy() {
        use std::os::unix::fs::PermissionsExt as _;
        let home = tempfile::tempdir().unwrap();
        let places = [Place::new(home.path().to_owned(), false)];
        let signed = Unsaved {
            copy: Some("QXJ".to_owned()),
            ..unsaved()
        };
        let results = Path::new("results/x");
        let kept = keep(&signed, "P01", results, &places).unwrap();
        let copy = keep_copy(&signed, "P01", results, &places).unwrap();
        for path in [kept.path, copy.unwrap().path] {
            let mode = std::fs::metadata(path).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600);
        }
    }
}
