//! Warnings of numbers that cannot be what they should be, and of columns that were not
//! read.

use super::{Rules, Warning};
use study_base::text::counted;
use study_session::outcome::ratings::Ratings;

/// The warnings of the rows that are analyzed, before all others.
pub(super) fn before(mut others: Vec<Warning>, ratings: &Ratings, rules: &Rules) -> Vec<Warning> {
    let mut found = Vec::new();
    let mut warn = |code, text| found.push(Warning { code, text });
    for (column, known) in &ratings.near_misses {
        let text = format!("column {column} is not read: did you mean {known}?");
        warn("column-not-read", text);
    }
    if let Some((low, high)) = rules.scale {
        let outside = |x: &f64| !(low..=high).contains(x);
        let outside: Vec<f64> = ratings
            .rating
            .iter()
            .copied()
            .flatten()
            .filter(outside)
            .collect();
        if let Some(first) = outside.first() {
            let ratings = counted(outside.len(), "rating", "ratings");
            let text = format!("{ratings} outside the scale {low} to {high}, such as {first}");
            warn("outside-scale", text);
        }
    }
    let above: Vec<f64> = ratings
        .vaf
        .iter()
        .copied()
        .flatten()
        .filter(|v| *v > 1.0)
        .collect();
    if let Some(first) = above.first() {
        let text = format!("VAF above 1, such as {first}: is it in per cent?");
        warn("vaf-above-1", text);
    }
    found.append(&mut others);
    found
}
