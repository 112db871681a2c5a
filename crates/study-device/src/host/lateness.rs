//! How late the host was: a computer that does other things sends heartbeats late.

use std::time::Duration;

/// Classes of one ms; the last one has all that is later.
const CLASSES: usize = 256;

/// The lateness of the turns of a loop.
#[derive(Debug, Clone, Default)]
pub struct Lateness {
    /// Number of turns by whole ms.
    by_ms: Vec<u64>,
    most: Duration,
}

impl Lateness {
    /// A turn was late by this time.
    pub fn add(&mut self, by: Duration) {
        if self.by_ms.is_empty() {
            self.by_ms = vec![0; CLASSES];
        }
        self.by_ms[(by.as_millis() as usize).min(CLASSES - 1)] += 1;
        self.most = self.most.max(by);
    }

    /// 99th percentile, rounded up to whole ms, and most, ms; `None` without turns.
    pub fn ms(&self) -> Option<[f64; 2]> {
        let all: u64 = self.by_ms.iter().sum();
        let mut seen = 0;
        let class = self.by_ms.iter().position(|n| {
            seen += n;
            seen > 0 && 100 * seen >= 99 * all
        })?;
        let most = self.most.as_nanos() as f64 / 1e6;
        Some([((class + 1) as f64).min(most), most])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_is_that_of_the_turns() {
        assert_eq!(Lateness::default().ms(), None);
        let mut late = Lateness::default();
        for us in 0..1000 {
            late.add(Duration::from_micros(us));
        }
        assert_eq!(late.ms(), Some([0.999, 0.999]));
        for _ in 0..9 {
            late.add(Duration::from_millis(40));
        }
        assert_eq!(late.ms(), Some([1.0, 40.0]));
        for _ in 0..2 {
            late.add(Duration::from_secs(3));
        }
        assert_eq!(late.ms(), Some([41.0, 3000.0]));
    }
}
