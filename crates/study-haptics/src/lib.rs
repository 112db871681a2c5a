//! From probe recordings to haptic models.
//!
//! A [`trajectory`] moves the probe, a [`plant`] answers, a [`recording`] keeps
//! both, and [`identify`] finds the [`model`] that explains it. The method is that
//! of Colton & Hollerbach, World Haptics 2007. No files: parsers take text or
//! readers and give values.

pub mod identify;
pub mod model;
pub mod plant;
pub mod recording;
pub mod trajectory;
