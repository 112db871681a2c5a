//! The current phase of a session: what its events do not determine.

use super::Ending;
use super::view::MessageKind;
use crate::outcome::{Channel, FormId, Moment};
use study_plan::protocol::Question;

/// Time within which the device must confirm a stop, s.
pub(super) const STOP_WITHIN_S: f64 = 2.0;
/// Time within which the device must confirm a table, and then its start, s.
pub(super) const LOAD_WITHIN_S: f64 = 5.0;
/// How long a forced exit waits for the last event to be on disk, s.
pub(super) const LEAVE_WITHIN_S: f64 = 5.0;
/// Time without telemetry after which the screen says so, s.
pub(super) const TELEMETRY_WITHIN_S: f64 = 0.5;
/// Smallest step of the wall clock that is recorded, s.
pub(super) const CLOCK_STEP_S: f64 = 2.0;

/// The current phase.
#[derive(Debug)]
pub(super) enum Phase {
    /// The operator types participant and operator.
    Identify,
    /// Waiting for the store to claim the session's folder.
    Claiming,
    /// The operator chooses how to resume after a long gap.
    ResumeChoice {
        gap_s: f64,
    },
    Consent,
    Message(MessageKind),
    Form(Form),
    /// The reference prompt.
    Reference {
        since: Moment,
    },
    /// The table was sent to the device.
    Loading {
        since: Moment,
    },
    /// Somebody mounts the sample with this code.
    Mounting {
        code: String,
    },
    /// The next interval is loaded and waits for the end of the gap.
    Gap {
        /// The end of the interval before it.
        ended: Moment,
        /// When it starts after that, s.
        start_after_s: f64,
    },
    /// The start was requested.
    Ready {
        since: Moment,
    },
    Playing {
        since: Moment,
        /// Full strokes so far.
        strokes: u32,
        /// When telemetry last arrived, or the start; `None` if the device reports none.
        telemetry: Option<Moment>,
    },
    /// The stop was requested.
    Stopping {
        since: Moment,
        /// By Esc, Space, a pause or a failed save, not in order to rate.
        aborted: bool,
        /// Limp was sent as well: the confirmation may never come.
        limped: bool,
        /// A pause follows.
        pause: bool,
        /// The level that was felt is confirmed.
        confirmed: Option<Confirmed>,
    },
    /// Stopped: play again or rate.
    Stopped {
        since: Moment,
    },
    /// Whether the answer was correct is shown.
    Feedback(Told),
    /// A scheduled break; `rested_s` is the part of it before a resume.
    Break {
        since: Moment,
        rested_s: f64,
    },
    /// Waiting until every recorded event is on disk.
    Saving,
    End,
    /// Waiting for the last events to be on disk, then exit.
    Leaving {
        since: Moment,
        ending: Ending,
        /// Whether to exit after a time limit even if saving fails.
        forced: bool,
    },
    /// The exit was requested.
    Over(Ending),
}

impl Phase {
    /// Whether a table is, or may be, loaded or playing.
    pub(super) fn armed(&self) -> bool {
        matches!(
            self,
            Self::Loading { .. }
                | Self::Mounting { .. }
                | Self::Gap { .. }
                | Self::Ready { .. }
                | Self::Playing { .. }
                | Self::Stopping { .. }
        )
    }

    /// Whether something is requested from the device that does not play yet.
    pub(super) fn preparing(&self) -> bool {
        matches!(
            self,
            Self::Loading { .. } | Self::Mounting { .. } | Self::Gap { .. } | Self::Ready { .. }
        )
    }

    /// Whether the session is claimed and not being left.
    pub(super) fn under_way(&self) -> bool {
        !matches!(
            self,
            Self::Identify | Self::Claiming | Self::Leaving { .. } | Self::Over(_)
        )
    }
}

/// That a level which was set feels right.
#[derive(Debug, Clone, Copy)]
pub(super) struct Confirmed {
    /// How that was entered.
    pub(super) channel: Option<Channel>,
}

/// What a participant is told of an answer.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Told {
    pub(super) correct: bool,
    /// The label that would have been correct, where labels are answers.
    pub(super) label: Option<String>,
}

/// Questions being answered.
#[derive(Debug)]
pub(super) struct Form {
    pub(super) id: FormId,
    /// Its pages.
    pub(super) pages: Vec<Vec<Question>>,
    /// Which of them is on the screen, from 0.
    pub(super) at: usize,
    /// When the form was opened.
    pub(super) opened: Moment,
    /// Time under an overlay since then, s.
    pub(super) overlaid_s: f64,
}

/// A problem of the device.
#[derive(Debug)]
pub(super) struct DeviceProblem {
    pub(super) what: String,
    pub(super) fault: bool,
}
