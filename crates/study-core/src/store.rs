//! The results folder.
//!
//! `results/<study id>` contains the frozen protocol, one folder for each session
//! with its journal and telemetry, and tables derived from the journals. Only the
//! journals and the protocol matter: the tables can be derived again from them.
//! `docs/results.md` describes each file.
//!
//! Invariants: [`Journal::append`] returns only when the event is on the medium.
//! A journal is only appended to; an incomplete last line is copied before it is cut
//! off, and a damaged line stays where it is. A session's folder is locked by one
//! process at a time, and a row belongs to one participant.
//!
//! Every change goes through [`disk::Disk`], so that tests can make each call fail.

pub mod disk;
pub mod journal_record;
pub mod layout;
pub mod manifest;
pub mod replay;
mod reveals;

mod atomic;
mod derive;
mod error;
mod journal;
mod ledger;
mod missing_sessions;
mod participant;
mod session_folder;
mod session_lock;
mod sessions;
mod tables;
mod telemetry;
mod tombstone;
mod verify;

pub use derive::{Derived, participants};
pub use error::{StoreError, plain};
pub use journal::Journal;
pub use ledger::{ClaimRequest, Claimed, SeatKind, next_row};
pub use manifest::Manifest;
pub use participant::{StateChange, StateRequest};
pub use replay::{Damage, DamageKind};
pub use session_folder::SessionFolder;
pub use session_lock::RESERVE_BYTES;
pub use sessions::SessionData;
pub use telemetry::TelemetryWriter;
pub use tombstone::Tombstone;
pub use verify::Finding;

use crate::outcome::Moment;
use crate::protocol::Protocol;
use crate::protocol::fingerprint::Fingerprints;
use disk::{Disk, Lock, RealDisk};
use error::At as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A protocol with the content of all its files, to be copied into the results.
#[derive(Debug, Clone, Copy)]
pub struct Frozen<'a> {
    /// The protocol.
    pub protocol: &'a Protocol,
    /// Paths relative to the protocol's folder, separated by `/`, and bytes; first
    /// `protocol.toml`.
    pub files: &'a [(String, Vec<u8>)],
    /// Fingerprints of these files.
    pub fingerprints: &'a Fingerprints,
}

/// The results folder of one study.
#[derive(Debug, Clone)]
pub struct StudyFolder {
    disk: Arc<dyn Disk>,
    path: PathBuf,
    manifest: Manifest,
}

/// Number of attempts to lock a study and the pause between two of them.
const LOCK_TRIES: u32 = 1500;
const LOCK_PAUSE: Duration = Duration::from_millis(20);

impl StudyFolder {
    /// Opens the folder of a protocol's study in `results`, or creates it.
    ///
    /// # Errors
    /// [`StoreError`] if the protocol has other stimuli than the study, or another
    /// wording or analysis without an amendment; for a newer format; or the disk's.
    pub fn open_or_create(
        results: &Path,
        frozen: &Frozen<'_>,
        at: Moment,
    ) -> Result<Self, StoreError> {
        Self::open_or_create_on(Arc::new(RealDisk), results, frozen, at)
    }

    /// The same on the given disk.
    ///
    /// # Errors
    /// As [`StudyFolder::open_or_create`].
    pub fn open_or_create_on(
        disk: Arc<dyn Disk>,
        results: &Path,
        frozen: &Frozen<'_>,
        at: Moment,
    ) -> Result<Self, StoreError> {
        let study = &frozen.protocol.study.id;
        let path = results.join(study);
        for folder in results
            .ancestors()
            .filter(|a| !a.as_os_str().is_empty())
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
            .chain([path.as_path()])
        {
            let known = disk.list(folder);
            if known.is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound) {
                atomic::folder(disk.as_ref(), folder)?;
            }
        }
        let lock = lock_study(disk.as_ref(), &path)?;
        let manifest = match Manifest::read(disk.as_ref(), &path) {
            Ok(manifest) => {
                check_unchanged(&path, &manifest, frozen)?;
                manifest
            }
            Err(StoreError::NoStudy { .. }) => {
                check_new(disk.as_ref(), &path)?;
                let first = manifest::freeze(disk.as_ref(), &path, 1, frozen, "", at)?;
                let manifest = Manifest::new(study, first, at);
                manifest.write(disk.as_ref(), &path)?;
                manifest
            }
            Err(e) => return Err(e),
        };
        drop(lock);
        Ok(Self {
            disk,
            path,
            manifest,
        })
    }

    /// Opens the folder of an existing study.
    ///
    /// # Errors
    /// [`StoreError`] if there is no study, or for a newer format or damage.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Self::open_on(Arc::new(RealDisk), path)
    }

    /// The same on the given disk.
    ///
    /// # Errors
    /// As [`StudyFolder::open`].
    pub fn open_on(disk: Arc<dyn Disk>, path: &Path) -> Result<Self, StoreError> {
        let manifest = Manifest::read(disk.as_ref(), path)?;
        Ok(Self {
            disk,
            path: path.to_owned(),
            manifest,
        })
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// `study.json` as it was when the folder was opened.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The newest version of the protocol.
    pub fn version(&self) -> u32 {
        self.manifest.newest().version
    }

    /// Freezes a new version of wording or analysis; returns its number.
    ///
    /// # Errors
    /// [`StoreError`] for other stimuli, another study or no change; or the disk's.
    pub fn amend(
        &mut self,
        frozen: &Frozen<'_>,
        reason: &str,
        at: Moment,
    ) -> Result<u32, StoreError> {
        let _lock = self.lock()?;
        let mut manifest = Manifest::read(self.disk.as_ref(), &self.path)?;
        let newest = manifest.newest();
        let version = newest.version;
        if manifest.study != frozen.protocol.study.id
            || newest.fingerprints.stimulus != frozen.fingerprints.stimulus
        {
            return Err(StoreError::StimulusChanged {
                path: self.path.clone(),
                study: manifest.study,
            });
        }
        if newest.fingerprints == *frozen.fingerprints {
            return Err(StoreError::NothingToAmend {
                path: self.path.clone(),
                version,
            });
        }
        let disk = self.disk.as_ref();
        let next = manifest::freeze(disk, &self.path, version + 1, frozen, reason, at)?;
        manifest.versions.push(next);
        manifest.write(disk, &self.path)?;
        self.manifest = manifest;
        Ok(version + 1)
    }

    /// Prevents other processes from claiming, amending and deriving.
    fn lock(&self) -> Result<Lock, StoreError> {
        lock_study(self.disk.as_ref(), &self.path)
    }
}

/// Waits for the lock of a study's folder, at most 30 s. It is normally held for the
/// duration of a few syncs.
fn lock_study(disk: &dyn Disk, path: &Path) -> Result<Lock, StoreError> {
    for _ in 0..LOCK_TRIES {
        if let Some(lock) = disk.lock(path).at(path)? {
            return Ok(lock);
        }
        std::thread::sleep(LOCK_PAUSE);
    }
    Err(StoreError::Busy {
        path: path.to_owned(),
    })
}

/// Checks that a running study can continue with this protocol.
fn check_unchanged(
    path: &Path,
    manifest: &Manifest,
    frozen: &Frozen<'_>,
) -> Result<(), StoreError> {
    let newest = manifest.newest();
    let (old, new) = (&newest.fingerprints, frozen.fingerprints);
    if old.stimulus != new.stimulus || manifest.study != frozen.protocol.study.id {
        return Err(StoreError::StimulusChanged {
            path: path.to_owned(),
            study: manifest.study.clone(),
        });
    }
    let what = match (old.wording != new.wording, old.analysis != new.analysis) {
        (false, false) => return Ok(()),
        (true, false) => "wording",
        (false, true) => "analysis",
        (true, true) => "wording and analysis",
    };
    Err(StoreError::NotAmended {
        path: path.to_owned(),
        version: newest.version,
        what,
    })
}

/// Checks that a folder without `study.json` contains at most the remains of an
/// interrupted creation.
fn check_new(disk: &dyn Disk, path: &Path) -> Result<(), StoreError> {
    let items = disk.list(path).at(path)?;
    let ours = |name: &str| name == layout::PROTOCOLS || name == ".study.json.tmp";
    match items.iter().find(|i| !ours(&i.name)) {
        None => Ok(()),
        Some(other) => Err(StoreError::Damaged {
            path: path.to_owned(),
            what: format!(
                "it has no study.json but contains `{}`: not the results of a study",
                study_base::text::Untrusted(&other.name)
            ),
        }),
    }
}
