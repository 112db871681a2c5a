//! Telemetry of one attempt, as CSV.
//!
//! It is buffered: a crash can lose the last part of one playback, and no rating.
//! When the disk is full it ends, so that the journal can use the reserve.

use super::disk::Appender;
use super::error::{At as _, StoreError};
use super::session_lock::SessionLock;
use super::sessions::check_kind;
use super::{atomic, layout};
use crate::outcome::cell::Row as _;
use crate::outcome::{Sample, TelemetryFile};
use std::fmt;
use std::io;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use study_base::hex::Digest;
use study_plan::protocol::columns::SampleColumn;

/// Bytes that are buffered before a write.
const BUFFER: usize = 32 << 10;

/// The first line of a telemetry file.
pub(super) fn header() -> String {
    let names: Vec<&str> = SampleColumn::ALL.iter().map(|c| c.name()).collect();
    names.join(",") + "\r\n"
}

/// Writes the telemetry of one attempt. It can be moved to another thread.
pub struct TelemetryWriter {
    lock: Arc<SessionLock>,
    file: Box<dyn Appender>,
    path: PathBuf,
    name: String,
    buffer: Vec<u8>,
    /// Of everything that was written.
    digest: Digest,
}

impl fmt::Debug for TelemetryWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TelemetryWriter")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl TelemetryWriter {
    pub(super) fn create(
        lock: Arc<SessionLock>,
        trial: u32,
        attempt: u32,
        interval: Option<u32>,
    ) -> Result<Self, StoreError> {
        let folder = lock.path.join(layout::TELEMETRY);
        atomic::folder(lock.disk.as_ref(), &folder)?;
        // A link would lead out of the results folder.
        check_kind(lock.disk.as_ref(), &lock.path, |name| {
            name == layout::TELEMETRY
        })?;
        let mut copy = 1;
        let (name, path, file) = loop {
            let name = layout::telemetry_of(trial, attempt, interval, copy);
            let path = folder.join(&name);
            match lock.disk.create(&path) {
                Ok(file) => break (name, path, file),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => copy += 1,
                Err(e) => return Err(e).at(&path),
            }
        };
        let mut buffer = Vec::with_capacity(BUFFER + 1024);
        buffer.extend_from_slice(header().as_bytes());
        Ok(Self {
            lock,
            file,
            path,
            name,
            buffer,
            digest: Digest::default(),
        })
    }

    /// Adds samples to the buffer, and writes the buffer when it is full.
    ///
    /// # Errors
    /// [`StoreError`] of the write. The file then ends here; the session can
    /// continue.
    pub fn write(&mut self, samples: &[Sample]) -> Result<(), StoreError> {
        for sample in samples {
            for (i, column) in SampleColumn::ALL.iter().enumerate() {
                let comma = if i == 0 { "" } else { "," };
                let cell = sample.cell(*column, "");
                write!(self.buffer, "{comma}{cell}").at(&self.path)?;
            }
            self.buffer.extend_from_slice(b"\r\n");
            if self.buffer.len() >= BUFFER {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), StoreError> {
        if self.lock.is_full() {
            return Err(io::Error::from(io::ErrorKind::StorageFull)).at(&self.path);
        }
        self.file.write_all(&self.buffer).at(&self.path)?;
        self.digest.update(&self.buffer);
        self.buffer.clear();
        Ok(())
    }

    /// Writes the rest and returns when the file is on the medium.
    ///
    /// # Errors
    /// [`StoreError`] of the write or the sync.
    pub fn finish(mut self) -> Result<TelemetryFile, StoreError> {
        self.flush()?;
        self.file.sync().at(&self.path)?;
        let folder = self.lock.path.join(layout::TELEMETRY);
        self.lock.disk.sync_folder(&folder).at(&folder)?;
        Ok(TelemetryFile {
            file: self.name.clone(),
            sha256: std::mem::take(&mut self.digest).finish(),
        })
    }
}

impl Drop for TelemetryWriter {
    fn drop(&mut self) {
        // Dropped without `finish`, such as after an error: the rest may still be useful.
        let _ = self.flush();
    }
}
