//! Version 1 of the wire format: every message, as a type and as bytes.
//!
//! `docs/wire.md` is the specification; this is what host and device share, and
//! the only thing. Fields are little-endian and packed. What is set once is an
//! f64 in the program's units; what streams is a 32-bit integer in nm, µm/s, µN
//! and µm/s² ([`fixed`]), exact for an encoder's counts and never "no number".
//!
//! A body is `version, type, sequence number (u16), fields`, and travels in a
//! [`frame`](super::frame). Only `core` and slices.

mod bytes;
pub mod code;
pub mod fixed;
pub mod probe;
pub mod reply;
pub mod stream;
pub mod table;

use super::frame::{Frame, MAX_BODY};
use bytes::{Reader, Writer};
use core::fmt;

pub use code::{Fault, Happening, Loaded, Refusal, State};
pub use probe::{PathBegin, PathChunk, PathCrc};
pub use reply::{Ack, Flags, Identity, Name, Outcome, Pulse};
pub use stream::{Event, Recorded, RecordedPoint, Telemetry, TelemetrySample};
pub use table::{Node, TableBegin, TableChunk, TableCrc};

/// The version that this is.
pub const VERSION: u8 = 1;

/// Why a body is no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WireError {
    /// Shorter than a header.
    Header,
    /// Another version than [`VERSION`]: this one.
    Version(u8),
    /// The type is none of this direction.
    UnknownType(u8),
    /// Not as long as its type.
    Length,
    /// A field has a value that it cannot have.
    Field,
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Header => f.write_str("shorter than a header"),
            Self::Version(version) => write!(f, "wire format version {version}, not {VERSION}"),
            Self::UnknownType(kind) => write!(f, "unknown type of message 0x{kind:02x}"),
            Self::Length => f.write_str("a message of the wrong length"),
            Self::Field => f.write_str("a field has a value that it cannot have"),
        }
    }
}

/// What every body begins with, in this and every later version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Of the wire format.
    pub version: u8,
    /// Type of the message.
    pub kind: u8,
    /// Of a request, chosen by the host; of a reply, the request's; of what the
    /// device sends by itself, counted from 0 at HELLO, wrapping.
    pub sequence: u16,
}

impl Header {
    /// Its length in bytes.
    pub const LEN: usize = 4;

    /// The first four bytes of a body, of whatever version.
    pub fn read(body: &[u8]) -> Option<Self> {
        let [version, kind, low, high] = *body.first_chunk::<4>()?;
        Some(Self {
            version,
            kind,
            sequence: u16::from_le_bytes([low, high]),
        })
    }
}

/// A few values, without an allocation.
#[derive(Debug, Clone, Copy)]
pub struct Few<T, const N: usize> {
    items: [T; N],
    len: usize,
}

impl<T: Copy + Default, const N: usize> Few<T, N> {
    /// None.
    pub fn new() -> Self {
        Self {
            items: [T::default(); N],
            len: 0,
        }
    }

    /// The first [`Few::MOST`] of `items`.
    pub fn of(items: &[T]) -> Self {
        let mut few = Self::new();
        for item in items {
            few.push(*item);
        }
        few
    }

    /// How many it can hold.
    pub const MOST: usize = N;

    /// Adds one; false if it is full.
    pub fn push(&mut self, item: T) -> bool {
        match self.items.get_mut(self.len) {
            Some(place) => {
                *place = item;
                self.len += 1;
                true
            }
            None => false,
        }
    }

    /// Whether no more fits.
    pub fn is_full(&self) -> bool {
        self.len == N
    }

    /// Takes all of them out.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// What it holds.
    pub fn as_slice(&self) -> &[T] {
        &self.items[..self.len]
    }
}

impl<T: Copy + Default, const N: usize> Default for Few<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Copy + Default + PartialEq, const N: usize> PartialEq for Few<T, N> {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

/// Opens a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hello {
    /// Different for each connection; the device gives it back.
    pub nonce: u32,
}

/// Completes an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Commit {
    /// Over the fields of BEGIN and all nodes or points, as they were sent.
    pub crc: u32,
}

/// Starts to play a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Play {
    /// The host's number for this playback, not 0.
    pub playback: u32,
    /// Of the table that has to be loaded.
    pub crc: u32,
    /// After so long the device stops by itself, ms.
    pub longest_ms: u32,
    /// One telemetry sample in so many servo periods; 0: none. The device takes
    /// fewer samples if this is more than its telemetry can carry.
    pub every: u16,
}

/// Starts to follow a path and to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    /// The host's number for this recording, not 0.
    pub playback: u32,
    /// Of the path that has to be loaded.
    pub crc: u32,
}

/// Ends a playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stop {
    /// Which.
    pub playback: u32,
}

/// The host is alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heartbeat {
    /// Higher than that of every heartbeat before, wrapping.
    pub count: u32,
    /// By the device's clock, ms, wrapping: from then on it says nothing.
    pub deadline_ms: u32,
}

/// From the host to the device. Each but a heartbeat is answered by exactly one
/// [`Reply`] of its sequence number; a heartbeat by a [`Reply::Pulse`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "no allocation on a device; one of them at a time"
)]
pub enum Request {
    /// Who are you? Ends whatever another host had begun.
    Hello(Hello),
    /// A table begins.
    TableBegin(TableBegin),
    /// Some of its nodes.
    TableChunk(TableChunk),
    /// It is complete.
    TableCommit(Commit),
    /// Play it.
    Play(Play),
    /// Stop playing or recording.
    Stop(Stop),
    /// Zero force at once, latched; in every state.
    Limp,
    /// The host is alive.
    Heartbeat(Heartbeat),
    /// Leave `Limp` or `Fault`; only at rest.
    Rearm,
    /// How are you, and what came of the last playback?
    State,
    /// A path begins.
    PathBegin(PathBegin),
    /// Some of its points.
    PathChunk(PathChunk),
    /// It is complete.
    PathCommit(Commit),
    /// Follow it and record.
    Record(Record),
}

/// From the device to the host.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "no allocation on a device; one of them at a time"
)]
pub enum Reply {
    /// To every request that has no reply of its own.
    Ack(Ack),
    /// To HELLO.
    Identity(Identity),
    /// To STATE.
    Outcome(Outcome),
    /// To a heartbeat.
    Pulse(Pulse),
    /// Samples of a playback; not asked for.
    Telemetry(Telemetry),
    /// Something has happened; not asked for.
    Event(Event),
    /// Samples of a recording; not asked for.
    Recorded(Recorded),
}

/// Types of messages. Below 0x80 to the device, from there on to the host.
pub mod kind {
    /// [`super::Request::Hello`]
    pub const HELLO: u8 = 0x01;
    /// [`super::Request::TableBegin`]
    pub const TABLE_BEGIN: u8 = 0x02;
    /// [`super::Request::TableChunk`]
    pub const TABLE_CHUNK: u8 = 0x03;
    /// [`super::Request::TableCommit`]
    pub const TABLE_COMMIT: u8 = 0x04;
    /// [`super::Request::Play`]
    pub const PLAY: u8 = 0x05;
    /// [`super::Request::Stop`]
    pub const STOP: u8 = 0x06;
    /// [`super::Request::Limp`]
    pub const LIMP: u8 = 0x07;
    /// [`super::Request::Heartbeat`]
    pub const HEARTBEAT: u8 = 0x08;
    /// [`super::Request::Rearm`]
    pub const REARM: u8 = 0x09;
    /// [`super::Request::State`]
    pub const STATE: u8 = 0x0A;
    /// [`super::Request::PathBegin`]
    pub const PATH_BEGIN: u8 = 0x10;
    /// [`super::Request::PathChunk`]
    pub const PATH_CHUNK: u8 = 0x11;
    /// [`super::Request::PathCommit`]
    pub const PATH_COMMIT: u8 = 0x12;
    /// [`super::Request::Record`]
    pub const RECORD: u8 = 0x13;
    /// [`super::Reply::Ack`]
    pub const ACK: u8 = 0x80;
    /// [`super::Reply::Identity`]
    pub const IDENTITY: u8 = 0x81;
    /// [`super::Reply::Outcome`]
    pub const OUTCOME: u8 = 0x82;
    /// [`super::Reply::Pulse`]
    pub const PULSE: u8 = 0x83;
    /// [`super::Reply::Telemetry`]
    pub const TELEMETRY: u8 = 0x90;
    /// [`super::Reply::Event`]
    pub const EVENT: u8 = 0x91;
    /// [`super::Reply::Recorded`]
    pub const RECORDED: u8 = 0x92;
}

impl Request {
    /// Its type.
    pub fn kind(&self) -> u8 {
        match self {
            Self::Hello(_) => kind::HELLO,
            Self::TableBegin(_) => kind::TABLE_BEGIN,
            Self::TableChunk(_) => kind::TABLE_CHUNK,
            Self::TableCommit(_) => kind::TABLE_COMMIT,
            Self::Play(_) => kind::PLAY,
            Self::Stop(_) => kind::STOP,
            Self::Limp => kind::LIMP,
            Self::Heartbeat(_) => kind::HEARTBEAT,
            Self::Rearm => kind::REARM,
            Self::State => kind::STATE,
            Self::PathBegin(_) => kind::PATH_BEGIN,
            Self::PathChunk(_) => kind::PATH_CHUNK,
            Self::PathCommit(_) => kind::PATH_COMMIT,
            Self::Record(_) => kind::RECORD,
        }
    }

    /// Whether the device does it only once for a sequence number. The others can
    /// be sent at any time, by anyone, with any number.
    pub fn sequenced(&self) -> bool {
        !matches!(
            self,
            Self::Hello(_) | Self::Limp | Self::Heartbeat(_) | Self::State
        )
    }

    /// As a frame.
    pub fn frame(&self, sequence: u16) -> Frame {
        let mut out = header(self.kind(), sequence);
        match self {
            Self::Hello(hello) => out.u32(hello.nonce),
            Self::TableBegin(begin) => begin.write(&mut out),
            Self::TableChunk(chunk) => chunk.write(&mut out),
            Self::TableCommit(commit) | Self::PathCommit(commit) => out.u32(commit.crc),
            Self::Play(play) => {
                out.u32(play.playback);
                out.u32(play.crc);
                out.u32(play.longest_ms);
                out.u16(play.every);
            }
            Self::Record(record) => {
                out.u32(record.playback);
                out.u32(record.crc);
            }
            Self::Stop(stop) => out.u32(stop.playback),
            Self::Heartbeat(beat) => {
                out.u32(beat.count);
                out.u32(beat.deadline_ms);
            }
            Self::PathBegin(begin) => begin.write(&mut out),
            Self::PathChunk(chunk) => chunk.write(&mut out),
            Self::Limp | Self::Rearm | Self::State => {}
        }
        framed(&out)
    }

    /// From a frame's body.
    ///
    /// # Errors
    /// [`WireError`], with which a device refuses it.
    pub fn decode(body: &[u8]) -> Result<(Header, Self), WireError> {
        let (header, mut from) = opened(body)?;
        let request = match header.kind {
            kind::HELLO => Self::Hello(Hello { nonce: from.u32()? }),
            kind::TABLE_BEGIN => Self::TableBegin(TableBegin::read(&mut from)?),
            kind::TABLE_CHUNK => Self::TableChunk(TableChunk::read(&mut from)?),
            kind::TABLE_COMMIT => Self::TableCommit(Commit { crc: from.u32()? }),
            kind::PLAY => Self::Play(Play {
                playback: from.u32()?,
                crc: from.u32()?,
                longest_ms: from.u32()?,
                every: from.u16()?,
            }),
            kind::STOP => Self::Stop(Stop {
                playback: from.u32()?,
            }),
            kind::LIMP => Self::Limp,
            kind::HEARTBEAT => Self::Heartbeat(Heartbeat {
                count: from.u32()?,
                deadline_ms: from.u32()?,
            }),
            kind::REARM => Self::Rearm,
            kind::STATE => Self::State,
            kind::PATH_BEGIN => Self::PathBegin(PathBegin::read(&mut from)?),
            kind::PATH_CHUNK => Self::PathChunk(PathChunk::read(&mut from)?),
            kind::PATH_COMMIT => Self::PathCommit(Commit { crc: from.u32()? }),
            kind::RECORD => Self::Record(Record {
                playback: from.u32()?,
                crc: from.u32()?,
            }),
            other => return Err(WireError::UnknownType(other)),
        };
        from.done()?;
        Ok((header, request))
    }
}

impl Reply {
    /// Its type.
    pub fn kind(&self) -> u8 {
        match self {
            Self::Ack(_) => kind::ACK,
            Self::Identity(_) => kind::IDENTITY,
            Self::Outcome(_) => kind::OUTCOME,
            Self::Pulse(_) => kind::PULSE,
            Self::Telemetry(_) => kind::TELEMETRY,
            Self::Event(_) => kind::EVENT,
            Self::Recorded(_) => kind::RECORDED,
        }
    }

    /// Whether it answers a request.
    pub fn answers(&self) -> bool {
        self.kind() < kind::TELEMETRY
    }

    /// As a frame.
    pub fn frame(&self, sequence: u16) -> Frame {
        let mut out = header(self.kind(), sequence);
        match self {
            Self::Ack(ack) => ack.write(&mut out),
            Self::Identity(identity) => identity.write(&mut out),
            Self::Outcome(outcome) => outcome.write(&mut out),
            Self::Pulse(pulse) => pulse.write(&mut out),
            Self::Telemetry(telemetry) => telemetry.write(&mut out),
            Self::Event(event) => event.write(&mut out),
            Self::Recorded(recorded) => recorded.write(&mut out),
        }
        framed(&out)
    }

    /// From a frame's body.
    ///
    /// # Errors
    /// [`WireError`]: a host takes it for a damaged frame, but [`WireError::Version`]
    /// for a device that it cannot talk to.
    pub fn decode(body: &[u8]) -> Result<(Header, Self), WireError> {
        let (header, mut from) = opened(body)?;
        let reply = match header.kind {
            kind::ACK => Self::Ack(Ack::read(&mut from)?),
            kind::IDENTITY => Self::Identity(Identity::read(&mut from)?),
            kind::OUTCOME => Self::Outcome(Outcome::read(&mut from)?),
            kind::PULSE => Self::Pulse(Pulse::read(&mut from)?),
            kind::TELEMETRY => Self::Telemetry(Telemetry::read(&mut from)?),
            kind::EVENT => Self::Event(Event::read(&mut from)?),
            kind::RECORDED => Self::Recorded(Recorded::read(&mut from)?),
            other => return Err(WireError::UnknownType(other)),
        };
        from.done()?;
        Ok((header, reply))
    }
}

fn header(kind: u8, sequence: u16) -> Writer {
    let mut out = Writer::new();
    out.u8(VERSION);
    out.u8(kind);
    out.u16(sequence);
    out
}

fn opened(body: &[u8]) -> Result<(Header, Reader<'_>), WireError> {
    let header = Header::read(body).ok_or(WireError::Header)?;
    if header.version != VERSION {
        return Err(WireError::Version(header.version));
    }
    Ok((header, Reader::new(&body[Header::LEN..])))
}

/// Every message fits its frame: the sizes below are checked when this compiles.
fn framed(out: &Writer) -> Frame {
    let body = out.done().unwrap_or_default();
    Frame::of(body).unwrap_or_else(|_| Frame::empty())
}

const _: () = {
    assert!(Header::LEN + TableBegin::LEN <= MAX_BODY);
    assert!(Header::LEN + TableChunk::MOST_LEN <= MAX_BODY);
    assert!(Header::LEN + PathBegin::LEN <= MAX_BODY);
    assert!(Header::LEN + PathChunk::MOST_LEN <= MAX_BODY);
    assert!(Header::LEN + Identity::LEN <= MAX_BODY);
    assert!(Header::LEN + Outcome::LEN <= MAX_BODY);
    assert!(Header::LEN + Telemetry::MOST_LEN <= MAX_BODY);
    assert!(Header::LEN + Recorded::MOST_LEN <= MAX_BODY);
};
