//! A rating study, from its protocol to its analysis.
//!
//! A [`protocol`] gives a [`schedule`]; a [`session`] turns inputs into events;
//! the [`store`] keeps the events; [`rendering`] judges whether a playback had the force
//! of its table; [`outcome`] folds the events into ratings; [`analyze`] says what the
//! ratings show, and [`export`] writes them down for other programs. A [`procedure`] chooses the level of the next trial from the answers so
//! far. Only `store` touches files.

pub mod analyze;
pub mod export;
pub mod outcome;
pub mod power;
pub mod preregister;
pub mod procedure;
pub mod protocol;
pub mod rendering;
pub mod schedule;
pub mod session;
pub mod store;
