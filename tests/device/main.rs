//! Playback devices: simulated, behind a program, checked, commanded to stop.

mod check;
mod playback;
mod process;
mod safety;
mod shipped;
#[path = "../support/mod.rs"]
mod support;
mod target;
