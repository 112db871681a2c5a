//! Foundations of `study`, without any knowledge of studies.
//!
//! * [`text`]: text of unknown origin, safe to print ([`text::Untrusted`]), and
//!   identifiers that are safe in file names.
//! * [`named!`]: enumerations whose values have names in files.
//! * [`limits`]: bounds that are finite and positive by construction.
//! * [`diagnostic`]: faults of a file with line, caret and suggestion, and a TOML
//!   reader that reports every fault rather than the first.
//! * [`hex`]: bytes and SHA-256 digests as text.
//! * [`license`]: terms of use as archives write them.
//! * [`perception`]: the least difference in force that people feel.
//! * [`rng`]: random streams that are named, independent and the same on every
//!   machine.
//! * [`sort`]: sorting that is compiled once.
//!
//! * [`child`]: a program that exchanges lines with this one.
//!
//! Apart from [`child`], nothing here does input or output or knows the time. Begin with
//! `examples/streams.rs`.

pub mod apa;
pub mod child;
pub mod diagnostic;
pub mod hex;
pub mod license;
pub mod limits;
mod named;
pub mod perception;
pub mod rng;
pub mod sort;
pub mod text;
