//! Where a session is, beyond what its events tell.

use super::Ending;
use super::view::{Counts, MessageKind};
use crate::outcome::{Moment, Place};
use crate::protocol::Question;

/// Seconds in which the device has to confirm a stop.
pub(super) const STOP_WITHIN_S: f64 = 2.0;
/// Seconds in which the device has to confirm a table, and then its start.
pub(super) const LOAD_WITHIN_S: f64 = 5.0;
/// Seconds that a forced leave waits for the last event to be on disk.
pub(super) const LEAVE_WITHIN_S: f64 = 5.0;
/// A step of the wall clock from here up is recorded, s.
pub(super) const CLOCK_STEP_S: f64 = 2.0;

/// The one thing that is going on.
#[derive(Debug)]
pub(super) enum Phase {
    /// Nobody is known yet.
    Who,
    /// The store was asked for the folder.
    Claiming,
    /// The operator chooses how to go on after so many seconds.
    ResumeChoice {
        gap_s: f64,
    },
    Consent,
    Message(MessageKind),
    Form(Form),
    /// The reference prompt since then.
    Reference {
        since: Moment,
    },
    /// The table was sent then.
    Loading {
        since: Moment,
    },
    /// Somebody mounts the sample with this code.
    Mounting {
        code: String,
    },
    /// The start was asked for then.
    Ready {
        since: Moment,
    },
    Playing {
        since: Moment,
        /// What the device has counted, if it counts.
        counts: Option<Counts>,
    },
    /// The stop was asked for then.
    Stopping {
        since: Moment,
        /// By Esc, Space, a pause or a disk that fails, not in order to rate.
        broken_off: bool,
        /// Limp was sent as well: a confirmation may never come.
        limped: bool,
        /// A pause follows.
        pause: bool,
    },
    /// Broken off: play again or rate.
    Stopped,
    /// A break of the design since then, after so much rest before.
    Break {
        since: Moment,
        rested_s: f64,
    },
    /// Everything recorded has to be on disk before it goes on.
    Saving,
    End,
    /// The last events are on their way to the disk.
    Leaving {
        since: Moment,
        ending: Ending,
        /// Whether nobody is there who could help if it fails, or would.
        forced: bool,
    },
    /// The program was told to end.
    Over(Ending),
}

impl Phase {
    /// Whether a table is loaded or playing, or may be.
    pub(super) fn armed(&self) -> bool {
        matches!(
            self,
            Self::Loading { .. }
                | Self::Mounting { .. }
                | Self::Ready { .. }
                | Self::Playing { .. }
                | Self::Stopping { .. }
        )
    }

    /// Whether a session is claimed and not yet left.
    pub(super) fn under_way(&self) -> bool {
        !matches!(
            self,
            Self::Who | Self::Claiming | Self::Leaving { .. } | Self::Over(_)
        )
    }
}

/// Questions being answered.
#[derive(Debug)]
pub(super) struct Form {
    pub(super) place: Place,
    /// What is still to be asked, page by page; the first is on the screen.
    pub(super) pages: Vec<Vec<Question>>,
    /// Pages that the whole form has.
    pub(super) total: usize,
    /// When it was opened.
    pub(super) opened: Moment,
    /// For how long something else was on the screen, s.
    pub(super) covered_s: f64,
}

/// What is wrong with the device.
#[derive(Debug)]
pub(super) struct Trouble {
    pub(super) what: String,
    pub(super) fault: bool,
}
