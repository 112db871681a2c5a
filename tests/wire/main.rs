//! The bytes between host and device, and the device at the end of them.

mod firmware;
mod firmware_probe;
mod firmware_states;
mod fuzz;
mod support;
mod v1;
