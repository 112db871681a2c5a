//! What happened, as it is stored: events, trials, telemetry, ratings.
//!
//! An [`Event`] is one line of a journal, the only truth. [`fold`] turns the
//! events of a session into rows; the fields of [`RatingRow`] are the columns of
//! `ratings.csv` and its doc comments the data dictionary. [`ratings`] holds the
//! same rows by column, for analysis.

pub mod columns;
pub mod event;
pub mod fold;
pub mod ratings;

pub use columns::{AttemptRow, ParticipantRow, RatingRow, Status};
pub use event::{Author, Choice, Entry, Event, Failure, Moment, Place, Playback, Start, State};

/// A row says what its realization is; readers of rows need no protocol for it.
pub use crate::protocol::Role;

use serde::{Deserialize, Serialize};

/// One instant of a playback, as the device reports it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Since the playback's confirmed start, by the device's clock, s.
    pub t_s: f64,
    /// Position, mm.
    pub x_mm: f64,
    /// Velocity, mm/s.
    pub v_mm_s: f64,
    /// Commanded force, N, after every limit.
    pub force_command_n: f64,
    /// Measured force, N, where there is a sensor.
    pub force_measured_n: Option<f64>,
}
