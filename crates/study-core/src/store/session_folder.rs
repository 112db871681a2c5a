//! An open session's folder: its lock, its reserve, its telemetry.

use super::disk::{Disk, Lock};
use super::error::StoreError;
use super::journal::Journal;
use super::layout;
use super::replay::Replay;
use super::telemetry::TelemetryWriter;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Room that is kept for the last records of a session, bytes.
pub const RESERVE_BYTES: u64 = 64 << 10;

/// A session's folder, claimed by this process until it and everything opened
/// from it is dropped.
#[derive(Debug)]
pub struct SessionFolder {
    held: Arc<Held>,
    /// Last segment and what the journal holds, until the journal is opened.
    journal: Option<(u32, Replay)>,
}

/// What journal and telemetry share: the lock, and whether the disk is full.
pub(super) struct Held {
    pub(super) disk: Arc<dyn Disk>,
    pub(super) path: PathBuf,
    /// What is left of the disk belongs to the journal.
    full: AtomicBool,
    _lock: Lock,
}

impl fmt::Debug for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Held")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl Held {
    pub(super) fn new(disk: Arc<dyn Disk>, path: PathBuf, lock: Lock) -> Self {
        Self {
            disk,
            path,
            full: AtomicBool::new(false),
            _lock: lock,
        }
    }

    /// Gives the reserve back to the disk and keeps telemetry from taking it.
    pub(super) fn free_reserve(&self) {
        self.full.store(true, Ordering::Release);
        // If it is gone already there is nothing to free.
        let _ = self.disk.remove_file(&self.path.join(layout::RESERVE));
    }

    /// Whether telemetry has to make way.
    pub(super) fn is_full(&self) -> bool {
        self.full.load(Ordering::Acquire)
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        // A left-over reserve is harmless: readers pass it over.
        let _ = self.disk.remove_file(&self.path.join(layout::RESERVE));
    }
}

impl SessionFolder {
    pub(super) fn new(held: Arc<Held>, segment: u32, replay: Replay) -> Self {
        Self {
            held,
            journal: Some((segment, replay)),
        }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.held.path
    }

    /// Opens the journal, once.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be opened or already is.
    pub fn journal(&mut self) -> Result<Journal, StoreError> {
        let Some((segment, replay)) = &self.journal else {
            return Err(StoreError::JournalTaken {
                path: self.held.path.clone(),
            });
        };
        let journal = Journal::open(Arc::clone(&self.held), *segment, replay)?;
        self.journal = None;
        Ok(journal)
    }

    /// A file for the telemetry of an attempt. An existing one is never written to.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be made.
    pub fn telemetry(&self, trial: u32, attempt: u32) -> Result<TelemetryWriter, StoreError> {
        TelemetryWriter::create(Arc::clone(&self.held), trial, attempt)
    }
}
