//! A session of a study and what remains of it.
//!
//! A [`session`] turns inputs into effects and events; [`outcome`] folds the events into
//! rows; [`page`] puts what a session shows into words; [`rendering`] judges whether a
//! playback had the force of its table; the [`store`] keeps the journal and derives the
//! tables. Only `store` touches files.

pub mod outcome;
pub mod page;
pub mod rendering;
pub mod session;
pub mod store;
