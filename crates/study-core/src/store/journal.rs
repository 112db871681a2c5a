//! Writing the journal of one session.
//!
//! Each record is one write followed by a sync; [`Journal::append`] returns only
//! when the record is on the medium. After a failed write or sync the file is not
//! touched again, because a second sync can succeed although data were lost.
//! [`Journal::new_segment`] continues in another file.

use super::disk::{Appender, Disk};
use super::error::{At as _, StoreError};
use super::journal_record::{self, Record};
use super::layout;
use super::replay::{Replay, Segment, replay};
use super::session_lock::SessionLock;
use crate::outcome::{Event, Moment};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An open journal. It can be moved to another thread.
pub struct Journal {
    lock: Arc<SessionLock>,
    file: Box<dyn Appender>,
    path: PathBuf,
    segment: u32,
    next_seq: u64,
    prev: String,
    /// Why the current segment must not be written to any more.
    failed: Option<SegmentFailure>,
}

/// How a write to a segment failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SegmentFailure {
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
    /// Opens the last segment to continue after the last record.
    pub(super) fn open(lock: Arc<SessionLock>, from: &Recovered) -> Result<Self, StoreError> {
        let path = lock.path.join(layout::segment(from.segment));
        let file = lock.disk.open(&path).at(&path)?;
        Ok(Self {
            lock,
            file,
            path,
            segment: from.segment,
            next_seq: from.replay.next_seq,
            prev: from.replay.prev.clone(),
            failed: None,
        })
    }

    /// Writes an event and returns its sequence number when it is on the medium.
    ///
    /// # Errors
    /// [`StoreError`]: the event is not acknowledged, whatever the file contains.
    /// After a failed write or sync call [`Journal::new_segment`] and append the same
    /// event again.
    pub fn append(&mut self, at: Moment, event: &Event) -> Result<u64, StoreError> {
        self.record(&Record::Event(at, event.clone()))
    }

    pub(super) fn record(&mut self, record: &Record) -> Result<u64, StoreError> {
        if self.failed.is_some() {
            return Err(StoreError::SegmentFailed {
                path: self.path.clone(),
            });
        }
        let unstorable = |e: journal_record::LineError| StoreError::Unstorable {
            path: self.path.clone(),
            what: e.to_string(),
        };
        let mut bytes =
            journal_record::encode(self.next_seq, &self.prev, record).map_err(unstorable)?;
        // A record that cannot be read back now would be lost unnoticed later.
        journal_record::decode(&bytes).map_err(unstorable)?;
        let hash = journal_record::hash(&bytes);
        bytes.push(b'\n');
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync());
        if let Err(e) = written {
            self.failed = Some(if super::error::is_full(&e) {
                SegmentFailure::Full
            } else {
                SegmentFailure::Other
            });
            return Err(e).at(&self.path);
        }
        let seq = self.next_seq;
        self.next_seq += 1;
        self.prev = hash;
        Ok(seq)
    }

    /// Continues in a new file (`journal-2.jsonl`, …) of the same folder; on a full
    /// disk it first frees the reserve. The failed record must be appended again. It
    /// keeps its sequence number, and a reader takes two equal lines as one.
    ///
    /// # Errors
    /// [`StoreError`]; the call can be repeated.
    pub fn new_segment(&mut self) -> Result<(), StoreError> {
        if self.failed == Some(SegmentFailure::Full) {
            self.lock.free_reserve();
        }
        let mut number = self.segment + 1;
        let (path, file) = loop {
            let path = self.lock.path.join(layout::segment(number));
            match self.lock.disk.create(&path) {
                Ok(file) => break (path, file),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => number += 1,
                Err(e) => return Err(e).at(&path),
            }
        };
        self.lock
            .disk
            .sync_folder(&self.lock.path)
            .at(&self.lock.path)?;
        self.file = file;
        self.path = path;
        self.segment = number;
        self.failed = None;
        Ok(())
    }
}

/// The segments of a journal, in order; none if there is no journal.
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

/// A journal that can be continued.
#[derive(Debug)]
pub(super) struct Recovered {
    /// Number of the last segment.
    pub(super) segment: u32,
    pub(super) replay: Replay,
    /// Messages to the operator about repairs and damage.
    pub(super) notices: Vec<String>,
}

/// Prepares the journal of a locked session for writing: creates the first segment
/// if there is none and moves an incomplete last line to a file of its own. Damaged
/// lines before it stay where they are.
///
/// After an interruption at any step the call can be repeated: the bytes are copied
/// and on the medium before they are cut off, and an equal copy is not made twice.
///
/// # Errors
/// [`StoreError::Newer`] for a journal of a later version, or the disk's.
pub(super) fn recover(lock: &SessionLock) -> Result<Recovered, StoreError> {
    let (disk, folder) = (lock.disk.as_ref(), lock.path.as_path());
    let items = disk.list(folder).at(folder)?;
    let number = |i: &super::disk::Item| layout::segment_number(&i.name);
    if !items.iter().any(|i| number(i).is_some()) {
        let path = folder.join(layout::segment(1));
        disk.create(&path).at(&path)?;
        disk.sync_folder(folder).at(folder)?;
    }
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
                "the last line of {} was incomplete; its {} bytes are in {copy}",
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
    if let Some(found) = replay.newer() {
        let path = folder.to_owned();
        return Err(StoreError::Newer { path, found });
    }
    notices.extend(replay.damage.iter().map(ToString::to_string));
    let last = segments.last();
    Ok(Recovered {
        segment: last
            .and_then(|s| layout::segment_number(&s.name))
            .unwrap_or(1),
        replay,
        notices,
    })
}

/// Copies bytes to the first free `torn-<n>.bin` unless one contains them already.
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
                    // Written by a process that died before it could truncate.
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

    /// Saving runs on its own thread, so that a blocked screen does not delay it.
    #[test]
    fn journal_and_telemetry_can_move_to_a_thread() {
        fn moves<T: Send + 'static>() {}
        moves::<Journal>();
        moves::<TelemetryWriter>();
    }
}
