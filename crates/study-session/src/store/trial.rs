//! Tries a disk in the way in which a session uses it, in a folder that is removed again.
//!
//! A record is appended to a journal and synced, and then `head.json` is replaced: what a
//! session does before a page says "saved". The times of both are what a participant waits.

use super::disk::{Appender, Disk, Lock};
use super::error::{At as _, StoreError};
use super::head::{Head, HeadFile};
use super::layout;
use super::participant::remove_all;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use study_base::hex::sha256;

/// A usual record of a journal, without what makes it unique, bytes.
const RECORD_BYTES: usize = 250;
/// Folder in the folder of the trial that is locked as a session's is.
const LOCKED: &str = "session";
/// File that is used to find out whether a name that exists is refused.
const TAKEN: &str = "taken";

/// How long the two halves of saving a record took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SavingTime {
    /// Appending the record to the journal, and its sync.
    pub journal: Duration,
    /// Replacing `head.json`.
    pub head: Duration,
}

/// What a file system promises and this one does not do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Broken {
    /// A journal that is read again differs from what was written.
    Journal,
    /// So does `head.json`, which was renamed to its place.
    Head,
    /// A file is created although its name exists.
    Names,
    /// A lock that is held is given again.
    Locks,
}

impl Broken {
    /// In a sentence about the file system.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Journal => "a file that was written and synced reads differently",
            Self::Head => "a file that was renamed to its place reads differently",
            Self::Names => "a file is created although its name exists",
            Self::Locks => "a lock that is held is given a second time",
        }
    }
}

/// A folder in which a disk is tried. Dropping it removes it.
pub struct DiskTrial {
    disk: Arc<dyn Disk>,
    folder: PathBuf,
    journal: Option<Box<dyn Appender>>,
    written: Vec<u8>,
    seq: u64,
    lock: Option<Lock>,
    ended: bool,
}

impl fmt::Debug for DiskTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DiskTrial")
            .field("folder", &self.folder)
            .field("seq", &self.seq)
            .finish_non_exhaustive()
    }
}

impl DiskTrial {
    /// Begins a trial in an existing folder. What a trial that was killed left there is removed.
    ///
    /// # Errors
    /// [`StoreError::Busy`] if another process tries the same disk, or the disk's.
    pub fn begin(disk: Arc<dyn Disk>, around: &Path) -> Result<Self, StoreError> {
        let folder = around.join(layout::TRIAL);
        let locked = folder.join(LOCKED);
        if let Err(e) = disk.create_folder(&folder) {
            if e.kind() != io::ErrorKind::AlreadyExists {
                return Err(e).at(&folder);
            }
            if disk.list(&locked).is_ok() && disk.lock(&locked).at(&locked)?.is_none() {
                return Err(StoreError::Busy { path: folder });
            }
            remove(disk.as_ref(), &folder)?;
            disk.create_folder(&folder).at(&folder)?;
        }
        // From here on, an error removes the folder.
        let mut trial = Self {
            disk,
            folder,
            journal: None,
            written: Vec::new(),
            seq: 0,
            lock: None,
            ended: false,
        };
        trial.disk.create_folder(&locked).at(&locked)?;
        trial.lock = trial.disk.lock(&locked).at(&locked)?;
        let path = trial.journal_path();
        trial.journal = Some(trial.disk.create(&path).at(&path)?);
        trial.disk.sync_folder(&trial.folder).at(&trial.folder)?;
        Ok(trial)
    }

    /// The folder, which is removed at the end.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn journal_path(&self) -> PathBuf {
        self.folder.join(layout::segment(1))
    }

    /// Saves a record as a session does.
    ///
    /// # Errors
    /// [`StoreError`] of the write, of a sync or of the rename.
    pub fn save(&mut self) -> Result<SavingTime, StoreError> {
        let path = self.journal_path();
        let closed = || io::Error::from(io::ErrorKind::NotFound);
        let mut line = format!("{{\"seq\":{},\"trial\":\"", self.seq).into_bytes();
        line.resize(line.len() + RECORD_BYTES, b'.');
        line.extend_from_slice(b"\"}\n");
        let begun = Instant::now();
        let journal = self.journal.as_mut().ok_or_else(closed).at(&path)?;
        journal.write_all(&line).at(&path)?;
        journal.sync().at(&path)?;
        let synced = begun.elapsed();
        let head = Head::new(self.seq, &sha256(&line), 1);
        head.write(self.disk.as_ref(), &self.folder)?;
        self.written.extend_from_slice(&line);
        self.seq += 1;
        Ok(SavingTime {
            journal: synced,
            head: begun.elapsed() - synced,
        })
    }

    /// What the file system does not do, as far as that shows without a power failure.
    ///
    /// # Errors
    /// [`StoreError`] if a file cannot be read again.
    pub fn broken(&self) -> Result<Vec<Broken>, StoreError> {
        let disk = self.disk.as_ref();
        let mut found = Vec::new();
        let path = self.journal_path();
        if disk.read(&path).at(&path)? != self.written {
            found.push(Broken::Journal);
        }
        let last = self.seq.checked_sub(1);
        let head = match Head::read(disk, &self.folder)? {
            HeadFile::Is(head) => Some(head.seq),
            HeadFile::None | HeadFile::Damaged => None,
        };
        if head != last {
            found.push(Broken::Head);
        }
        let taken = self.folder.join(TAKEN);
        drop(disk.create(&taken).at(&taken)?);
        if disk.create(&taken).is_ok() {
            found.push(Broken::Names);
        }
        let locked = self.folder.join(LOCKED);
        if self.lock.is_none() || disk.lock(&locked).at(&locked)?.is_some() {
            found.push(Broken::Locks);
        }
        Ok(found)
    }

    /// Removes everything that the trial has made.
    ///
    /// # Errors
    /// [`StoreError`] if something cannot be removed; it names what.
    pub fn end(mut self) -> Result<(), StoreError> {
        self.clear()
    }

    fn clear(&mut self) -> Result<(), StoreError> {
        if self.ended {
            return Ok(());
        }
        self.ended = true;
        // Windows removes no file that is open.
        (self.journal, self.lock) = (None, None);
        remove(self.disk.as_ref(), &self.folder)
    }
}

impl Drop for DiskTrial {
    fn drop(&mut self) {
        // The error of the trial itself is the one to report.
        let _ = self.clear();
    }
}

/// Removes the folder of a trial, also where a lock is a file of its own.
fn remove(disk: &dyn Disk, folder: &Path) -> Result<(), StoreError> {
    let _ = disk.remove_file(&folder.join(format!(".{LOCKED}.lock")));
    remove_all(disk, folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::disk::{Item, RealDisk};

    /// What is wrong with a disk.
    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Fault {
        /// Every sync and rename takes this long.
        Slow(Duration),
        /// Nothing can be renamed.
        NoRename,
        /// Locks are given to everybody.
        NoLocks,
        /// What is written is not there.
        Forgets,
    }

    #[derive(Debug)]
    struct Faulty(Fault);

    struct File(Fault, Box<dyn Appender>);

    impl Appender for File {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.0 {
                Fault::Forgets => Ok(bytes.len()),
                _ => self.1.write(bytes),
            }
        }

        fn sync(&mut self) -> io::Result<()> {
            if let Fault::Slow(time) = self.0 {
                std::thread::sleep(time);
            }
            self.1.sync()
        }
    }

    impl Disk for Faulty {
        fn create_folder(&self, path: &Path) -> io::Result<()> {
            RealDisk.create_folder(path)
        }
        fn sync_folder(&self, path: &Path) -> io::Result<()> {
            RealDisk.sync_folder(path)
        }
        fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
            Ok(Box::new(File(self.0, RealDisk.create(path)?)))
        }
        fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
            RealDisk.open(path)
        }
        fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()> {
            RealDisk.truncate(path, bytes)
        }
        fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
            match self.0 {
                Fault::NoRename => Err(io::ErrorKind::Unsupported.into()),
                _ => RealDisk.rename(from, to),
            }
        }
        fn remove_file(&self, path: &Path) -> io::Result<()> {
            RealDisk.remove_file(path)
        }
        fn remove_folder(&self, path: &Path) -> io::Result<()> {
            RealDisk.remove_folder(path)
        }
        fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
            RealDisk.read(path)
        }
        fn list(&self, path: &Path) -> io::Result<Vec<Item>> {
            RealDisk.list(path)
        }
        fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
            match self.0 {
                Fault::NoLocks => Ok(Some(Box::new(()))),
                _ => RealDisk.lock(path),
            }
        }
        fn free_bytes(&self, path: &Path) -> io::Result<Option<u64>> {
            RealDisk.free_bytes(path)
        }
    }

    fn left(home: &Path) -> usize {
        std::fs::read_dir(home).unwrap().count()
    }

    #[test]
    fn a_good_disk_keeps_its_word_and_nothing_is_left() {
        let home = tempfile::tempdir().unwrap();
        let mut trial = DiskTrial::begin(Arc::new(RealDisk), home.path()).unwrap();
        for _ in 0..20 {
            let time = trial.save().unwrap();
            assert!(time.journal > Duration::ZERO && time.head > Duration::ZERO);
        }
        assert_eq!(trial.broken().unwrap(), []);
        let journal = std::fs::read(trial.journal_path()).unwrap();
        assert_eq!(journal.iter().filter(|b| **b == b'\n').count(), 20);
        trial.end().unwrap();
        assert_eq!(left(home.path()), 0);
    }

    /// Times of a shim that is slow, and of one that is not.
    #[test]
    fn a_slow_disk_shows_in_the_times() {
        let home = tempfile::tempdir().unwrap();
        let pause = Duration::from_millis(40);
        let disk = Arc::new(Faulty(Fault::Slow(pause)));
        let mut trial = DiskTrial::begin(disk, home.path()).unwrap();
        let time = trial.save().unwrap();
        assert!(time.journal >= pause, "{time:?}");
        assert!(time.head >= pause, "{time:?}");
        drop(trial);
        assert_eq!(left(home.path()), 0);
    }

    #[test]
    fn what_a_file_system_does_not_do_is_named_and_nothing_is_left() {
        for (fault, expected) in [
            (Fault::NoLocks, vec![Broken::Locks]),
            (Fault::Forgets, vec![Broken::Journal, Broken::Head]),
        ] {
            let home = tempfile::tempdir().unwrap();
            let mut trial = DiskTrial::begin(Arc::new(Faulty(fault)), home.path()).unwrap();
            trial.save().unwrap();
            assert_eq!(trial.broken().unwrap(), expected);
            drop(trial);
            assert_eq!(left(home.path()), 0);
        }
        let home = tempfile::tempdir().unwrap();
        let disk = Arc::new(Faulty(Fault::NoRename));
        let mut trial = DiskTrial::begin(disk, home.path()).unwrap();
        let why = trial.save().unwrap_err().to_string();
        assert!(why.contains(layout::HEAD), "{why}");
        drop(trial);
        assert_eq!(left(home.path()), 0);
    }

    #[test]
    fn a_killed_trial_is_cleared_away_and_one_at_work_is_left_alone() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join(layout::TRIAL);
        std::fs::create_dir_all(folder.join(LOCKED)).unwrap();
        std::fs::write(folder.join("journal.jsonl"), "old").unwrap();
        let disk: Arc<dyn Disk> = Arc::new(RealDisk);
        let trial = DiskTrial::begin(disk.clone(), home.path()).unwrap();
        let second = DiskTrial::begin(disk, home.path()).unwrap_err();
        assert!(matches!(second, StoreError::Busy { .. }), "{second}");
        assert!(trial.folder().exists());
        trial.end().unwrap();
        assert_eq!(left(home.path()), 0);
    }

    #[test]
    fn a_folder_that_does_not_exist_is_an_error() {
        let home = tempfile::tempdir().unwrap();
        let none = home.path().join("none");
        assert!(DiskTrial::begin(Arc::new(RealDisk), &none).is_err());
    }
}
