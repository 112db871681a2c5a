//! What happened, as it is stored: events, trials, telemetry, ratings.
//!
//! An [`Event`] is one line of a journal, the only truth. [`fold`] turns the
//! events of a session into rows, whose columns `protocol::columns` declares;
//! [`cell`] says what a row has in each. [`ratings`] holds the same rows by column,
//! for analysis.

pub mod cell;
pub mod event;
pub mod fold;
pub mod ratings;
pub mod rows;

pub use event::{Author, Choice, Entry, Event, Failure, Moment, Place, Playback, Start, State};
pub use rows::{AttemptRow, ParticipantRow, RatingRow, Status};

/// A row says what its realization is; readers of rows need no protocol for it.
pub use crate::protocol::Role;

use serde::{Deserialize, Serialize};

/// A telemetry sample of a playback, as the device reports it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "SampleColumn has the meanings")]
pub struct Sample {
    pub t_s: f64,
    pub x_mm: f64,
    pub v_mm_s: f64,
    pub force_command_n: f64,
    pub force_measured_n: Option<f64>,
}
