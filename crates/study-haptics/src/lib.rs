//! Haptic models from probe recordings.
//!
//! This crate identifies *realizations* of a haptic model, tables of mass, damping,
//! stiffness and offset force by position and direction of travel, from recordings of a
//! probe that moved the target. The method is that of Colton & Hollerbach, "Haptic Models
//! of an Automotive Turn-Signal Switch", World Haptics 2007.
//!
//! # Data flow
//!
//! ```text
//! trajectory ──▶ plant (or a real probe) ──▶ recording ──▶ identify ──▶ model
//! ```
//!
//! * [`trajectory`]: the motion of the probe, as a formula;
//! * [`plant`]: a simulated target, probe and hand;
//! * [`recording`]: position, velocity, acceleration and force over time, as CSV;
//! * [`identify`]: filters, estimators and validation;
//! * [`model`]: the realization and its model file;
//! * [`safe_play`]: what an adversary makes of it on a device;
//! * [`swing`]: what the swing of a free handle tells of its motor;
//! * [`archive`]: a realization with everything that it rests on, in one file.
//!
//! # Units
//!
//! Time s, position mm, velocity mm/s, acceleration m/s², force N; hence mass kg, damping
//! N·s/mm, stiffness N/mm. A suffix of each name states its unit. Force is what the probe
//! applies to the target, positive with +x.
//!
//! The crate opens no files: readers take text or [`std::io::BufRead`], and writers
//! return text or take [`std::io::Write`].
//!
//! # Example
//!
//! `cargo run -p study-haptics --example identify`
//!
//! ```no_run
#![doc = include_str!("../examples/identify.rs")]
//! ```

pub mod archive;
pub mod family;
pub mod identify;
pub mod model;
pub mod plant;
pub mod recording;
pub mod safe_play;
pub mod swing;
pub mod trajectory;
