//! The level of significance.

/// Whether a test rejects: p ≤ level. Under the null hypothesis P(p ≤ α) ≤ α for every
/// test, those with few values of p included, so that the level is kept and no larger
/// rejection region keeps it (Lehmann & Romano 2005, Testing Statistical Hypotheses, §3.3).
pub fn rejects(p: f64, level: f64) -> bool {
    p <= level
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_orders_meets_the_level_exactly() {
        for (count, all, level) in [
            (6u64, 120u64, 0.05),
            (36, 720, 0.05),
            (252, 5040, 0.05),
            (500, 10_000, 0.05),
            (100, 10_000, 0.01),
            (3, 120, 0.025),
        ] {
            assert!(
                rejects(count as f64 / all as f64, level),
                "{count} of {all}"
            );
            assert!(!rejects((count + 1) as f64 / all as f64, level));
        }
    }
}
