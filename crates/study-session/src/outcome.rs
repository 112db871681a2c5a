//! What happened, as it is stored: events, trials, telemetry, ratings.
//!
//! An [`Event`] is one line of a journal. [`fold::History`] is what the events of
//! a session add up to; the derived tables and the memory of a running session
//! both come from it. `protocol::columns` declares the columns of the tables and
//! [`cell`] gives the content of each. [`ratings`] holds the rows by column, for
//! analysis.

pub mod cell;
pub mod event;
pub mod fidelity;
pub mod fold;
pub mod media;
pub mod motion;
pub mod ratings;
pub mod rows;
pub mod sent;

pub use event::{
    Author, Channel, Choice, Entry, Event, Failure, FormId, Moment, Playback, STEP_BACK,
    SelfWeighed, Start, State, TelemetryFile, TrackLevel,
};
pub use fidelity::{Defect, Fidelity, Verdict};
pub use media::{Onset, Onsets};
pub use rows::{AttemptEvent, AttemptRow, IntervalRow, ParticipantRow, RatingRow, Status};
pub use sent::{SentFault, SentNumber};

/// A row says what its realization is; readers of rows need no protocol for it.
pub use study_plan::protocol::Role;

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
