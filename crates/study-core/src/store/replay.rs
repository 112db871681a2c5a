//! Reading the segments of a journal.
//!
//! Nothing is repaired here. A line that cannot be read affects no other line: every
//! valid line is used, wherever it is. All damage is listed as [`Damage`].

use super::journal_record::{self, Claim, Line, LineError, PREFIX, Record};
use crate::outcome::Entry;
use crate::outcome::fold::History;
use crate::protocol::Seat;
use serde::de::IgnoredAny;
use std::fmt;

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
    /// The last line is incomplete: it was never acknowledged. Number of bytes that
    /// are not part of a record.
    Torn(usize),
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
        write!(f, "{}, line {}: ", self.file, self.line)?;
        match &self.kind {
            DamageKind::Torn(0) => write!(f, "the last line has no line end"),
            DamageKind::Torn(bytes) => {
                write!(f, "the last line is incomplete ({bytes} bytes)")
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
    /// Number of bytes up to the end of the last valid record.
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
}

/// Reads the segments of one journal, in order.
pub fn replay(segments: &[Segment]) -> Replay {
    let mut reader = Reader {
        out: Replay {
            prev: journal_record::NO_LINE.to_owned(),
            ..Replay::default()
        },
        seen: Vec::new(),
        lost: 0,
    };
    for segment in segments {
        reader.segment(segment);
    }
    reader.finish(segments)
}

struct Reader {
    out: Replay,
    /// Hash of each record by sequence number, in ascending order.
    seen: Vec<(u64, String)>,
    /// Unreadable lines since the last record.
    lost: u64,
}

impl Reader {
    fn segment(&mut self, segment: &Segment) {
        let mut from = 0;
        let mut number = 0;
        self.out.tail = Tail::default();
        while from < segment.bytes.len() {
            number += 1;
            let rest = &segment.bytes[from..];
            match rest.iter().position(|b| *b == b'\n') {
                Some(end) => {
                    self.ended_line(segment, number, &rest[..end]);
                    from += end + 1;
                    self.out.tail.keep = from;
                }
                None => {
                    self.tail(segment, number, from);
                    break;
                }
            }
        }
    }

    fn ended_line(&mut self, segment: &Segment, number: usize, bytes: &[u8]) {
        let why = match journal_record::decode(bytes) {
            Ok(line) => return self.record(segment, number, bytes, line),
            Err(why) => why,
        };
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

    fn tail(&mut self, segment: &Segment, number: usize, from: usize) {
        let bytes = &segment.bytes[from..];
        let mut keep = from;
        let mut at = from;
        for piece in pieces(bytes) {
            if let Some((raw, line)) = whole(piece) {
                keep = at + raw.len();
                self.record(segment, number, raw, line);
            }
            at += piece.len();
        }
        let torn = segment.bytes.len() - keep;
        self.out.tail = Tail {
            keep,
            torn,
            unended: keep > from,
        };
        self.damage(segment, number, DamageKind::Torn(torn));
    }

    fn record(&mut self, segment: &Segment, number: usize, raw: &[u8], line: Line) {
        let hash = journal_record::hash(raw);
        let due = self.out.next_seq;
        if line.seq < due {
            // After a failed write the same record is written again.
            if let Ok(at) = self.seen.binary_search_by_key(&line.seq, |(seq, _)| *seq) {
                if self.seen[at].1 != hash {
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
        let place = self.seen.partition_point(|(seq, _)| *seq < line.seq);
        self.seen.insert(place, (line.seq, hash.clone()));
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

    fn finish(mut self, segments: &[Segment]) -> Replay {
        self.out.next_seq += self.lost;
        self.out.entries.sort_by_key(|e| e.seq);
        self.out.history = History::of(&self.out.entries);
        if let (None, Some(first), true) = (&self.out.claim, segments.first(), self.out.records > 0)
        {
            self.damage(&first.clone(), 1, DamageKind::NoClaim);
        }
        self.out
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
