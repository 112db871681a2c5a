//! Random numbers of a stream for the functions of study-stats.

use study_base::rng::Stream;
use study_stats::random::RandomSource;

/// A stream as a source.
pub(crate) struct Random(pub(crate) Stream);

impl RandomSource for Random {
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
