//! Playback of haptic realizations on a device: wire format, servo, force prediction
//! and passivity certificate, shared by a motor's firmware and the host.
//!
//! The crate is `no_std`, does not allocate and calculates in `f64`, so that a device
//! validates and renders a table with exactly the same results as the host. A processor
//! without a double-precision unit renders with `f32`, within 1 mN ([`real`]).
//!
//! # For firmware authors
//!
//! A firmware provides a millisecond clock, a serial port that never blocks, sensors
//! and a motor. Everything else is [`handler::Handler`]:
//!
//! 1. Describe the device with a [`handler::Profile`]: its limits, its servo rate and
//!    the settings of the [`servo`].
//! 2. Put a `Handler<NODES, POINTS>`, or `Handler<NODES, POINTS, f32>`, into a `static`:
//!    [`handler::Handler::new`] is `const`. A table node or value of a
//!    mechanism takes 80 bytes, or 44 in `f32`, a
//!    point of a probe's path 4 bytes. `POINTS` is 0 without probe mode.
//! 3. In the servo's timer interrupt call [`handler::Handler::servo`] with the measured
//!    motion, apply the returned [`handler::Drive`] to the motor, and pass received
//!    bytes to [`handler::Handler::receive`].
//! 4. Report missed periods with [`handler::Handler::overrun`] and faults of the hardware
//!    with [`handler::Handler::trip`].
//!
//! The crate `study-firmware` of the same repository is this loop, and
//! `docs/wire.md` specifies the bytes, states and time limits. `study device check`
//! tests a finished device against that specification.
//!
//! # Modules, in reading order
//!
//! - [`predict`]: the force of a table at a given motion. Start here; `examples/servo.rs`
//!   plays a small table.
//! - [`mechanism`]: a virtual mechanism in place of a table.
//! - [`elements`]: a potential with springs that slip, relax or break, in place of a table.
//! - [`certificate`]: whether a table is passive.
//! - [`estimate`]: speed and acceleration from an encoder, and rotary devices.
//! - [`servo`]: one servo period, with trips, slew limit, ramp and clamp.
//! - [`frame`] and [`message`]: the wire format.
//! - [`handler`]: the device's state machine, watchdog and uploads.
//!
//! # Units and signs
//!
//! Positions are in mm, speeds in mm/s, accelerations in m/s², forces in N, masses in
//! kg, damping in N·s/mm, stiffness in N/mm, energy in J and times in s or ms, as the
//! suffix of each name says. A force is the one that the hand has to apply, positive
//! in the direction of +x.

#![cfg_attr(not(test), no_std)]

pub mod certificate;
#[cfg(test)]
mod draw;
pub mod elements;
pub mod estimate;
pub mod frame;
pub mod handler;
pub mod mechanism;
pub mod message;
pub mod predict;
pub mod real;
pub mod servo;
mod sum;
