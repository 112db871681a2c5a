//! The folder of a claimed session: its journal, telemetry and copy of the consent.

use super::error::{At as _, StoreError};
use super::journal::Journal;
use super::session_lock::SessionLock;
use super::telemetry::TelemetryWriter;
use super::{atomic, layout};
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

/// The folder of a session, locked by this process until this value and everything
/// opened from it is dropped.
#[derive(Debug)]
pub struct SessionFolder {
    lock: Arc<SessionLock>,
    /// The journal until it is taken.
    journal: Option<Journal>,
}

impl SessionFolder {
    pub(super) fn new(lock: Arc<SessionLock>, journal: Journal) -> Self {
        Self {
            lock,
            journal: Some(journal),
        }
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.lock.path
    }

    /// The journal, open for writing.
    ///
    /// # Errors
    /// [`StoreError::JournalTaken`] on the second call.
    pub fn journal(&mut self) -> Result<Journal, StoreError> {
        self.journal.take().ok_or_else(|| StoreError::JournalTaken {
            path: self.lock.path.clone(),
        })
    }

    /// Writes the participant's copy of the consent document; a copy from before a crash is
    /// replaced.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be written.
    pub fn keep_consent(&self, copy: &str) -> Result<(), StoreError> {
        let path = self.lock.path.join(layout::CONSENT);
        atomic::replace(self.lock.disk.as_ref(), &path, copy.as_bytes())
    }

    /// Removes a copy of the consent document from before a crash: the participant does not agree.
    ///
    /// # Errors
    /// [`StoreError`] if there is one and it cannot be removed.
    pub fn drop_consent(&self) -> Result<(), StoreError> {
        let path = self.lock.path.join(layout::CONSENT);
        match self.lock.disk.remove_file(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
            Err(e) => Err(e).at(&path),
            Ok(()) => self.lock.disk.sync_folder(&self.lock.path).at(&path),
        }
    }

    /// Creates a file for the telemetry of an attempt; an existing one is never
    /// written to.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be created.
    pub fn telemetry(&self, trial: u32, attempt: u32) -> Result<TelemetryWriter, StoreError> {
        self.telemetry_of(trial, attempt, None)
    }

    /// The same for an interval, if the trial has several.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be created.
    pub fn telemetry_of(
        &self,
        trial: u32,
        attempt: u32,
        interval: Option<u32>,
    ) -> Result<TelemetryWriter, StoreError> {
        TelemetryWriter::create(Arc::clone(&self.lock), trial, attempt, interval)
    }
}
