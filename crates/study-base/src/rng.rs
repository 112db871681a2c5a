//! Reproducible random streams: a seed and a path of names give an independent,
//! bit-exact stream.
//!
//! Everything random in a study (orders, simulated participants, sensor noise)
//! comes from a [`Stream`]. The key of a stream is the SHA-256 of a version tag,
//! the seed and the names of its path; its bits are ChaCha20 of RFC 8439 with a zero
//! nonce, from block 0. `docs/schedule.md` specifies the construction, so that
//! another language can reproduce an order; it never changes under the tag
//! [`VERSION`].
//!
//! Not for cryptography: seeds are public.

use num_bigint::BigUint;
use rand::rngs::ChaCha20Rng;
use rand::{Rng, RngExt, SeedableRng};
use rand_distr::StandardNormal;
use sha2::{Digest, Sha256};

/// The tag in every key. A change of any rule in this file needs a new tag.
pub const VERSION: &str = "study-rng/1";

/// A named, reproducible stream of random numbers.
#[derive(Debug)]
pub struct Stream {
    chacha: ChaCha20Rng,
}

impl Stream {
    /// The stream of `seed` with the given path of names.
    ///
    /// key = SHA-256(tag, 0x00, seed as 8 bytes little-endian, then for each name
    /// its length in bytes as 4 bytes little-endian and its UTF-8 bytes).
    ///
    /// ```
    /// # use study_base::rng::Stream;
    /// let mut order = ["A", "B", "C", "D"];
    /// Stream::new(2007, &["order", "1"]).shuffle(&mut order);
    /// let mut again = ["A", "B", "C", "D"];
    /// Stream::new(2007, &["order", "1"]).shuffle(&mut again);
    /// assert_eq!(order, again);
    /// ```
    pub fn new(seed: u64, path: &[&str]) -> Self {
        let mut hash = Sha256::new();
        hash.update(VERSION.as_bytes());
        hash.update([0]);
        hash.update(seed.to_le_bytes());
        for name in path {
            let length = u32::try_from(name.len()).expect("a name is shorter than 4 GiB");
            hash.update(length.to_le_bytes());
            hash.update(name.as_bytes());
        }
        Self::from_key(hash.finalize().into())
    }

    fn from_key(key: [u8; 32]) -> Self {
        Self {
            chacha: ChaCha20Rng::from_seed(key),
        }
    }

    /// The next 64 bits: 8 bytes of the key stream, little-endian.
    pub fn next_u64(&mut self) -> u64 {
        self.chacha.next_u64()
    }

    /// A whole number in `0..n`, exactly uniform. For `n` = 1 nothing is drawn.
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below(&mut self, n: u64) -> u64 {
        assert!(n > 0, "no number is below zero");
        let bits = u64::BITS - (n - 1).leading_zeros();
        if bits == 0 {
            return 0;
        }
        let mask = u64::MAX >> (u64::BITS - bits);
        loop {
            let drawn = self.next_u64() & mask;
            if drawn < n {
                return drawn;
            }
        }
    }

    /// A whole number in `0..n` of any size, exactly uniform; for `n` below 2^64
    /// the same number, from the same draws, as [`Stream::below`].
    ///
    /// ceil(bits / 64) draws, the first the least significant, cut to the bit
    /// length of n − 1; a number that is not below `n` is rejected and drawn again.
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below_big(&mut self, n: &BigUint) -> BigUint {
        assert!(n.bits() > 0, "no number is below zero");
        let bits = (n - 1u32).bits();
        let words = usize::try_from(bits.div_ceil(64)).expect("a count fits in memory");
        let top_mask = match bits % 64 {
            0 => u64::MAX,
            rest => u64::MAX >> (64 - rest),
        };
        loop {
            let mut bytes = Vec::with_capacity(words * 8);
            for word in 0..words {
                let mut drawn = self.next_u64();
                if word + 1 == words {
                    drawn &= top_mask;
                }
                bytes.extend_from_slice(&drawn.to_le_bytes());
            }
            let drawn = BigUint::from_bytes_le(&bytes);
            if drawn < *n {
                return drawn;
            }
        }
    }

    /// Puts `items` in a uniformly random order (Fisher–Yates from the end:
    /// i = n−1 … 1 is exchanged with [`Stream::below`]`(i + 1)`).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            let j = self.below(i as u64 + 1);
            items.swap(i, usize::try_from(j).expect("j is an index of items"));
        }
    }

    /// A number in [0, 1): the upper 53 of 64 bits times 2⁻⁵³.
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * 2f64.powi(-53)
    }

    /// A standard normal deviate. For simulation only; no order uses it.
    pub fn normal(&mut self) -> f64 {
        self.chacha.sample(StandardNormal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 8439, appendix A.1, test vector 1: key 0, nonce 0, block 0.
    #[test]
    fn the_stream_is_chacha20_of_rfc_8439() {
        let mut stream = Stream::from_key([0; 32]);
        let mut bytes = Vec::new();
        for _ in 0..8 {
            bytes.extend_from_slice(&stream.next_u64().to_le_bytes());
        }
        assert_eq!(
            bytes[..16],
            [
                0x76, 0xb8, 0xe0, 0xad, 0xa0, 0xf1, 0x3d, 0x90, 0x40, 0x5d, 0x6a, 0xe5, 0x53, 0x86,
                0xbd, 0x28
            ]
        );
    }

    /// The second block follows the first (appendix A.1, vector 2).
    #[test]
    fn block_one_follows_block_zero() {
        let mut stream = Stream::from_key([0; 32]);
        for _ in 0..8 {
            stream.next_u64();
        }
        assert_eq!(
            stream.next_u64().to_le_bytes(),
            [0x9f, 0x07, 0xe7, 0xbe, 0x55, 0x51, 0x38, 0x7a]
        );
    }

    #[test]
    fn the_division_of_a_path_into_names_matters() {
        let one = Stream::new(1, &["ab", "c"]).next_u64();
        let other = Stream::new(1, &["a", "bc"]).next_u64();
        assert_ne!(one, other);
    }

    #[test]
    fn big_and_small_bounded_integers_agree() {
        for n in [1u64, 2, 3, 5, 17, 1 << 40, u64::MAX] {
            let mut small = Stream::new(7, &["x"]);
            let mut big = Stream::new(7, &["x"]);
            for _ in 0..20 {
                assert_eq!(
                    BigUint::from(small.below(n)),
                    big.below_big(&BigUint::from(n))
                );
            }
        }
    }

    #[test]
    fn bounded_integers_are_uniform() {
        let mut stream = Stream::new(2007, &["uniform"]);
        let mut counts = [0u32; 5];
        for _ in 0..50_000 {
            counts[usize::try_from(stream.below(5)).unwrap()] += 1;
        }
        let chi2: f64 = counts
            .iter()
            .map(|&c| (f64::from(c) - 10_000.0).powi(2) / 10_000.0)
            .sum();
        assert!(chi2 < 18.5, "chi2 = {chi2}, 0.1 % point of 4 df is 18.47");
    }

    #[test]
    fn a_shuffle_keeps_every_item() {
        let mut items: Vec<u32> = (0..50).collect();
        Stream::new(1, &["shuffle"]).shuffle(&mut items);
        assert_ne!(items, (0..50).collect::<Vec<_>>());
        items.sort_unstable();
        assert_eq!(items, (0..50).collect::<Vec<_>>());
    }
}
