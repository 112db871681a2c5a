//! Simulated plants: the target, the probe, and the hand on the playback device.
//!
//! [`Target`] is the turn-signal switch: a spring-loaded follower on a cam with three
//! detents, with friction, backlash and end stops; a probe imposes a motion on its
//! handle. [`Probe`] moves the handle along a trajectory and measures with noisy
//! sensors. [`file`](mod@file) reads and writes the parameters of a target as TOML.
//! [`Hand`] is a person's hand on the slider of the playback device, which it moves back
//! and forth over the stroke.
//!
//! None of this was measured on hardware: forces, and the ranking of methods by them,
//! are those of the simulation. Equations and parameters: `docs/simulation.md`.
//!
//! Units: mm, s, N, kg, N/mm; damping in N·s/m as in data sheets. Force is what the
//! probe applies to the target, positive with +x. Equal parameters and motion give
//! bit-identical forces on one platform.

/// The version of the simulation: recordings with the same version, parameters,
/// trajectory and seed are identical. It is in the header of recordings in place of the
/// program's version, so that a release that does not change the simulation leaves
/// recordings and their hashes in model files unchanged.
pub const SIMULATION: u32 = 1;

pub mod file;

mod cam;
mod friction;
mod hand;
mod parameters;
mod probe;
mod target;

pub use hand::{Hand, HandParameters};
pub use parameters::{Extremum, Parameters, PlantError};
pub use probe::{MAX_RATE_HZ, MIN_RATE_HZ, Measurement, Probe, ProbeError};
pub use target::{DT_S, Target};
