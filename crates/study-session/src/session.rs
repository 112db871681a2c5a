//! The running session as a pure state machine.
//!
//! [`Session::handle`] takes an [`Input`] and the time and returns [`Effect`]s;
//! [`Session::view`] returns what the screen shows. The session itself uses no
//! clock, device, store or random numbers. A [`View`] never contains anything that
//! identifies a realization.
//!
//! The memory of a session is the [`History`] of its own events. In addition it
//! holds the current phase and up to three overlays that can hide the phase: a
//! failed save, a pause, a device problem. A resumed session builds its history
//! from the journal and continues from there.
//!
//! Invariants:
//!
//! * An answer is shown as saved only after [`Input::Saved`] has acknowledged it.
//! * A rating opens only after the device has confirmed the start and the end of
//!   the playback.
//! * Every transition out of playing first sends [`Effect::Stop`], [`Effect::Fade`] or
//!   [`Effect::Limp`].
//! * After a stop, a pause or a fault nothing is loaded or started until somebody
//!   requests it again.
//! * Nothing is answered about a picture, video or sound that did not come in time, or that nobody is known to have seen.
//! * Nothing is answered after a longer pause than the protocol allows, nor compared over one: it is
//!   felt again.
//!
//! Effects must be carried out in order. [`Effect::Limp`] also cancels a load: no
//! [`Input::DeviceLoaded`] for it may follow.

mod adjusting;
mod away;
mod between;
mod consenting;
mod course;
pub mod cue;
mod failures;
mod flow;
mod forms;
pub mod input;
mod media;
mod opening;
mod own_answers;
mod phase;
mod project_view;
pub mod retrace;
pub mod roster;
mod saving;
mod search;
mod sent;
mod tracks;
mod trial;
mod unsaved;
pub mod view;

pub use input::{Claim, Effect, Ending, Input};
pub use opening::MAX_OPERATOR;
pub use roster::Roster;
pub use unsaved::Unsaved;
pub use view::{Screen, View};

use crate::outcome::fold::History;
use crate::outcome::{Channel, Event, Fidelity, Moment, SelfWeighed};
use phase::{DeviceProblem, Phase, Told};
use saving::SaveState;
use std::collections::BTreeSet;
use std::sync::Arc;
use study_base::text::{ModelId, PartId};
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{DeviceKind, FileOrders, Protocol, Seat, Trial};

/// Presets from the command line.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Config {
    /// Participant id shown on the first screen; may be empty.
    pub participant: String,
    /// Operator code shown on the first screen; may be empty.
    pub operator: String,
    /// Name and version of the participant's front, if it is a program of somebody else.
    pub front: Option<String>,
    /// Who is known already, for a line on the first screen.
    pub roster: Option<Arc<Roster>>,
    /// What the participant's page shows and plays beside what is felt; `None` if nobody presents media.
    pub media: Option<Arc<cue::Shows>>,
    /// Use the presets without showing the first screen.
    pub auto_identify: bool,
}

/// A session from the first screen to the last.
pub struct Session {
    protocol: Arc<Protocol>,
    orders: Option<Arc<FileOrders>>,
    /// What participants read besides the texts of the protocol.
    words: Arc<Words>,
    /// As typed on the first screen.
    participant: String,
    operator: String,
    front: Option<String>,
    roster: Option<Arc<Roster>>,
    /// Seat and device; `None` until the session's folder is claimed.
    claim: Option<ClaimFacts>,
    history: History,
    phase: Phase,
    /// Start of the pause.
    paused: Option<Moment>,
    device_problem: Option<DeviceProblem>,
    /// The judgement of the playback whose end is reported next.
    judged: Option<Box<Fidelity>>,
    /// The device does not respond.
    device_lost: bool,
    saves: SaveState,
    /// Forms and messages completed in this process, in addition to the history.
    passed: BTreeSet<flow::Step>,
    /// Parts whose text was shown in this process.
    parts_shown: BTreeSet<PartId>,
    /// Tracks in progress.
    running: Vec<tracks::Running>,
    /// The last pair of a search, with the answers from which it follows.
    searching: Option<search::Searching>,
    /// What the participant's page shows and plays.
    media: media::MediaState,
    /// Whether the last answer was correct, until the participant is told.
    feedback: Option<Told>,
    /// Remarks of this process.
    remarks: Vec<String>,
    /// How the inputs are entered.
    channel: Option<Channel>,
    notice: Option<String>,
    mirror: Option<view::Mirror>,
    /// When the session's folder was claimed.
    opened: Option<Moment>,
    /// Both clocks at the last comparison that showed no step.
    clock: Moment,
    /// Since when an overlay hides the phase.
    overlaid_since: Option<Moment>,
    /// Pauses since the end of the last playback, s; infinite if nobody knows how long.
    away_s: f64,
    /// Pauses since the last trial was answered, or the last questionnaire after one, s; infinite
    /// if nobody knows how long.
    apart_s: f64,
    out: Vec<Effect>,
}

/// Facts of a claim that are not in the journal.
struct ClaimFacts {
    session: u32,
    seat: Seat,
    device_kind: DeviceKind,
    device_id: String,
    device_telemetry: bool,
    self_weighed: Option<SelfWeighed>,
}

impl Session {
    /// A session on its first screen, or waiting for its claim, and its first
    /// effects.
    pub fn new(
        protocol: Arc<Protocol>,
        orders: Option<Arc<FileOrders>>,
        config: Config,
        at: Moment,
    ) -> (Self, Vec<Effect>) {
        let mut session = Self {
            words: Arc::new(protocol.text.phrases()),
            protocol,
            orders,
            participant: config.participant.clone(),
            operator: config.operator.clone(),
            front: config.front,
            roster: config.roster,
            claim: None,
            history: History::default(),
            phase: Phase::Identify,
            paused: None,
            device_problem: None,
            judged: None,
            device_lost: false,
            saves: SaveState::default(),
            passed: BTreeSet::new(),
            parts_shown: BTreeSet::new(),
            running: Vec::new(),
            searching: None,
            media: media::MediaState::new(config.media),
            feedback: None,
            remarks: Vec::new(),
            channel: None,
            notice: None,
            mirror: None,
            opened: None,
            clock: at,
            overlaid_since: None,
            away_s: 0.0,
            apart_s: 0.0,
            out: Vec::new(),
        };
        if config.auto_identify {
            session.identify(&config.participant, &config.operator);
        }
        let effects = std::mem::take(&mut session.out);
        (session, effects)
    }

    /// Processes one input; returns the effects to carry out, in order.
    pub fn handle(&mut self, input: Input, at: Moment) -> Vec<Effect> {
        if is_deliberate(&input) {
            self.notice = None;
        }
        self.dispatch(input, at);
        self.track_overlay(at);
        std::mem::take(&mut self.out)
    }

    /// How the next inputs are entered; `None` if not by a person.
    pub fn set_channel(&mut self, channel: Option<Channel>) {
        self.channel = channel;
    }

    /// The realization being felt or rated. For the simulated rater only: it must
    /// never reach a screen or a log.
    pub fn playing_model(&self) -> Option<&ModelId> {
        let attempt = self.history.open()?.attempt;
        let interval = attempt.interval().unwrap_or(attempt.intervals());
        attempt.models.get(interval.checked_sub(1)? as usize)
    }

    /// The trial being felt or answered, and the realization of each interval. For the
    /// simulated rater only, too.
    pub fn presented(&self) -> Option<(&Trial, &[ModelId])> {
        let open = self.history.open()?;
        Some((open.trial, &open.attempt.models))
    }

    /// The events so far; equal to the history of the journal.
    pub fn history(&self) -> &History {
        &self.history
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
            Input::DeviceSampled => self.device_sampled(at),
            Input::DeviceProgress { strokes } => self.device_progress(strokes),
            Input::DeviceNumbers { numbers, outside } => self.device_numbers(numbers, outside, at),
            Input::DeviceJudged(fidelity) => self.judged = Some(fidelity),
            Input::DeviceStopped(playback) => self.device_stopped(playback, at),
            Input::DeviceFault(what) => self.device_fault(&what, at),
            Input::DeviceLost(what) => self.device_gone(&what, at),
            Input::PlaybackLost(what) => self.playback_lost(&what, at),
            Input::DeviceReady => self.device_ready(),
            Input::StoodStill { seconds } => self.did_not_run(seconds, at),
            Input::Media(report) => self.media_report(report, at),
            Input::Identify {
                participant,
                operator,
            } => {
                if matches!(self.phase, Phase::Identify) {
                    self.identify(&participant, &operator);
                }
            }
            Input::Claimed(claim) => self.claimed(*claim, at),
            Input::ClaimRefused(why) => self.claim_refused(&why),
            Input::Mirrored { results, mirror } => self.mirrored(results, mirror),
            Input::Notice(what) => self.notify(what),
            Input::RetrySave => self.retry_save(),
            Input::Advance => self.advance_or_dismiss(at),
            _ if !self.phase.under_way() => {}
            Input::Remark { by, text } => self.remark(by, text, at),
            Input::Correct {
                form,
                question,
                answer,
                reason,
                by,
            } => self.correct(form, &question, answer, reason, by, at),
            _ if self.overlay().is_some() => self.notify("continue from this screen first"),
            Input::Resume(choice) => self.resume(choice, at),
            Input::Consent(accepted) => self.consent(accepted, at),
            Input::Answer(answers) => self.answer(answers, at),
            Input::MarkBad { reason } => self.mark_bad(reason, at),
            Input::PlayAgain => self.play_again(at),
            Input::RateStopped => self.rate_stopped(at),
            Input::Adjust(turn) => self.adjust(turn, at),
            Input::Back => self.back(),
            Input::Pause => self.pause(at),
        }
    }

    /// Sends an event to the store and adds it to the history.
    fn record(&mut self, event: Event, at: Moment) {
        self.history.apply(&event, at);
        self.saves.send(event.clone(), at);
        self.out.push(Effect::Record(event));
    }

    fn notify(&mut self, notice: impl Into<String>) {
        self.notice = Some(notice.into());
    }
}

/// Whether the input shows that somebody has seen the last notice.
fn is_deliberate(input: &Input) -> bool {
    !matches!(
        input,
        Input::Tick
            | Input::Notice(_)
            | Input::Mirrored { .. }
            | Input::Saved { .. }
            | Input::Claimed(_)
            | Input::DeviceLoaded
            | Input::DeviceMount(_)
            | Input::DeviceStarted
            | Input::DeviceSampled
            | Input::DeviceProgress { .. }
            | Input::DeviceNumbers { .. }
            | Input::DeviceJudged(_)
            | Input::DeviceStopped(_)
            | Input::DeviceReady
            | Input::StoodStill { .. }
            | Input::Media(_)
    )
}
