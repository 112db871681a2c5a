//! A results folder on two disks.
//!
//! [`MirrorDisk`] does every call twice: in the results folder and, under the same
//! names, in the mirror. A call succeeds if it succeeds on one side. The other side is
//! then left behind: nothing more is written to it by this process, and [`Copies`] says
//! why. [`catch_up`] brings it up to date at the next start. While both sides work, a
//! record is acknowledged when it is on both disks.

pub(super) mod against;
pub(super) mod catch_up;

use super::disk::{Appender, Disk, Item, Lock};
use super::error::plain;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Which of the two copies are up to date.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Copies {
    /// Why the results folder was left behind; `None` while it is up to date.
    pub results: Option<String>,
    /// Why the mirror was left behind; `None` while it is up to date.
    pub mirror: Option<String>,
}

impl Copies {
    /// Whether everything is on both disks.
    pub fn in_step(&self) -> bool {
        self.results.is_none() && self.mirror.is_none()
    }
}

/// A folder on a disk.
#[derive(Debug, Clone)]
pub(super) struct Side {
    pub(super) disk: Arc<dyn Disk>,
    pub(super) root: PathBuf,
}

/// Two folders as one.
#[derive(Debug, Clone)]
pub(super) struct MirrorDisk {
    results: Side,
    mirror: Side,
    copies: Shared,
}

/// The state of both sides, shared by the disk and its open files.
#[derive(Debug, Clone, Default)]
struct Shared(Arc<Mutex<Copies>>);

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Copies> {
        // Nothing panics while it is locked.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn results_in_step(&self) -> bool {
        self.lock().results.is_none()
    }

    fn mirror_in_step(&self) -> bool {
        self.lock().mirror.is_none()
    }

    /// The results of a call on both sides as that of one; `None` where a side was not
    /// asked. If only one succeeds, the other is left behind.
    fn settle<T>(
        &self,
        results: Option<io::Result<T>>,
        mirror: Option<io::Result<T>>,
    ) -> io::Result<(Option<T>, Option<T>)> {
        match (results, mirror) {
            (Some(Err(e)), Some(Err(_)) | None) | (None, Some(Err(e))) => Err(e),
            // Where a name is new although it exists on the other side, it was lost.
            (Some(Ok(_)), Some(Err(e))) if e.kind() == ErrorKind::AlreadyExists => {
                self.lock().results = Some(lost());
                Err(e)
            }
            (Some(Err(e)), Some(Ok(_))) if e.kind() == ErrorKind::AlreadyExists => {
                self.lock().mirror = Some(lost());
                Err(e)
            }
            (Some(Ok(value)), Some(Err(e))) => {
                self.lock().mirror = Some(plain(&e));
                Ok((Some(value), None))
            }
            (Some(Err(e)), Some(Ok(value))) => {
                self.lock().results = Some(plain(&e));
                Ok((None, Some(value)))
            }
            (results, mirror) => Ok((results.transpose()?, mirror.transpose()?)),
        }
    }
}

fn lost() -> String {
    plain(&ErrorKind::NotFound.into())
}

impl MirrorDisk {
    /// Mirrors the folder `results` in the folder `mirror`.
    pub(super) fn new(results: Side, mirror: Side) -> Self {
        Self {
            results,
            mirror,
            copies: Shared::default(),
        }
    }

    /// Which copies are up to date.
    pub(super) fn copies(&self) -> Copies {
        self.copies.lock().clone()
    }

    /// Where a path of the results folder is in the mirror; `None` if it is outside.
    pub(super) fn mirrored(&self, path: &Path) -> Option<PathBuf> {
        let inside = path.strip_prefix(&self.results.root).ok()?;
        Some(self.mirror.root.join(inside))
    }

    /// Makes a call on each side that is up to date.
    fn both<T>(
        &self,
        path: &Path,
        call: impl Fn(&dyn Disk, &Path) -> io::Result<T>,
    ) -> io::Result<(Option<T>, Option<T>)> {
        let mirrored = self.mirrored(path);
        let results = self.copies.results_in_step();
        // What is around a results folder that was left behind does not matter any more.
        let mirror = mirrored.filter(|_| self.copies.mirror_in_step());
        let results = results.then(|| call(self.results.disk.as_ref(), path));
        let mirror = mirror.map(|path| call(self.mirror.disk.as_ref(), &path));
        self.copies.settle(results, mirror)
    }

    /// Asks the results folder, and the mirror only if that fails.
    fn either<T>(
        &self,
        path: &Path,
        call: impl Fn(&dyn Disk, &Path) -> io::Result<T>,
    ) -> io::Result<T> {
        let results = match self.copies.results_in_step() {
            true => match call(self.results.disk.as_ref(), path) {
                Ok(value) => return Ok(value),
                Err(e) => Some(Err(e)),
            },
            false => None,
        };
        let mirror = self
            .mirrored(path)
            .filter(|_| self.copies.mirror_in_step())
            .map(|path| call(self.mirror.disk.as_ref(), &path));
        let (results, mirror) = self.copies.settle(results, mirror)?;
        results.or(mirror).ok_or(ErrorKind::NotFound.into())
    }

    fn file(&self, (results, mirror): (OnSide, OnSide)) -> MirrorFile {
        MirrorFile {
            results,
            mirror,
            copies: self.copies.clone(),
        }
    }
}

/// A file that was removed already is removed.
fn removed(result: io::Result<()>) -> io::Result<bool> {
    match result {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(false),
        Err(e) => Err(e),
    }
}

impl Disk for MirrorDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.both(path, |disk, path| disk.create_folder(path))
            .map(drop)
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        self.both(path, |disk, path| disk.sync_folder(path))
            .map(drop)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let opened = self.both(path, |disk, path| disk.create(path))?;
        Ok(Box::new(self.file(opened)))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let opened = self.both(path, |disk, path| disk.open(path))?;
        Ok(Box::new(self.file(opened)))
    }

    fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()> {
        self.both(path, |disk, path| disk.truncate(path, bytes))
            .map(drop)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mirrored = self.mirrored(to);
        self.both(from, |disk, path| {
            let is_results = path == from;
            let to = match &mirrored {
                Some(mirrored) if !is_results => mirrored,
                _ => to,
            };
            disk.rename(path, to)
        })
        .map(drop)
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        let (results, mirror) = self.both(path, |disk, path| removed(disk.remove_file(path)))?;
        match results.or(mirror) {
            _ if results == Some(true) || mirror == Some(true) => Ok(()),
            _ => Err(ErrorKind::NotFound.into()),
        }
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        self.both(path, |disk, path| disk.remove_folder(path))
            .map(drop)
    }

    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        self.either(path, |disk, path| disk.read(path))
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Item>> {
        self.either(path, |disk, path| disk.list(path))
    }

    fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
        let (results, mirror) = self.both(path, |disk, path| disk.lock(path))?;
        Ok(match (results, mirror) {
            (Some(Some(results)), Some(Some(mirror))) => Some(Box::new((results, mirror))),
            (Some(Some(one)), None) | (None, Some(Some(one))) => Some(one),
            _ => None,
        })
    }

    fn free_bytes(&self, path: &Path) -> io::Result<Option<u64>> {
        let (results, mirror) = self.both(path, |disk, path| disk.free_bytes(path))?;
        let known = [results.flatten(), mirror.flatten()];
        Ok(known.into_iter().flatten().min())
    }
}

/// An open file on one side; `None` if the side was left behind.
type OnSide = Option<Box<dyn Appender>>;

/// An open file on both sides.
struct MirrorFile {
    results: OnSide,
    mirror: OnSide,
    copies: Shared,
}

impl MirrorFile {
    fn both(&mut self, call: impl Fn(&mut dyn Appender) -> io::Result<()>) -> io::Result<()> {
        let results = self
            .results
            .as_mut()
            .filter(|_| self.copies.results_in_step());
        let mirror = self
            .mirror
            .as_mut()
            .filter(|_| self.copies.mirror_in_step());
        if results.is_none() && mirror.is_none() {
            return Err(io::Error::other("neither copy can be used"));
        }
        let results = results.map(|file| call(file.as_mut()));
        let mirror = mirror.map(|file| call(file.as_mut()));
        self.copies.settle(results, mirror).map(drop)
    }
}

impl Appender for MirrorFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.both(|file| file.write_all(bytes))?;
        Ok(bytes.len())
    }

    fn sync(&mut self) -> io::Result<()> {
        self.both(|file| file.sync())
    }
}
