//! An open session's folder: its lock, its reserve, its telemetry.

use super::error::StoreError;
use super::held::Held;
use super::journal::Journal;
use super::replay::Replay;
use super::telemetry::TelemetryWriter;
use std::path::Path;
use std::sync::Arc;

/// A session's folder, claimed by this process until it and everything opened
/// from it is dropped.
#[derive(Debug)]
pub struct SessionFolder {
    held: Arc<Held>,
    /// Last segment and what the journal holds, until the journal is opened.
    journal: Option<(u32, Replay)>,
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
