//! Random streams of the permutation tests and the bootstrap.

use study_base::rng::Stream;
use study_stats::random::RandomSource;

/// A random stream, separate for each method.
pub(super) struct Draws(Stream);

impl Draws {
    pub(super) fn new(seed: u64, method: &str) -> Self {
        Self(Stream::new(seed, &[method]))
    }
}

impl RandomSource for Draws {
    fn below(&mut self, n: u64) -> u64 {
        self.0.below(n)
    }

    fn shuffle(&mut self, items: &mut [usize]) {
        self.0.shuffle(items);
    }

    fn normal(&mut self) -> f64 {
        self.0.normal()
    }
}
