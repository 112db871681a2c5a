//! The target, and the hand that holds the device.
//!
//! Three simulated things stand in for what a lab has on its bench. [`Target`] is
//! the turn-signal switch: a spring-loaded follower on a cam with three detents,
//! with friction, backlash and end stops; a probe imposes a motion on its handle
//! and feels a force. [`Probe`] is that probe: it imposes a trajectory and measures
//! with the noise of its sensors; [`file`](mod@file) holds the parameters of a target
//! as TOML. [`Hand`] is a person's hand on the slider of the playback device, which it
//! moves back and forth over the stroke.
//!
//! Neither is measured on hardware: forces and ranks of methods that come out of
//! them are those of the simulation. Equations and parameters are in
//! `docs/simulation.md`. Nothing here knows of files, clocks or devices.
//!
//! Units: mm, s, N, kg, N/mm; damping in N·s/m as in the data sheets that the
//! parameters come from. Force is what the probe applies, positive with +x.
//! Same parameters and same motion give the same force, bit for bit, on one
//! platform.

/// Counts what changes the simulated forces or measurements: recordings with the same
/// number, parameters, trajectory and seed are the same. It stands in their headers in
/// place of the program's version, so that a release that changes none of this leaves
/// every recording, and the hash that model files know it by, as it is.
pub const SIMULATION: u32 = 1;

pub mod file;

mod cam;
mod friction;
mod hand;
mod parameters;
mod probe;
mod target;

pub use hand::{Hand, HandParameters};
pub use parameters::{BadPlant, Parameters, Well};
pub use probe::{LEAST_RATE_HZ, MOST_RATE_HZ, Measured, Probe, ProbeError, envelope_of};
pub use target::{DT_S, Target};
