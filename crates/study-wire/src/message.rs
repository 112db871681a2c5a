//! Version 1 of the wire format: every message as a type and as bytes.
//!
//! `docs/wire.md` is the specification. Host and device both use this module.
//! Fields are little-endian and packed. Settings are f64 in mm, N and s; streamed
//! quantities are 32-bit integers in nm, µm/s, µN and µm/s² ([`fixed`]), which are
//! exact for encoder counts and always finite.
//!
//! A body is `version, type, sequence number (u16), fields` and is sent in a
//! [`frame`](super::frame).

mod bytes;
pub mod code;
pub mod elements;
pub mod fixed;
pub mod mechanism;
mod probe;
pub mod reply;
pub mod stream;
pub mod table;

use super::frame::{Frame, MAX_BODY};
use bytes::{Field, Reader, Writer, fields};
use core::fmt;
use core::num::NonZeroU16;

pub use code::{DeviceState, EventKind, Fault, Loaded, Refusal};
pub use elements::ElementsBegin;
pub use mechanism::{MechanismBegin, MechanismChunk};
pub use probe::{PathBegin, PathChunk};
pub use reply::{Ack, Constants, Features, Flags, Identity, Name, Outcome, Pulse};
pub use stream::{Event, Recorded, RecordedPoint, Telemetry, TelemetrySample};
pub use table::{Node, TableBegin, TableChunk, UploadCrc};

/// The version of the wire format that this module implements.
pub const VERSION: u8 = 1;
/// The newest minor version that this module implements. Minor versions only add: host
/// and device use the lower one of both, see [`Hello`] and [`Constants`].
pub const MINOR: u8 = 3;
/// The minor version that added mechanisms.
pub const MECHANISM_MINOR: u8 = 2;
/// The minor version that added elements, for devices with that feature.
pub const ELEMENTS_MINOR: u8 = 2;
/// The minor version that added forces that fall before the end of a playback, for devices
/// with that feature.
pub const FADE_MINOR: u8 = 3;

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

    /// The first `N` of `items`.
    pub fn of(items: &[T]) -> Self {
        let mut list = Self::new();
        for item in items {
            list.push(*item);
        }
        list
    }

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
    /// Newest minor version that the host supports. It is sent unless it is 0, so that a
    /// HELLO of minor version 0 has the bytes that it always had.
    pub minor: u8,
}

impl Field for Hello {
    const MAX_LEN: usize = u32::MAX_LEN + u8::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        self.nonce.write(out);
        if self.minor > 0 {
            self.minor.write(out);
        }
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let nonce = u32::read(from)?;
        if from.left() == 0 {
            return Ok(Self { nonce, minor: 0 });
        }
        match u8::read(from)? {
            0 => Err(WireError::Length),
            minor => Ok(Self { nonce, minor }),
        }
    }
}

fields! {
    /// Completes an upload.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Commit {
        /// CRC over the fields of BEGIN and all nodes or points in the order sent.
        crc: u32;
    }
}

fields! {
    /// Starts to play a table.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Play {
        /// The host's number for this playback, not 0.
        playback: u32;
        /// CRC of the table that has to be loaded.
        crc: u32;
        /// Duration after which the device stops by itself, ms.
        longest_ms: u32;
        /// Servo periods per telemetry sample; `None` without telemetry. A device whose
        /// link is slower takes fewer samples.
        every: Option<NonZeroU16>;
    }
}

fields! {
    /// Starts a recording along a path.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Record {
        /// The host's number for this recording, not 0.
        playback: u32;
        /// CRC of the path that has to be loaded.
        crc: u32;
    }
}

fields! {
    /// Ends a playback, at once or with a force that falls.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Stop {
        /// The host's number of the playback or recording to stop.
        playback: u32;
    }
}

fields! {
    /// Shows that the host is alive.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Heartbeat {
        /// Higher than in every earlier heartbeat, wrapping.
        count: u32;
        /// Time on the device's clock at which the heartbeat expires, ms, wrapping.
        deadline_ms: u32;
    }
}

/// Defines the messages of both directions: their enums, type bytes, encoding and
/// decoding.
macro_rules! messages {
    ($($(#[$about:meta])* $direction:ident {
        $($(#[$what:meta])* $variant:ident $(($fields:ident: $payload:ty))? = $constant:ident $kind:literal;)+
    })+) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy, PartialEq)]
            #[allow(
                clippy::large_enum_variant,
                reason = "a device does not allocate and holds one message at a time"
            )]
            pub enum $direction {
                $($(#[$what])* $variant $(($payload))?,)+
            }

            impl $direction {
                /// The message type, see [`kind`].
                pub fn kind(&self) -> u8 {
                    match self {
                        $(Self::$variant { .. } => $kind,)+
                    }
                }

                /// Encodes the message as a frame.
                pub fn frame(&self, sequence: u16) -> Frame {
                    let mut out = header(self.kind(), sequence);
                    match self {
                        $(Self::$variant $(($fields))? => { $($fields.write(&mut out);)? })+
                    }
                    to_frame(&out)
                }

                /// Decodes the body of a frame.
                ///
                /// # Errors
                /// [`WireError`]. A device refuses such a request. A host treats such a
                /// reply as a damaged frame, except for [`WireError::Version`], which
                /// means that the device is incompatible.
                pub fn decode(body: &[u8]) -> Result<(Header, Self), WireError> {
                    let (header, mut from) = split_header(body)?;
                    let message = match header.kind {
                        $($kind => Self::$variant $((<$payload>::read(&mut from)?))?,)+
                        other => return Err(WireError::UnknownType(other)),
                    };
                    from.done()?;
                    Ok((header, message))
                }
            }
        )+

        /// Message types: below 0x80 to the device, from 0x80 to the host.
        pub mod kind {
            $($(
                #[doc = concat!("[`super::", stringify!($direction), "::", stringify!($variant), "`]")]
                pub const $constant: u8 = $kind;
            )+)+

            /// The name of a message type in docs/wire.md.
            pub fn name(kind: u8) -> &'static str {
                match kind {
                    $($($kind => stringify!($constant),)+)+
                    _ => "a message of an unknown type",
                }
            }
        }

        // Every message fits into a frame.
        const _: () = {
            $($($(assert!(Header::LEN + <$payload as Field>::MAX_LEN <= MAX_BODY);)?)+)+
        };
    };
}

messages! {
    /// A message from the host to the device. Each request gets exactly one [`Reply`]
    /// with its sequence number; the reply to a heartbeat is a [`Reply::Pulse`].
    Request {
        /// Opens a connection and ends that of another host.
        Hello(fields: Hello) = HELLO 0x01;
        /// Begins the upload of a table.
        TableBegin(fields: TableBegin) = TABLE_BEGIN 0x02;
        /// Carries nodes of the table.
        TableChunk(fields: TableChunk) = TABLE_CHUNK 0x03;
        /// Ends the upload of a table.
        TableCommit(fields: Commit) = TABLE_COMMIT 0x04;
        /// Plays the loaded table.
        Play(fields: Play) = PLAY 0x05;
        /// Stops playing or recording.
        Stop(fields: Stop) = STOP 0x06;
        /// Sets the force to zero at once and latches, in every state.
        Limp = LIMP 0x07;
        /// Shows that the host is alive.
        Heartbeat(fields: Heartbeat) = HEARTBEAT 0x08;
        /// Leaves `Limp` or `Fault`, only at rest.
        Rearm = REARM 0x09;
        /// Asks for the state and the outcome of the last playback.
        State = STATE 0x0A;
        /// Lets the force fall to zero and then stops playing; from minor version 3 on.
        Fade(fields: Stop) = FADE 0x0C;
        /// Begins the upload of a path.
        PathBegin(fields: PathBegin) = PATH_BEGIN 0x10;
        /// Carries points of the path.
        PathChunk(fields: PathChunk) = PATH_CHUNK 0x11;
        /// Ends the upload of a path.
        PathCommit(fields: Commit) = PATH_COMMIT 0x12;
        /// Records along the loaded path.
        Record(fields: Record) = RECORD 0x13;
        /// Begins the upload of a mechanism; from minor version 2 on, as the next two.
        MechanismBegin(fields: MechanismBegin) = MECHANISM_BEGIN 0x20;
        /// Carries values of the mechanism's profiles.
        MechanismChunk(fields: MechanismChunk) = MECHANISM_CHUNK 0x21;
        /// Ends the upload of a mechanism.
        MechanismCommit(fields: Commit) = MECHANISM_COMMIT 0x22;
        /// Begins the upload of elements; from minor version 2 on. Nodes and COMMIT are those
        /// of a table.
        ElementsBegin(fields: ElementsBegin) = ELEMENTS_BEGIN 0x30;
    }
    /// A message from the device to the host.
    Reply {
        /// Reply to every request without a reply of its own.
        Ack(fields: Ack) = ACK 0x80;
        /// Reply to HELLO.
        Identity(fields: Identity) = IDENTITY 0x81;
        /// Reply to STATE.
        Outcome(fields: Outcome) = OUTCOME 0x82;
        /// Reply to a heartbeat.
        Pulse(fields: Pulse) = PULSE 0x83;
        /// Samples of a playback; unsolicited.
        Telemetry(fields: Telemetry) = TELEMETRY 0x90;
        /// A change of state; unsolicited.
        Event(fields: Event) = EVENT 0x91;
        /// Samples of a recording; unsolicited.
        Recorded(fields: Recorded) = RECORDED 0x92;
    }
}

impl Request {
    /// The minor version that added it.
    pub fn minor(&self) -> u8 {
        match self {
            Self::MechanismBegin(_) | Self::MechanismChunk(_) | Self::MechanismCommit(_) => {
                MECHANISM_MINOR
            }
            Self::ElementsBegin(_) => ELEMENTS_MINOR,
            Self::Fade(_) => FADE_MINOR,
            _ => 0,
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
}

fn header(kind: u8, sequence: u16) -> Writer {
    let mut out = Writer::new();
    [VERSION, kind].write(&mut out);
    sequence.write(&mut out);
    out
}

fn split_header(body: &[u8]) -> Result<(Header, Reader<'_>), WireError> {
    let header = Header::read(body).ok_or(WireError::Header)?;
    if header.version != VERSION {
        return Err(WireError::Version(header.version));
    }
    Ok((header, Reader::new(&body[Header::LEN..])))
}

/// Every message fits into a frame; `messages!` checks the sizes.
fn to_frame(out: &Writer) -> Frame {
    let body = out.done().unwrap_or_default();
    Frame::of(body).unwrap_or_else(|_| Frame::empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body with a field changed.
    fn with(message: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
        let mut body = message.to_vec();
        body[Header::LEN + at..][..bytes.len()].copy_from_slice(bytes);
        body
    }

    fn body(frame: &Frame) -> Vec<u8> {
        let mut decoder = crate::frame::Decoder::new();
        let bodies = frame.as_bytes().iter().filter_map(|byte| {
            let decoded = decoder.push(*byte)?;
            Some(decoded.unwrap().to_vec())
        });
        bodies.last().unwrap()
    }

    #[test]
    fn a_chunk_without_nodes_is_refused() {
        let chunk = TableChunk {
            first: 0,
            nodes: FixedVec::of(&[Node::default()]),
        };
        let one = body(&Request::TableChunk(chunk).frame(1));
        assert!(Request::decode(&one).is_ok());
        let none = &with(&one, 2, &[0])[..Header::LEN + 3];
        assert_eq!(Request::decode(none), Err(WireError::Field));
        let four = with(&one, 2, &[4]);
        assert_eq!(Request::decode(&four), Err(WireError::Field));
    }

    #[test]
    fn an_identity_with_a_limit_of_zero_or_no_number_is_refused() {
        let identity = Identity {
            nonce: 1,
            versions: [1, 1],
            state: DeviceState::Idle,
            fault: Fault::None,
            flags: Flags::default(),
            clock_ms: 0,
            watchdog_ms: 30,
            max_nodes: 2,
            max_points: 0,
            longest_ms: 1000,
            servo_hz: 4000.0,
            telemetry_hz: 0.0,
            force_n: 9.0,
            velocity_mm_s: 500.0,
            stiffness_n_per_mm: 10.0,
            damping_n_s_per_mm: 0.1,
            stroke_mm: [-20.0, 20.0],
            firmware: Name::new("f"),
            serial: Name::new("s"),
            constants: None,
        };
        let good = body(&Reply::Identity(identity).frame(1));
        assert!(Reply::decode(&good).is_ok());
        // servo_hz comes after 25 bytes, then telemetry_hz, which may be 0
        for quantity in [0, 2, 3, 4, 5] {
            for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let body = with(&good, 25 + 8 * quantity, &bad.to_le_bytes());
                assert_eq!(
                    Reply::decode(&body),
                    Err(WireError::Field),
                    "{quantity} {bad}"
                );
            }
        }
        for quantity in [1, 6, 7] {
            let body = with(&good, 25 + 8 * quantity, &f64::NAN.to_le_bytes());
            assert_eq!(Reply::decode(&body), Err(WireError::Field), "{quantity}");
        }
    }
}
