//! Where the resampling methods take their randomness from.

/// A source of random numbers. Who calls decides which, and so whether a result can
/// be reproduced.
pub trait RandomSource {
    /// A whole number in `0..n`, uniform; `n` is at least 1.
    fn below(&mut self, n: u64) -> u64;
    /// Puts `items` in a uniformly random order.
    fn shuffle(&mut self, items: &mut [usize]);
    /// A number from the standard normal distribution.
    fn normal(&mut self) -> f64;
}

#[cfg(test)]
impl RandomSource for study_base::rng::Stream {
    fn below(&mut self, n: u64) -> u64 {
        study_base::rng::Stream::below(self, n)
    }
    fn shuffle(&mut self, items: &mut [usize]) {
        study_base::rng::Stream::shuffle(self, items);
    }
    fn normal(&mut self) -> f64 {
        study_base::rng::Stream::normal(self)
    }
}
