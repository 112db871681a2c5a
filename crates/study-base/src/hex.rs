//! Bytes and SHA-256 digests as text.
//!
//! ```
//! use study_base::hex::{Digest, hex, sha256};
//!
//! assert_eq!(hex(&[0, 10, 255]), "000aff");
//! let mut digest = Digest::default();
//! digest.update("a");
//! digest.update("bc");
//! assert_eq!(digest.finish(), sha256("abc"));
//! ```

use sha2::{Digest as _, Sha256};

/// Bytes as lower-case hexadecimal digits, two each.
pub fn hex(bytes: &[u8]) -> String {
    let digit = |four_bits: u8| char::from(b"0123456789abcdef"[usize::from(four_bits)]);
    let pairs = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    pairs.map(digit).collect()
}

/// The SHA-256 digest of bytes, 64 lower-case hexadecimal digits.
pub fn sha256(bytes: impl AsRef<[u8]>) -> String {
    hex(&Sha256::digest(bytes))
}

/// The SHA-256 digest of bytes that arrive in pieces.
#[derive(Debug, Clone, Default)]
pub struct Digest(Sha256);

impl Digest {
    /// Adds bytes.
    pub fn update(&mut self, bytes: impl AsRef<[u8]>) {
        self.0.update(bytes);
    }

    /// The digest of all bytes so far, 64 lower-case hexadecimal digits.
    pub fn finish(self) -> String {
        hex(&self.0.finalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FIPS 180-4, examples of one block and of two.
    #[test]
    fn published_digests() {
        let one = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256("abc"), one);
        let mut two = Digest::default();
        two.update("abcdbcdecdefdefgefghfghighijhijkijkl");
        two.update("jklmklmnlmnomnopnopq");
        assert_eq!(
            two.finish(),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"
        );
    }
}
