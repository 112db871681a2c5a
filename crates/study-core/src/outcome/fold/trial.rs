//! The history of one trial: its attempts.

use crate::outcome::event::{Moment, Playback};
use crate::outcome::fidelity::Fidelity;
use study_base::text::ModelId;

/// What the events say of one trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct TrialHistory {
    pub(super) attempts: Vec<Attempt>,
    /// Failures that count towards `max_attempts`.
    pub(super) failures: u32,
    /// Closed as failed after its last attempt.
    pub(super) given_up: bool,
    pub(super) remarks: Vec<String>,
}

impl TrialHistory {
    /// The attempt whose answers count.
    pub(super) fn counted(&self) -> Option<&Attempt> {
        self.attempts.last().filter(|a| !a.void)
    }

    pub(super) fn is_closed(&self) -> bool {
        self.given_up || self.counted().is_some_and(|a| a.done.is_some())
    }

    /// The block is restarted: nothing of it counts until it is felt again.
    pub(super) fn send_back(&mut self) {
        self.failures = 0;
        self.given_up = false;
        if let Some(attempt) = self.attempts.last_mut() {
            attempt.void = true;
        }
    }
}

/// Operator, program and device from one start of the program to its end.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sitting {
    /// Operator's initials or code.
    pub operator: String,
    /// Version of this program.
    pub tool_version: String,
    /// Device.
    pub device_id: String,
}

/// One attempt at a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// From 1.
    pub number: u32,
    /// In which sitting it was made.
    pub sitting: Sitting,
    /// Its start; `None` if that line of the journal is damaged.
    pub start: Option<AttemptStart>,
    /// The confirmed end of its playback.
    pub ended: Option<Ended>,
    /// Whether the force was that of the table, for each playback that was judged.
    pub rendering: Vec<Fidelity>,
    /// Rating time before the program was last left, s.
    pub rated_earlier_s: f64,
    /// First and last moment of the rating in this sitting.
    pub(super) rating: Option<(Moment, Moment)>,
    /// Its completion.
    pub done: Option<Completion>,
    /// Failed or sent back: its answers do not count.
    pub void: bool,
}

/// The start of an attempt.
#[derive(Debug, Clone, PartialEq)]
pub struct AttemptStart {
    /// When the playback was requested.
    pub at: Moment,
    /// Place in the order as felt, from 1.
    pub position: u32,
    /// Realization felt before it; `None` at the start of the session.
    pub previous: Option<ModelId>,
    /// Duration of the reference prompt, s.
    pub reference_s: f64,
}

/// The confirmed end of a playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ended {
    /// The device's report.
    pub playback: Playback,
    /// Whether it was stopped by Esc, Space or a pause.
    pub stopped: bool,
}

/// The completion of a trial: every question answered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Completion {
    /// When.
    pub at: Moment,
    /// From the opening of the rating to its confirmation, s.
    pub response_s: f64,
    /// Number of the trial on the screen, from 1.
    pub number: u32,
}

impl Attempt {
    pub(super) fn new(number: u32, sitting: &Sitting, start: Option<AttemptStart>) -> Self {
        Self {
            number,
            sitting: sitting.clone(),
            start,
            ended: None,
            rendering: Vec::new(),
            rated_earlier_s: 0.0,
            rating: None,
            done: None,
            void: false,
        }
    }
}
