//! Version 1 of the wire format: every message as a type and as bytes.
//!
//! `docs/wire.md` is the specification. Host and device both use this module.
//! Fields are little-endian and packed. Settings are f64 in mm, N and s; streamed
//! quantities are 32-bit integers in nm, µm/s, µN and µm/s² ([`fixed`]), which are
//! exact for encoder counts and always finite.
//!
//! A body is `version, type, sequence number (u16), fields` and is sent in a
//! [`frame`](super::frame). The code uses only `core` and slices.

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
use core::num::NonZeroU16;

pub use code::{DeviceState, EventKind, Fault, Loaded, Refusal};
pub use probe::{PathBegin, PathChunk, PathCrc};
pub use reply::{Ack, Flags, Identity, Name, Outcome, Pulse};
pub use stream::{Event, Recorded, RecordedPoint, Telemetry, TelemetrySample};
pub use table::{Node, TableBegin, TableChunk, TableCrc};

/// The version of the wire format that this module implements.
pub const VERSION: u8 = 1;

/// Why a body is no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WireError {
    /// Shorter than a header.
    Header,
    /// Another version than [`VERSION`], with its number.
    Version(u8),
    /// The type is unknown or belongs to the other direction.
    UnknownType(u8),
    /// The length does not fit the type.
    Length,
    /// A field has an invalid value.
    Field,
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Header => f.write_str("shorter than a header"),
            Self::Version(version) => write!(f, "wire format version {version}, not {VERSION}"),
            Self::UnknownType(kind) => write!(f, "unknown message type 0x{kind:02x}"),
            Self::Length => f.write_str("the message has the wrong length"),
            Self::Field => f.write_str("a field has an invalid value"),
        }
    }
}

/// The first bytes of every body, in this and every later version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Version of the wire format.
    pub version: u8,
    /// Type of the message, see [`kind`].
    pub kind: u8,
    /// For a request chosen by the host; for a reply the request's; for unsolicited
    /// messages counted from 0 after HELLO, wrapping.
    pub sequence: u16,
}

impl Header {
    /// Length in bytes.
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

/// A list of up to `N` values without allocation.
#[derive(Debug, Clone, Copy)]
pub struct FixedVec<T, const N: usize> {
    items: [T; N],
    len: usize,
}

impl<T: Copy + Default, const N: usize> FixedVec<T, N> {
    /// An empty list.
    pub fn new() -> Self {
        Self {
            items: [T::default(); N],
            len: 0,
        }
    }

    /// The first [`FixedVec::CAPACITY`] of `items`.
    pub fn of(items: &[T]) -> Self {
        let mut list = Self::new();
        for item in items {
            list.push(*item);
        }
        list
    }

    /// The largest number of values.
    pub const CAPACITY: usize = N;

    /// Appends a value; false if the list is full.
    pub fn push(&mut self, item: T) -> bool {
        match self.items.get_mut(self.len) {
            Some(free) => {
                *free = item;
                self.len += 1;
                true
            }
            None => false,
        }
    }

    /// Whether the list is full.
    pub fn is_full(&self) -> bool {
        self.len == N
    }

    /// The values.
    pub fn as_slice(&self) -> &[T] {
        &self.items[..self.len]
    }
}

impl<T: Copy + Default, const N: usize> Default for FixedVec<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Copy + Default + PartialEq, const N: usize> PartialEq for FixedVec<T, N> {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

/// Opens a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hello {
    /// Different for each connection; the device returns it.
    pub nonce: u32,
}

/// Completes an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Commit {
    /// CRC over the fields of BEGIN and all nodes or points in the order sent.
    pub crc: u32,
}

/// Starts to play a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Play {
    /// The host's number for this playback, not 0.
    pub playback: u32,
    /// CRC of the table that has to be loaded.
    pub crc: u32,
    /// Duration after which the device stops by itself, ms.
    pub longest_ms: u32,
    /// Servo periods per telemetry sample; `None` without telemetry. A device whose
    /// link is slower takes fewer samples.
    pub every: Option<NonZeroU16>,
}

/// Starts a recording along a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    /// The host's number for this recording, not 0.
    pub playback: u32,
    /// CRC of the path that has to be loaded.
    pub crc: u32,
}

/// Ends a playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stop {
    /// The host's number of the playback or recording to stop.
    pub playback: u32,
}

/// Shows that the host is alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heartbeat {
    /// Higher than in every earlier heartbeat, wrapping.
    pub count: u32,
    /// Time on the device's clock at which the heartbeat expires, ms, wrapping.
    pub deadline_ms: u32,
}

/// A message from the host to the device. Each request gets exactly one [`Reply`]
/// with its sequence number; the reply to a heartbeat is a [`Reply::Pulse`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "a device does not allocate and holds one message at a time"
)]
pub enum Request {
    /// Opens a connection and ends that of another host.
    Hello(Hello),
    /// Begins the upload of a table.
    TableBegin(TableBegin),
    /// Carries nodes of the table.
    TableChunk(TableChunk),
    /// Ends the upload of a table.
    TableCommit(Commit),
    /// Plays the loaded table.
    Play(Play),
    /// Stops playing or recording.
    Stop(Stop),
    /// Sets the force to zero at once and latches, in every state.
    Limp,
    /// Shows that the host is alive.
    Heartbeat(Heartbeat),
    /// Leaves `Limp` or `Fault`, only at rest.
    Rearm,
    /// Asks for the state and the outcome of the last playback.
    State,
    /// Begins the upload of a path.
    PathBegin(PathBegin),
    /// Carries points of the path.
    PathChunk(PathChunk),
    /// Ends the upload of a path.
    PathCommit(Commit),
    /// Records along the loaded path.
    Record(Record),
}

/// A message from the device to the host.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "a device does not allocate and holds one message at a time"
)]
pub enum Reply {
    /// Reply to every request without a reply of its own.
    Ack(Ack),
    /// Reply to HELLO.
    Identity(Identity),
    /// Reply to STATE.
    Outcome(Outcome),
    /// Reply to a heartbeat.
    Pulse(Pulse),
    /// Samples of a playback; unsolicited.
    Telemetry(Telemetry),
    /// A change of state; unsolicited.
    Event(Event),
    /// Samples of a recording; unsolicited.
    Recorded(Recorded),
}

/// Message types: below 0x80 to the device, from 0x80 to the host.
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
    /// The message type, see [`kind`].
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

    /// Whether the device executes it only once per sequence number. All other
    /// requests may be sent at any time with any number.
    pub fn sequenced(&self) -> bool {
        !matches!(
            self,
            Self::Hello(_) | Self::Limp | Self::Heartbeat(_) | Self::State
        )
    }

    /// Encodes the message as a frame.
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
                out.u16(play.every.map_or(0, NonZeroU16::get));
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
        to_frame(&out)
    }

    /// Decodes the body of a frame.
    ///
    /// # Errors
    /// [`WireError`]; a device refuses such a request.
    pub fn decode(body: &[u8]) -> Result<(Header, Self), WireError> {
        let (header, mut from) = split_header(body)?;
        let request = match header.kind {
            kind::HELLO => Self::Hello(Hello { nonce: from.u32()? }),
            kind::TABLE_BEGIN => Self::TableBegin(TableBegin::read(&mut from)?),
            kind::TABLE_CHUNK => Self::TableChunk(TableChunk::read(&mut from)?),
            kind::TABLE_COMMIT => Self::TableCommit(Commit { crc: from.u32()? }),
            kind::PLAY => Self::Play(Play {
                playback: from.u32()?,
                crc: from.u32()?,
                longest_ms: from.u32()?,
                every: NonZeroU16::new(from.u16()?),
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
    /// The message type, see [`kind`].
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
    pub fn is_answer(&self) -> bool {
        self.kind() < kind::TELEMETRY
    }

    /// Encodes the message as a frame.
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
        to_frame(&out)
    }

    /// Decodes the body of a frame.
    ///
    /// # Errors
    /// [`WireError`]. A host treats such a reply as a damaged frame, except for
    /// [`WireError::Version`], which means that the device is incompatible.
    pub fn decode(body: &[u8]) -> Result<(Header, Self), WireError> {
        let (header, mut from) = split_header(body)?;
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

fn split_header(body: &[u8]) -> Result<(Header, Reader<'_>), WireError> {
    let header = Header::read(body).ok_or(WireError::Header)?;
    if header.version != VERSION {
        return Err(WireError::Version(header.version));
    }
    Ok((header, Reader::new(&body[Header::LEN..])))
}

/// Every message fits into a frame; the assertions below check the sizes.
fn to_frame(out: &Writer) -> Frame {
    let body = out.done().unwrap_or_default();
    Frame::of(body).unwrap_or_else(|_| Frame::empty())
}

const _: () = {
    assert!(Header::LEN + TableBegin::LEN <= MAX_BODY);
    assert!(Header::LEN + TableChunk::MAX_LEN <= MAX_BODY);
    assert!(Header::LEN + PathBegin::LEN <= MAX_BODY);
    assert!(Header::LEN + PathChunk::MAX_LEN <= MAX_BODY);
    assert!(Header::LEN + Identity::LEN <= MAX_BODY);
    assert!(Header::LEN + Outcome::LEN <= MAX_BODY);
    assert!(Header::LEN + Telemetry::MAX_LEN <= MAX_BODY);
    assert!(Header::LEN + Recorded::MAX_LEN <= MAX_BODY);
};
