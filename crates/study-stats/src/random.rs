//! Random numbers for the resampling methods.

/// A source of random numbers. The caller chooses it, and so decides whether a result
/// can be reproduced.
pub trait RandomSource {
    /// A uniformly distributed whole number in `0..n`; `n` is at least 1.
    fn below(&mut self, n: u64) -> u64;
    /// Puts `items` in a uniformly random order.
    fn shuffle(&mut self, items: &mut [usize]);
    /// A number from the standard normal distribution.
    fn normal(&mut self) -> f64;
}

/// The generator SplitMix64 (Steele, Lea & Flood 2014), with a fixed seed: for callers
/// without a generator of their own.
#[derive(Debug, Clone)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The same seed gives the same numbers.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in (0, 1].
    fn unit(&mut self) -> f64 {
        ((self.next() >> 11) + 1) as f64 / (1u64 << 53) as f64
    }
}

impl RandomSource for SplitMix64 {
    fn below(&mut self, n: u64) -> u64 {
        // The numbers from the largest multiple of n on are rejected.
        let limit = u64::MAX - u64::MAX % n;
        loop {
            let x = self.next();
            if x < limit {
                return x % n;
            }
        }
    }

    fn shuffle(&mut self, items: &mut [usize]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u64 + 1) as usize);
        }
    }

    /// Box & Muller (1958).
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.unit().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first outputs for the seed 1234567, as published with the algorithm's
    /// reference implementation.
    #[test]
    fn the_generator_is_splitmix64() {
        let mut random = SplitMix64::new(1_234_567);
        assert_eq!(random.next(), 6_457_827_717_110_365_317);
        assert_eq!(random.next(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn numbers_have_their_distributions() {
        let mut random = SplitMix64::new(1);
        let (mut counts, mut sum, mut squares) = ([0; 3], 0.0, 0.0);
        let n = 30_000;
        for _ in 0..n {
            counts[random.below(3) as usize] += 1;
            let z = random.normal();
            sum += z;
            squares += z * z;
        }
        // Four standard errors.
        assert!(
            counts.iter().all(|c| (c - n / 3i32).abs() < 330),
            "{counts:?}"
        );
        assert!((sum / f64::from(n)).abs() < 0.024);
        assert!((squares / f64::from(n) - 1.0).abs() < 0.033);
        let mut items: Vec<usize> = (0..9).collect();
        random.shuffle(&mut items);
        let shuffled = items.clone();
        items.sort_unstable();
        assert!(shuffled != items && items == (0..9).collect::<Vec<_>>());
    }
}
