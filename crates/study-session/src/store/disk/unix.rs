//! What only Unix offers: permissions, syncs and locks of folders, free space.

use super::{ItemKind, NotAFile};
use rustix::fs::{OFlags, statvfs};
use rustix::io::Errno;
use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::Path;

/// Opens a file, but not through a symbolic link, and without waiting for the other
/// end of a pipe. Only the owner can read a new one.
pub(super) fn open(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits();
    let opened = options.mode(0o600).custom_flags(flags as i32).open(path);
    opened.map_err(|e| match e.raw_os_error() {
        Some(number) if number == Errno::LOOP.raw_os_error() => NotAFile(ItemKind::Link).into(),
        _ => e,
    })
}

/// Whether an open file has no name any more.
pub(super) fn is_removed(file: &File) -> io::Result<bool> {
    Ok(file.metadata()?.nlink() == 0)
}

/// Creates a folder that only its owner can enter.
pub(super) fn create_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().mode(0o700).create(path)
}

/// Renames a file, replacing a file of the new name.
pub(super) fn rename(from: &Path, to: &Path) -> io::Result<()> {
    std::fs::rename(from, to)
}

/// Removes a file.
pub(super) fn remove_file(path: &Path) -> io::Result<()> {
    std::fs::remove_file(path)
}

/// Removes an empty folder.
pub(super) fn remove_folder(path: &Path) -> io::Result<()> {
    std::fs::remove_dir(path)
}

/// Returns when the names in a folder are on the medium.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}

/// The file whose lock stands for a folder's: the folder itself.
pub(super) fn lock_file(path: &Path) -> io::Result<File> {
    File::open(path)
}

/// Whether a name is that of a lock file.
pub(super) fn is_lock(_name: &str) -> bool {
    false
}

/// Bytes that can still be written near a path.
pub(super) fn free_bytes(path: &Path) -> io::Result<Option<u64>> {
    let known = statvfs(path)?;
    Ok(Some(known.f_bavail.saturating_mul(known.f_frsize)))
}
