//! The target, and the hand that holds the device.
//!
//! Two simulated things stand in for what a lab has on its bench. [`Target`] is
//! the turn-signal switch: a spring-loaded follower on a cam with three detents,
//! with friction, backlash and end stops; a probe imposes a motion on its handle
//! and feels a force. [`Hand`] is a person's hand on the slider of the playback
//! device, which it moves back and forth over the stroke.
//!
//! Neither is measured on hardware: forces and ranks of methods that come out of
//! them are those of the simulation. Equations and parameters are in
//! `docs/simulation.md`. Nothing here knows of files, clocks or devices.
//!
//! Units: mm, s, N, kg, N/mm; damping in N·s/m as in the data sheets that the
//! parameters come from. Force is what the probe applies, positive with +x.
//! Same parameters and same motion give the same force, bit for bit, on one
//! platform.

mod cam;
mod friction;
mod hand;
mod parameters;
mod target;

pub use hand::{Hand, HandParameters};
pub use parameters::{BadPlant, Parameters, Well};
pub use target::{DT_S, Target};
