//! What only Windows offers or lacks: folders that are synced through a handle, a lock file
//! beside a folder, waiting for a program that looks into a file. docs/results.md says what
//! is promised.

use super::{ItemKind, NotAFile};
use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::os::windows::ffi::OsStrExt as _;
use std::os::windows::fs::OpenOptionsExt as _;
use std::path::Path;
use std::time::{Duration, Instant};
use windows_sys::Win32::Foundation::{
    ERROR_ACCESS_DENIED, ERROR_INVALID_FUNCTION, ERROR_INVALID_PARAMETER, ERROR_LOCK_VIOLATION,
    ERROR_NOT_SUPPORTED, ERROR_SHARING_VIOLATION, GENERIC_WRITE,
};
use windows_sys::Win32::Storage::FileSystem::{
    FILE_FLAG_BACKUP_SEMANTICS, FILE_FLAG_OPEN_REPARSE_POINT, GetDiskFreeSpaceExW,
};

const LOCK: &str = ".lock";

/// How long a file is waited for that another program, such as a virus scanner or an indexer,
/// has open in a way that excludes this one.
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// How long a call is repeated whose access is denied: that is also the answer for a file that
/// is being removed, and otherwise final.
const LONGEST_WAIT_DENIED: Duration = Duration::from_secs(1);
const WAIT_BETWEEN: Duration = Duration::from_millis(10);

/// Repeats a call while another program is in the way.
fn patiently<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    let begun = Instant::now();
    loop {
        let result = call();
        let longest = match result.as_ref().err().and_then(system_error) {
            Some(ERROR_SHARING_VIOLATION | ERROR_LOCK_VIOLATION) => LONGEST_WAIT,
            Some(ERROR_ACCESS_DENIED) => LONGEST_WAIT_DENIED,
            _ => return result,
        };
        if begun.elapsed() >= longest {
            return result;
        }
        std::thread::sleep(WAIT_BETWEEN);
    }
}

fn system_error(error: &io::Error) -> Option<u32> {
    u32::try_from(error.raw_os_error()?).ok()
}

/// Opens a file, but not through a symbolic link or a junction. Who can read a new one is up
/// to its folder.
pub(super) fn open(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    // The link itself is opened, and then recognized.
    options.custom_flags(FILE_FLAG_OPEN_REPARSE_POINT | FILE_FLAG_BACKUP_SEMANTICS);
    let file = patiently(|| options.open(path))?;
    match file.metadata()?.file_type().is_symlink() {
        true => Err(NotAFile(ItemKind::Link).into()),
        false => Ok(file),
    }
}

/// Never: Windows keeps the name of a file that was removed until it is closed.
pub(super) fn is_removed(_file: &File) -> io::Result<bool> {
    Ok(false)
}

/// Creates a folder; who can enter it is up to the folder around it.
pub(super) fn create_folder(path: &Path) -> io::Result<()> {
    patiently(|| DirBuilder::new().create(path))
}

/// Renames a file, replacing a file of the new name, and returns when the new name is on the
/// medium, as far as the file system offers that.
pub(super) fn rename(from: &Path, to: &Path) -> io::Result<()> {
    patiently(|| std::fs::rename(from, to))?;
    // A file system with a journal writes the change of name before this returns.
    let renamed = patiently(|| OpenOptions::new().write(true).open(to))?;
    renamed.sync_all()
}

/// Removes a file.
pub(super) fn remove_file(path: &Path) -> io::Result<()> {
    patiently(|| std::fs::remove_file(path))
}

/// Removes an empty folder.
pub(super) fn remove_folder(path: &Path) -> io::Result<()> {
    patiently(|| std::fs::remove_dir(path))
}

/// Returns when the names in a folder are on the medium, where the file system can sync a
/// folder; where it cannot, at once.
pub(super) fn sync_folder(path: &Path) -> io::Result<()> {
    let mut options = OpenOptions::new();
    options
        .access_mode(GENERIC_WRITE)
        .custom_flags(FILE_FLAG_BACKUP_SEMANTICS);
    let synced = options.open(path).and_then(|folder| folder.sync_all());
    match synced.as_ref().err().and_then(system_error) {
        Some(
            ERROR_ACCESS_DENIED
            | ERROR_INVALID_FUNCTION
            | ERROR_INVALID_PARAMETER
            | ERROR_NOT_SUPPORTED,
        ) => Ok(()),
        _ => synced,
    }
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

/// Bytes that can still be written near a path, by this user.
#[allow(unsafe_code, reason = "the standard library does not have the call")]
pub(super) fn free_bytes(path: &Path) -> io::Result<Option<u64>> {
    let wide: Vec<u16> = path.as_os_str().encode_wide().chain([0]).collect();
    let mut free = 0;
    // SAFETY: the path ends with a zero, the number is written during the call, and the two
    // results that are not asked for may be null.
    let done = unsafe {
        GetDiskFreeSpaceExW(
            wide.as_ptr(),
            &raw mut free,
            std::ptr::null_mut(),
            std::ptr::null_mut(),
        )
    };
    match done {
        0 => Err(io::Error::last_os_error()),
        _ => Ok(Some(free)),
    }
}

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
        assert!(free_bytes(&folder).unwrap().unwrap() > 0);
    }

    #[test]
    fn a_file_that_another_program_has_open_is_waited_for() {
        let home = tempfile::tempdir().unwrap();
        let (from, to) = (home.path().join("from"), home.path().join("to"));
        std::fs::write(&from, "new").unwrap();
        std::fs::write(&to, "old").unwrap();
        // A share mode of 0 excludes every other opening.
        let held = OpenOptions::new()
            .read(true)
            .share_mode(0)
            .open(&to)
            .unwrap();
        assert!(File::open(&to).is_err());
        let other = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(300));
            drop(held);
        });
        rename(&from, &to).unwrap();
        other.join().unwrap();
        assert_eq!(std::fs::read_to_string(&to).unwrap(), "new");
    }

    #[test]
    fn a_call_that_fails_for_another_reason_is_not_repeated() {
        let mut calls = 0;
        let missing = patiently(|| -> io::Result<()> {
            calls += 1;
            Err(io::ErrorKind::NotFound.into())
        });
        assert!(missing.is_err() && calls == 1);
    }
}
