//! Opening the studies of a results folder; shared by the commands on it.

use super::failure::Kind;
use super::{Console, Failure};
use study_analysis::load::{self, FrozenError, LoadError, Loaded, RecordingError, Unplayable};
use study_analysis::study::{Difference, PoolError, StudyError};
use study_base::diagnostic::{Fault, Findings};
use study_base::text::Untrusted;
use study_plan::protocol::answer::MAX_TEXT_BYTES;
use study_plan::protocol::difference::Change;
use study_plan::protocol::file;
use study_session::outcome::Moment;
use study_session::outcome::ratings::Origin;
use study_session::store::{SessionData, StoreError, StudyFolder, layout};

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

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        Self::faults(error.0)
    }
}

impl From<FrozenError> for Failure {
    fn from(error: FrozenError) -> Self {
        Self {
            kind: Kind::Results,
            ..error.0.into()
        }
    }
}

impl From<Unplayable> for Failure {
    fn from(error: Unplayable) -> Self {
        Self::input(&error).hint(error.hint())
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        Self::input(error)
    }
}

impl From<StudyError> for Failure {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Store(error) => error.into(),
            StudyError::Frozen(error) => error.into(),
            StudyError::NotNumeric { ref numeric, .. } => {
                Self::input(&error).hint(format!("questions with numeric answers: {numeric}"))
            }
            StudyError::OnlyPilots(ref path) => Self::input(&error).hint(format!(
                "`study analyze {} --include pilot` analyzes them",
                path.display()
            )),
            StudyError::Preregistration { .. } => Self::results(error)
                .hint("`study verify` says whether it was changed since the study began"),
            StudyError::Table(_) | StudyError::Id(_) => Self::input(error),
        }
    }
}

impl From<PoolError> for Failure {
    fn from(error: PoolError) -> Self {
        let hint = match &error {
            PoolError::Table(path) => {
                return Self::input(format!(
                    "{}: --pool compares the fingerprints of studies, and a table has none",
                    Untrusted(&path.display().to_string())
                ))
                .hint("name the results folder of each site");
            }
            PoolError::TooFew => {
                return Self::usage("--pool takes two sites or more")
                    .hint("study analyze --pool SITE-A SITE-B");
            }
            PoolError::Several { first, .. } => format!(
                "name one, such as {}",
                Untrusted(&first.display().to_string())
            ),
            PoolError::Differ { what, .. } => match what {
                Difference::Stimuli => {
                    "only sites with the same stimulus fingerprint can be pooled; analyze them apart"
                }
                Difference::Rules => {
                    "amend one of them, so that one set of rules holds for both sites"
                }
            }
            .to_owned(),
            PoolError::SameSession { .. } => {
                "a site is counted once; was a folder copied?".to_owned()
            }
            PoolError::NotPooled { .. } => {
                "analyze each site; `--question` names a rating of the study, if it has one"
                    .to_owned()
            }
            PoolError::Mixed { other, .. } => {
                let flag = match other.1 {
                    Origin::Simulated => "simulated",
                    _ => "pilot",
                };
                format!("--include {flag} mixes them, under a banner")
            }
            PoolError::OnlyPilots => "--include pilot analyzes them".to_owned(),
            PoolError::Study(_) | PoolError::Twice(_) | PoolError::Empty(_) => {
                return match error {
                    PoolError::Study(error) => error.into(),
                    other => Self::input(other),
                };
            }
        };
        Self::input(error).hint(hint)
    }
}

/// The failure to open or amend a study with a protocol. If the stimuli differ, each
/// difference is shown with its key and line.
pub(super) fn refused(error: StoreError, loaded: &Loaded) -> Failure {
    let StoreError::StimulusChanged { path, .. } = &error else {
        return error.into();
    };
    let study = StudyFolder::open(path).ok();
    let found = study.and_then(|study| load::changes(&study, loaded).ok());
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

/// Prints [`study_analysis::load::damage`] on standard error.
pub(super) fn warn(study: &StudyFolder, warnings: &[String], console: &mut Console) {
    warn_of(&study.path().display().to_string(), warnings, console);
}

/// The same of a study by its folder.
pub(super) fn warn_of(folder: &str, warnings: &[String], console: &mut Console) {
    for warning in warnings {
        console.say(format!("warning: {warning}"));
    }
    if !warnings.is_empty() {
        console.say(format!(
            "  hint: `study verify {folder}` lists all findings"
        ));
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
    study.refresh(&load::frozen(study)?.protocol)?;
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
