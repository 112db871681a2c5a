//! A rating study, from its protocol to its analysis.
//!
//! A [`protocol`] gives a [`schedule`]; a [`session`] turns inputs into events;
//! the [`store`] keeps the events; [`outcome`] folds them into ratings; [`analyze`]
//! says what the ratings show. Only `store` touches files.

pub mod analyze;
pub mod outcome;
pub mod protocol;
pub mod schedule;
pub mod session;
pub mod store;
