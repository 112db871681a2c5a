//! Ratings by column, for analysis.
