//! Numbers so large that their squares, or sums of them, are beyond a double.
//!
//! What overflows on its way looks like something else: no finite sum of squares
//! is no variance. So the statistics of such tables are computed a second time,
//! of the same numbers divided by a power of two, which changes no digit of
//! them. What is defined there and not here has overflowed; what is not defined
//! there either has the reason that is found there.

use super::values::{Value, Values};
use crate::outcome::ratings::Ratings;

/// Fourth powers of larger numbers, summed over a table, may overflow.
const LARGE: f64 = 1e70;

const WHY: &str = "the numbers are so large that sums over them are beyond what a double holds \
                   (1.8e308): give them in another unit";

/// The same table with numbers near 1, if some are large.
pub(super) fn smaller(ratings: &Ratings) -> Option<Ratings> {
    let rating = factor(&ratings.rating);
    let vaf = factor(&ratings.vaf);
    if rating == 1.0 && vaf == 1.0 {
        return None;
    }
    let mut smaller = ratings.clone();
    (smaller.rating.iter_mut().flatten()).for_each(|v| *v *= rating);
    (smaller.vaf.iter_mut().flatten()).for_each(|v| *v *= vaf);
    Some(smaller)
}

/// A power of two that brings the largest to 1, or 1 if none is large.
fn factor(numbers: &[Option<f64>]) -> f64 {
    let largest = numbers.iter().flatten().fold(0.0f64, |a, v| a.max(v.abs()));
    if largest > LARGE {
        (-largest.log2().floor()).exp2()
    } else {
        1.0
    }
}

pub(super) fn explain(values: &mut Values, smaller: &Values) {
    values.explain(|id| match smaller.get(id) {
        Some(Value::Undefined(why)) => Some(why.clone()),
        Some(Value::Number(_) | Value::List(_)) => Some(WHY.to_owned()),
        None => None,
    });
}
