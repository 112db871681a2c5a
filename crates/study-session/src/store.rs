//! The results folder.
//!
//! `results/<study id>` contains the frozen protocol, one folder for each session
//! with its journal and telemetry, and tables derived from the journals. Only the
//! journals and the protocol matter: the tables can be derived again from them.
//! `docs/results.md` describes each file.
//!
//! Invariants: [`Journal::append`] returns only when the event is on the medium and
//! `head.json` says so. A journal is only appended to; an incomplete end is copied before
//! it is cut off, and a damaged line stays where it is. What another process left behind
//! is synced before it is used. A session's folder is locked by one process at a time,
//! and a row belongs to one participant.
//!
//! Every change goes through [`disk::Disk`], so that tests can make each call fail.

pub mod disk;
pub mod journal_record;
pub mod layout;
pub mod manifest;
pub mod replay;
mod reveals;

mod atomic;
mod correction;
mod derive;
mod doctor;
mod error;
mod head;
mod journal;
mod ledger;
mod mirror;
mod missing_sessions;
mod participant;
mod plan;
mod receipt;
mod sealed;
mod session_folder;
mod session_lock;
mod sessions;
mod tables;
mod telemetry;
mod tombstone;
mod trial;
mod verify;

pub use correction::{AnswerCorrection, CorrectedAnswer};
pub use derive::{Derived, participants};
pub use error::{StoreError, plain, when};
pub use head::{Head, HeadFile};
pub use journal::Journal;
pub use ledger::{ClaimRequest, Claimed, SeatKind, check_new_id, held_rows, next_row};
pub use manifest::Manifest;
pub use mirror::Copies;
pub use participant::{StateChange, StateRequest};
pub use plan::{Due, Next, Plan, Return, comes_again, next_session};
pub use receipt::Receipt;
pub use replay::{Damage, DamageKind};
pub use session_folder::SessionFolder;
pub use session_lock::{LEAST_FREE_BYTES, RESERVE_BYTES};
pub use sessions::SessionData;
pub use telemetry::TelemetryWriter;
pub use tombstone::Tombstone;
pub use trial::{Broken, DiskTrial, SavingTime};
pub use verify::Finding;

use crate::outcome::Moment;
use disk::{Disk, Lock, RealDisk};
use error::At as _;
use mirror::catch_up::catch_up;
use mirror::{MirrorDisk, Side};
use participant::remove_all;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use study_base::sort::SmallSort as _;
use study_plan::protocol::Protocol;
use study_plan::protocol::fingerprint::Fingerprints;

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
    mirror: Option<MirrorDisk>,
}

/// Number of attempts to lock a study and the pause between two of them.
const LOCK_TRIES: u32 = 1500;
const LOCK_PAUSE: Duration = Duration::from_millis(20);

/// The studies of a results folder, or of the folder of one study, sorted by path.
///
/// # Errors
/// [`StoreError`] if there is none, or if one of them cannot be opened.
///
/// ```no_run
/// for study in study_session::store::studies("results".as_ref())? {
///     println!("{}: {} sessions", study.manifest().study, study.sessions()?.len());
/// }
/// # Ok::<(), study_session::store::StoreError>(())
/// ```
pub fn studies(path: &Path) -> Result<Vec<StudyFolder>, StoreError> {
    // A link that leads nowhere is there, too.
    let is_study = |folder: &Path| folder.join(layout::MANIFEST).symlink_metadata().is_ok();
    if is_study(path) {
        return Ok(vec![StudyFolder::open(path)?]);
    }
    let unread = |source| StoreError::NoResults {
        path: path.to_owned(),
        source,
    };
    let mut folders = Vec::new();
    for item in std::fs::read_dir(path).map_err(unread)? {
        folders.push(item.map_err(unread)?.path());
    }
    folders.retain(|folder| is_study(folder));
    folders.small_sort();
    if folders.is_empty() {
        return Err(StoreError::Empty {
            path: path.to_owned(),
        });
    }
    (folders.iter())
        .map(|folder| StudyFolder::open(folder))
        .collect()
}

/// The only study of a results folder.
///
/// # Errors
/// As [`studies`], and [`StoreError::Several`].
pub fn one_study(path: &Path) -> Result<StudyFolder, StoreError> {
    let mut studies = studies(path)?;
    if studies.len() == 1 {
        return Ok(studies.remove(0));
    }
    let name = |study: &StudyFolder| study.path().file_name().unwrap_or_default().to_owned();
    Err(StoreError::Several {
        path: path.to_owned(),
        names: (studies.iter().map(name))
            .map(|name| name.to_string_lossy().into_owned())
            .collect(),
    })
}

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
        make_folders(disk.as_ref(), &path)?;
        let lock = lock_study(disk.as_ref(), &path)?;
        settle_names(disk.as_ref(), &path)?;
        let manifest = match Manifest::read_intact(disk.as_ref(), &path) {
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
            mirror: None,
        })
    }

    /// As [`StudyFolder::open_or_create`]; everything that is written from then on is
    /// also written to the folder `mirror`, which must exist. First the copy that is
    /// behind is brought up to date; the sentences say which.
    ///
    /// # Errors
    /// As [`StudyFolder::open_or_create`]; if the mirror cannot be used, or if both
    /// copies were continued without the other.
    pub fn open_or_create_mirrored(
        results: &Path,
        mirror: &Path,
        frozen: &Frozen<'_>,
        at: Moment,
    ) -> Result<(Self, Vec<String>), StoreError> {
        let disk: Arc<dyn Disk> = Arc::new(RealDisk);
        // A name may lead elsewhere; a folder that does not exist is no link.
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let (a, b) = (real(results), real(mirror));
        if a.starts_with(&b) || b.starts_with(&a) {
            return Err(StoreError::MirrorInside {
                results: results.to_owned(),
                mirror: mirror.to_owned(),
            });
        }
        Self::open_or_create_mirrored_on([(disk.clone(), results), (disk, mirror)], frozen, at)
    }

    /// The same on the given disks: of the results, and of the mirror.
    ///
    /// # Errors
    /// As [`StudyFolder::open_or_create_mirrored`].
    pub fn open_or_create_mirrored_on(
        sides: [(Arc<dyn Disk>, &Path); 2],
        frozen: &Frozen<'_>,
        at: Moment,
    ) -> Result<(Self, Vec<String>), StoreError> {
        let [results, mirror] = sides.map(|(disk, root)| Side {
            disk,
            root: root.to_owned(),
        });
        mirror
            .disk
            .list(&mirror.root)
            .map_err(|source| StoreError::NoMirror {
                path: mirror.root.clone(),
                source,
            })?;
        make_folders(results.disk.as_ref(), &results.root)?;
        let notices = catch_up(&results, &mirror, &frozen.protocol.study.id)?;
        let root = results.root.clone();
        let disk = MirrorDisk::new(results, mirror);
        let study = Self::open_or_create_on(Arc::new(disk.clone()), &root, frozen, at)?;
        let mirror = Some(disk);
        Ok((Self { mirror, ..study }, notices))
    }

    /// Which of results and mirror are up to date; `None` without a mirror.
    pub fn copies(&self) -> Option<Copies> {
        self.mirror.as_ref().map(MirrorDisk::copies)
    }

    /// The folder that has everything: this one, or the mirror's if this one was left behind.
    pub fn saved_in(&self) -> PathBuf {
        let mirror = self.mirror.as_ref();
        let mirror = mirror.filter(|mirror| mirror.copies().results.is_some());
        mirror
            .and_then(|mirror| mirror.mirrored(&self.path))
            .unwrap_or_else(|| self.path.clone())
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
            mirror: None,
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
        let mut manifest = Manifest::read_intact(self.disk.as_ref(), &self.path)?;
        // The tables are derived again afterwards: nothing is frozen if they could not be.
        self.sessions()?;
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

    /// Prevents other processes from claiming, amending and deriving. What is read
    /// afterwards by a name of the study's folder stays there.
    fn lock(&self) -> Result<Lock, StoreError> {
        let lock = lock_study(self.disk.as_ref(), &self.path)?;
        self.disk.sync_folder(&self.path).at(&self.path)?;
        Ok(lock)
    }
}

/// Creates a folder and those around it, as far as they do not exist.
fn make_folders(disk: &dyn Disk, path: &Path) -> Result<(), StoreError> {
    let folders = path.ancestors().filter(|a| !a.as_os_str().is_empty());
    for folder in folders.collect::<Vec<_>>().into_iter().rev() {
        let known = disk.list(folder);
        if known.is_err_and(|e| e.kind() == ErrorKind::NotFound) {
            atomic::folder(disk, folder)?;
        }
    }
    Ok(())
}

/// Returns when the names of and in a study's folder are on the medium: the process
/// that created them may have died before its syncs.
fn settle_names(disk: &dyn Disk, study: &Path) -> Result<(), StoreError> {
    for (level, folder) in study.ancestors().enumerate() {
        let folder = match folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => folder,
        };
        match disk.sync_folder(folder) {
            // The folders around the results may not be ours.
            Err(e) if level == 2 && e.kind() == ErrorKind::PermissionDenied => {}
            Err(e) if level <= 2 => return Err(e).at(folder),
            _ => {}
        }
    }
    Ok(())
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
