//! Ratings to an analysis: numbers and warnings. Pure.
