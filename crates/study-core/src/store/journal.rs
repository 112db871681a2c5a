//! The journal of one session, written.
//!
//! One write for a record, then a sync; [`Journal::append`] returns only when the
//! record is on the medium. After a failed write or sync the file is never touched
//! again: a second sync may well say "ok" over lost data. [`Journal::new_segment`]
//! goes on in another file.

use super::disk::{Appender, Disk};
use super::error::{At as _, StoreError};
use super::held::Held;
use super::journal_record::{self, Record};
use super::layout;
use super::replay::{Replay, Segment, replay};
use crate::outcome::{Event, Moment};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An open journal. It can be moved to a thread of its own.
pub struct Journal {
    held: Arc<Held>,
    file: Box<dyn Appender>,
    path: PathBuf,
    segment: u32,
    next_seq: u64,
    prev: String,
    /// Why the present segment is not touched any more.
    failed: Option<Trouble>,
}

/// What kind of failure a segment had.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trouble {
    Full,
    Other,
}

impl fmt::Debug for Journal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Journal")
            .field("path", &self.path)
            .field("next_seq", &self.next_seq)
            .field("failed", &self.failed)
            .finish_non_exhaustive()
    }
}

impl Journal {
    /// Opens the last segment to go on where a replay ended.
    pub(super) fn open(held: Arc<Held>, segment: u32, replay: &Replay) -> Result<Self, StoreError> {
        let path = held.path.join(layout::segment(segment));
        let file = held.disk.open(&path).at(&path)?;
        Ok(Self {
            held,
            file,
            path,
            segment,
            next_seq: replay.next_seq,
            prev: replay.prev.clone(),
            failed: None,
        })
    }

    /// Writes an event and returns its sequence number when it is on the medium.
    ///
    /// # Errors
    /// [`StoreError`]: the event is not acknowledged, whatever the file may hold.
    /// After a failed write or sync only [`Journal::new_segment`] helps; append the
    /// same event again afterwards.
    pub fn append(&mut self, at: Moment, event: &Event) -> Result<u64, StoreError> {
        self.record(&Record::Event(at, event.clone()))
    }

    pub(super) fn record(&mut self, record: &Record) -> Result<u64, StoreError> {
        if self.failed.is_some() {
            return Err(StoreError::SegmentFailed {
                path: self.path.clone(),
            });
        }
        let unstorable = |e: journal_record::BadLine| StoreError::Unstorable {
            path: self.path.clone(),
            what: e.to_string(),
        };
        let mut bytes =
            journal_record::encode(self.next_seq, &self.prev, record).map_err(unstorable)?;
        // What does not read back now would be lost later, in silence.
        journal_record::decode(&bytes).map_err(unstorable)?;
        let hash = journal_record::hash(&bytes);
        bytes.push(b'\n');
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync());
        if let Err(e) = written {
            self.failed = Some(if super::error::is_full(&e) {
                Trouble::Full
            } else {
                Trouble::Other
            });
            return Err(e).at(&self.path);
        }
        let seq = self.next_seq;
        self.next_seq += 1;
        self.prev = hash;
        Ok(seq)
    }

    /// Goes on in a new file, `journal-2.jsonl` and so on, of the same folder. On a
    /// full disk it first frees the reserve. The record in doubt has to be appended
    /// again; it keeps its sequence number, and a reader takes two equal lines as one.
    ///
    /// # Errors
    /// [`StoreError`]; it can be tried again.
    pub fn new_segment(&mut self) -> Result<(), StoreError> {
        if self.failed == Some(Trouble::Full) {
            self.held.free_reserve();
        }
        let mut number = self.segment + 1;
        let (path, file) = loop {
            let path = self.held.path.join(layout::segment(number));
            match self.held.disk.create(&path) {
                Ok(file) => break (path, file),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => number += 1,
                Err(e) => return Err(e).at(&path),
            }
        };
        self.held
            .disk
            .sync_folder(&self.held.path)
            .at(&self.held.path)?;
        self.file = file;
        self.path = path;
        self.segment = number;
        self.failed = None;
        Ok(())
    }
}

/// The segments of a journal, in order. No folder or no journal: none.
pub(super) fn segments(disk: &dyn Disk, folder: &Path) -> Result<Vec<Segment>, StoreError> {
    let items = disk.list(folder).at(folder)?;
    let mut numbers: Vec<u32> = items
        .iter()
        .filter(|i| !i.is_folder)
        .filter_map(|i| layout::segment_number(&i.name))
        .collect();
    numbers.sort_unstable();
    let read = |number: u32| {
        let name = layout::segment(number);
        let path = folder.join(&name);
        let bytes = disk.read(&path).at(&path)?;
        Ok(Segment { name, bytes })
    };
    numbers.into_iter().map(read).collect()
}

/// Sets a torn tail of the last segment apart, so that it can be written on, and
/// says what it did. Damaged lines before it are left alone. The caller holds the
/// lock of the session.
///
/// Each step leaves a folder from which it can be done again: the bytes are copied
/// and on the medium before they are cut off, and an equal copy is not made twice.
pub(super) fn recover(
    disk: &dyn Disk,
    folder: &Path,
) -> Result<(Vec<Segment>, Replay, Vec<String>), StoreError> {
    let mut segments = segments(disk, folder)?;
    let first = replay(&segments);
    let mut notices = Vec::new();
    if let Some(last) = segments.last_mut() {
        let path = folder.join(&last.name);
        let tail = first.tail;
        if tail.torn > 0 {
            let copy = set_apart(disk, folder, &last.bytes[tail.keep..])?;
            disk.truncate(&path, tail.keep as u64).at(&path)?;
            last.bytes.truncate(tail.keep);
            notices.push(format!(
                "the last line of {} had not been written to its end; its {} bytes are in {copy}",
                last.name, tail.torn
            ));
        }
        if tail.unended {
            let ended = disk.open(&path).and_then(|mut file| {
                file.write_all(b"\n")?;
                file.sync()
            });
            ended.at(&path)?;
            last.bytes.push(b'\n');
        }
    }
    let replay = replay(&segments);
    notices.extend(replay.damage.iter().map(ToString::to_string));
    Ok((segments, replay, notices))
}

/// Copies bytes to the first free `torn-<n>.bin`, unless one holds them already.
fn set_apart(disk: &dyn Disk, folder: &Path, bytes: &[u8]) -> Result<String, StoreError> {
    let mut number = 1;
    loop {
        let name = layout::torn(number);
        let path = folder.join(&name);
        match disk.create(&path) {
            Ok(mut file) => {
                file.write_all(bytes).and_then(|()| file.sync()).at(&path)?;
                disk.sync_folder(folder).at(folder)?;
                return Ok(name);
            }
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {
                if disk.read(&path).at(&path)? == bytes {
                    // Made by a process that died before it could cut.
                    let mut file = disk.open(&path).at(&path)?;
                    file.sync().at(&path)?;
                    disk.sync_folder(folder).at(folder)?;
                    return Ok(name);
                }
                number += 1;
            }
            Err(e) => return Err(e).at(&path),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::TelemetryWriter;

    /// Saving has a thread of its own, so that a screen that hangs delays nothing.
    #[test]
    fn journal_and_telemetry_can_move_to_a_thread() {
        fn moves<T: Send + 'static>() {}
        moves::<Journal>();
        moves::<TelemetryWriter>();
    }
}
