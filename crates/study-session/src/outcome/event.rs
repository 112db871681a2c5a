//! The events of a session; each is one line of its journal.
//!
//! The serialized names and fields are a file format: a later version may add
//! events and optional fields but must not change these. `store` adds a sequence
//! number, checksums and clocks to each event.

use super::fidelity::Fidelity;
use super::sent::SentNumber;
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use study_base::named;
use study_base::text::{ModelId, PartId, ParticipantId, QuestionId};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::{Answer, Assigned, DeviceKind, Medium, Seat, Trial};

/// A point in time by both clocks. Durations come from the monotonic clock; the
/// wall clock, which gives the date, may step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Date and time with the offset from UTC.
    pub wall: DateTime<FixedOffset>,
    /// Monotonic clock of the process, ns.
    pub mono_ns: u64,
}

impl Moment {
    /// Time since an earlier moment of the same process, s; 0 if that moment is later.
    pub fn seconds_since(&self, earlier: &Self) -> f64 {
        self.mono_ns.saturating_sub(earlier.mono_ns) as f64 * 1e-9
    }
}

/// An event with its sequence number and time.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Sequence number from 1, without gaps; line 0 of a journal is the claim.
    pub seq: u64,
    /// When it happened.
    pub at: Moment,
    /// Event.
    pub event: Event,
}

named! {
    /// Who entered something.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Author {
        /// Participant.
        Participant = "participant",
        /// Operator.
        Experimenter = "experimenter",
    }
}

named! {
    /// How an answer was entered.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Channel {
        /// By keys, in the terminal.
        Terminal = "terminal",
        /// In typed lines.
        Plain = "plain",
        /// On the participant's page.
        Page = "page",
    }
}

/// The form in which a question is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FormId {
    /// Questions to the experimenter before the first trial.
    Setup,
    /// Questions to the participant before the first trial.
    Intake,
    /// The rating after an attempt at a trial.
    Trial {
        /// [`Trial::trial`].
        trial: u32,
        /// Attempt, from 1.
        attempt: u32,
    },
    /// Questionnaires after a condition, block or part. Since `study-protocol/3`.
    After {
        /// The trial with which it ended, whose realization is that of a condition.
        trial: u32,
        /// The attempt with which that trial was completed.
        attempt: u32,
    },
    /// Questions to the participant at the end.
    Outro,
    /// The initials of the participant, in a running session only: no journal has them, or could.
    #[serde(skip)]
    Consent,
}

impl FormId {
    /// Whether its questions can be declined: initials are no answer.
    pub fn can_be_declined(self) -> bool {
        self != Self::Consent
    }
}

named! {
    /// Why an attempt failed; the names are those in `attempts.csv`.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Failure {
        /// The device reported a fault or refused.
        DeviceFault = "device-fault",
        /// The start or end of the playback was not confirmed.
        PlaybackLost = "playback-lost",
        /// The operator marked it as bad.
        MarkedBad = "marked-bad",
        /// Stopped by Esc or a pause and played again instead of rated.
        Stopped = "stopped",
        /// The program ended or stood still during the attempt, or paused too long before
        /// its answer or its next interval.
        Interrupted = "interrupted",
        /// The force was not that of the table.
        Rendering = "rendering",
        /// A picture, video or sound was not shown or played in step. Since `study-protocol/3`.
        Media = "media",
    }
}

/// The operator's choice on resuming a session after a long gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// Repeat all trials of the block that was under way.
    RestartBlock,
    /// Continue where it stopped. The log of attempts notes it.
    Continue,
    /// The participant drops out.
    DropOut,
}

named! {
    /// The state of a participant.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    State {
        /// Started, not finished.
        #[default]
        Unfinished = "unfinished",
        /// All trials and forms are completed.
        Done = "done",
        /// Started by mistake, before the first rating.
        Void = "void",
        /// Did not come.
        NoShow = "no-show",
        /// Dropped out during the session.
        DroppedOut = "dropped-out",
        /// Excluded from the analysis.
        Excluded = "excluded",
        /// Withdrew consent.
        Withdrawn = "withdrawn",
    }
}

impl State {
    /// Whether a participant in this state keeps their row of the schedule; otherwise
    /// the next participant gets it.
    pub fn keeps_row(self) -> bool {
        matches!(self, Self::Unfinished | Self::Done)
    }
}

/// The device's report of a playback.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Playback {
    /// From confirmed start to confirmed stop, s.
    #[serde(deserialize_with = "null_as_nan")]
    pub exploration_s: f64,
    /// Full strokes from one end of the range to the other.
    pub strokes: u32,
    /// Minimum of the energy that the hand had put in, J; negative if the device was
    /// active.
    #[serde(deserialize_with = "null_as_nan")]
    pub least_energy_j: f64,
    /// Changes of the direction state per second.
    #[serde(deserialize_with = "null_as_nan")]
    pub switches_per_s: f64,
    /// Number of times the force was clamped.
    pub clamp_count: u64,
    /// Telemetry samples received.
    pub samples: u64,
    /// Telemetry samples known to have been lost.
    pub samples_lost: u64,
    /// Time of the samples over time of the host, if both are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_ratio: Option<f64>,
    /// How late the host's thread for the device was, ms: 99th percentile and most; `None`
    /// if that was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub host_late_ms: Option<[f64; 2]>,
}

/// JSON has no NaN: it is written as null, which must not make a line unreadable.
fn null_as_nan<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// The level of a trial of a track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackLevel {
    /// The rule's own level; `None` for an easy or catch trial, which it does not
    /// propose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proposed: Option<f64>,
    /// The level of the comparison, a step of the ladder.
    pub presented: f64,
}

/// A completed telemetry file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TelemetryFile {
    /// File name in the session's folder `telemetry`.
    pub file: String,
    /// SHA-256 of the file in hexadecimal.
    pub sha256: String,
}

/// The first event of every session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Study id.
    pub study: String,
    /// Participant.
    pub participant: ParticipantId,
    /// Session of the participant, from 1.
    pub session: u32,
    /// Source of the order; also distinguishes pilots and simulated participants.
    pub seat: Seat,
    /// The operator's initials or code.
    pub operator: String,
    /// Kind of the device.
    pub device_kind: DeviceKind,
    /// Identity of the device.
    pub device_id: String,
    /// Result of the device's last commissioning test, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_check: Option<String>,
    /// Name and version of the front on which the participant answers, as it says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<String>,
    /// Version of this program.
    pub tool_version: String,
    /// Frozen version of the protocol.
    pub protocol_version: u32,
    /// Fingerprints of that version.
    pub fingerprints: Fingerprints,
    /// Every planned trial, in order.
    pub schedule: Vec<Trial>,
    /// Group and planned session, in a study that has them.
    #[serde(flatten)]
    pub assigned: Assigned,
}

/// The reason of a correction that is made on a page to which somebody went back.
pub const STEP_BACK: &str = "step back";

/// How a motor that weighed itself before a session compares with its commissioning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SelfWeighed {
    /// Id of the record of the commissioning; empty if there is none.
    pub commissioning: String,
    /// Whether it is as it was; `false` also if that is not known.
    pub ok: bool,
    /// Its gain over that of the commissioning.
    pub gain: Option<f64>,
    /// By how much later its force comes, ms.
    pub lag_ms: Option<f64>,
    /// Mass of the handle over its gain, kg.
    pub apparent_kg: Option<f64>,
    /// Why it is not as it was, or why that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

impl SelfWeighed {
    /// For a row of `attempts.csv`.
    pub fn in_words(&self) -> String {
        let mut parts: Vec<String> = Vec::new();
        parts.extend(self.gain.map(|gain| format!("gain {gain:.3}")));
        parts.extend(self.lag_ms.map(|ms| format!("lag {ms:.1} ms")));
        parts.extend(
            self.apparent_kg
                .map(|kg| format!("apparent mass {kg:.3} kg")),
        );
        if !self.commissioning.is_empty() {
            parts.push(format!("against {}", self.commissioning));
        }
        parts.extend(self.why.clone());
        parts.join(", ")
    }
}

/// Something that happened in a session.
///
/// In all events `trial` is [`Trial::trial`], `attempt` counts from 1, and `queue` has the
/// trials still to come, the next one first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
#[allow(
    missing_docs,
    reason = "fields that several events have are described above"
)]
pub enum Event {
    /// The session started: the first event, exactly once.
    SessionStarted(Box<Start>),
    /// The motor weighed itself before the participant came to the device. Since `study-protocol/3`.
    SelfWeighed(Box<SelfWeighed>),
    /// An unfinished session was resumed.
    Reopened {
        /// Operator from now on.
        operator: String,
        /// Version of this program from now on.
        tool_version: String,
        /// Device from now on.
        device_id: String,
        /// Front from now on.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        front: Option<String>,
        /// Wall-clock time since the last activity, s.
        gap_s: f64,
        /// The operator's choice; `None` if the gap was short enough to continue
        /// without one.
        choice: Option<Choice>,
        queue: Vec<u32>,
        /// Whether a restart of the block makes the order violate `max_run` or
        /// `min_distance`.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        constraint_broken: bool,
    },
    /// The participant decided on the consent document.
    Consented {
        document: String,
        version: String,
        /// Whether they agreed.
        accepted: bool,
        by: Author,
    },
    /// A question was answered for the first time.
    Answered {
        #[serde(rename = "place")]
        form: FormId,
        question: QuestionId,
        answer: Answer,
        /// How it was entered; not in journals of earlier releases.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        channel: Option<Channel>,
    },
    /// An earlier answer was changed.
    Corrected {
        #[serde(rename = "place")]
        form: FormId,
        question: QuestionId,
        /// Answer before.
        from: Option<Answer>,
        /// Answer after.
        to: Answer,
        reason: String,
        /// Who corrected it.
        by: Author,
        /// How it was entered; not in journals of earlier releases.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        channel: Option<Channel>,
    },
    /// A realization was requested from the device.
    AttemptStarted {
        trial: u32,
        attempt: u32,
        /// Its position in the order as felt, from 1.
        position: u32,
        /// The realization, unless the trial has several intervals.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        model: Option<ModelId>,
        /// Duration of the reference prompt, s.
        reference_s: f64,
        /// The realization of each interval, if there are several.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        intervals: Vec<ModelId>,
        /// What a track presents.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        level: Option<TrackLevel>,
    },
    /// The device confirmed that it plays.
    PlaybackStarted {
        trial: u32,
        attempt: u32,
        /// Which interval, from 1, if the trial has several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        interval: Option<u32>,
    },
    /// The device confirmed that it has stopped. Only now can the trial be rated.
    PlaybackEnded {
        trial: u32,
        attempt: u32,
        /// The device's report.
        playback: Playback,
        /// Whether it was stopped by Esc, Space or a pause.
        stopped: bool,
        /// Its telemetry, if a file of it was completed; not in journals of earlier
        /// releases.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        telemetry: Option<TelemetryFile>,
        /// Whether the force was that of the table; not in journals of earlier releases.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rendering: Option<Box<Fidelity>>,
        /// Which interval, from 1, if the trial has several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        interval: Option<u32>,
    },
    /// The participant's page showed or played a medium of what plays. Since `study-protocol/3`.
    MediaShown {
        trial: u32,
        attempt: u32,
        /// Which interval, from 1, if the trial has several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        interval: Option<u32>,
        medium: Medium,
        /// Its onset after the confirmed start, ms, by the page's clock.
        offset_ms: f64,
        /// By how much the clocks may make that wrong, ms.
        uncertainty_ms: f64,
    },
    /// A controller program sent numbers: those that count, and those that do not. Since `study-protocol/3`.
    NumbersSent {
        /// The trial under way or, before and after its playback, the last one that was felt, if there was one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        trial: Option<u32>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        attempt: Option<u32>,
        numbers: Vec<SentNumber>,
    },
    /// What is felt was changed in a trial of adjustment; it is loaded once what plays has stopped. Since `study-protocol/3`.
    Adjusted {
        trial: u32,
        attempt: u32,
        /// What comes: a level that is at most a step from the one before, or the standard.
        to: ModelId,
        /// Whether it is the standard.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        standard: bool,
    },
    /// What came next in a trial of adjustment could not be presented, or was not what it should be: the level before is felt
    /// again on request, and nothing that was set so far is lost. Since `study-protocol/3`.
    StepFailed {
        trial: u32,
        attempt: u32,
        failure: Failure,
        /// The device's message or the reason.
        detail: String,
    },
    /// All intervals of the attempt are felt again before it is answered.
    Replayed { trial: u32, attempt: u32 },
    /// The telemetry of the attempt could not be saved, or only in part.
    TelemetryLost {
        /// [`Trial::trial`].
        trial: u32,
        /// Attempt, from 1.
        attempt: u32,
        /// Reason.
        reason: String,
        /// Which interval, from 1, if the trial has several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        interval: Option<u32>,
    },
    /// The attempt does not count.
    AttemptFailed {
        trial: u32,
        attempt: u32,
        failure: Failure,
        /// The device's message or the operator's reason.
        detail: String,
        queue: Vec<u32>,
        /// Whether the order of the trials still to come violates `max_run` or
        /// `min_distance`.
        constraint_broken: bool,
        /// The pause after which it would have been answered, s, if that is why.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        paused_s: Option<f64>,
    },
    /// All questions of an attempt are answered: the trial is completed.
    TrialDone {
        trial: u32,
        attempt: u32,
        /// From the opening of the rating to its confirmation, s.
        response_s: f64,
        /// Pauses between the end of the playback and the answer, s, if there were any; not
        /// in journals of earlier releases.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        paused_s: Option<f64>,
    },
    /// The questionnaires between the trials that follow this attempt are answered after a pause: the event before these
    /// answers, with the pauses since the answers before. Since `study-protocol/3`.
    FormDelayed {
        trial: u32,
        attempt: u32,
        /// How long, s; `None` if nobody knows, because the clock went back.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        paused_s: Option<f64>,
        /// Whether all pauses since the trial was answered are longer than the protocol allows between feeling and answering.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        late: bool,
    },
    /// The trial was closed after `max_attempts` failures.
    TrialClosed {
        trial: u32,
        /// Last attempt.
        attempt: u32,
    },
    /// A track has ended: its other planned trials do not take place.
    TrackEnded {
        track: PartId,
        /// Whether its rule was fulfilled, not only its largest number of trials reached.
        finished: bool,
    },
    /// The criterion of a part's practice was reached: its other practice trials do not take place.
    PracticeEnded { part: PartId },
    /// The device failed at a point of a space in several attempts: the searches of the session present it no more.
    PointLeftOut {
        /// Part whose search it was.
        part: PartId,
        /// The point, as a realization.
        point: ModelId,
    },
    /// A remark was entered.
    Remark {
        by: Author,
        /// Trial during which it was entered, if any.
        trial: Option<u32>,
        /// Text as typed.
        text: String,
    },
    /// The instructions were read.
    InstructionsRead,
    /// What the study was about was shown, and left. Since `study-protocol/3`.
    Debriefed,
    /// A pause began.
    Paused,
    /// The pause ended.
    Unpaused { paused_s: f64 },
    /// A scheduled break began.
    BreakStarted {
        /// Number of closed trials before it, without practice.
        after: u32,
    },
    /// The break ended.
    BreakEnded { rested_s: f64 },
    /// The wall clock stepped relative to the monotonic clock.
    ClockStepped {
        /// Size of the step, s; positive forward.
        by_s: f64,
    },
    /// The program was left before the end of the session.
    Interrupted { reason: String },
    /// Every trial is closed and every form answered.
    Finished,
    /// The participant's id had been mistyped; it was corrected from outside a session.
    IdCorrected {
        /// As it was typed.
        from: ParticipantId,
        to: ParticipantId,
        reason: String,
    },
    /// The operator set the participant's state from outside a session.
    StateSet { state: State, reason: String },
    /// The order was shown to somebody during the study.
    Revealed {
        /// Reason; may be empty.
        reason: String,
    },
}
