//! Atomic replacement of a file.
//!
//! A reader sees the old bytes or the new ones, also after a crash: the new bytes
//! are on the medium before the file is renamed, and the rename is on the medium
//! before this returns. Without a sync of the folder a crash can undo a rename.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use std::io;
use std::path::Path;

/// Writes `bytes` to `path`, which may exist. The caller holds the study's lock,
/// because the name of the temporary file is fixed; a left-over one is replaced.
///
/// # Errors
/// [`StoreError::Io`]; the old file is then unchanged.
pub(super) fn replace(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let temporary = folder.join(format!(".{name}.tmp"));
    match disk.remove_file(&temporary) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e).at(&temporary),
        _ => {}
    }
    let written = disk.create(&temporary).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync()
    });
    if let Err(e) = written {
        // Frees the space; the first error is the one to report.
        let _ = disk.remove_file(&temporary);
        return Err(e).at(&temporary);
    }
    disk.rename(&temporary, path).at(path)?;
    disk.sync_folder(folder).at(folder)
}

/// Calls [`replace`] unless the file already has these bytes.
pub(super) fn replace_if_new(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    if disk.read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    replace(disk, path, bytes)
}

/// Creates a folder if it does not exist. Its name is made durable in any case: an
/// earlier process may have died after creating it.
pub(super) fn folder(disk: &dyn Disk, path: &Path) -> Result<(), StoreError> {
    match disk.create_folder(path) {
        Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(e).at(path),
        _ => {}
    }
    let parent = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    disk.sync_folder(parent).at(parent)
}
