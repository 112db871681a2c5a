//! What `unix.rs` does, on other systems, by what the standard library offers.
//! docs/results.md has the differences.

use super::{ItemKind, NotAFile};
use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::path::Path;

/// Opens a file, but not through a symbolic link. Who can read a new one is up to its
/// folder.
pub(super) fn open(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    if std::fs::symlink_metadata(path).is_ok_and(|known| known.is_symlink()) {
        return Err(NotAFile(ItemKind::Link).into());
    }
    options.open(path)
}

/// Not known: these systems do not remove a file that is open.
pub(super) fn is_removed(_file: &File) -> io::Result<bool> {
    Ok(false)
}

/// Creates a folder; who can enter it is up to the folder around it.
pub(super) fn create_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().create(path)
}

/// Does nothing: these systems have no such call.
pub(super) fn sync_folder(_path: &Path) -> io::Result<()> {
    Ok(())
}

/// The file whose lock stands for a folder's: one beside it, as a folder cannot be
/// locked.
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

/// `None`: not known.
pub(super) fn free_bytes(_path: &Path) -> io::Result<Option<u64>> {
    Ok(None)
}

const LOCK: &str = ".lock";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_locked_by_a_file_beside_it() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("P01");
        create_folder(&folder).unwrap();
        sync_folder(&folder).unwrap();
        let first = lock_file(&folder).unwrap();
        let second = lock_file(&folder).unwrap();
        first.try_lock().unwrap();
        assert!(!is_removed(&first).unwrap());
        assert!(second.try_lock().is_err());
        drop(first);
        second.try_lock().unwrap();
        assert!(is_lock(".P01.lock") && home.path().join(".P01.lock").is_file());
        assert!(!is_lock("P01") && !is_lock(".study.json.tmp"));
        assert_eq!(free_bytes(&folder).unwrap(), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_is_not_opened() {
        let home = tempfile::tempdir().unwrap();
        let (file, link) = (home.path().join("file"), home.path().join("link"));
        std::fs::write(&file, "x").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(open(&file, OpenOptions::new().read(true)).is_ok());
        assert!(open(&link, OpenOptions::new().read(true)).is_err());
    }
}
