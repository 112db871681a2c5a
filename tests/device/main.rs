//! Playback devices: simulated, as a program, commissioning, safety.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod accused;
mod changes;
mod check;
#[path = "../support/designs.rs"]
mod designs;
mod playback;
mod port;
mod precision;
mod process;
mod process_check;
mod rendering;
mod safety;
#[cfg(unix)]
mod shell;
mod shipped;
mod supervision;
#[path = "../support/mod.rs"]
mod support;
mod tables;
mod target;
mod turning;
mod verdict;
mod wrong;
