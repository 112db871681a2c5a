//! The bytes of one line of a journal.
//!
//! ```text
//! {"crc":"3f2a9c01","v":1,"seq":7,"prev":"9b1c…","wall":"…","mono_ns":…,"event":"…",…}
//! ```
//!
//! `crc` is the CRC-32 (ISO-HDLC, as in zlib) of every byte after its comma up to
//! the closing brace; `prev` is the first 16 hexadecimal digits of the SHA-256 of the
//! line before, without its line end. The first 8 bytes of a line occur nowhere else
//! in it, because JSON escapes quotation marks in text: two records can be separated
//! even if the line end between them is damaged.

use crate::outcome::{Event, Moment};
use chrono::{DateTime, FixedOffset};
use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};
use study_base::hex::sha256;
use study_base::text::ParticipantId;
use study_plan::protocol::Seat;

/// The version of the line format that this program writes.
pub const VERSION: u32 = 1;

/// `prev` of the first line.
pub const NO_LINE: &str = "0000000000000000";

/// Start of every line; occurs nowhere else in it.
pub(super) const PREFIX: &[u8] = b"{\"crc\":\"";

/// Number of bytes before the checksummed part: `{"crc":"3f2a9c01",`.
const HEAD: usize = 18;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The content of a line.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// The first line: whose session it is.
    Claim(Claim),
    /// Any other line.
    Event(Moment, Event),
    /// Name of an event of a later version of the program.
    Unknown(String),
}

/// The first line of a journal, written when the session is claimed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Claim {
    /// Participant.
    pub participant: ParticipantId,
    /// Session of the participant, from 1.
    pub session: u32,
    /// Source of the order; `None` for a no-show.
    pub seat: Option<Seat>,
    /// Newest version of the protocol at that time.
    pub protocol_version: u32,
    /// Whether the last acknowledged record is in `head.json`; not in journals of
    /// earlier releases.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub head: bool,
}

/// A valid line.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Sequence number, from 0.
    pub seq: u64,
    /// Hash of the line before.
    pub prev: String,
    /// Content.
    pub record: Record,
}

/// Why a line is not valid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// It does not have the form of a line.
    #[error("it is not a record")]
    Shape,
    /// A byte was changed.
    #[error("its checksum does not match")]
    Checksum,
    /// A later version of the format.
    #[error("it has version {0} of the format")]
    Newer(u32),
    /// The checksum matches, but the content is not valid.
    #[error("it is not an event: {0}")]
    Content(String),
}

#[derive(Serialize)]
#[serde(untagged)]
enum Body<'a> {
    Claim {
        v: u32,
        seq: u64,
        prev: &'a str,
        claim: &'a Claim,
    },
    Event {
        v: u32,
        seq: u64,
        prev: &'a str,
        wall: DateTime<FixedOffset>,
        mono_ns: u64,
        #[serde(flatten)]
        event: &'a Event,
    },
}

#[derive(Deserialize)]
struct Version {
    v: u32,
}

#[derive(Deserialize)]
struct Head {
    v: u32,
    seq: Option<u64>,
    prev: Option<String>,
    claim: Option<Claim>,
    wall: Option<DateTime<FixedOffset>>,
    mono_ns: Option<u64>,
    event: Option<String>,
}

/// Writes a line without its line end.
///
/// # Errors
/// [`LineError::Content`] if the record cannot be serialized.
pub fn encode(seq: u64, prev: &str, record: &Record) -> Result<Vec<u8>, LineError> {
    let body = match record {
        Record::Claim(claim) => Body::Claim {
            v: VERSION,
            seq,
            prev,
            claim,
        },
        Record::Event(at, event) => Body::Event {
            v: VERSION,
            seq,
            prev,
            wall: at.wall,
            mono_ns: at.mono_ns,
            event,
        },
        Record::Unknown(name) => return Err(LineError::Content(format!("unknown event {name}"))),
    };
    let body = serde_json::to_string(&body).map_err(|e| LineError::Content(e.to_string()))?;
    // The opening brace of the body is replaced by the checksum.
    let counted = &body[1..];
    let sum = CRC.checksum(counted.as_bytes());
    Ok(format!("{{\"crc\":\"{sum:08x}\",{counted}").into_bytes())
}

/// Reads a line without its line end.
///
/// # Errors
/// [`LineError`]; never panics.
pub fn decode(bytes: &[u8]) -> Result<Line, LineError> {
    let (head, counted) = bytes.split_at_checked(HEAD).ok_or(LineError::Shape)?;
    if !head.starts_with(PREFIX) || !head.ends_with(b"\",") {
        return Err(LineError::Shape);
    }
    if head[PREFIX.len()..HEAD - 2] != *format!("{:08x}", CRC.checksum(counted)).as_bytes() {
        return Err(LineError::Checksum);
    }
    let content = |e: serde_json::Error| LineError::Content(e.to_string());
    let head: Head = serde_json::from_slice(bytes).map_err(|e| {
        // The rest of a newer line may have any form.
        match serde_json::from_slice(bytes) {
            Ok(Version { v }) if v > VERSION => LineError::Newer(v),
            _ => content(e),
        }
    })?;
    if head.v > VERSION {
        return Err(LineError::Newer(head.v));
    }
    let missing = |what: &str| LineError::Content(format!("{what} is missing"));
    let seq = head.seq.ok_or_else(|| missing("seq"))?;
    let prev = head.prev.ok_or_else(|| missing("prev"))?;
    let record = match (head.claim, head.event) {
        (Some(claim), None) => Record::Claim(claim),
        (None, Some(name)) => {
            let at = Moment {
                wall: head.wall.ok_or_else(|| missing("wall"))?,
                mono_ns: head.mono_ns.ok_or_else(|| missing("mono_ns"))?,
            };
            match serde_json::from_slice::<Event>(bytes) {
                Ok(event) => Record::Event(at, event),
                Err(e) if e.to_string().starts_with("unknown variant `") => Record::Unknown(name),
                Err(e) => return Err(content(e)),
            }
        }
        _ => return Err(missing("event")),
    };
    Ok(Line { seq, prev, record })
}

/// `prev` of the line after this one.
pub fn hash(line: &[u8]) -> String {
    let mut digits = sha256(line);
    digits.truncate(16);
    digits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Playback;
    use proptest::prelude::*;

    fn remark(text: &str) -> Record {
        Record::Event(
            Moment {
                wall: DateTime::parse_from_rfc3339("2007-03-22T10:00:00.123456789+01:00").unwrap(),
                mono_ns: u64::MAX,
            },
            Event::Remark {
                by: crate::outcome::Author::Participant,
                trial: Some(7),
                text: text.to_owned(),
            },
        )
    }

    #[test]
    fn the_start_of_a_line_occurs_nowhere_else_in_it() {
        let hostile = remark("{\"crc\":\"00000000\",\n{\"crc\":\"");
        let bytes = encode(3, NO_LINE, &hostile).unwrap();
        let found = bytes.windows(PREFIX.len()).filter(|w| *w == PREFIX).count();
        assert_eq!(found, 1);
        assert!(!bytes.contains(&b'\n'));
        assert_eq!(decode(&bytes).unwrap().record, hostile);
    }

    #[test]
    fn a_line_of_the_next_version_is_newer_whatever_its_form() {
        let line = |rest: &str| {
            let counted = format!("\"v\":{},{rest}}}", VERSION + 1);
            let sum = CRC.checksum(counted.as_bytes());
            format!("{{\"crc\":\"{sum:08x}\",{counted}").into_bytes()
        };
        for rest in ["\"seq\":1", "\"seq\":\"one\"", "\"event\":[]"] {
            assert_eq!(decode(&line(rest)), Err(LineError::Newer(VERSION + 1)));
        }
    }

    /// 0xcbf43926 is the check value of CRC-32/ISO-HDLC for "123456789".
    #[test]
    fn the_checksum_is_that_of_zlib() {
        assert_eq!(CRC.checksum(b"123456789"), 0xcbf4_3926);
    }

    /// SHA-256("abc"), FIPS 180-4 example: ba7816bf 8f01cfea 414140de …
    #[test]
    fn the_chain_is_of_sha_256() {
        assert_eq!(hash(b"abc"), "ba7816bf8f01cfea");
    }

    #[test]
    fn nan_is_stored_and_read() {
        let at = Moment {
            wall: DateTime::parse_from_rfc3339("2007-03-22T10:00:00+01:00").unwrap(),
            mono_ns: 1,
        };
        let event = Event::PlaybackEnded {
            trial: 1,
            attempt: 1,
            playback: Playback {
                least_energy_j: f64::NAN,
                exploration_s: 2.5,
                ..Playback::default()
            },
            stopped: false,
            telemetry: None,
            rendering: None,
            interval: None,
        };
        let bytes = encode(1, NO_LINE, &Record::Event(at, event)).unwrap();
        let Record::Event(_, Event::PlaybackEnded { playback, .. }) =
            decode(&bytes).unwrap().record
        else {
            panic!("another event");
        };
        assert!(playback.least_energy_j.is_nan());
        assert_eq!(playback.exploration_s, 2.5);
    }

    #[test]
    fn an_event_of_a_later_version_is_named_and_is_not_damage() {
        let body = r#""v":1,"seq":4,"prev":"0000000000000000","wall":"2007-03-22T10:00:00+01:00","mono_ns":1,"event":"levitated","height_m":2}"#;
        let sum = CRC.checksum(body.as_bytes());
        let bytes = format!("{{\"crc\":\"{sum:08x}\",{body}").into_bytes();
        assert_eq!(
            decode(&bytes).unwrap().record,
            Record::Unknown("levitated".to_owned())
        );
        let newer = body.replace("\"v\":1", "\"v\":2");
        let sum = CRC.checksum(newer.as_bytes());
        let bytes = format!("{{\"crc\":\"{sum:08x}\",{newer}").into_bytes();
        assert_eq!(decode(&bytes), Err(LineError::Newer(2)));
    }

    proptest! {
        #[test]
        fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = decode(&bytes);
            let mut line = PREFIX.to_vec();
            line.extend_from_slice(&bytes);
            let _ = decode(&line);
        }

        #[test]
        fn any_text_reads_back_as_typed(text in any::<String>()) {
            let record = remark(&text);
            let bytes = encode(1, NO_LINE, &record).unwrap();
            prop_assert_eq!(decode(&bytes).unwrap().record, record);
        }
    }
}
