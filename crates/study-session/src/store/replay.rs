//! Reading the segments of a journal.
//!
//! Nothing is repaired here. A line that cannot be read affects no other line: every
//! valid line is used, wherever it is. All damage is listed as [`Damage`]. Unreadable
//! lines at the end of a segment are what a crash leaves of records that were not
//! acknowledged, unless `head.json` says that they were.

use super::head::HeadFile;
use super::journal_record::{self, Claim, Line, LineError, PREFIX, Record};
use super::layout::{self, HEAD};
use crate::outcome::Entry;
use crate::outcome::fold::History;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::fmt;
use study_base::sort::SmallSort as _;
use study_plan::protocol::Seat;

/// One file of a journal, in order.
#[derive(Debug, Clone)]
pub struct Segment {
    /// File name in the session's folder.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Damage of a journal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// File name in the session's folder.
    pub file: String,
    /// Line of the file, from 1.
    pub line: usize,
    /// Kind of damage.
    pub kind: DamageKind,
}

/// A kind of damage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DamageKind {
    /// The end cannot be read or has no line end: it was never acknowledged. Number of
    /// bytes that are not part of a record.
    Torn(usize),
    /// Acknowledged records are missing at the end: the first and the last of them.
    Truncated(u64, u64),
    /// The last acknowledged record is another one.
    Changed(u64),
    /// `head.json` cannot be read.
    Head,
    /// There is no `head.json` although the claim says that there is one.
    NoHead,
    /// The line cannot be read.
    Unreadable(LineError),
    /// Whole lines are missing: the expected and the found sequence number.
    Missing(u64, u64),
    /// The line does not follow the one before it.
    Chain(u64),
    /// Two different lines have the same sequence number.
    Conflict(u64),
    /// An event of a later version of the program.
    Unknown(String),
    /// The journal has no claim, or events precede it.
    NoClaim,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.kind {
            DamageKind::Head => {
                return write!(
                    f,
                    "{HEAD}: damaged; the end of the journal is not protected"
                );
            }
            DamageKind::NoHead => {
                return write!(
                    f,
                    "{HEAD}: missing; the end of the journal is not protected"
                );
            }
            _ => write!(f, "{}, line {}: ", self.file, self.line)?,
        }
        match &self.kind {
            DamageKind::Head | DamageKind::NoHead => Ok(()),
            DamageKind::Truncated(from, to) if from == to => {
                write!(
                    f,
                    "the journal is truncated: record {to} was saved and is missing"
                )
            }
            DamageKind::Truncated(from, to) => write!(
                f,
                "the journal is truncated: records {from} to {to} were saved and are missing"
            ),
            DamageKind::Changed(seq) => write!(f, "record {seq} is not the one that was saved"),
            DamageKind::Torn(0) => write!(f, "the last line has no line end"),
            DamageKind::Torn(bytes) => {
                write!(f, "the end is incomplete ({bytes} bytes)")
            }
            DamageKind::Unreadable(why) => write!(f, "damaged: {why}"),
            DamageKind::Missing(due, found) => {
                write!(f, "lines are missing: expected record {due}, found {found}")
            }
            DamageKind::Chain(seq) => write!(f, "record {seq} does not follow the line before it"),
            DamageKind::Conflict(seq) => write!(f, "there are two different records {seq}"),
            DamageKind::Unknown(name) => write!(
                f,
                "`{}` is an event of a newer version of study",
                study_base::text::Untrusted(name)
            ),
            DamageKind::NoClaim => write!(f, "the claim of the session is missing"),
        }
    }
}

/// The end of the last segment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tail {
    /// Number of bytes up to the end of the last valid or damaged record.
    pub keep: usize,
    /// Number of bytes after it.
    pub torn: usize,
    /// The last valid record has no line end.
    pub unended: bool,
}

/// The content of a journal.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Replay {
    /// The first line, if it could be read.
    pub claim: Option<Claim>,
    /// Every event that could be read, by sequence number.
    pub entries: Vec<Entry>,
    /// What these events add up to.
    pub history: History,
    /// All damage, in the order of the files.
    pub damage: Vec<Damage>,
    /// Number of records that could be read, including the claim.
    pub records: u64,
    /// Sequence number of the next record.
    pub next_seq: u64,
    /// Hash of the last line.
    pub prev: String,
    /// The end of the last segment.
    pub tail: Tail,
    /// Whether every record was acknowledged and is therefore on the medium.
    pub settled: bool,
    /// Hash of each record by sequence number, in ascending order.
    pub(super) hashes: Vec<(u64, String)>,
}

impl Replay {
    /// The seat from the claim or, if that is damaged, from the first event.
    pub fn seat(&self) -> Option<Seat> {
        match (&self.claim, self.history.start()) {
            (Some(claim), _) => claim.seat,
            (None, Some(start)) => Some(start.seat),
            (None, None) => None,
        }
    }

    /// The format or event of a later version of the program, if it contains one.
    pub fn newer(&self) -> Option<String> {
        self.damage.iter().find_map(|d| match &d.kind {
            DamageKind::Unknown(name) => Some(name.clone()),
            DamageKind::Unreadable(LineError::Newer(v)) => Some(format!("journal version {v}")),
            _ => None,
        })
    }

    /// Whether acknowledged records are missing at the end.
    pub fn is_truncated(&self) -> bool {
        let truncated = |d: &Damage| matches!(d.kind, DamageKind::Truncated(..));
        self.damage.iter().any(truncated)
    }
}

/// Reads the segments of one journal, in order, and compares them with its head.
pub fn replay(segments: &[Segment], head: &HeadFile) -> Replay {
    let mut reader = Reader {
        out: Replay {
            prev: journal_record::NO_LINE.to_owned(),
            ..Replay::default()
        },
        lost: 0,
        bad: Vec::new(),
    };
    let mut rest = segments;
    while let Some((segment, after)) = rest.split_first() {
        reader.segment(segment);
        // Unreadable lines at the end were acknowledged if what follows is more than the
        // next record.
        let end = head.head().map(|head| head.seq + 1);
        let follows = after.iter().find_map(first_seq).or(end);
        if follows.is_some_and(|seq| seq > reader.out.next_seq) {
            reader.bad_lines(segment);
        }
        reader.torn(segment);
        rest = after;
    }
    reader.finish(segments, head)
}

/// Sequence number of the first record of a segment.
fn first_seq(segment: &Segment) -> Option<u64> {
    let mut records = records(segment);
    records.next().map(|(_, line)| line.seq)
}

/// The valid records of a segment and their bytes.
fn records(segment: &Segment) -> impl Iterator<Item = (&[u8], Line)> {
    let lines = segment.bytes.split(|b| *b == b'\n');
    lines.flat_map(pieces).filter_map(whole)
}

/// The valid lines with a sequence number after `seq`, in order and without line ends;
/// all if it is `None`.
pub(super) fn lines_after(segments: &[Segment], seq: Option<u64>) -> Vec<Vec<u8>> {
    let mut lines = BTreeMap::new();
    for segment in segments {
        for (raw, line) in records(segment) {
            if seq.is_none_or(|seq| line.seq > seq) {
                lines.entry(line.seq).or_insert_with(|| raw.to_vec());
            }
        }
    }
    lines.into_values().collect()
}

struct Reader {
    out: Replay,
    /// Unreadable lines since the last record.
    lost: u64,
    /// Unreadable lines of the present segment, after which no record came yet.
    bad: Vec<BadLine>,
}

/// A line without any record.
struct BadLine {
    /// In the segment, from 1.
    number: usize,
    why: LineError,
    hash: String,
    /// End of the line in the segment.
    end: usize,
}

impl Reader {
    /// Reads a segment up to its last record.
    fn segment(&mut self, segment: &Segment) {
        let mut from = 0;
        let mut number = 0;
        self.out.tail = Tail::default();
        while from < segment.bytes.len() {
            number += 1;
            let rest = &segment.bytes[from..];
            match rest.iter().position(|b| *b == b'\n') {
                Some(end) => {
                    self.ended_line(segment, number, from, &rest[..end]);
                    from += end + 1;
                }
                None => {
                    self.unended_line(segment, number, from);
                    break;
                }
            }
        }
    }

    fn ended_line(&mut self, segment: &Segment, number: usize, from: usize, bytes: &[u8]) {
        let end = from + bytes.len() + 1;
        let why = match journal_record::decode(bytes) {
            Ok(line) => {
                self.bad_lines(segment);
                self.record(segment, number, bytes, line);
                self.out.tail.keep = end;
                return;
            }
            Err(why) => why,
        };
        if !pieces(bytes).any(|piece| whole(piece).is_some()) {
            let hash = journal_record::hash(bytes);
            self.bad.push(BadLine {
                number,
                why,
                hash,
                end,
            });
            return;
        }
        self.bad_lines(segment);
        self.out.tail.keep = end;
        // Two records are on one line if the line end between them is damaged.
        self.damage(segment, number, DamageKind::Unreadable(why));
        let mut lost = 0;
        for piece in pieces(bytes) {
            match whole(piece) {
                Some((raw, line)) => self.record(segment, number, raw, line),
                None => lost += 1,
            }
        }
        if lost > 0 {
            self.lost += lost;
            self.out.prev = journal_record::hash(bytes);
        }
    }

    fn unended_line(&mut self, segment: &Segment, number: usize, from: usize) {
        let mut at = from;
        for piece in pieces(&segment.bytes[from..]) {
            if let Some((raw, line)) = whole(piece) {
                self.bad_lines(segment);
                self.record(segment, number, raw, line);
                self.out.tail.keep = at + raw.len();
                self.out.tail.unended = true;
            }
            at += piece.len();
        }
    }

    /// Unreadable lines before a record: each may have been one.
    fn bad_lines(&mut self, segment: &Segment) {
        for bad in std::mem::take(&mut self.bad) {
            self.damage(segment, bad.number, DamageKind::Unreadable(bad.why));
            self.lost += 1;
            self.out.prev = bad.hash;
            self.out.tail.keep = bad.end;
        }
    }

    /// What is left at the end of a segment was never acknowledged.
    fn torn(&mut self, segment: &Segment) {
        self.bad.clear();
        let tail = &mut self.out.tail;
        tail.torn = segment.bytes.len() - tail.keep;
        if tail.torn > 0 || tail.unended {
            let before = &segment.bytes[..tail.keep];
            let line = before.iter().filter(|b| **b == b'\n').count() + 1;
            let kind = DamageKind::Torn(tail.torn);
            self.damage(segment, line, kind);
        }
    }

    fn record(&mut self, segment: &Segment, number: usize, raw: &[u8], line: Line) {
        let hash = journal_record::hash(raw);
        let due = self.out.next_seq;
        if line.seq < due {
            // After a failed write the same record is written again.
            let seen = &self.out.hashes;
            if let Ok(at) = seen.binary_search_by_key(&line.seq, |(seq, _)| *seq) {
                if seen[at].1 != hash {
                    self.damage(segment, number, DamageKind::Conflict(line.seq));
                }
                return;
            }
            self.damage(segment, number, DamageKind::Chain(line.seq));
        } else if line.seq - due > self.lost {
            self.damage(
                segment,
                number,
                DamageKind::Missing(due + self.lost, line.seq),
            );
        } else if self.lost == 0 && line.prev != self.out.prev {
            self.damage(segment, number, DamageKind::Chain(line.seq));
        }
        let is_claim = matches!(line.record, Record::Claim(_));
        if is_claim != (line.seq == 0) {
            self.damage(segment, number, DamageKind::NoClaim);
        }
        self.lost = 0;
        self.out.next_seq = due.max(line.seq + 1);
        let place = self.out.hashes.partition_point(|(seq, _)| *seq < line.seq);
        self.out.hashes.insert(place, (line.seq, hash.clone()));
        self.out.prev = hash;
        self.out.records += 1;
        match line.record {
            Record::Claim(claim) => self.out.claim = self.out.claim.take().or(Some(claim)),
            Record::Event(at, event) => self.out.entries.push(Entry {
                seq: line.seq,
                at,
                event,
            }),
            Record::Unknown(name) => self.damage(segment, number, DamageKind::Unknown(name)),
        }
    }

    fn damage(&mut self, segment: &Segment, line: usize, kind: DamageKind) {
        self.out.damage.push(Damage {
            file: segment.name.clone(),
            line,
            kind,
        });
    }

    fn finish(mut self, segments: &[Segment], head: &HeadFile) -> Replay {
        self.out.next_seq += self.lost;
        self.compare(segments, head);
        self.out.entries.small_sort_by_key(|e| e.seq);
        self.out.history = History::of(&self.out.entries);
        if let (None, Some(first), true) = (&self.out.claim, segments.first(), self.out.records > 0)
        {
            self.damage(first, 1, DamageKind::NoClaim);
        }
        self.out
    }

    /// Compares the end of the journal with its head. What is found wrong stays wrong
    /// when the journal is continued: the next record follows the head.
    fn compare(&mut self, segments: &[Segment], head: &HeadFile) {
        let last = self.out.hashes.last().map(|(seq, _)| *seq);
        let promised = self.out.claim.as_ref().is_some_and(|c| c.head);
        let kind = match head {
            HeadFile::Damaged => Some(DamageKind::Head),
            // It is written after the claim and before the first event.
            HeadFile::None if promised && last > Some(0) => Some(DamageKind::NoHead),
            _ => None,
        };
        self.out.damage.extend(kind.map(|kind| Damage {
            file: HEAD.to_owned(),
            line: 1,
            kind,
        }));
        let head = head.head();
        self.out.settled = last.is_none_or(|last| head.is_some_and(|head| last <= head.seq));
        let Some(head) = head else {
            return;
        };
        let kind = match self.out.hashes.iter().rfind(|(seq, _)| *seq == head.seq) {
            Some((_, hash)) if *hash == head.hash => return,
            Some(_) => DamageKind::Changed(head.seq),
            None if head.seq >= self.out.next_seq => {
                DamageKind::Truncated(self.out.next_seq, head.seq)
            }
            // Missing inside the journal, and already reported.
            None => return,
        };
        if last.is_none_or(|last| last <= head.seq) {
            self.out.next_seq = head.seq + 1;
            self.out.prev.clone_from(&head.hash);
        }
        let (file, bytes) = match segments.last() {
            Some(segment) => (segment.name.clone(), &segment.bytes[..]),
            None => (layout::segment(1), &[][..]),
        };
        let line = bytes.iter().filter(|b| **b == b'\n').count();
        self.out.damage.push(Damage { file, line, kind });
    }
}

/// The bytes split before each start of a record.
fn pieces(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut starts: Vec<usize> = bytes
        .windows(PREFIX.len())
        .enumerate()
        .filter(|(_, w)| *w == PREFIX)
        .map(|(at, _)| at)
        .collect();
    if starts.first() != Some(&0) {
        starts.insert(0, 0);
    }
    let ends: Vec<usize> = starts
        .iter()
        .skip(1)
        .copied()
        .chain([bytes.len()])
        .collect();
    starts
        .into_iter()
        .zip(ends)
        .map(|(from, to)| &bytes[from..to])
        .filter(|piece| !piece.is_empty())
}

/// The record at the start of the bytes.
fn whole(piece: &[u8]) -> Option<(&[u8], Line)> {
    let mut values = serde_json::Deserializer::from_slice(piece).into_iter::<IgnoredAny>();
    values.next()?.ok()?;
    let raw = &piece[..values.byte_offset()];
    Some((raw, journal_record::decode(raw).ok()?))
}
