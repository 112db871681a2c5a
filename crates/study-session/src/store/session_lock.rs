//! The lock of a session's folder and its reserve of disk space.

use super::disk::{Disk, Lock};
use super::layout;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Disk space kept free for the last records of a session, bytes.
pub const RESERVE_BYTES: u64 = 64 << 10;
/// Free disk space below which no session starts, bytes.
pub const LEAST_FREE_BYTES: u64 = 2 * RESERVE_BYTES;

/// The lock of a session's folder, shared by its journal and telemetry.
pub(super) struct SessionLock {
    pub(super) disk: Arc<dyn Disk>,
    pub(super) path: PathBuf,
    /// The disk is full: the remaining space is for the journal alone.
    full: AtomicBool,
    _lock: Lock,
}

impl fmt::Debug for SessionLock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SessionLock")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl SessionLock {
    pub(super) fn new(disk: Arc<dyn Disk>, path: PathBuf, lock: Lock) -> Self {
        Self {
            disk,
            path,
            full: AtomicBool::new(false),
            _lock: lock,
        }
    }

    /// Frees the reserve and stops telemetry from using it.
    pub(super) fn free_reserve(&self) {
        self.full.store(true, Ordering::Release);
        // If it does not exist there is nothing to free.
        let _ = self.disk.remove_file(&self.path.join(layout::RESERVE));
    }

    /// Whether telemetry must stop.
    pub(super) fn is_full(&self) -> bool {
        self.full.load(Ordering::Acquire)
    }
}

impl Drop for SessionLock {
    fn drop(&mut self) {
        // A remaining reserve is harmless: readers ignore it.
        let _ = self.disk.remove_file(&self.path.join(layout::RESERVE));
    }
}
