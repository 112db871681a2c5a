//! A rating study, from its protocol to its analysis.
//!
//! A [`protocol`] gives a [`schedule`]; a [`session`] turns inputs into events;
//! the [`store`] keeps the events; [`outcome`] folds them into ratings; [`analyze`]
//! says what the ratings show. A [`procedure`] chooses the level of the next trial from
//! the answers so far. Only `store` touches files.

pub mod analyze;
pub mod outcome;
pub mod procedure;
pub mod protocol;
pub mod schedule;
pub mod session;
pub mod store;
