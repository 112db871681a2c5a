//! The rows of the derived tables. Field docs are the data dictionary.

use crate::protocol::{Answer, DeviceKind, Role};
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use study_base::text::{ModelId, ParticipantId, QuestionId};

use super::event::{Author, Failure, State};

/// What became of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Rated.
    Ok,
    /// Closed after its last failed attempt.
    Failed,
    /// The primary question was declined.
    Declined,
    /// Never reached, or the primary question left empty.
    Missing,
}

impl Status {
    /// As in `ratings.csv`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Failed => "failed",
            Self::Declined => "declined",
            Self::Missing => "missing",
        }
    }
}

/// One row of `ratings.csv`: a planned trial with its last answers.
#[derive(Debug, Clone, PartialEq)]
pub struct RatingRow {
    /// Study id.
    pub study: String,
    /// Pseudonym.
    pub participant: ParticipantId,
    /// Session of the participant, from 1.
    pub session: u32,
    /// Row of the schedule; empty for pilots and simulated participants.
    pub row: Option<u32>,
    /// Trial of the session, practice included, from 1.
    pub trial: u32,
    /// Block, from 1; 0 for practice.
    pub block: u32,
    /// Place among the trials that count, as felt; empty if never felt.
    pub position: Option<u32>,
    /// Place that the schedule had for it.
    pub planned_position: u32,
    /// Realization.
    pub model: ModelId,
    /// Its role.
    pub role: Role,
    /// Its repetition, from 1; 0 for practice.
    pub repetition: u32,
    /// Realization that the hand last felt before it; empty at the start.
    pub previous_model: Option<ModelId>,
    /// Practice trial.
    pub practice: bool,
    /// The participant was a pilot.
    pub pilot: bool,
    /// There was no person.
    pub simulated: bool,
    /// Kind of the device.
    pub device_kind: DeviceKind,
    /// Which device.
    pub device_id: String,
    /// Who ran the session.
    pub operator: String,
    /// Version of this program.
    pub tool_version: String,
    /// Version of the protocol.
    pub protocol_version: u32,
    /// Question → last answer.
    pub answers: BTreeMap<QuestionId, Answer>,
    /// Whether an answer was corrected.
    pub corrected: bool,
    /// Whether an answer was declined.
    pub declined: bool,
    /// Remarks made during the trial, joined by ` | `.
    pub remarks: String,
    /// Duration of the reference prompt, s.
    pub reference_s: Option<f64>,
    /// Duration of the playback, confirmed start to confirmed stop, s.
    pub exploration_s: Option<f64>,
    /// Duration of the rating, opening to confirmation, s.
    pub response_s: Option<f64>,
    /// Full strokes.
    pub strokes: Option<u32>,
    /// Least energy put in by the hand, J.
    pub least_energy_j: Option<f64>,
    /// Changes of the direction state per second.
    pub switches_per_s: Option<f64>,
    /// How often the force was clamped.
    pub clamp_count: Option<u64>,
    /// When the playback was asked for.
    pub started_at: Option<DateTime<FixedOffset>>,
    /// When the rating was confirmed.
    pub rated_at: Option<DateTime<FixedOffset>>,
    /// Attempt that counts, from 1.
    pub attempt: Option<u32>,
    /// What became of it.
    pub status: Status,
    /// VAF of the realization.
    pub vaf: Option<f64>,
    /// Covariates of the realization, by name.
    pub covariates: BTreeMap<String, f64>,
}

/// One row of `attempts.csv`: every attempt, correction and failure.
#[derive(Debug, Clone, PartialEq)]
pub struct AttemptRow {
    /// Pseudonym.
    pub participant: ParticipantId,
    /// Session of the participant, from 1.
    pub session: u32,
    /// There was no person.
    pub simulated: bool,
    /// The participant was a pilot.
    pub pilot: bool,
    /// Trial of the session.
    pub trial: Option<u32>,
    /// Attempt, from 1.
    pub attempt: Option<u32>,
    /// Realization.
    pub model: Option<ModelId>,
    /// `attempt`, `answer`, `correction`, `failure`, `closed`, `remark`, `resume`,
    /// `state`, `reveal`.
    pub what: &'static str,
    /// Question that was answered or corrected.
    pub question: Option<QuestionId>,
    /// The answer before.
    pub from: Option<Answer>,
    /// The answer after.
    pub to: Option<Answer>,
    /// Why an attempt failed.
    pub failure: Option<Failure>,
    /// Who corrected or remarked.
    pub by: Option<Author>,
    /// Reason, detail or remark.
    pub text: String,
    /// When.
    pub at: DateTime<FixedOffset>,
}

/// One row of `participants.csv`.
#[derive(Debug, Clone, PartialEq)]
pub struct ParticipantRow {
    /// Pseudonym.
    pub participant: ParticipantId,
    /// Last session, from 1.
    pub session: u32,
    /// State.
    pub state: State,
    /// Why, where somebody set it.
    pub reason: String,
    /// Row of the schedule that the order came from; empty for pilots and
    /// simulated participants.
    pub row: Option<u32>,
    /// Pilot.
    pub pilot: bool,
    /// No person.
    pub simulated: bool,
    /// What was erased at the participant's wish.
    pub erased: bool,
    /// Version of the consent document that was agreed to.
    pub consent_version: Option<String>,
    /// Version of the protocol.
    pub protocol_version: u32,
    /// Trials that count and are closed.
    pub trials_done: u32,
    /// Trials that count.
    pub trials_planned: u32,
    /// Wall-clock start.
    pub started_at: Option<DateTime<FixedOffset>>,
    /// Answers of setup, intake and outro, by question.
    pub answers: BTreeMap<QuestionId, Answer>,
}
