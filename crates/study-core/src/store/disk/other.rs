//! The same on systems that are not Unix, by what the standard library has.
//! docs/results.md says how it differs.

use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::path::Path;

/// Opens a file, not through a symbolic link; who can read it is up to its folder.
pub(super) fn open(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    if std::fs::symlink_metadata(path).is_ok_and(|known| known.is_symlink()) {
        return Err(io::Error::other("it is a symbolic link"));
    }
    options.open(path)
}

/// Who can enter it is up to the folder around it.
pub(super) fn create_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().create(path)
}

/// Does nothing: there is no such call.
#[allow(clippy::unnecessary_wraps, reason = "it can fail on Unix")]
pub(super) fn sync_folder(_path: &Path) -> io::Result<()> {
    Ok(())
}

/// The file whose lock is a folder's: a folder has none, so it is a file beside it.
pub(super) fn lock_file(path: &Path) -> io::Result<File> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut options = OpenOptions::new();
    options.create(true).append(true);
    open(&path.with_file_name(format!(".{name}{LOCK}")), &mut options)
}

/// Whether a name is that of a lock file.
pub(super) fn is_lock(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(LOCK)
}

/// Not known.
#[allow(clippy::unnecessary_wraps, reason = "it can fail on Unix")]
pub(super) fn free_bytes(_path: &Path) -> io::Result<Option<u64>> {
    Ok(None)
}

const LOCK: &str = ".lock";
