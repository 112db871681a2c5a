//! Frames on the wire: COBS between 0x00 bytes, with a CRC-32 at the end.
//!
//! ```text
//! 0x00 | COBS( body | crc32(body), little-endian ) | 0x00
//! ```
//!
//! A frame contains no zero byte, so a receiver that starts in the middle of a frame
//! is synchronized at the next zero. Each frame has a zero on both sides, so noise
//! before a frame does not damage it. Repeated zeros have no meaning.

use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc};

/// Longest body of a frame, bytes. With the CRC it has 254 bytes, the most that COBS
/// encodes with one additional byte.
pub const MAX_BODY: usize = 250;
/// Length of the CRC, bytes.
pub const FRAME_CRC_LEN: usize = 4;
/// Longest encoded content between the zeros, bytes.
const MAX_ENCODED: usize = 1 + MAX_BODY + FRAME_CRC_LEN;
/// Longest frame with both zeros, bytes.
pub const MAX_FRAME: usize = MAX_ENCODED + 2;

/// CRC-32 as in Ethernet, zip and PNG: polynomial 0x04C11DB7, bits reflected,
/// start and final exclusive-or 0xFFFFFFFF. The CRC of `123456789` is 0xCBF43926.
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why bytes between two zeros are not a frame, or a body cannot be framed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// Longer than a frame can be.
    TooLong,
    /// Shorter than a CRC.
    TooShort,
    /// A COBS code byte points beyond the end.
    Cobs,
    /// The CRC does not match the body.
    Crc,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "longer than a frame can be",
            Self::TooShort => "shorter than a frame can be",
            Self::Cobs => "invalid COBS encoding",
            Self::Crc => "the CRC does not match",
        })
    }
}

/// CRC-32 of `bytes`.
///
/// ```
/// # use study_wire::frame::crc32;
/// assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
/// ```
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// CRC-32 of bytes that arrive in pieces.
#[derive(Clone)]
pub struct RunningCrc(crc::Digest<'static, u32>);

/// Look-up table shared by all running CRCs.
static SHARED: Crc<u32> = CRC;

impl RunningCrc {
    /// The CRC of no bytes.
    pub const fn new() -> Self {
        Self(SHARED.digest())
    }

    /// Adds the next piece.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The CRC of everything so far.
    pub fn value(&self) -> u32 {
        self.0.clone().finalize()
    }
}

impl Default for RunningCrc {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for RunningCrc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "RunningCrc({:08x})", self.value())
    }
}

/// An encoded frame.
#[derive(Clone, Copy)]
pub struct Frame {
    bytes: [u8; MAX_FRAME],
    len: usize,
}

impl Frame {
    /// Encodes a body.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] for a body of more than [`MAX_BODY`] bytes.
    pub fn of(body: &[u8]) -> Result<Self, FrameError> {
        if body.len() > MAX_BODY {
            return Err(FrameError::TooLong);
        }
        let crc = crc32(body).to_le_bytes();
        let mut bytes = [0; MAX_FRAME];
        // bytes[0] is the first zero, bytes[1] the first code byte
        let mut code_at = 1;
        let mut len = 2;
        for byte in body.iter().chain(&crc) {
            if *byte == 0 {
                bytes[code_at] = (len - code_at) as u8;
                code_at = len;
            } else {
                bytes[len] = *byte;
            }
            len += 1;
        }
        bytes[code_at] = (len - code_at) as u8;
        Ok(Self {
            bytes,
            len: len + 1,
        })
    }

    /// Two zeros, which a receiver ignores.
    pub(super) fn empty() -> Self {
        Self {
            bytes: [0; MAX_FRAME],
            len: 2,
        }
    }

    /// The bytes to send, including both zeros.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Frame").field(&self.as_bytes()).finish()
    }
}

/// Whether a frame of a device is part of a stream that a full queue may drop: TELEMETRY,
/// EVENT or RECORDED, and not a reply. Version and type are not zero, so COBS leaves them
/// where they are.
pub fn is_stream(frame: &[u8]) -> bool {
    const FIRST_STREAM: u8 = 0x90;
    frame.get(3).is_some_and(|kind| *kind >= FIRST_STREAM)
}

/// Finds frames in a stream of bytes.
#[derive(Debug, Clone)]
pub struct Decoder {
    buffer: [u8; MAX_ENCODED],
    len: usize,
    /// The content is too long for a frame; the decoder waits for the next zero.
    overlong: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder without content.
    pub const fn new() -> Self {
        Self {
            buffer: [0; MAX_ENCODED],
            len: 0,
            overlong: false,
        }
    }

    /// Processes a byte. Returns `Some` at the end of a frame: its body, or why it is
    /// invalid. The next byte then starts a new frame.
    pub fn push(&mut self, byte: u8) -> Option<Result<&[u8], FrameError>> {
        if byte != 0 {
            if self.len < MAX_ENCODED {
                self.buffer[self.len] = byte;
                self.len += 1;
            } else {
                self.overlong = true;
            }
            return None;
        }
        let len = core::mem::take(&mut self.len);
        if core::mem::take(&mut self.overlong) {
            return Some(Err(FrameError::TooLong));
        }
        if len == 0 {
            return None;
        }
        Some(body(&mut self.buffer[..len]))
    }
}

/// Decodes COBS in place and checks the CRC.
fn body(encoded: &mut [u8]) -> Result<&[u8], FrameError> {
    let mut read = 0;
    let mut written = 0;
    while read < encoded.len() {
        let code = usize::from(encoded[read]);
        let end = read + code;
        if end > encoded.len() {
            return Err(FrameError::Cobs);
        }
        // Writing never overtakes reading.
        encoded.copy_within(read + 1..end, written);
        written += code - 1;
        read = end;
        if read < encoded.len() && code < 0xFF {
            encoded[written] = 0;
            written += 1;
        }
    }
    let Some(len) = written.checked_sub(FRAME_CRC_LEN) else {
        return Err(FrameError::TooShort);
    };
    let (body, crc) = encoded[..written].split_at(len);
    if crc == crc32(body).to_le_bytes() {
        Ok(body)
    } else {
        Err(FrameError::Crc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// All results of a decoder for a stream.
    fn decoded(stream: &[u8]) -> Vec<Result<Vec<u8>, FrameError>> {
        let mut decoder = Decoder::new();
        let mut found = Vec::new();
        for byte in stream {
            if let Some(result) = decoder.push(*byte) {
                found.push(result.map(<[u8]>::to_vec));
            }
        }
        found
    }

    #[test]
    fn the_crc_is_that_of_the_specification() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b""), 0);
        let mut pieces = RunningCrc::new();
        pieces.update(b"1234");
        pieces.update(b"");
        pieces.update(b"56789");
        assert_eq!(pieces.value(), 0xCBF4_3926);
    }

    #[test]
    fn a_frame_contains_no_zeros() {
        let frame = Frame::of(b"123456789").unwrap();
        let mut expected = vec![0, 14];
        expected.extend_from_slice(b"123456789");
        expected.extend_from_slice(&[0x26, 0x39, 0xF4, 0xCB, 0]);
        assert_eq!(frame.as_bytes(), expected);
        // COBS of [0, 0, 7] and the CRC
        let frame = Frame::of(&[0, 0, 7]).unwrap();
        assert_eq!(frame.as_bytes()[..5], [0, 1, 1, 6, 7]);
    }

    #[test]
    fn the_longest_body_takes_one_byte_more_and_a_longer_one_is_refused() {
        let longest = Frame::of(&[0xAA; MAX_BODY]).unwrap();
        assert_eq!(longest.as_bytes().len(), MAX_FRAME);
        assert_eq!(longest.as_bytes()[1], 0xFF);
        assert_eq!(decoded(longest.as_bytes()), [Ok(vec![0xAA; MAX_BODY])]);
        assert_eq!(
            Frame::of(&[0; MAX_BODY + 1]).unwrap_err(),
            FrameError::TooLong
        );
        assert_eq!(
            decoded(Frame::of(&[0; MAX_BODY]).unwrap().as_bytes()),
            [Ok(vec![0; MAX_BODY])]
        );
    }

    /// 253 bytes without a zero, then one zero: the longest block that ends in a zero.
    #[test]
    fn a_longest_frame_whose_checksum_ends_in_zero_keeps_that_zero() {
        let body = (1..=u32::from(u16::MAX))
            .map(|n| {
                let mut body = [0xAA; MAX_BODY];
                body[0] = (n % 255 + 1) as u8;
                body[1] = (n / 255 % 255 + 1) as u8;
                body
            })
            .find(|body| matches!(crc32(body).to_le_bytes(), [(1..), (1..), (1..), 0]))
            .unwrap();
        let frame = Frame::of(&body).unwrap();
        assert_eq!(frame.as_bytes()[1], 0xFE);
        assert_eq!(decoded(frame.as_bytes()), [Ok(body.to_vec())]);
    }

    #[test]
    fn invalid_frames_are_reported_with_their_error() {
        for (bytes, expected) in [
            (&[9, 1, 0][..], FrameError::Cobs),
            (&[2, 1, 0], FrameError::TooShort),
            (&[6, 1, 2, 3, 4, 5, 0], FrameError::Crc),
            (
                &[[1; MAX_ENCODED + 1].as_slice(), &[0]].concat(),
                FrameError::TooLong,
            ),
        ] {
            assert_eq!(decoded(bytes), [Err(expected)]);
        }
        assert_eq!(decoded(&[0; 50]), []);
    }

    #[test]
    fn an_endless_stream_without_a_zero_is_one_error() {
        let mut stream = vec![0x55; 100_000];
        stream.push(0);
        stream.extend_from_slice(Frame::of(b"next").unwrap().as_bytes());
        assert_eq!(
            decoded(&stream),
            [Err(FrameError::TooLong), Ok(b"next".to_vec())]
        );
    }

    proptest! {
        #[test]
        fn every_body_survives_encoding_and_decoding(body in proptest::collection::vec(any::<u8>(), 0..=MAX_BODY)) {
            let frame = Frame::of(&body).unwrap();
            prop_assert!(frame.as_bytes()[1..frame.as_bytes().len() - 1].iter().all(|b| *b != 0));
            prop_assert_eq!(decoded(frame.as_bytes()), [Ok(body)]);
        }

        #[test]
        fn noise_does_not_damage_the_next_frame(noise in proptest::collection::vec(any::<u8>(), 0..600)) {
            let mut stream = noise;
            stream.extend_from_slice(Frame::of(b"the next").unwrap().as_bytes());
            let found = decoded(&stream);
            prop_assert_eq!(found.last(), Some(&Ok(b"the next".to_vec())));
        }
    }
}
