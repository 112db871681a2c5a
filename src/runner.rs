//! Runs a session: connects it with device, store, operator and clock.
//!
//! One turn of the loop shows the view, takes the operator's inputs, feeds them to the
//! session, performs the session's effects, polls the device and the saver, and ticks.
//! Nothing in the loop waits for the disk or the device: a thread saves ([`saver`]), and
//! the device reports when it is polled. Whatever ends the loop, including an error or a
//! panic, the device goes limp (produces no force).
//!
//! [`rehearsal`] runs the same loop on a virtual clock.

pub mod beside;
pub mod clock;
mod judging;
mod loading;
pub mod rehearsal;
pub mod saver;
mod setup;
mod standstill;

pub use setup::Setup;

use loading::Slot;
use saver::{Job, SaveEvent, Saver};
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;
use study_base::limits::Limits;
use study_base::text::{ModelId, ParticipantId};
use study_device::{Report, Stimulus, manual};
use study_haptics::model::Realization;
use study_haptics::safe_play;
use study_plan::protocol::{DeviceKind, ModelEntry, Protocol, Trial};
use study_session::outcome::{Channel, Moment, Sample};
use study_session::session::{Effect, Ending, Input, Screen, Session, Unsaved, View, input::Claim};
use study_session::store::{ClaimRequest, Copies, Plan, Receipt, StudyFolder};

/// Longest wait for an input while nothing else is expected: clocks on the screen move.
const IDLE: Duration = Duration::from_millis(100);
/// Longest wait during playback.
const PLAYING: Duration = Duration::from_millis(20);
/// Longest wait while an event is being saved, or the device is about to start or stop.
const SOON: Duration = Duration::from_millis(2);
/// Samples of a playback that are judged: ten minutes at 1 kHz.
const MOST_SAMPLES: usize = 600_000;
/// A playback is lost if a device with telemetry reports nothing for this time.
const SILENCE: Duration = Duration::from_secs(1);
/// Operates a session: sees the view and gives inputs.
pub trait Operator {
    /// Shows `view` and waits at most `timeout` for inputs (possibly none).
    ///
    /// # Errors
    /// [`OperatorError`] if the operator can no longer see or type; the session then
    /// ends as after a quit.
    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError>;

    /// How the inputs that were returned last were entered; `None` if not by a person.
    fn channel(&self) -> Option<Channel> {
        None
    }
}

/// The reason why the operator is gone.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct OperatorError(pub String);

/// Until the device has to stop by itself; without such a time, for ever.
fn exposure_left(view: &View) -> Duration {
    match &view.screen {
        Screen::Playing {
            since_s, exposure, ..
        } => {
            let left = exposure.left_s(*since_s).unwrap_or(f64::INFINITY);
            Duration::try_from_secs_f64(left).unwrap_or(Duration::MAX)
        }
        _ => Duration::MAX,
    }
}

/// How a session ended.
#[derive(Debug, Clone, PartialEq)]
#[must_use = "something may not be saved"]
pub struct Ended {
    /// How it was left.
    pub ending: Ending,
    /// What is not known to be on disk.
    pub unsaved: Option<Unsaved>,
    /// The last record that is on disk.
    pub receipt: Option<Receipt>,
}

/// A running session with its device and its folder.
pub struct Runner {
    setup: Setup,
    session: Session,
    saver: Option<Saver>,
    saved: u64,
    ended: Option<Ending>,
    receipt: Option<Receipt>,
    /// What the session knows of results folder and mirror.
    copies: Option<Copies>,
    /// When the load under way was requested.
    load_began: Duration,
    /// How long every load takes, from the first one on.
    slot: Option<Slot>,
    /// When the session is told that the table is loaded.
    loaded_due: Option<Duration>,
    /// When the last turn of the loop began.
    turned: Moment,
    /// When the device last reported about the current playback.
    last_report: Option<Duration>,
    /// The code on the physical sample of each realization.
    codes: BTreeMap<ModelId, String>,
    /// Of each table: [`playback_limits`] plays a mechanism for a moment.
    limits: BTreeMap<ModelId, Limits>,
    /// Whether the current playback reports telemetry.
    has_telemetry: bool,
    /// Samples of the current playback, for its judgement.
    samples: Vec<Sample>,
    /// From when its force fell to its end, s.
    faded_from_s: Option<f64>,
    /// Whether wrong playbacks are only marked.
    only_flags: bool,
}

impl Runner {
    /// Opens a session; no participant is claimed yet.
    pub fn new(setup: Setup, config: study_session::session::Config) -> Self {
        let at = setup.clock.now();
        let (session, effects) =
            Session::new(setup.protocol.clone(), setup.orders.clone(), config, at);
        let codes = sample_codes(&setup.protocol);
        let limits = |table: &Realization| playback_limits(&setup.protocol, Some(table));
        let limits = (setup.models.iter())
            .map(|(id, table)| (id.clone(), limits(table)))
            .collect();
        let only_flags = !setup.study.manifest().judges_rendering;
        let mut runner = Self {
            setup,
            session,
            saver: None,
            saved: 0,
            ended: None,
            receipt: None,
            copies: None,
            load_began: Duration::ZERO,
            slot: None,
            loaded_due: None,
            turned: at,
            last_report: None,
            codes,
            limits,
            has_telemetry: false,
            samples: Vec::new(),
            faded_from_s: None,
            only_flags,
        };
        runner.device_limp();
        runner.perform(effects, at);
        runner
    }

    /// Runs the session to its end with an operator.
    pub fn run(&mut self, operator: &mut dyn Operator) -> Ended {
        loop {
            let view = self.view();
            let changes = matches!(view.screen, Screen::Loading { .. } | Screen::Stopping);
            let timeout = if changes || !view.line.all_saved {
                SOON
            } else if view.armed {
                PLAYING.min(exposure_left(&view))
            } else {
                IDLE
            };
            let inputs = operator
                .next(&view, self.setup.clock.wait(timeout))
                .unwrap_or_else(|gone| vec![Input::Abort(gone.0)]);
            self.session.set_channel(operator.channel());
            if let Some(ended) = self.step(inputs) {
                return ended;
            }
        }
    }

    /// One turn: feeds the inputs, polls device and saver, ticks. `Some` when the session
    /// has ended.
    pub fn step(&mut self, inputs: Vec<Input>) -> Option<Ended> {
        self.notice_standstill();
        for input in inputs {
            self.feed(input);
        }
        self.poll_device();
        self.poll_saver();
        self.poll_mirror();
        self.feed(Input::Tick);
        let ending = self.ended.clone()?;
        self.close();
        Some(Ended {
            ending,
            unsaved: self.session.unsaved(),
            receipt: self.receipt.clone(),
        })
    }

    /// The present view.
    pub fn view(&self) -> View {
        self.session.view(self.setup.clock.now())
    }

    /// The realization that plays or was just played: for a simulated rater only, never
    /// for a screen.
    pub fn felt(&self) -> Option<&ModelId> {
        self.session.playing_model()
    }

    /// The trial that plays or is answered, and the realization of each interval: for a
    /// simulated rater only, too.
    pub fn presented(&self) -> Option<(&Trial, &[ModelId])> {
        self.session.presented()
    }

    /// The folder of the study.
    pub fn study(&self) -> &StudyFolder {
        &self.setup.study
    }

    fn feed(&mut self, input: Input) {
        if self.ended.is_some() {
            return;
        }
        let at = self.setup.clock.now();
        let effects = self.session.handle(input, at);
        self.perform(effects, at);
    }

    /// Performs the effects of an input that was handled at a moment. It is that of all of
    /// its events: the journal has the times that the session has, and tells which events
    /// belong to one step.
    fn perform(&mut self, effects: Vec<Effect>, at: Moment) {
        let timed = |at: Moment| move |effect: Effect| (effect, at);
        let mut queue: VecDeque<(Effect, Moment)> = effects.into_iter().map(timed(at)).collect();
        while let Some((effect, at)) = queue.pop_front() {
            let response = self.perform_one(effect, at);
            // Effects of the response are performed after the remaining effects; the
            // session does not depend on their order.
            if let Some(input) = response {
                let at = self.setup.clock.now();
                let more = self.session.handle(input, at);
                queue.extend(more.into_iter().map(timed(at)));
            }
        }
    }

    /// Performs one effect; returns the input that reports an immediate result.
    fn perform_one(&mut self, effect: Effect, handled: Moment) -> Option<Input> {
        match effect {
            Effect::Claim {
                participant,
                operator: _,
            } => Some(self.claim(participant)),
            Effect::Record(event) => {
                self.send(Job::Append(handled, event));
                None
            }
            Effect::Load {
                trial,
                attempt,
                model,
                interval,
            } => self.load(trial, attempt, &model, interval),
            Effect::Start => {
                let at = self.device_time();
                let started = self.setup.device.start(at);
                started.err().map(|e| Input::DeviceFault(e.to_string()))
            }
            Effect::Stop => {
                let at = self.device_time();
                let stopped = self.setup.device.stop(at);
                stopped.err().map(|e| Input::DeviceLost(e.to_string()))
            }
            Effect::Fade => {
                let at = self.device_time();
                let stopped = self.setup.device.fade(at);
                stopped.err().map(|e| Input::DeviceLost(e.to_string()))
            }
            Effect::Limp => {
                self.device_limp();
                self.send(Job::TelemetryEnd);
                None
            }
            Effect::KeepConsent(copy) => {
                self.send(Job::KeepConsent(copy));
                None
            }
            Effect::RetrySave => {
                self.send(Job::Retry);
                None
            }
            Effect::End(ending) => {
                self.device_limp();
                self.ended = Some(ending);
                None
            }
        }
    }

    fn claim(&mut self, participant: ParticipantId) -> Input {
        let now = self.setup.clock.now().wall;
        let request = ClaimRequest {
            participant: participant.clone(),
            kind: self.setup.kind,
            rows: self.setup.rows.clone(),
            plan: Plan::of(&self.setup.protocol, self.setup.group.clone(), now),
        };
        let opened = self.setup.study.claim(&request).and_then(|mut claimed| {
            let journal = claimed.folder.journal()?;
            Ok((claimed, journal))
        });
        match opened {
            Err(error) => Input::ClaimRefused(match error.hint() {
                Some(hint) => format!("{error}: {hint}"),
                None => error.to_string(),
            }),
            Ok((claimed, journal)) => {
                self.took_time();
                let saving = self.setup.saving.clone();
                self.saver = Some(Saver::new(claimed.folder, journal, saving));
                let identity = self.setup.device.identity();
                Input::Claimed(Box::new(Claim {
                    participant,
                    session: claimed.session,
                    seat: claimed.seat,
                    entries: claimed.entries,
                    protocol_version: claimed.protocol_version,
                    fingerprints: self.setup.fingerprints.clone(),
                    device_kind: self.setup.device_kind,
                    device_id: identity.id,
                    device_check: self.setup.device_check.clone(),
                    self_weighed: self.setup.self_weighed.clone(),
                    device_telemetry: identity.telemetry,
                    assigned: claimed.assigned,
                    notices: claimed.notices,
                }))
            }
        }
    }

    fn load(
        &mut self,
        trial: u32,
        attempt: u32,
        model: &ModelId,
        interval: Option<u32>,
    ) -> Option<Input> {
        let protocol = &self.setup.protocol;
        let entry = protocol.model(model);
        let own = entry.and_then(|m: &ModelEntry| m.device);
        let kind = own.unwrap_or(self.setup.device_kind);
        let by_hand = kind == DeviceKind::Manual;
        let table = self.setup.models.get(model);
        if table.is_none() && !by_hand && kind != DeviceKind::Process {
            return Some(Input::DeviceFault(
                "the realization has no table for this device".to_owned(),
            ));
        }
        let limits = self.limits.get(model).copied();
        let limits = limits.unwrap_or(protocol.device.limits);
        self.has_telemetry = !by_hand && self.setup.device.identity().telemetry;
        self.samples.clear();
        self.faded_from_s = None;
        let stimulus = Stimulus {
            model: model.as_str(),
            table,
            code: self.codes.get(model).map_or("", String::as_str),
            by_hand,
            allow_uncertified: protocol.device.uncertified.as_ref().is_some_and(|u| u.play),
        };
        let at = self.device_time();
        self.load_began = at;
        let planned = || Slot::planned(&self.setup, &self.limits);
        self.slot = Some(self.slot.unwrap_or_else(planned));
        match self.setup.device.load(&stimulus, limits, at) {
            Ok(()) => {
                self.send(Job::TelemetryBegin {
                    trial,
                    attempt,
                    interval,
                });
                None
            }
            Err(error) => Some(Input::DeviceFault(error.to_string())),
        }
    }

    fn poll_device(&mut self) {
        let at = self.device_time();
        for report in self.setup.device.poll(at) {
            self.last_report = match &report {
                Report::Started if self.has_telemetry => Some(at),
                Report::Telemetry(_) | Report::Progress { .. } | Report::Numbers { .. } => {
                    self.last_report.map(|_| at)
                }
                _ => None,
            };
            if let Report::Stopped(_) | Report::Fault(_) | Report::Lost(_) = &report {
                self.send(Job::TelemetryEnd);
            }
            if let Report::Stopped(playback) = &report {
                let fidelity = Box::new(self.judge(playback));
                self.feed(Input::DeviceJudged(fidelity));
            }
            let input = match report {
                Report::Loaded => {
                    let told = self.slot.map(|slot| slot.end(self.load_began, at));
                    self.loaded_due = told.or(Some(at));
                    continue;
                }
                Report::Mount(code) => Input::DeviceMount(code),
                Report::Started => Input::DeviceStarted,
                Report::Telemetry(samples) => {
                    let room = MOST_SAMPLES.saturating_sub(self.samples.len());
                    self.samples.extend(samples.iter().take(room));
                    self.send(Job::Telemetry(samples));
                    Input::DeviceSampled
                }
                Report::Progress { strokes, .. } => Input::DeviceProgress { strokes },
                Report::Faded { from_s } => {
                    self.faded_from_s = Some(from_s);
                    continue;
                }
                Report::Numbers { numbers, outside } => Input::DeviceNumbers { numbers, outside },
                Report::Stopped(playback) => Input::DeviceStopped(playback),
                Report::Fault(what) => Input::DeviceFault(what),
                Report::Lost(what) => Input::DeviceLost(what),
                Report::Ready => Input::DeviceReady,
            };
            self.feed(input);
        }
        if self.loaded_due.take_if(|due| *due <= at).is_some() {
            self.feed(Input::DeviceLoaded);
        }
        if self
            .last_report
            .is_some_and(|last| at.saturating_sub(last) > SILENCE)
        {
            self.last_report = None;
            self.send(Job::TelemetryEnd);
            let what = format!("the device has sent nothing for {} s", SILENCE.as_secs());
            self.feed(Input::PlaybackLost(what));
        }
    }

    fn poll_saver(&mut self) {
        let events = self.saver.as_mut().map(Saver::drain).unwrap_or_default();
        for event in events {
            if let Some(input) = self.save_input(event) {
                self.feed(input);
            }
        }
    }

    fn poll_mirror(&mut self) {
        let copies = self.setup.study.copies();
        if copies != self.copies {
            self.copies.clone_from(&copies);
            if let Some(Copies { results, mirror }) = copies {
                self.feed(Input::Mirrored { results, mirror });
            }
        }
    }

    fn save_input(&mut self, event: SaveEvent) -> Option<Input> {
        Some(match event {
            SaveEvent::Saved => {
                self.saved += 1;
                Input::Saved { count: self.saved }
            }
            SaveEvent::Failed(why) => Input::SaveFailed(why),
            SaveEvent::TelemetryLost(why) => Input::Notice(why),
            SaveEvent::Left(receipt) => {
                self.receipt = Some(receipt);
                return None;
            }
        })
    }

    fn send(&mut self, job: Job) {
        if let Some(saver) = &mut self.saver {
            saver.send(job);
        }
    }

    fn close(&mut self) {
        self.device_limp();
        let Some(saver) = self.saver.take() else {
            return;
        };
        for event in saver.finish() {
            // The session has ended: it only takes note of what is saved.
            if let Some(input) = self.save_input(event) {
                self.session.handle(input, self.setup.clock.now());
            }
        }
    }

    fn device_time(&self) -> Duration {
        Duration::from_nanos(self.setup.clock.now().mono_ns)
    }

    fn device_limp(&mut self) {
        self.last_report = None;
        self.loaded_due = None;
        let at = self.device_time();
        self.setup.device.limp(at);
    }
}

impl Drop for Runner {
    /// Also runs while a panic unwinds: the device never keeps its force after a session.
    fn drop(&mut self) {
        self.close();
    }
}

/// The codes on the physical samples of a study: for labeling them, and for the
/// experimenter's prompt, which identifies a sample by its code only.
pub fn sample_codes(protocol: &Protocol) -> BTreeMap<ModelId, String> {
    let ids: Vec<&ModelId> = protocol.models.iter().map(|m| &m.id).collect();
    manual::codes(protocol.study.seed, &ids)
}

/// The playback limits for a table: those of the protocol. A table that fails its
/// certificate or is not safe to play can put energy into a hand; its force is also limited by
/// the protocol's `uncertified` permission.
pub fn playback_limits(protocol: &Protocol, table: Option<&Realization>) -> Limits {
    let mut limits = protocol.device.limits;
    if let Some(uncertified) = &protocol.device.uncertified
        && table.is_some_and(|table| {
            let device = safe_play::Device::default();
            !table.certificate().passes() || safe_play::refusal(table, &device).is_some()
        })
    {
        limits.force_n = limits.force_n.capped_at(uncertified.force_n);
    }
    limits
}
