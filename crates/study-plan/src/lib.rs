//! What a study is before its first session.
//!
//! A [`protocol`] is the study file, checked; [`schedule`] computes the reproducible order of
//! the trials of each row; a [`procedure`] chooses the level of the next trial from the
//! answers so far. Nothing here touches a file: text goes in, checked values come out.

pub mod procedure;
pub mod protocol;
pub mod schedule;
