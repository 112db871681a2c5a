//! The lock of a session's folder and its reserve of disk space.

use super::disk::{Disk, Lock};
use super::layout;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Disk space kept free for the last records of a session, bytes.
pub const RESERVE_BYTES: u64 = 64 << 10;

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
