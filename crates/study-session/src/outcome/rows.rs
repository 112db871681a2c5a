//! The rows of the derived tables. Their fields are the columns of the same name,
//! which `protocol::columns` declares.

use super::event::{Author, Channel, Event, Failure, State};
use super::fidelity::Fidelity;
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use study_base::text::{ModelId, PartId, ParticipantId, QuestionId};
use study_plan::protocol::{Answer, DeviceKind, Medium, Role};

study_base::named! {
    /// The outcome of a trial.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Status {
        /// Rated.
        #[default]
        Ok = "ok",
        /// Abandoned after the last permitted attempt.
        Failed = "failed",
        /// The primary question was declined.
        Declined = "declined",
        /// Not reached, or the primary question was left empty.
        Missing = "missing",
    }
}

/// One row of `ratings.csv`: a planned trial with its last answers.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "RatingColumn has the meanings")]
pub struct RatingRow {
    pub study: String,
    pub participant: ParticipantId,
    pub session: u32,
    pub row: Option<u32>,
    pub trial: u32,
    pub block: u32,
    pub position: Option<u32>,
    pub planned_position: u32,
    pub model: Option<ModelId>,
    pub role: Role,
    pub repetition: u32,
    pub previous_model: Option<ModelId>,
    pub practice: bool,
    pub pilot: bool,
    pub simulated: bool,
    pub device_kind: DeviceKind,
    pub device_id: String,
    pub operator: String,
    pub tool_version: String,
    pub protocol_version: u32,
    /// Last answers of the attempt that counts.
    pub answers: BTreeMap<QuestionId, Answer>,
    pub corrected: bool,
    pub declined: bool,
    pub remarks: String,
    pub reference_s: Option<f64>,
    pub exploration_s: Option<f64>,
    pub response_s: Option<f64>,
    pub strokes: Option<u32>,
    pub least_energy_j: Option<f64>,
    pub switches_per_s: Option<f64>,
    pub clamp_count: Option<u64>,
    pub started_at: Option<DateTime<FixedOffset>>,
    pub rated_at: Option<DateTime<FixedOffset>>,
    pub attempt: Option<u32>,
    pub status: Status,
    pub vaf: Option<f64>,
    pub covariates: BTreeMap<String, f64>,
    /// Factor → level of the realization.
    pub levels: BTreeMap<String, String>,
    pub part: Option<PartId>,
    pub track: Option<PartId>,
    pub level: Option<f64>,
    pub correct: Option<bool>,
    pub replays: Option<u32>,
    /// Of several playbacks the worst.
    pub fidelity: Option<Fidelity>,
    pub host_late_ms: Option<f64>,
    pub input_channel: Option<Channel>,
    pub front_name: Option<String>,
    pub group: Option<PartId>,
    pub session_id: Option<PartId>,
    pub paused_s: Option<f64>,
    pub felt_again_after_s: Option<f64>,
    pub answer_before_feedback: Option<Answer>,
    pub questionnaire_paused_s: Option<f64>,
    pub questionnaire_late: Option<bool>,
    pub media_offset_ms: Option<f64>,
    pub media_uncertainty_ms: Option<f64>,
    pub media_jitter_ms: Option<f64>,
    /// Outcome → the number that the device sent.
    pub sent: BTreeMap<String, f64>,
}

impl RatingRow {
    /// The first attempt at a trial in which a question was answered. Nothing else is known.
    pub fn answered(
        participant: ParticipantId,
        session: u32,
        trial: u32,
        (question, answer): (QuestionId, Answer),
    ) -> Self {
        Self {
            study: String::new(),
            participant,
            session,
            row: None,
            trial,
            block: 1,
            position: Some(trial),
            planned_position: trial,
            model: None,
            role: Role::Test,
            repetition: 1,
            previous_model: None,
            practice: false,
            pilot: false,
            simulated: false,
            device_kind: DeviceKind::Simulated,
            device_id: String::new(),
            operator: String::new(),
            tool_version: String::new(),
            protocol_version: 1,
            answers: BTreeMap::from([(question, answer)]),
            corrected: false,
            declined: false,
            remarks: String::new(),
            reference_s: None,
            exploration_s: None,
            response_s: None,
            strokes: None,
            least_energy_j: None,
            switches_per_s: None,
            clamp_count: None,
            started_at: None,
            rated_at: None,
            attempt: Some(1),
            status: Status::Ok,
            vaf: None,
            covariates: BTreeMap::new(),
            levels: BTreeMap::new(),
            part: None,
            track: None,
            level: None,
            correct: None,
            replays: None,
            fidelity: None,
            host_late_ms: None,
            input_channel: None,
            front_name: None,
            group: None,
            session_id: None,
            paused_s: None,
            felt_again_after_s: None,
            answer_before_feedback: None,
            questionnaire_paused_s: None,
            questionnaire_late: None,
            media_offset_ms: None,
            media_uncertainty_ms: None,
            media_jitter_ms: None,
            sent: BTreeMap::new(),
        }
    }
}

/// One row of `intervals.csv`: a presentation.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "IntervalColumn has the meanings")]
pub struct IntervalRow {
    pub study: String,
    pub participant: ParticipantId,
    pub session: u32,
    pub part: Option<PartId>,
    pub trial: u32,
    pub attempt: u32,
    pub interval: u32,
    pub model: Option<ModelId>,
    pub level: Option<f64>,
    pub level_proposed: Option<f64>,
    pub track: Option<PartId>,
    pub track_trial: Option<u32>,
    pub target: Option<bool>,
    pub catch: Option<bool>,
    pub gap_s: Option<f64>,
    pub replays: u32,
    pub exploration_s: Option<f64>,
    pub strokes: Option<u32>,
    pub fidelity: Option<Fidelity>,
    pub host_late_ms: Option<f64>,
}

study_base::named! {
    /// What a row of `attempts.csv` is about.
    #[allow(missing_docs, reason = "AttemptColumn::What has the meanings")]
    AttemptEvent {
        Attempt = "attempt",
        Answer = "answer",
        Correction = "correction",
        Failure = "failure",
        Closed = "closed",
        Remark = "remark",
        Resume = "resume",
        State = "state",
        Reveal = "reveal",
        SelfWeighed = "self-weighed",
        Media = "media",
        NumberSent = "number-sent",
    }
}

impl AttemptEvent {
    /// That of an event of the journal, if it has a row.
    pub(super) fn of(event: &Event) -> Option<Self> {
        Some(match event {
            Event::AttemptStarted { .. } => Self::Attempt,
            Event::Answered { .. } => Self::Answer,
            Event::Corrected { .. } | Event::IdCorrected { .. } => Self::Correction,
            Event::AttemptFailed { .. } | Event::StepFailed { .. } => Self::Failure,
            Event::TrialClosed { .. } => Self::Closed,
            Event::Remark { .. } => Self::Remark,
            Event::Reopened { .. } => Self::Resume,
            Event::StateSet { .. } => Self::State,
            Event::Revealed { .. } => Self::Reveal,
            Event::SelfWeighed(_) => Self::SelfWeighed,
            Event::MediaShown { .. } => Self::Media,
            // Only those that do not count; the others are in `ratings.csv`.
            Event::NumbersSent { numbers, .. } if numbers.iter().any(|n| n.fault.is_some()) => {
                Self::NumberSent
            }
            _ => return None,
        })
    }
}

/// One row of `attempts.csv`: an attempt, answer, correction, failure or remark.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "AttemptColumn has the meanings")]
pub struct AttemptRow {
    pub participant: ParticipantId,
    pub session: u32,
    pub simulated: bool,
    pub pilot: bool,
    pub trial: Option<u32>,
    pub attempt: Option<u32>,
    pub model: Option<ModelId>,
    pub what: AttemptEvent,
    pub question: Option<QuestionId>,
    pub from: Option<Answer>,
    pub to: Option<Answer>,
    pub failure: Option<Failure>,
    pub by: Option<Author>,
    pub text: String,
    pub at: DateTime<FixedOffset>,
    pub input_channel: Option<Channel>,
    pub medium: Option<Medium>,
    pub media_offset_ms: Option<f64>,
    pub media_uncertainty_ms: Option<f64>,
}

/// One row of `participants.csv`.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "ParticipantColumn has the meanings")]
pub struct ParticipantRow {
    pub participant: ParticipantId,
    pub session: u32,
    pub state: State,
    pub reason: String,
    pub row: Option<u32>,
    pub pilot: bool,
    pub simulated: bool,
    pub erased: bool,
    pub consent_version: Option<String>,
    pub protocol_version: Option<u32>,
    pub trials_done: u32,
    pub trials_planned: u32,
    pub started_at: Option<DateTime<FixedOffset>>,
    pub answers: BTreeMap<QuestionId, Answer>,
    pub group: Option<PartId>,
    pub session_id: Option<PartId>,
    pub gap_h: Option<f64>,
}
