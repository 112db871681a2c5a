//! What the commands on a results folder share.

use super::failure::Kind;
use super::load::{self, Loaded};
use super::{Console, Failure};
use crate::outcome::Moment;
use crate::protocol::question::MAX_TEXT_BYTES;
use crate::store::{StoreError, StudyFolder, layout};
use std::path::Path;

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

/// The studies of RESULTS: a results folder, or one study in it.
pub(super) fn studies(path: &Path) -> Result<Vec<StudyFolder>, Failure> {
    if path.join(layout::MANIFEST).exists() {
        return Ok(vec![StudyFolder::open(path)?]);
    }
    let failed = |e: &std::io::Error| Failure::results(format!("{}: {e}", path.display()));
    let mut folders = Vec::new();
    for item in std::fs::read_dir(path).map_err(|e| failed(&e))? {
        let folder = item.map_err(|e| failed(&e))?.path();
        if folder.join(layout::MANIFEST).exists() {
            folders.push(folder);
        }
    }
    folders.sort();
    if folders.is_empty() {
        let none = format!("{}: no results of a study there", path.display());
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
            let many = format!("{}: {} studies are there", path.display(), others + 1);
            Err(Failure::input(many).hint("name the folder of one of them"))
        }
    }
}

/// The newest frozen protocol of a study, with the VAF of its models.
pub(super) fn frozen(study: &StudyFolder) -> Result<Loaded, Failure> {
    load::load_frozen(&study.frozen_protocol()).map_err(|mut failure| {
        failure.kind = Kind::Results;
        failure
    })
}

/// Writes the derived tables again.
pub(super) fn refresh(study: &StudyFolder, console: &mut Console) -> Result<(), Failure> {
    study.refresh(&frozen(study)?.protocol)?;
    if study.path().join("analysis").exists() {
        console.say("analysis/ still holds the results from before: run `study analyze` again");
    }
    Ok(())
}

/// Now, outside a session: there is no monotonic clock to compare with.
pub(super) fn now() -> Moment {
    Moment {
        wall: chrono::Local::now().fixed_offset(),
        mono_ns: 0,
    }
}

/// A reason that says something and is not a book.
pub(super) fn reason(given: &str) -> Result<&str, Failure> {
    if given.trim().is_empty() {
        Err(Failure::input("--reason is empty").hint("say why in a few words; it is kept"))
    } else if given.len() > MAX_TEXT_BYTES {
        let long = format!("--reason is longer than {MAX_TEXT_BYTES} bytes");
        Err(Failure::input(long))
    } else {
        Ok(given)
    }
}
