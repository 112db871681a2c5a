//! The device's side of a haptic playback: what a motor's firmware and the host share.
//!
//! No `std`, no allocator, `f64` throughout: a table is judged and played on the
//! device bit for bit as on the host. `docs/wire.md` specifies the bytes.
//!
//! A byte from the serial port goes to a [`frame::Decoder`], a frame becomes a
//! [`message`], the [`handler`] keeps the device's state, the [`servo`] turns a
//! measured motion into a force, and [`predict`] is the model's force.
//! [`certificate`] says whether a table is passive.

#![cfg_attr(not(test), no_std)]

pub mod certificate;
pub mod frame;
pub mod handler;
pub mod message;
pub mod predict;
pub mod servo;
