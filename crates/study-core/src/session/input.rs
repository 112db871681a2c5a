//! What comes into a session and what goes out.

use crate::outcome::{Author, Choice, Entry, Event, FormId, Playback};
use crate::protocol::fingerprint::Fingerprints;
use crate::protocol::{Answer, DeviceKind, Seat};
use study_base::text::{ModelId, ParticipantId, QuestionId};

/// What an operator, the device or the store tells a session.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// Who it is; from the first screen.
    Identify {
        /// As typed; checked by the session.
        participant: String,
        /// As typed, possibly empty.
        operator: String,
    },
    /// The store has claimed the session folder.
    Claimed(Box<Claim>),
    /// It could not: back to the first screen with these words.
    ClaimRefused(String),
    /// How to go on with an old unfinished session.
    Resume(Choice),
    /// Consent given or refused.
    Consent(bool),
    /// Enter, where there is nothing to answer.
    Advance,
    /// Confirmed answers to all questions of the page on the screen, in any order.
    /// An optional one may be absent: a text or choice then counts as left empty.
    /// If one is not accepted, none is taken.
    Answer(Vec<(QuestionId, Answer)>),
    /// A remark, at any time.
    Remark {
        /// By whom.
        by: Author,
        /// What.
        text: String,
    },
    /// A correction of an earlier answer, at any time.
    Correct {
        /// Where it was asked.
        form: FormId,
        /// Which.
        question: QuestionId,
        /// The new answer.
        answer: Answer,
        /// Why; not empty.
        reason: String,
        /// By whom.
        by: Author,
    },
    /// The present trial, or the last one where none is under way, is bad.
    MarkBad {
        /// Why; not empty.
        reason: String,
    },
    /// Esc, or Space while a table is loaded or playing: stop the device. A second
    /// one during a stop makes it limp whatever becomes of the playback.
    Stop,
    /// After a stop: play the same trial again.
    PlayAgain,
    /// After a stop: rate what was felt.
    RateStopped,
    /// Pause.
    Pause,
    /// Leave the program; the operator confirmed it. It waits for the disk; a
    /// second one does not.
    Quit,
    /// The terminal is gone, a signal came: leave at once.
    Abort(String),
    /// The device has taken the table.
    DeviceLoaded,
    /// The sample with this opaque code is to be mounted by hand.
    DeviceMount(String),
    /// The device confirms that it plays.
    DeviceStarted,
    /// Strokes and clamps so far, from telemetry.
    DeviceProgress {
        /// Full strokes so far.
        strokes: u32,
        /// Clamps so far.
        clamps: u64,
    },
    /// The device confirms that it has stopped.
    DeviceStopped(Playback),
    /// The device reports a fault; it is limp.
    DeviceFault(String),
    /// The device does not answer any more; it is limp by its own watchdog.
    DeviceLost(String),
    /// The device answers, or may, but has said nothing of the playback for too
    /// long: its end will never be confirmed.
    PlaybackLost(String),
    /// The device is back and limp.
    DeviceReady,
    /// All events are on disk that the session sent before its `count`-th (from 0,
    /// of this process).
    Saved {
        /// How many events of this process are on disk now.
        count: u64,
    },
    /// It could not be saved; nothing since is acknowledged.
    SaveFailed(String),
    /// Something that the operator should know and that changes nothing, such as
    /// telemetry that could not be written.
    Notice(String),
    /// Try again to save what is in memory.
    RetrySave,
    /// Time has passed.
    Tick,
}

/// A claimed session folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Who.
    pub participant: ParticipantId,
    /// Which session of theirs.
    pub session: u32,
    /// Where the order comes from.
    pub seat: Seat,
    /// What the journal holds already: empty for a new session.
    pub entries: Vec<Entry>,
    /// Version of the protocol that a new session records.
    pub protocol_version: u32,
    /// Of that version.
    pub fingerprints: Fingerprints,
    /// What plays.
    pub device_kind: DeviceKind,
    /// Which one.
    pub device_id: String,
    /// What its last commissioning came to, if it is known.
    pub device_check: Option<String>,
    /// Whether it reports telemetry.
    pub device_telemetry: bool,
    /// Notices for the operator, such as a recovered tail.
    pub notices: Vec<String>,
}

/// What a session wants done.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Claim a session folder for this participant.
    Claim {
        /// Who.
        participant: ParticipantId,
        /// By whom.
        operator: String,
    },
    /// Write the event to the journal, in this order, and say when it is on disk.
    /// After [`Input::SaveFailed`] it is only kept, until [`Effect::RetrySave`].
    Record(Event),
    /// Give the device this realization, for this trial and attempt.
    Load {
        /// Names the telemetry file.
        trial: u32,
        /// Names the telemetry file.
        attempt: u32,
        /// What to play.
        model: ModelId,
    },
    /// Start playing what is loaded.
    Start,
    /// Stop playing; the device confirms.
    Stop,
    /// Go limp at once, whatever happens. Cancels a load as well: no
    /// [`Input::DeviceLoaded`] for it may follow.
    Limp,
    /// Rewrite what is not acknowledged to a new journal segment.
    RetrySave,
    /// The program is over.
    End(Ending),
}

/// How a session's process ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ending {
    /// Everything is done.
    Finished,
    /// Left in the middle; it can be picked up.
    Interrupted,
    /// The participant dropped out or did not consent.
    DroppedOut,
    /// Left before a session was claimed.
    Nothing,
}
