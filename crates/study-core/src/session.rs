//! The running study as a pure state machine.
//!
//! `handle(Input, at) → effects; view()`. No clock, no device, no store, no
//! randomness: time comes in as an argument, everything it wants done goes out as
//! an [`Effect`], and what the operator may see is a [`View`], which never holds
//! anything that identifies a realization.
//!
//! What a session knows is the fold of its own events (`history`); beside it
//! stand only where it is on the screen (`phase`) and three things that can lie
//! over it: a disk that fails, a pause, a device in trouble. A session that is
//! resumed folds the journal and goes on from there.
//!
//! Invariants: an answer shows as saved only after [`Input::Saved`] came back for
//! its event; a rating opens only after the device confirmed start and end of the
//! playback; every path out of playing sends [`Effect::Stop`] or
//! [`Effect::Limp`] first; after a stop, a pause or a fault nothing is loaded or
//! started until somebody asks for it again.
//!
//! Effects are carried out in their order. [`Effect::Limp`] also cancels a load:
//! no [`Input::DeviceLoaded`] for it may follow.

mod course;
mod failing;
mod forms;
mod history;
pub mod input;
mod opening;
mod phase;
mod saving;
mod show;
mod trial;
pub mod view;

pub use input::{Claim, Effect, Ending, Input};
pub use opening::MAX_OPERATOR;
pub use view::{Screen, View};

use crate::outcome::{Event, Moment};
use crate::protocol::{DeviceKind, FileOrders, Protocol, Seat};
use history::History;
use phase::{Phase, Trouble};
use saving::Ledger;
use std::collections::BTreeSet;
use std::sync::Arc;
use study_base::text::ModelId;

/// What is known before anybody typed anything.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Config {
    /// Preset on the first screen.
    pub participant: String,
    /// Preset on the first screen.
    pub operator: String,
    /// Whether the presets are taken as they are, without the first screen.
    pub auto_identify: bool,
}

/// A session, from the first screen to the last.
pub struct Session {
    protocol: Arc<Protocol>,
    orders: Option<Arc<FileOrders>>,
    /// As typed so far.
    participant: String,
    operator: String,
    /// What the store said of the folder.
    claim: Option<ClaimFacts>,
    history: History,
    phase: Phase,
    /// Since when it is paused.
    paused: Option<Moment>,
    trouble: Option<Trouble>,
    /// Whether the device does not answer.
    device_lost: bool,
    ledger: Ledger,
    /// Forms and messages that are behind us in this process, beside what the
    /// history tells.
    behind: BTreeSet<course::Step>,
    notice: Option<String>,
    /// When the folder was claimed.
    opened: Option<Moment>,
    /// Both clocks when they last agreed.
    clock: Moment,
    /// Since when something lies over the phase.
    covered: Option<Moment>,
    out: Vec<Effect>,
}

/// What a claim says beside the journal.
struct ClaimFacts {
    seat: Seat,
    device_kind: DeviceKind,
    device_id: String,
    device_telemetry: bool,
}

impl Session {
    /// A session on its first screen, or asking for its claim.
    pub fn new(
        protocol: Arc<Protocol>,
        orders: Option<Arc<FileOrders>>,
        config: Config,
        at: Moment,
    ) -> (Self, Vec<Effect>) {
        let mut session = Self {
            protocol,
            orders,
            participant: config.participant.clone(),
            operator: config.operator.clone(),
            claim: None,
            history: History::default(),
            phase: Phase::Who,
            paused: None,
            trouble: None,
            device_lost: false,
            ledger: Ledger::default(),
            behind: BTreeSet::new(),
            notice: None,
            opened: None,
            clock: at,
            covered: None,
            out: Vec::new(),
        };
        if config.auto_identify {
            session.identify(&config.participant, &config.operator);
        }
        let effects = std::mem::take(&mut session.out);
        (session, effects)
    }

    /// Takes in one input at a moment; says what is to be done, in order.
    pub fn handle(&mut self, input: Input, at: Moment) -> Vec<Effect> {
        if is_deliberate(&input) {
            self.notice = None;
        }
        self.dispatch(input, at);
        self.note_cover(at);
        std::mem::take(&mut self.out)
    }

    /// What is being felt or rated now. For the simulated rater only; nothing
    /// that a person sees or reads may come from here.
    pub fn playing_model(&self) -> Option<&ModelId> {
        self.history.open.as_ref().map(|open| &open.trial.model)
    }

    fn dispatch(&mut self, input: Input, at: Moment) {
        match input {
            Input::Saved { count } => self.saved(count, at),
            Input::SaveFailed(what) => self.save_failed(what, at),
            Input::Tick => self.tick(at),
            Input::Stop => self.stop(at),
            Input::Quit => self.quit("the operator quit", false, at),
            Input::Abort(reason) => self.quit(&reason, true, at),
            Input::DeviceLoaded => self.device_loaded(at),
            Input::DeviceMount(code) => self.device_mount(code),
            Input::DeviceStarted => self.device_started(at),
            Input::DeviceProgress { strokes, clamps } => self.device_progress(strokes, clamps),
            Input::DeviceStopped(playback) => self.device_stopped(playback, at),
            Input::DeviceFault(what) => self.device_fault(&what, at),
            Input::DeviceLost(what) => self.device_gone(&what, at),
            Input::PlaybackLost(what) => self.playback_lost(&what, at),
            Input::DeviceReady => self.device_ready(),
            Input::Identify {
                participant,
                operator,
            } => {
                if matches!(self.phase, Phase::Who) {
                    self.identify(&participant, &operator);
                }
            }
            Input::Claimed(claim) => self.claimed(*claim, at),
            Input::ClaimRefused(why) => self.claim_refused(&why),
            Input::Notice(what) => self.say(what),
            Input::RetrySave => self.retry_save(),
            Input::Advance => self.advance_or_uncover(at),
            _ if !self.phase.under_way() => {}
            Input::Remark { by, text } => self.remark(by, text, at),
            Input::Correct {
                place,
                question,
                answer,
                reason,
                by,
            } => self.correct(place, &question, answer, reason, by, at),
            _ if self.cover().is_some() => self.say("first go on from this screen"),
            Input::Resume(choice) => self.resume(choice, at),
            Input::Consent(accepted) => self.consent(accepted, at),
            Input::Answer(answers) => self.answer(answers, at),
            Input::MarkBad { reason } => self.mark_bad(reason, at),
            Input::PlayAgain => self.play_again(at),
            Input::RateStopped => self.rate_stopped(at),
            Input::Pause => self.pause(at),
        }
    }

    /// Sends an event to the store and takes it into the history.
    fn record(&mut self, event: Event, at: Moment) {
        self.history.apply(&event, at);
        self.ledger.sent += 1;
        if let Event::TrialDone { trial, .. } = &event {
            self.ledger.done.insert(*trial, self.ledger.sent);
        }
        self.out.push(Effect::Record(event));
    }

    fn say(&mut self, notice: impl Into<String>) {
        self.notice = Some(notice.into());
    }
}

/// Whether somebody did it, so that the last notice has been seen.
fn is_deliberate(input: &Input) -> bool {
    !matches!(
        input,
        Input::Tick
            | Input::Notice(_)
            | Input::Saved { .. }
            | Input::Claimed(_)
            | Input::DeviceLoaded
            | Input::DeviceMount(_)
            | Input::DeviceStarted
            | Input::DeviceProgress { .. }
            | Input::DeviceStopped(_)
            | Input::DeviceReady
    )
}
