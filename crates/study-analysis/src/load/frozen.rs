//! The protocols that a study froze.

use super::{LoadError, Loaded, load_begun, load_frozen};
use study_plan::protocol::difference::{self, Change};
use study_session::store::{Finding, SessionData, StoreError, StudyFolder, layout};

/// A frozen protocol that cannot be read: the results folder is damaged.
#[derive(Debug, Clone, thiserror::Error)]
#[error(transparent)]
pub struct FrozenError(#[from] pub LoadError);

/// The newest frozen protocol of a study, with the VAF of its models.
///
/// # Errors
/// [`FrozenError`].
pub fn frozen(study: &StudyFolder) -> Result<Loaded, FrozenError> {
    frozen_version(study, study.version())
}

/// The same for any version.
///
/// # Errors
/// [`FrozenError`].
pub fn frozen_version(study: &StudyFolder, version: u32) -> Result<Loaded, FrozenError> {
    let file = layout::protocol(study.path(), version).join(layout::PROTOCOL);
    let mut versions = study.manifest().versions.iter();
    Ok(match versions.find(|known| known.version == version) {
        Some(known) => load_begun(&file, &known.fingerprints)?,
        None => load_frozen(&file)?,
    })
}

/// What differs between the newest frozen protocol of a study and another.
///
/// # Errors
/// [`FrozenError`].
pub fn changes(study: &StudyFolder, loaded: &Loaded) -> Result<Vec<Change>, FrozenError> {
    Ok(difference::changes(&frozen(study)?.parts, &loaded.parts))
}

/// The problems of the journals and the frozen protocols of a study, as `study verify`
/// reports them; one sentence each. `newest` is the newest protocol, if it has been read.
///
/// # Errors
/// [`StoreError`] if the folder cannot be read.
pub fn damage(
    study: &StudyFolder,
    sessions: &[SessionData],
    newest: Option<&Loaded>,
) -> Result<Vec<String>, StoreError> {
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
pub fn frozen_versions(study: &StudyFolder, newest: Option<&Loaded>) -> Vec<Finding> {
    let mut found = Vec::new();
    for version in &study.manifest().versions {
        let number = version.version;
        let folder = layout::protocol(study.path(), number);
        let is_link = folder.is_symlink();
        let path = folder.join(layout::PROTOCOL);
        let prints = match newest {
            Some(loaded) if number == study.version() => Ok(loaded.fingerprints.clone()),
            _ => load_begun(&path, &version.fingerprints).map(|loaded| loaded.fingerprints),
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
