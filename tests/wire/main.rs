//! The wire format, and the device that implements it.

mod commit;
mod elements;
mod fade;
mod firmware;
mod firmware_probe;
mod firmware_states;
mod fuzz;
mod mechanism;
mod minor;
mod rules;
mod support;
mod v1;
