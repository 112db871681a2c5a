//! What every crate of `study` needs: untrusted text and identifiers, limits,
//! diagnostics with line and caret, and reproducible random streams.

pub mod diagnostic;
pub mod limits;
pub mod rng;
pub mod text;
