//! Numbers so large that their squares, or sums of these, exceed a double.
//!
//! A sum that overflows looks like a missing one to the statistic that needs it, so
//! the reason it gives would be wrong. In a table with such numbers every undefined
//! statistic that forms sums of ratings therefore names the overflow as a cause.

use super::results::{Field, Results};
use study_session::outcome::ratings::Ratings;

/// Sums of fourth powers of larger numbers may overflow.
const LARGE: f64 = 1e70;

const WHY: &str = "undefined, or lost because sums over numbers this large are beyond what a \
                   double holds (1.8e308): use another unit";

/// Names the overflow where a table has numbers that large. The ordinal models count
/// ratings and sum none.
pub(super) fn explain(ratings: &Ratings, results: &mut Results) {
    let mut numbers = ratings.rating.iter().chain(&ratings.vaf).flatten();
    if numbers.any(|v| v.abs() > LARGE) {
        let ordinal = results.ordinal.clone();
        results.explain(&WHY.into());
        results.ordinal = ordinal;
    }
}
