//! Opening the studies of a results folder; shared by the commands on it.

use super::failure::Kind;
use super::load::{self, Loaded};
use super::{Console, Failure};
use std::path::Path;
use study_base::diagnostic::{Fault, Findings};
use study_core::outcome::Moment;
use study_core::protocol::difference::{self, Change};
use study_core::protocol::file;
use study_core::protocol::question::MAX_TEXT_BYTES;
use study_core::store::{Finding, SessionData, StoreError, StudyFolder, layout, plain};

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        let kind = if error.is_request() {
            Kind::Input
        } else {
            Kind::Results
        };
        let failure = Self::new(kind, &error);
        match error.hint() {
            Some(hint) => failure.hint(hint),
            None => failure,
        }
    }
}

/// The studies of RESULTS, a results folder or the folder of one study in it.
pub(super) fn studies(path: &Path) -> Result<Vec<StudyFolder>, Failure> {
    // A link that leads nowhere is there, too.
    let is_study = |folder: &Path| folder.join(layout::MANIFEST).symlink_metadata().is_ok();
    if is_study(path) {
        return Ok(vec![StudyFolder::open(path)?]);
    }
    let failed = |e: &std::io::Error| {
        let why = match e.kind() {
            std::io::ErrorKind::NotADirectory => "a file, not a results folder".to_owned(),
            _ => plain(e),
        };
        Failure::results(format!("{}: {why}", path.display()))
    };
    let mut folders = Vec::new();
    for item in std::fs::read_dir(path).map_err(|e| failed(&e))? {
        let folder = item.map_err(|e| failed(&e))?.path();
        if is_study(&folder) {
            folders.push(folder);
        }
    }
    folders.sort();
    if folders.is_empty() {
        let none = format!("{}: contains no results of a study", path.display());
        return Err(Failure::results(none)
            .hint("RESULTS is a results folder, or the folder of one study in it"));
    }
    folders
        .iter()
        .map(|folder| Ok(StudyFolder::open(folder)?))
        .collect()
}

/// The only study of RESULTS.
pub(super) fn one_study(path: &Path) -> Result<StudyFolder, Failure> {
    let mut studies = studies(path)?;
    match (studies.pop(), studies.len()) {
        (Some(only), 0) => Ok(only),
        (_, others) => {
            let many = format!("{}: contains {} studies", path.display(), others + 1);
            Err(Failure::input(many).hint("give the folder of one of them"))
        }
    }
}

/// The newest frozen protocol of a study, with the VAF of its models.
pub(super) fn frozen(study: &StudyFolder) -> Result<Loaded, Failure> {
    frozen_version(study, study.version())
}

/// The same for any version.
pub(super) fn frozen_version(study: &StudyFolder, version: u32) -> Result<Loaded, Failure> {
    let file = layout::protocol(study.path(), version).join(layout::PROTOCOL);
    load::load_frozen(&file).map_err(|mut failure| {
        failure.kind = Kind::Results;
        failure
    })
}

/// What differs between the newest frozen protocol of a study and another.
pub(super) fn changes(study: &StudyFolder, loaded: &Loaded) -> Result<Vec<Change>, Failure> {
    Ok(difference::changes(&frozen(study)?.parts, &loaded.parts))
}

/// The failure to open or amend a study with a protocol. If the stimuli differ, each
/// difference is shown with its key and line.
pub(super) fn refused(error: StoreError, loaded: &Loaded) -> Failure {
    let StoreError::StimulusChanged { path, .. } = &error else {
        return error.into();
    };
    let study = StudyFolder::open(path).ok();
    let found = study.and_then(|study| changes(&study, loaded).ok());
    let bytes = loaded.files.first().map(|(_, bytes)| bytes.as_slice());
    let text = String::from_utf8_lossy(bytes.unwrap_or_default());
    let path = loaded.path.display().to_string();
    let spans = file::parse(&path, &text).spans;
    let mut findings = Findings::new(path, text);
    for change in found.unwrap_or_default().iter().filter(|c| c.fixed) {
        let fault = Fault::error(format!("{} cannot change while the study runs", change.key))
            .at(change.span(|place| spans.get(place)))
            .label(values(change));
        findings.faults.push(fault);
    }
    let mut failure = Failure::from(error);
    if !findings.faults.is_empty() {
        findings.sort();
        failure.findings = vec![findings];
    }
    failure
}

/// What a change replaces, in a few words.
pub(super) fn values(change: &Change) -> String {
    match (&change.old, &change.new) {
        (Some(old), Some(new)) if old == new => format!("{new} differs"),
        (Some(old), Some(new)) => format!("{old} → {new}"),
        (None, Some(new)) => format!("new: {new}"),
        (Some(old), None) => format!("removed: {old}"),
        (None, None) => String::new(),
    }
}

/// The problems of the journals and the frozen protocol of a study, as `study verify`
/// reports them; one sentence each.
pub(super) fn warnings(
    study: &StudyFolder,
    sessions: &[SessionData],
    newest: Option<&Loaded>,
) -> Result<Vec<String>, Failure> {
    let mut found = study.faults(sessions)?;
    found.extend(frozen_versions(study, newest));
    let path = study.path().display();
    Ok(found
        .iter()
        .map(|f| format!("{path}/{}: {}", f.place, f.what))
        .collect())
}

/// Reads each frozen protocol and compares its fingerprints with study.json. `newest`
/// is the newest version, if it has been read already.
pub(super) fn frozen_versions(study: &StudyFolder, newest: Option<&Loaded>) -> Vec<Finding> {
    let mut found = Vec::new();
    for version in &study.manifest().versions {
        let number = version.version;
        let folder = layout::protocol(study.path(), number);
        let is_link = folder.is_symlink();
        let path = folder.join(layout::PROTOCOL);
        let prints = match newest {
            Some(loaded) if number == study.version() => Ok(loaded.fingerprints.clone()),
            _ => load::load_frozen(&path).map(|loaded| loaded.fingerprints),
        };
        let what = match prints {
            Ok(_) if is_link => "a symbolic link in the place of a folder".to_owned(),
            Ok(prints) if prints == version.fingerprints => continue,
            Ok(_) => "its fingerprints differ from those in study.json".to_owned(),
            Err(_) => format!("it cannot be read; see `study check {}`", path.display()),
        };
        found.push(Finding {
            is_problem: true,
            place: format!("{}/{number}/{}", layout::PROTOCOLS, layout::PROTOCOL),
            what,
        });
    }
    found
}

/// Prints [`warnings`] on standard error.
pub(super) fn warn(study: &StudyFolder, warnings: &[String], console: &mut Console) {
    for warning in warnings {
        console.say(format!("warning: {warning}"));
    }
    if !warnings.is_empty() {
        let path = study.path().display();
        console.say(format!("  hint: `study verify {path}` lists all findings"));
    }
}

/// The failure to report, after everything was printed, if acknowledged records are
/// missing at the end of a journal.
pub(super) fn whole(study: &StudyFolder, sessions: &[SessionData]) -> Result<(), Failure> {
    let truncated = sessions.iter().filter(|s| s.truncated);
    let who: Vec<&str> = truncated.map(|s| s.participant.as_str()).collect();
    if who.is_empty() {
        return Ok(());
    }
    let path = study.path().display();
    let what = format!(
        "{path}: saved answers are missing: the journal of {} is truncated",
        who.join(", ")
    );
    Err(Failure::results(what).hint(format!(
        "restore the session's folder from the mirror or a copy; `study verify {path}` lists all findings"
    )))
}

/// Warns that the tables of a printed analysis could not be written.
pub(super) fn tables_unwritten(failure: &Failure, console: &mut Console) {
    console.say(format!(
        "warning: the tables could not be written: {}",
        failure.message
    ));
    console.say("  hint: `--out DIR` writes them elsewhere");
}

/// Writes the derived tables again.
pub(super) fn refresh(study: &StudyFolder, console: &mut Console) -> Result<(), Failure> {
    study.refresh(&frozen(study)?.protocol)?;
    if study.path().join(layout::ANALYSIS).exists() {
        console.say("analysis/ is out of date: run `study analyze` again");
    }
    Ok(())
}

/// The current time outside a session, where no monotonic clock is needed.
pub(super) fn now() -> Moment {
    Moment {
        wall: chrono::Local::now().fixed_offset(),
        mono_ns: 0,
    }
}

/// Checks a reason: neither empty nor too long.
pub(super) fn reason(given: &str) -> Result<&str, Failure> {
    if given.trim().is_empty() {
        Err(Failure::input("the reason is empty")
            .hint("give a reason in a few words; it is recorded"))
    } else if given.len() > MAX_TEXT_BYTES {
        let long = format!("the reason is longer than {MAX_TEXT_BYTES} bytes");
        Err(Failure::input(long))
    } else {
        Ok(given)
    }
}
