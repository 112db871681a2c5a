//! Writing the journal of one session.
//!
//! Each record is one write; [`Journal::append`] returns only when the record and then
//! `head.json` are on the medium. After a failed write or sync the file is not touched
//! again, because a second sync can succeed although data were lost.
//! [`Journal::new_segment`] continues in another file.
//!
//! For the same reason a journal that is continued by another process continues in a new
//! segment, which first repeats every record that was not acknowledged: the process
//! before may have been told that its sync failed.

use super::disk::{Appender, Disk};
use super::error::{At as _, StoreError};
use super::head::{Head, HeadFile};
use super::journal_record::{self, LineError, Record};
use super::layout;
use super::receipt::Receipt;
use super::replay::{Replay, Segment, lines_after, replay};
use super::session_lock::SessionLock;
use crate::outcome::{Event, Moment};
use std::collections::BTreeSet;
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
    /// The lines that are acknowledged.
    acknowledged: Vec<Vec<u8>>,
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
    /// Continues a journal: in a new segment, unless this process created the first one.
    pub(super) fn open(lock: Arc<SessionLock>, from: Recovered) -> Result<Self, StoreError> {
        let path = lock.path.join(layout::segment(from.segment));
        let file = lock.disk.open(&path).at(&path)?;
        let mut journal = Self {
            lock,
            file,
            path,
            segment: from.segment,
            next_seq: from.replay.next_seq,
            prev: from.replay.prev,
            acknowledged: Vec::new(),
            failed: None,
        };
        if !from.is_new {
            journal.new_segment()?;
        }
        journal.acknowledged = from.acknowledged;
        if !from.in_doubt.is_empty() {
            journal.write(&from.in_doubt)?;
            let last = journal.next_seq - 1;
            journal.write_head(last, &journal.prev)?;
            journal.acknowledged.extend(from.in_doubt);
        }
        Ok(journal)
    }

    /// Writes an event and returns its sequence number when it is on the medium.
    ///
    /// # Errors
    /// As [`Journal::append_all`].
    pub fn append(&mut self, at: Moment, event: &Event) -> Result<u64, StoreError> {
        self.append_all(&[(at, event)])
    }

    /// Writes events, with one sync for all; returns the sequence number of the last one
    /// when they are on the medium.
    ///
    /// # Errors
    /// [`StoreError`]: no event is acknowledged, whatever the file contains. After a
    /// failed write or sync call [`Journal::new_segment`] and append the same events
    /// again.
    pub fn append_all(&mut self, events: &[(Moment, &Event)]) -> Result<u64, StoreError> {
        let records = events
            .iter()
            .map(|(at, event)| Record::Event(*at, (*event).clone()));
        self.records(&records.collect::<Vec<_>>())
    }

    pub(super) fn records(&mut self, records: &[Record]) -> Result<u64, StoreError> {
        if self.failed.is_some() {
            return Err(StoreError::SegmentFailed {
                path: self.path.clone(),
            });
        }
        let unstorable = |e: LineError| StoreError::Unstorable {
            path: self.path.clone(),
            what: e.to_string(),
        };
        let (mut next, mut prev) = (self.next_seq, self.prev.clone());
        let mut lines = Vec::with_capacity(records.len());
        for record in records {
            let line = journal_record::encode(next, &prev, record).map_err(unstorable)?;
            // A record that cannot be read back now would be lost unnoticed later.
            journal_record::decode(&line).map_err(unstorable)?;
            prev = journal_record::hash(&line);
            next += 1;
            lines.push(line);
        }
        let last = next.saturating_sub(1);
        let written = self.write(&lines);
        if let Err(e) = written.and_then(|()| self.write_head(last, &prev)) {
            self.failed = Some(if e.is_full() {
                SegmentFailure::Full
            } else {
                SegmentFailure::Other
            });
            return Err(e);
        }
        (self.next_seq, self.prev) = (next, prev);
        self.acknowledged.extend(lines);
        Ok(last)
    }

    /// Writes lines without their line ends and returns when they are on the medium.
    fn write(&mut self, lines: &[Vec<u8>]) -> Result<(), StoreError> {
        write_lines(self.file.as_mut(), lines).at(&self.path)
    }

    fn write_head(&self, seq: u64, hash: &str) -> Result<(), StoreError> {
        Head::new(seq, hash, self.segment).write(self.lock.disk.as_ref(), &self.lock.path)
    }

    /// Continues in a new file (`journal-2.jsonl`, …) of the same folder; on a full
    /// disk it first frees the reserve. The failed records must be appended again. They
    /// keep their sequence numbers, and a reader takes two equal lines as one. What was
    /// acknowledged and is not there any more, because somebody removed or changed a file, is
    /// written again.
    ///
    /// # Errors
    /// [`StoreError`]; the call can be repeated.
    pub fn new_segment(&mut self) -> Result<(), StoreError> {
        if self.failed == Some(SegmentFailure::Full) {
            self.lock.free_reserve();
        }
        let mut number = self.segment + 1;
        let (path, mut file) = loop {
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
        let lost = self.lost()?;
        if !lost.is_empty() {
            write_lines(file.as_mut(), &lost).at(&path)?;
        }
        self.file = file;
        self.path = path;
        self.segment = number;
        self.failed = None;
        Ok(())
    }

    /// The acknowledged lines that are in no segment.
    fn lost(&self) -> Result<Vec<Vec<u8>>, StoreError> {
        if self.acknowledged.is_empty() {
            return Ok(Vec::new());
        }
        let segments = segments(self.lock.disk.as_ref(), &self.lock.path)?;
        let there: BTreeSet<Vec<u8>> = lines_after(&segments, None).into_iter().collect();
        let lost = self.acknowledged.iter();
        Ok(lost
            .filter(|line| !there.contains(*line))
            .cloned()
            .collect())
    }

    /// Writes `receipt.json`: what this journal contains now that the session is left.
    /// `None` if nothing was ever acknowledged.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be written; no answer depends on it.
    pub fn receipt(&self) -> Result<Option<Receipt>, StoreError> {
        let Some(last) = self.next_seq.checked_sub(1) else {
            return Ok(None);
        };
        let receipt = Receipt::new(last, &self.prev);
        receipt.write(self.lock.disk.as_ref(), &self.lock.path)?;
        Ok(Some(receipt))
    }
}

/// Writes lines without their line ends and returns when they are on the medium.
fn write_lines(file: &mut dyn Appender, lines: &[Vec<u8>]) -> io::Result<()> {
    for line in lines {
        file.write_all(&[line, &b"\n"[..]].concat())?;
    }
    file.sync()
}

/// The segments of a journal, in order; none if there is no journal.
pub(super) fn segments(disk: &dyn Disk, folder: &Path) -> Result<Vec<Segment>, StoreError> {
    let read = |number: u32| {
        let name = layout::segment(number);
        let path = folder.join(&name);
        let bytes = disk.read(&path).at(&path)?;
        Ok(Segment { name, bytes })
    };
    let numbers = segment_numbers(disk, folder)?;
    numbers.into_iter().map(read).collect()
}

/// The numbers of the segments in a session's folder, in order.
fn segment_numbers(disk: &dyn Disk, folder: &Path) -> Result<Vec<u32>, StoreError> {
    let items = disk.list(folder).at(folder)?;
    let mut numbers: Vec<u32> = items
        .iter()
        .filter_map(|i| layout::segment_number(&i.name))
        .collect();
    numbers.sort_unstable();
    Ok(numbers)
}

/// A journal that can be continued.
#[derive(Debug)]
pub(super) struct Recovered {
    /// Number of the last segment.
    segment: u32,
    /// Whether this process created it.
    is_new: bool,
    /// The lines that were acknowledged, and those that were not.
    acknowledged: Vec<Vec<u8>>,
    in_doubt: Vec<Vec<u8>>,
    pub(super) replay: Replay,
    /// Messages to the operator about repairs and damage.
    pub(super) notices: Vec<String>,
}

/// Prepares the journal of a locked session for writing: makes what is there durable,
/// creates the first segment if there is none, and moves an incomplete end to a file of
/// its own. Damaged lines before it stay where they are.
///
/// After an interruption at any step the call can be repeated: the bytes are copied
/// and on the medium before they are cut off, and an equal copy is not made twice.
///
/// # Errors
/// [`StoreError::Newer`] for a journal of a later version, [`StoreError::Damaged`] if
/// nothing is left of a journal, or the disk's.
pub(super) fn recover(lock: &SessionLock) -> Result<Recovered, StoreError> {
    let (disk, folder) = (lock.disk.as_ref(), lock.path.as_path());
    let head = Head::read(disk, folder)?;
    let is_new = head == HeadFile::None && segment_numbers(disk, folder)?.is_empty();
    if is_new {
        let path = folder.join(layout::segment(1));
        disk.create(&path).at(&path)?;
    }
    settle(disk, folder)?;
    let mut segments = segments(disk, folder)?;
    let first = replay(&segments, &head);
    if first.records == 0 && first.is_truncated() {
        return Err(StoreError::Damaged {
            path: folder.to_owned(),
            what: "its journal is missing, although answers were saved".to_owned(),
        });
    }
    let mut notices = Vec::new();
    if let Some(last) = segments.last_mut() {
        let path = folder.join(&last.name);
        let tail = first.tail;
        if tail.torn > 0 {
            let copy = set_apart(disk, folder, &last.bytes[tail.keep..])?;
            disk.truncate(&path, tail.keep as u64).at(&path)?;
            last.bytes.truncate(tail.keep);
            notices.push(format!(
                "the end of {} was incomplete; its {} bytes are in {copy}",
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
    let replay = replay(&segments, &head);
    if let Some(found) = replay.newer() {
        let path = folder.to_owned();
        return Err(StoreError::Newer { path, found });
    }
    notices.extend(replay.damage.iter().map(ToString::to_string));
    let last = segments.last();
    let in_doubt = lines_after(&segments, head.head().map(|head| head.seq));
    let mut acknowledged = lines_after(&segments, None);
    acknowledged.truncate(acknowledged.len() - in_doubt.len());
    Ok(Recovered {
        segment: last
            .and_then(|s| layout::segment_number(&s.name))
            .unwrap_or(1),
        is_new,
        acknowledged,
        in_doubt,
        replay,
        notices,
    })
}

/// Returns when the segments of a journal and their names are on the medium: the
/// process that wrote them may have died before its syncs.
pub(super) fn settle(disk: &dyn Disk, folder: &Path) -> Result<(), StoreError> {
    for number in segment_numbers(disk, folder)? {
        let path = folder.join(layout::segment(number));
        disk.open(&path)
            .and_then(|mut file| file.sync())
            .at(&path)?;
    }
    disk.sync_folder(folder).at(folder)
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
