//! The few things that the store asks of a file system.
//!
//! Everything that changes a results folder goes through [`Disk`], so that a test
//! can fail, cut or reorder each call; [`RealDisk`] is the only implementation in
//! the program. Files are made 0600, folders 0700: what participants say is
//! nobody else's business.

use rustix::fs::{CWD, FlockOperation, Mode, OFlags};
use std::any::Any;
use std::fmt;
use std::io::{self, Read as _, Write as _};
use std::path::Path;

/// A journal or table that is larger than this is not read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;

/// Held while it lives; the kernel lets go of it when the process dies.
pub type Lock = Box<dyn Any + Send + Sync>;

/// A file that only grows.
pub trait Appender: Send {
    /// One write at the end; how many bytes were taken.
    ///
    /// # Errors
    /// Of the operating system.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Returns when everything written is on the medium.
    ///
    /// # Errors
    /// Of the operating system. What was written before is then in doubt.
    fn sync(&mut self) -> io::Result<()>;

    /// Writes all of it; goes on after an interruption or a short write.
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
    /// Its name; what is no UTF-8 in it is replaced.
    pub name: String,
    /// Whether it is a folder.
    pub is_folder: bool,
}

/// A file system. No file is opened, made, cut or removed through a symbolic link
/// in the last part of its path.
///
/// # Errors
/// Every method gives the error of the operating system.
#[allow(clippy::missing_errors_doc)]
pub trait Disk: fmt::Debug + Send + Sync {
    /// Makes one folder; an error if there is anything of that name.
    fn create_folder(&self, path: &Path) -> io::Result<()>;
    /// Returns when the names in a folder are on the medium.
    fn sync_folder(&self, path: &Path) -> io::Result<()>;
    /// Makes a file and opens it; an error if there is anything of that name.
    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>>;
    /// Opens an existing file to write at its end.
    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>>;
    /// Cuts a file to a length; returns when that is on the medium.
    fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()>;
    /// Renames a file, replacing what has the new name.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove_file(&self, path: &Path) -> io::Result<()>;
    /// Removes an empty folder.
    fn remove_folder(&self, path: &Path) -> io::Result<()>;
    /// Reads a whole file.
    fn read(&self, path: &Path) -> io::Result<Vec<u8>>;
    /// What is in a folder, sorted by name.
    fn list(&self, path: &Path) -> io::Result<Vec<Item>>;
    /// Locks a folder against other processes; `None` if one has it.
    fn lock(&self, path: &Path) -> io::Result<Option<Lock>>;
    /// Bytes that can still be written near a path.
    fn free_bytes(&self, path: &Path) -> io::Result<u64>;
}

/// The operating system's.
#[derive(Debug, Clone, Copy, Default)]
pub struct RealDisk;

struct RealFile(std::fs::File);

impl Appender for RealFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.sync_data()
    }
}

fn open(path: &Path, flags: OFlags) -> io::Result<std::fs::File> {
    let fd = rustix::fs::openat(
        CWD,
        path,
        flags | OFlags::NOFOLLOW | OFlags::CLOEXEC,
        Mode::RUSR | Mode::WUSR,
    )?;
    Ok(fd.into())
}

impl Disk for RealDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        Ok(rustix::fs::mkdir(path, Mode::RWXU)?)
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        std::fs::File::open(path)?.sync_all()
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let flags = OFlags::WRONLY | OFlags::APPEND | OFlags::CREATE | OFlags::EXCL;
        Ok(Box::new(RealFile(open(path, flags)?)))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let file = open(path, OFlags::WRONLY | OFlags::APPEND)?;
        Ok(Box::new(RealFile(file)))
    }

    fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()> {
        let file = open(path, OFlags::WRONLY)?;
        file.set_len(bytes)?;
        file.sync_all()
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::rename(from, to)
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        std::fs::remove_dir(path)
    }

    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        let file = open(path, OFlags::RDONLY | OFlags::NONBLOCK)?;
        let known = file.metadata()?;
        if !known.is_file() {
            return Err(io::Error::other("not a file"));
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
            items.push(Item {
                name: entry.file_name().to_string_lossy().into_owned(),
                is_folder: entry.file_type()?.is_dir(),
            });
        }
        items.sort();
        Ok(items)
    }

    fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
        let folder = std::fs::File::open(path)?;
        match rustix::fs::flock(&folder, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(Some(Box::new(folder))),
            Err(rustix::io::Errno::WOULDBLOCK) => Ok(None),
            Err(e) => Err(e.into()),
        }
    }

    fn free_bytes(&self, path: &Path) -> io::Result<u64> {
        let known = rustix::fs::statvfs(path)?;
        Ok(known.f_bavail.saturating_mul(known.f_frsize))
    }
}
