//! The events of a session, one line of its journal each.
//!
//! The names and fields are a file format: a later version may add events and
//! optional fields, never change these. `store` wraps each event with a sequence
//! number, checksums and clocks.

use crate::protocol::fingerprint::Fingerprints;
use crate::protocol::{Answer, DeviceKind, Seat, Trial};
use chrono::{DateTime, FixedOffset};
use serde::{Deserialize, Serialize};
use study_base::text::{ModelId, ParticipantId, QuestionId};

/// Both clocks at once: durations come from the monotonic one, dates from the
/// wall clock, which may step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Date and time with the offset from UTC.
    pub wall: DateTime<FixedOffset>,
    /// Monotonic nanoseconds since the process started its clock.
    pub mono_ns: u64,
}

impl Moment {
    /// Seconds from an earlier moment of the same process; 0 if it is later.
    pub fn seconds_since(&self, earlier: &Self) -> f64 {
        self.mono_ns.saturating_sub(earlier.mono_ns) as f64 * 1e-9
    }
}

/// An event with its place in the journal.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// From 1, without gaps; line 0 of a journal is the claim of its folder.
    pub seq: u64,
    /// When.
    pub at: Moment,
    /// What.
    pub event: Event,
}

/// Who said or did something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Author {
    /// The subject.
    Participant,
    /// The operator.
    Experimenter,
}

/// Where a question was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Of the experimenter, before.
    Setup,
    /// Of the participant, before.
    Intake,
    /// After an attempt at a trial.
    Trial {
        /// [`Trial::trial`].
        trial: u32,
        /// From 1.
        attempt: u32,
    },
    /// Of the participant, at the end.
    Outro,
}

/// Why an attempt failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// The device reported a fault or refused.
    DeviceFault,
    /// The playback's start or end was never confirmed.
    PlaybackLost,
    /// Somebody marked it as bad.
    MarkedBad,
    /// Stopped by Esc or a pause, and played again instead of rated.
    Stopped,
    /// The program ended during it.
    Interrupted,
}

/// What the operator chose on coming back to an old unfinished session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// All trials of the block that was under way are felt again.
    RestartBlock,
    /// It goes on where it stopped; every later row is flagged.
    Continue,
    /// The participant does not come back.
    DropOut,
}

/// The state of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// Started and not finished.
    Unfinished,
    /// All trials are done.
    Done,
    /// Started by mistake; only before the first rating.
    Void,
    /// Did not come.
    NoShow,
    /// Broke off.
    DroppedOut,
    /// Not analysed.
    Excluded,
    /// Took back what was given.
    Withdrawn,
}

impl State {
    /// As on the command line and in `participants.csv`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Unfinished => "unfinished",
            Self::Done => "done",
            Self::Void => "void",
            Self::NoShow => "no-show",
            Self::DroppedOut => "dropped-out",
            Self::Excluded => "excluded",
            Self::Withdrawn => "withdrawn",
        }
    }

    /// Whether a participant in this state keeps their row; if not, the next
    /// participant gets it.
    pub fn keeps_row(self) -> bool {
        matches!(self, Self::Unfinished | Self::Done)
    }
}

/// What a playback came to, by the device's account.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Playback {
    /// From confirmed start to confirmed stop, s.
    #[serde(deserialize_with = "null_as_nan")]
    pub exploration_s: f64,
    /// Full strokes, each from one end of the range to the other.
    pub strokes: u32,
    /// Least value of the energy that the hand had put in, J; negative: active.
    #[serde(deserialize_with = "null_as_nan")]
    pub least_energy_j: f64,
    /// Changes of the direction state per second.
    #[serde(deserialize_with = "null_as_nan")]
    pub switches_per_s: f64,
    /// How often the force was clamped.
    pub clamp_count: u64,
    /// Telemetry samples received.
    pub samples: u64,
    /// Telemetry samples known to be lost.
    pub samples_lost: u64,
}

/// JSON has no NaN: the writer puts null, and a device's nonsense must not make a
/// line unreadable.
fn null_as_nan<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// The first event of every session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Of the protocol.
    pub study: String,
    /// Whose session.
    pub participant: ParticipantId,
    /// From 1.
    pub session: u32,
    /// Where the order comes from; also tells pilots and simulations apart.
    pub seat: Seat,
    /// The operator's initials or code.
    pub operator: String,
    /// What plays.
    pub device_kind: DeviceKind,
    /// Which one.
    pub device_id: String,
    /// What its last commissioning came to, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_check: Option<String>,
    /// Of this program.
    pub tool_version: String,
    /// Which frozen version of the protocol.
    pub protocol_version: u32,
    /// Of that version.
    pub fingerprints: Fingerprints,
    /// The whole order, frozen.
    pub schedule: Vec<Trial>,
}

/// Something that happened in a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// Always the first, and only once.
    SessionStarted(Box<Start>),
    /// The program came back to an unfinished session.
    Reopened {
        /// The operator now.
        operator: String,
        /// The program now.
        tool_version: String,
        /// The device now.
        device_id: String,
        /// Wall-clock seconds since the event before.
        gap_s: f64,
        /// What the operator chose, if the gap was too long to simply go on.
        choice: Option<Choice>,
        /// Trials still to come, first the next, as [`Trial::trial`].
        queue: Vec<u32>,
    },
    /// The participant agreed, or not, to the consent document.
    Consented {
        /// Its title.
        document: String,
        /// Its version.
        version: String,
        /// Whether they agreed.
        accepted: bool,
        /// Who typed it.
        by: Author,
    },
    /// A question was answered for the first time.
    Answered {
        /// Where it was asked.
        place: Place,
        /// Which.
        question: QuestionId,
        /// What.
        answer: Answer,
    },
    /// An earlier answer was changed. The old one stays in the journal.
    Corrected {
        /// Where it was asked.
        place: Place,
        /// Which.
        question: QuestionId,
        /// The answer until now.
        from: Option<Answer>,
        /// The answer from now on.
        to: Answer,
        /// Why.
        reason: String,
        /// By whom.
        by: Author,
    },
    /// A realization was asked of the device.
    AttemptStarted {
        /// [`Trial::trial`].
        trial: u32,
        /// From 1.
        attempt: u32,
        /// Its real place among the trials that count so far, from 1.
        position: u32,
        /// What is played.
        model: ModelId,
        /// How long the reference prompt was shown, s.
        reference_s: f64,
    },
    /// The device confirmed that it plays.
    PlaybackStarted {
        /// [`Trial::trial`].
        trial: u32,
        /// From 1.
        attempt: u32,
    },
    /// The device confirmed that it has stopped. Only now can it be rated.
    PlaybackEnded {
        /// [`Trial::trial`].
        trial: u32,
        /// From 1.
        attempt: u32,
        /// What it came to.
        playback: Playback,
        /// Whether it was stopped by Esc, Space or a pause.
        stopped: bool,
    },
    /// The attempt does not count.
    AttemptFailed {
        /// [`Trial::trial`].
        trial: u32,
        /// From 1.
        attempt: u32,
        /// Why.
        failure: Failure,
        /// The device's or the operator's words.
        detail: String,
        /// Trials still to come after this, first the next.
        queue: Vec<u32>,
        /// Whether the trial's new place breaks `max_run` or `min_distance`.
        constraint_broken: bool,
    },
    /// All questions of an attempt are answered: the trial is done.
    TrialDone {
        /// [`Trial::trial`].
        trial: u32,
        /// From 1.
        attempt: u32,
        /// From the opening of the rating to its confirmation, s.
        response_s: f64,
    },
    /// Given up after `max_attempts` failures.
    TrialClosed {
        /// [`Trial::trial`].
        trial: u32,
        /// The last attempt.
        attempt: u32,
    },
    /// Something was remarked.
    Remark {
        /// By whom.
        by: Author,
        /// During which trial, if any.
        trial: Option<u32>,
        /// What, as typed.
        text: String,
    },
    /// The instructions were read, up to the first trial.
    InstructionsRead,
    /// The operator or participant asked for a pause.
    Paused,
    /// It goes on.
    Unpaused {
        /// How long it was, s.
        paused_s: f64,
    },
    /// A break of the design began.
    BreakStarted {
        /// After how many trials that count.
        after: u32,
    },
    /// It ended.
    BreakEnded {
        /// How long it was, s.
        rested_s: f64,
    },
    /// The wall clock stepped against the monotonic one.
    ClockStepped {
        /// Forward positive, s.
        by_s: f64,
    },
    /// The program was left before the end.
    Interrupted {
        /// Why.
        reason: String,
    },
    /// Every trial is closed and every closing question answered.
    Finished,
    /// The operator set the participant's state from outside a session.
    StateSet {
        /// New state.
        state: State,
        /// Why.
        reason: String,
    },
    /// The order was revealed to somebody while the study ran.
    Revealed {
        /// Why, if it was said.
        reason: String,
    },
}
