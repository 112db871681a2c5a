//! The calls to the file system that the store makes.
//!
//! Everything that changes a results folder goes through [`Disk`], so that a test
//! can fail, cut or reorder each call; [`RealDisk`] is the only implementation in
//! the program. On Unix files are made 0600 and folders 0700, so that only their
//! owner can read what participants said.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
use study_base::sort::SmallSort as _;
use unix as system;
#[cfg(windows)]
use windows as system;

use std::any::Any;
use std::fmt;
use std::fs::{OpenOptions, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::Path;

/// Size of the largest file that is read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;

/// A lock, held until it is dropped; the operating system releases it when the
/// process dies.
pub type Lock = Box<dyn Any + Send + Sync>;

/// A file that is only appended to.
pub trait Appender: Send {
    /// Makes one write at the end and returns how many bytes were written.
    ///
    /// # Errors
    /// Of the operating system.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Returns when everything that was written is on the medium.
    ///
    /// # Errors
    /// Of the operating system, or the file was removed. Data written before may then
    /// be lost.
    fn sync(&mut self) -> io::Result<()>;

    /// Writes all bytes, continuing after an interruption or a short write.
    ///
    /// # Errors
    /// Of the operating system. Part of it may then be in the file.
    fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            match self.write(bytes) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(n) => bytes = &bytes[n..],
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        Ok(())
    }
}

/// One entry of a folder.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Item {
    /// Its name; bytes that are not UTF-8 are replaced.
    pub name: String,
    /// What it is.
    pub kind: ItemKind,
}

impl Item {
    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        self.kind == ItemKind::Folder
    }
}

/// What an entry of a folder is; a link is not followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ItemKind {
    /// A file.
    File,
    /// A folder.
    Folder,
    /// A symbolic link.
    Link,
    /// Anything else, such as a pipe.
    Other,
}

impl ItemKind {
    /// The word for it in a sentence.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::File => "a file",
            Self::Folder => "a folder",
            Self::Link => "a symbolic link",
            Self::Other => "neither a file nor a folder",
        }
    }
}

/// Something else in the place of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{} in the place of a file", .0.as_str())]
pub struct NotAFile(pub ItemKind);

impl From<NotAFile> for io::Error {
    fn from(error: NotAFile) -> Self {
        Self::other(error)
    }
}

/// A file system. No file is opened, created, truncated or removed through a symbolic
/// link in the last part of its path.
///
/// # Errors
/// Every method returns the error of the operating system.
#[allow(clippy::missing_errors_doc)]
pub trait Disk: fmt::Debug + Send + Sync {
    /// Creates one folder; an error if the name exists.
    fn create_folder(&self, path: &Path) -> io::Result<()>;
    /// Returns when the names in a folder are on the medium.
    fn sync_folder(&self, path: &Path) -> io::Result<()>;
    /// Creates a file and opens it; an error if the name exists.
    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>>;
    /// Opens an existing file for appending.
    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>>;
    /// Truncates a file; returns when that is on the medium.
    fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()>;
    /// Renames a file, replacing a file of the new name.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove_file(&self, path: &Path) -> io::Result<()>;
    /// Removes an empty folder.
    fn remove_folder(&self, path: &Path) -> io::Result<()>;
    /// Reads a whole file.
    fn read(&self, path: &Path) -> io::Result<Vec<u8>>;
    /// The entries of a folder, sorted by name.
    fn list(&self, path: &Path) -> io::Result<Vec<Item>>;
    /// Locks a folder; `None` if another process holds the lock.
    fn lock(&self, path: &Path) -> io::Result<Option<Lock>>;
    /// Bytes that can still be written near a path; `None` where the system is not
    /// asked.
    fn free_bytes(&self, path: &Path) -> io::Result<Option<u64>>;
}

fn kind_of(known: std::fs::FileType) -> ItemKind {
    if known.is_symlink() {
        ItemKind::Link
    } else if known.is_dir() {
        ItemKind::Folder
    } else if known.is_file() {
        ItemKind::File
    } else {
        ItemKind::Other
    }
}

/// The file system of the operating system.
#[derive(Debug, Clone, Copy, Default)]
pub struct RealDisk;

struct RealFile(std::fs::File);

impl Appender for RealFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.sync_data()?;
        if system::is_removed(&self.0)? {
            return Err(io::Error::new(
                io::ErrorKind::NotFound,
                "the file was removed while it was open",
            ));
        }
        Ok(())
    }
}

impl Disk for RealDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        system::create_folder(path)
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        system::sync_folder(path)
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let file = system::open(path, OpenOptions::new().append(true).create_new(true))?;
        Ok(Box::new(RealFile(file)))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let file = system::open(path, OpenOptions::new().append(true))?;
        Ok(Box::new(RealFile(file)))
    }

    fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()> {
        let file = system::open(path, OpenOptions::new().write(true))?;
        file.set_len(bytes)?;
        file.sync_all()
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        system::rename(from, to)
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        system::remove_file(path)
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        system::remove_folder(path)
    }

    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        let file = system::open(path, OpenOptions::new().read(true))?;
        let known = file.metadata()?;
        if !known.is_file() {
            return Err(NotAFile(kind_of(known.file_type())).into());
        }
        if known.len() > MAX_FILE_BYTES {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let mut bytes = Vec::new();
        file.take(MAX_FILE_BYTES).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Item>> {
        let mut items = Vec::new();
        for entry in std::fs::read_dir(path)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if system::is_lock(&name) {
                continue;
            }
            items.push(Item {
                name,
                kind: kind_of(entry.file_type()?),
            });
        }
        items.small_sort();
        Ok(items)
    }

    fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
        let file = system::lock_file(path)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Box::new(file))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(e)) => Err(e),
        }
    }

    fn free_bytes(&self, path: &Path) -> io::Result<Option<u64>> {
        system::free_bytes(path)
    }
}

/// Why a file that a user named cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// There is none.
    #[error("there is no such file")]
    NotFound,
    /// A folder.
    #[error("it is a folder")]
    Folder,
    /// A pipe or a device.
    #[error("it is not a regular file")]
    NotRegular,
    /// Larger than allowed; bytes.
    #[error("it has more than {} KiB", .0 / 1024)]
    TooLarge(usize),
    /// The operating system's error.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Reads a regular file of at most `most` bytes. Its type is checked before it is
/// opened, because opening a pipe would block.
///
/// # Errors
/// [`ReadError`].
pub fn read_capped(path: &Path, most: usize) -> Result<Vec<u8>, ReadError> {
    let metadata = std::fs::metadata(path).map_err(|e| match e.kind() {
        io::ErrorKind::NotFound => ReadError::NotFound,
        _ => ReadError::Io(e),
    })?;
    if metadata.is_dir() {
        return Err(ReadError::Folder);
    }
    if !metadata.is_file() {
        return Err(ReadError::NotRegular);
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(most as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > most {
        return Err(ReadError::TooLarge(most));
    }
    Ok(bytes)
}

/// Opens a file for reading.
///
/// # Errors
/// The operating system's.
pub fn reader(path: &Path) -> io::Result<io::BufReader<std::fs::File>> {
    std::fs::File::open(path).map(io::BufReader::new)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs wherever the program does, so it asks for nothing of one system.
    #[test]
    fn the_real_disk_does_what_the_trait_says() {
        let home = tempfile::tempdir().unwrap();
        let (folder, file) = (home.path().join("P01"), home.path().join("P01/journal"));
        let disk = RealDisk;
        disk.create_folder(&folder).unwrap();
        assert!(disk.create_folder(&folder).is_err());
        let mut journal = disk.create(&file).unwrap();
        assert!(disk.create(&file).is_err(), "it exists");
        journal.write_all(b"one\n").unwrap();
        journal.sync().unwrap();
        disk.open(&file).unwrap().write_all(b"two\n").unwrap();
        assert_eq!(disk.read(&file).unwrap(), b"one\ntwo\n");
        disk.truncate(&file, 4).unwrap();
        journal.write_all(b"end\n").unwrap();
        drop(journal);
        let new = folder.join("new");
        disk.create(&new).unwrap().write_all(b"new").unwrap();
        disk.rename(&file, &folder.join("old")).unwrap();
        disk.rename(&new, &folder.join("old")).unwrap();
        assert_eq!(disk.read(&folder.join("old")).unwrap(), b"new");
        disk.sync_folder(&folder).unwrap();

        let lock = disk.lock(&folder).unwrap();
        assert!(lock.is_some() && disk.lock(&folder).unwrap().is_none());
        drop(lock);
        assert!(disk.lock(&folder).unwrap().is_some());
        let names = |path: &Path| -> Vec<(String, bool)> {
            let items = disk.list(path).unwrap().into_iter();
            items.map(|i| (i.name.clone(), i.is_folder())).collect()
        };
        assert_eq!(names(&folder), [("old".to_owned(), false)]);
        assert_eq!(names(home.path()), [("P01".to_owned(), true)]);

        assert!(disk.read(&folder).is_err(), "a folder is not a file");
        assert!(
            disk.free_bytes(&folder)
                .unwrap()
                .is_some_and(|free| free > 0)
        );
        disk.remove_file(&folder.join("old")).unwrap();
        disk.remove_folder(&folder).unwrap();
        let gone = disk.read(&file).unwrap_err();
        assert_eq!(gone.kind(), io::ErrorKind::NotFound);
    }
}
