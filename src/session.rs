//! The running study as a pure state machine.
//!
//! `handle(Input, at) → effects; view()`. No clock, no device, no store, no
//! randomness: time comes in as an argument, everything it wants done goes out as
//! an [`Effect`], and what the operator may see is a [`View`], which never holds
//! anything that identifies a realization.
//!
//! Invariants: an answer shows as saved only after [`Input::Saved`] came back for
//! its event; a rating opens only after the device confirmed start and end of the
//! playback; every path out of playing sends [`Effect::Stop`] or
//! [`Effect::Limp`] first.

pub mod input;
pub mod view;

pub use input::{Effect, Ending, Input};
pub use view::{Screen, View};
