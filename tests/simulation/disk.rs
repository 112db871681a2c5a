//! The disks of a simulated computer, which are without power together.

use crate::bugs::Bug;
use crate::memory::MemoryDisk;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use study_session::store::disk::{Appender, Disk, Item, Lock};
use study_session::store::layout;

/// Whether a process has died. What it does from then on reaches nothing. Clones share it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Death(Arc<AtomicBool>);

impl Death {
    /// The process dies now.
    pub(crate) fn comes(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it has died.
    pub(crate) fn is_here(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// One of the disks, as a process sees it.
#[derive(Debug, Clone)]
pub(crate) struct SimDisk {
    pub(crate) disk: MemoryDisk,
    pub(crate) death: Death,
    pub(crate) bug: Option<Bug>,
}

impl SimDisk {
    /// Makes a call, unless the process is dead; it dies of some calls.
    fn on<T>(&self, call: impl FnOnce(&MemoryDisk) -> io::Result<T>) -> io::Result<T> {
        self.alive()?;
        let done = call(&self.disk);
        self.notice();
        done
    }

    fn alive(&self) -> io::Result<()> {
        match self.death.is_here() {
            true => Err(io::Error::other("the process is dead")),
            false => Ok(()),
        }
    }

    fn notice(&self) {
        if self.disk.is_dead() {
            self.death.comes();
        }
    }

    fn opened(&self, path: &Path, file: Box<dyn Appender>) -> Box<dyn Appender> {
        let name = path.file_name().and_then(|name| name.to_str());
        let is_journal = name.and_then(layout::segment_number).is_some();
        Box::new(SimFile {
            file,
            disk: self.clone(),
            bug: self.bug.filter(|_| is_journal),
            late: false,
        })
    }
}

impl Disk for SimDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.on(|disk| disk.create_folder(path))
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        self.on(|disk| disk.sync_folder(path))
    }

    fn create(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let file = self.on(|disk| disk.create(path))?;
        Ok(self.opened(path, file))
    }

    fn open(&self, path: &Path) -> io::Result<Box<dyn Appender>> {
        let file = self.on(|disk| disk.open(path))?;
        Ok(self.opened(path, file))
    }

    fn truncate(&self, path: &Path, bytes: u64) -> io::Result<()> {
        self.on(|disk| disk.truncate(path, bytes))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.on(|disk| disk.rename(from, to))
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        self.on(|disk| disk.remove_file(path))
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        self.on(|disk| disk.remove_folder(path))
    }

    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        self.on(|disk| disk.read(path))
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Item>> {
        self.on(|disk| disk.list(path))
    }

    fn lock(&self, path: &Path) -> io::Result<Option<Lock>> {
        self.on(|disk| disk.lock(path))
    }

    fn free_bytes(&self, path: &Path) -> io::Result<Option<u64>> {
        self.on(|disk| disk.free_bytes(path))
    }
}

struct SimFile {
    file: Box<dyn Appender>,
    disk: SimDisk,
    bug: Option<Bug>,
    /// Whether a sync has been promised.
    late: bool,
}

impl Appender for SimFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.disk.alive()?;
        if std::mem::take(&mut self.late) {
            self.file.sync()?;
        }
        let written = self.file.write(bytes);
        self.disk.notice();
        written
    }

    fn sync(&mut self) -> io::Result<()> {
        self.disk.alive()?;
        match self.bug {
            Some(Bug::MissingSync) => return Ok(()),
            Some(Bug::LateSync) => {
                self.late = true;
                return Ok(());
            }
            _ => {}
        }
        let synced = self.file.sync();
        self.disk.notice();
        synced
    }
}
