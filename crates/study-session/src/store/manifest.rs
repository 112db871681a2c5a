//! `study.json`: the study and every version of its protocol.
//!
//! A version exists when `study.json` names it; its files are on the medium before.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use super::layout;
use super::{atomic, sealed};
use crate::outcome::Moment;
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use study_base::hex::sha256;
use study_plan::protocol::fingerprint::Fingerprints;

/// Format of the folder that this program writes and reads.
pub const FORMAT: &str = "study-results/1";

/// The content of `study.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: String,
    /// Study id.
    pub study: String,
    /// Version of the program that created the folder.
    pub tool_version: String,
    /// When the folder was created.
    pub created: DateTime<FixedOffset>,
    /// Versions of the protocol, from 1, without gaps.
    pub versions: Vec<Version>,
    /// Whether wrong playbacks fail since the first session; not in studies of earlier
    /// releases, which only mark them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub judges_rendering: bool,
    /// Whether the file agreed with its checksum when it was read; `None` for one of an
    /// earlier release, which has none.
    #[serde(skip)]
    pub(super) intact: Option<bool>,
}

/// A frozen version of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Version {
    /// From 1.
    pub version: u32,
    /// When it was frozen.
    pub at: DateTime<FixedOffset>,
    /// Reason of the amendment; empty for the first version.
    pub reason: String,
    /// Version of the program that froze it.
    pub tool_version: String,
    /// Fingerprints of stimuli, wording and analysis.
    pub fingerprints: Fingerprints,
    /// Path in the frozen folder → SHA-256 of the file.
    pub files: BTreeMap<String, String>,
}

/// What is wrong with a file that does not agree with its own checksum.
pub(super) const CHECKSUM: &str = "its checksum does not match; restore it from a copy";

#[derive(Deserialize)]
struct FormatOnly {
    format: String,
}

impl Manifest {
    /// The manifest of a new study.
    pub(super) fn new(study: &str, first: Version, at: Moment) -> Self {
        Self {
            format: FORMAT.to_owned(),
            study: study.to_owned(),
            tool_version: env!("CARGO_PKG_VERSION").to_owned(),
            created: at.wall,
            versions: vec![first],
            judges_rendering: true,
            intact: Some(true),
        }
    }

    /// Whether this is the other manifest, possibly with later versions.
    pub(super) fn continues(&self, other: &Self) -> bool {
        (&self.study, self.created) == (&other.study, other.created)
            && self.versions.starts_with(&other.versions)
    }

    /// The newest version of the protocol.
    pub fn newest(&self) -> &Version {
        self.versions
            .last()
            .expect("reading refuses a manifest without versions")
    }

    /// Reads the manifest of a study's folder.
    ///
    /// # Errors
    /// [`StoreError`] if there is none, or it is of a newer version or damaged.
    pub(super) fn read(disk: &dyn Disk, study: &Path) -> Result<Self, StoreError> {
        let path = study.join(layout::MANIFEST);
        let bytes = match disk.read(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Err(StoreError::NoStudy {
                    path: study.to_owned(),
                });
            }
            read => read.at(&path)?,
        };
        let damaged = |what: String| StoreError::Damaged {
            path: path.clone(),
            what,
        };
        let FormatOnly { format } =
            serde_json::from_slice(&bytes).map_err(|e| damaged(e.to_string()))?;
        if format != FORMAT {
            return Err(StoreError::Newer {
                path,
                found: format,
            });
        }
        let mut manifest: Self =
            serde_json::from_slice(&bytes).map_err(|e| damaged(e.to_string()))?;
        // No release that judges the rendering wrote a manifest without a checksum.
        manifest.intact = sealed::is_intact(&bytes).or(manifest.judges_rendering.then_some(false));
        let numbered = (1..).zip(&manifest.versions).all(|(n, v)| v.version == n);
        if manifest.versions.is_empty() || !numbered {
            return Err(damaged("the versions are not numbered 1, 2, …".to_owned()));
        }
        let mut names = manifest.versions.iter().flat_map(|v| v.files.keys());
        if let Some(name) = names.find(|name| !is_inside(name)) {
            return Err(StoreError::OutsideFolder { name: name.clone() });
        }
        Ok(manifest)
    }

    /// Replaces the manifest of a study's folder.
    pub(super) fn write(&self, disk: &dyn Disk, study: &Path) -> Result<(), StoreError> {
        let path = study.join(layout::MANIFEST);
        atomic::replace(disk, &path, &sealed::seal(self, &path)?)
    }

    /// As [`Manifest::read`], for a study that is to be changed: its checksum must match.
    pub(super) fn read_intact(disk: &dyn Disk, study: &Path) -> Result<Self, StoreError> {
        let manifest = Self::read(disk, study)?;
        if manifest.intact == Some(false) {
            return Err(StoreError::Damaged {
                path: study.join(layout::MANIFEST),
                what: CHECKSUM.to_owned(),
            });
        }
        Ok(manifest)
    }
}

/// Writes the files of a version to its folder; the manifest must name it afterwards.
/// Remains of an interrupted call are replaced.
pub(super) fn freeze(
    disk: &dyn Disk,
    study: &Path,
    version: u32,
    frozen: &super::Frozen<'_>,
    reason: &str,
    at: Moment,
) -> Result<Version, StoreError> {
    if let Some((name, _)) = frozen.files.iter().find(|(name, _)| !is_inside(name)) {
        return Err(StoreError::OutsideFolder { name: name.clone() });
    }
    atomic::folder(disk, &study.join(layout::PROTOCOLS))?;
    let folder = layout::protocol(study, version);
    atomic::folder(disk, &folder)?;
    let mut files = BTreeMap::new();
    for (name, bytes) in frozen.files {
        let mut at = folder.clone();
        let mut parts = name.split('/').peekable();
        while let Some(part) = parts.next() {
            at.push(part);
            if parts.peek().is_some() {
                atomic::folder(disk, &at)?;
            }
        }
        atomic::replace(disk, &at, bytes)?;
        files.insert(name.clone(), sha256(bytes));
    }
    Ok(Version {
        version,
        at: at.wall,
        reason: reason.to_owned(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        fingerprints: frozen.fingerprints.clone(),
        files,
    })
}

/// Whether a path separated by `/` stays in its folder.
fn is_inside(name: &str) -> bool {
    !name.contains(['\\', '\0'])
        && name
            .split('/')
            .all(|part| !part.is_empty() && part != "." && part != "..")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_leave_the_frozen_folder() {
        for bad in ["../x", "/etc/x", "a/../../x", "a//b", "", "a\\b", "./a"] {
            assert!(!is_inside(bad), "{bad}");
        }
        assert!(is_inside("protocol.toml"));
        assert!(is_inside("models/lambda-0.9995.toml"));
    }
}
