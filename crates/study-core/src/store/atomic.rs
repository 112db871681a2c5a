//! Replacing a file as a whole.
//!
//! A reader sees the old bytes or the new ones, after a crash too: the new bytes
//! are on the medium before the name points at them, and the name is on the medium
//! before this returns. A rename without a sync of its folder can come undone.

use super::disk::Disk;
use super::error::{At as _, StoreError};
use std::io;
use std::path::Path;

/// Writes `bytes` to `path`, which may exist. The caller holds the lock of the
/// study: the name of the temporary file is fixed, and a left-over one is replaced.
///
/// # Errors
/// [`StoreError::Io`]; the old file is then untouched.
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
        // Gives the space back; the error that counts is the first.
        let _ = disk.remove_file(&temporary);
        return Err(e).at(&temporary);
    }
    disk.rename(&temporary, path).at(path)?;
    disk.sync_folder(folder).at(folder)
}

/// The same, unless the file already has these bytes.
pub(super) fn replace_if_new(disk: &dyn Disk, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    if disk.read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    replace(disk, path, bytes)
}

/// Makes a folder if it is not there, and its name durable in any case: an
/// earlier process may have died between the two.
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
