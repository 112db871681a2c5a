//! The inputs and effects of a session.

use super::cue::MediaReport;
use crate::outcome::{
    Author, Choice, Entry, Event, Fidelity, FormId, Playback, SelfWeighed, SentNumber,
};
use study_base::text::{ModelId, ParticipantId, QuestionId};
use study_plan::protocol::fingerprint::Fingerprints;
use study_plan::protocol::{Answer, Assigned, DeviceKind, Seat, Turn};

/// An input from the operator, the device or the store.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// Participant and operator, from the first screen.
    Identify {
        /// As typed; checked by the session.
        participant: String,
        /// As typed; may be empty.
        operator: String,
    },
    /// The store has claimed the session's folder.
    Claimed(Box<Claim>),
    /// The store refused the claim, with a message for the first screen.
    ClaimRefused(String),
    /// How to resume after a long gap.
    Resume(Choice),
    /// Consent given or refused.
    Consent(bool),
    /// Enter on a screen without questions.
    Advance,
    /// Confirmed answers to all questions of the page on the screen, in any order.
    /// Optional questions may be absent: a text or choice then counts as left empty.
    /// If one answer is not accepted, none is recorded.
    Answer(Vec<(QuestionId, Answer)>),
    /// Show the page of questions before the one on the screen.
    Back,
    /// A remark, at any time.
    Remark {
        /// Who enters it.
        by: Author,
        /// Text.
        text: String,
    },
    /// A correction of an earlier answer, at any time.
    Correct {
        /// Form.
        form: FormId,
        /// Question.
        question: QuestionId,
        /// New answer.
        answer: Answer,
        /// Reason; not empty.
        reason: String,
        /// Who corrects it.
        by: Author,
    },
    /// Mark the trial under way, or else the last one, as bad.
    MarkBad {
        /// Reason; not empty.
        reason: String,
    },
    /// Esc, or Space while a table is loaded or playing: stop the device. Repeated
    /// during a stop, it makes the device limp without waiting for the report.
    Stop,
    /// After a stop: play the same trial again. Before an answer, where the part permits
    /// it: feel all intervals again.
    PlayAgain,
    /// After a stop: rate what was felt.
    RateStopped,
    /// Change the level that is felt in a trial of adjustment, or feel the standard.
    Adjust(Turn),
    /// Pause.
    Pause,
    /// Leave the program, confirmed by the operator. Waits until everything is saved;
    /// a second one does not.
    Quit,
    /// Leave without confirmation, because of a signal or a lost terminal; with the
    /// reason.
    Abort(String),
    /// The device has loaded the table.
    DeviceLoaded,
    /// The sample with this opaque code must be mounted by hand.
    DeviceMount(String),
    /// The device confirms that it plays.
    DeviceStarted,
    /// Samples have arrived.
    DeviceSampled,
    /// Progress of the playback.
    DeviceProgress {
        /// Full strokes so far.
        strokes: u32,
    },
    /// A controller program sends numbers; those of the end of a playback come before [`Input::DeviceStopped`].
    DeviceNumbers {
        /// As they were sent.
        numbers: Vec<SentNumber>,
        /// Whether they belong to no playback under way.
        outside: bool,
    },
    /// Whether the playback that has just stopped had the force of its table;
    /// [`Input::DeviceStopped`] follows.
    DeviceJudged(Box<Fidelity>),
    /// The device confirms that it has stopped.
    DeviceStopped(Playback),
    /// The device reports a fault; it is limp.
    DeviceFault(String),
    /// The device no longer responds; its watchdog makes it limp.
    DeviceLost(String),
    /// The device has sent no telemetry for too long: the end of the playback will
    /// not be confirmed.
    PlaybackLost(String),
    /// The device responds again and is limp.
    DeviceReady,
    /// The program did not run for a while: the computer was suspended, or the process
    /// stopped.
    StoodStill {
        /// For how long, s.
        seconds: f64,
    },
    /// What the participant's page says of its media.
    Media(MediaReport),
    /// More events are on disk.
    Saved {
        /// Number of events of this process on disk, counted from the first.
        count: u64,
    },
    /// Saving failed; no later event is acknowledged.
    SaveFailed(String),
    /// Results folder and mirror are both up to date, or why one is not.
    Mirrored {
        /// Why the results folder is not.
        results: Option<String>,
        /// Why the mirror is not.
        mirror: Option<String>,
    },
    /// A message to the operator without other effect, such as telemetry that could
    /// not be written.
    Notice(String),
    /// Retry saving.
    RetrySave,
    /// Time has passed; sent regularly.
    Tick,
}

/// A claimed session.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Participant.
    pub participant: ParticipantId,
    /// Session of the participant, from 1.
    pub session: u32,
    /// Source of the order.
    pub seat: Seat,
    /// Events in the journal; empty for a new session.
    pub entries: Vec<Entry>,
    /// Version of the protocol that a new session records.
    pub protocol_version: u32,
    /// Fingerprints of that version.
    pub fingerprints: Fingerprints,
    /// Kind of the device.
    pub device_kind: DeviceKind,
    /// Identity of the device.
    pub device_id: String,
    /// Result of the device's last commissioning test, if known.
    pub device_check: Option<String>,
    /// How its motor weighed itself before the session.
    pub self_weighed: Option<SelfWeighed>,
    /// Whether the device reports telemetry.
    pub device_telemetry: bool,
    /// Group and planned session of a new session.
    pub assigned: Assigned,
    /// Messages to the operator, such as a repaired journal.
    pub notices: Vec<String>,
}

/// An action that the session requests.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Claim a session for this participant.
    Claim {
        /// Participant.
        participant: ParticipantId,
        /// Operator.
        operator: String,
    },
    /// Write the event to the journal, in this order, and report when it is on disk.
    /// After [`Input::SaveFailed`] keep it until [`Effect::RetrySave`].
    Record(Event),
    /// Load a realization into the device.
    Load {
        /// Trial, for the name of the telemetry file.
        trial: u32,
        /// Attempt, for the name of the telemetry file.
        attempt: u32,
        /// Realization.
        model: ModelId,
        /// Interval, for the name of the telemetry file, if the trial has several.
        interval: Option<u32>,
    },
    /// Start playing what is loaded.
    Start,
    /// Stop playing; the device confirms.
    Stop,
    /// Stop playing without a step of the force, as far as the device can; it confirms as after
    /// [`Effect::Stop`].
    Fade,
    /// Make the device limp at once. Also cancels a load: no [`Input::DeviceLoaded`]
    /// for it may follow.
    Limp,
    /// Keep the participant's copy of the consent document, with what they typed as a
    /// signature, in a file of its own, before the event that follows.
    KeepConsent(String),
    /// Write the unacknowledged events to a new journal segment.
    RetrySave,
    /// End the program.
    End(Ending),
}

/// How a session's process ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ending {
    /// The session is completed.
    Finished,
    /// Left before the end; it can be resumed.
    Interrupted,
    /// The participant dropped out or did not consent.
    DroppedOut,
    /// Left before a session was claimed.
    Nothing,
}
