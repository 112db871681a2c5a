//! A session from the first screen to the last, with a device and a store that
//! the tests play. Every step of every test also passes the walls in `rig`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod adjustment;
mod agreement;
mod between;
mod blinding;
mod consent;
mod debriefing;
mod device;
mod exposure;
mod failed_steps;
mod forms;
mod identification;
mod initials;
mod interpreters;
mod late_forms;
mod media;
mod media_steps;
mod numbers;
mod part_rig;
mod parts;
mod pauses;
mod random;
mod ranking;
mod refused;
mod resume;
mod retraced;
mod retraced_whole;
mod rig;
mod saving;
mod search;
mod similarity;
mod studies;
mod unasked;
mod whole;
