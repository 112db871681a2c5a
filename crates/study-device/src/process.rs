//! A controller program of the lab as a device, in any programming language.
//!
//! The program exchanges JSON, one object per line, on its standard streams;
//! `docs/devices.md` is the specification. Separate threads read and write, so nothing
//! waits for the program. A program that does not read, violates the specification,
//! sends too much or ends is killed and counts as a lost device; it is restarted after a
//! second. [`study_base::child`] contains the threads, `messages` the messages.
//!
//! The host cannot switch off the force of a program that it cannot reach. It therefore
//! sends `free`, sends `alive` as long as it polls, and closes the program's input when
//! it ends. The program has to go limp when it receives `free`, which it confirms, when
//! `alive` stays away, and at the end of its input. `check` tests that.

pub mod check;
mod error;
mod hello;
mod messages;

use super::host::Arrivals;
use super::table::TableError;
use super::{Device, DeviceError, Identity, Report, Stimulus};
use error::MessageError;
use messages::ChildMessage;
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use study_base::child::{ChildFailure, RESTART_DELAY, Running};
use study_base::limits::Limits;
use study_session::outcome::{Playback, Sample};

pub use error::FORMAT;
pub use hello::Told;
pub use study_base::child::HELLO_TIMEOUT;

/// Largest number of lines processed per poll.
const MAX_LINES_PER_POLL: usize = 2048;
/// Time between two `alive` messages.
const ALIVE_INTERVAL: Duration = Duration::from_millis(20);
/// A program that has not confirmed `free` in this time is ended.
const FREE_TIMEOUT: Duration = Duration::from_secs(2);

/// A controller program, connected by its standard streams.
#[derive(Debug)]
pub struct ProcessDevice {
    command: Vec<String>,
    told: Told,
    child: Option<Running>,
    phase: Phase,
    /// Number of the current load; messages about earlier loads are ignored.
    load: u64,
    /// Samples of the current playback.
    samples: u64,
    /// When they arrived.
    arrivals: Arrivals,
    /// When `alive` was last sent.
    alive_at: Duration,
    /// Loads whose `free` is not confirmed, and when it was sent.
    freed: VecDeque<(u64, Duration)>,
    reports: Vec<Report>,
    /// Last reported reason why no program is running.
    reported_loss: Option<String>,
}

/// Waits at most `wait` for the next message of a program.
fn message(child: &mut Running, wait: Duration) -> Result<Option<ChildMessage>, ChildFailure> {
    let line = child.receive(wait)?;
    let message = line.map(|line| messages::read(&line)).transpose();
    message.map_err(|why| child.invalid(why))
}

/// A program that was started and has not sent its `hello`.
#[derive(Debug)]
pub struct Opening {
    command: Vec<String>,
    child: Running,
    since: Instant,
}

impl Opening {
    /// Starts the program.
    ///
    /// `command` is the program and its arguments; no shell is involved.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if it cannot be started.
    pub fn begin(command: Vec<String>) -> Result<Self, DeviceError> {
        let child = Running::start(&command).map_err(|e| DeviceError::Lost(e.to_string()))?;
        Ok(Self {
            command,
            child,
            since: Instant::now(),
        })
    }

    /// Waits at most `wait` for the `hello`, which has to come within
    /// [`HELLO_TIMEOUT`] after the start.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if the program ends, sends something else or is too slow.
    pub fn hello(mut self, wait: Duration) -> Result<Opened, DeviceError> {
        let hello = match message(&mut self.child, wait) {
            Ok(None) if self.since.elapsed() < HELLO_TIMEOUT => return Ok(Opened::NotYet(self)),
            Ok(None) => Err(ChildFailure::no_hello()),
            Ok(Some(message)) => message.hello().map_err(ChildFailure::from),
            Err(failure) => Err(failure),
        };
        match hello {
            Err(failure) => Err(DeviceError::Lost(self.child.end(&failure))),
            Ok(told) => Ok(Opened::Device(Box::new(ProcessDevice {
                told,
                command: self.command,
                child: Some(self.child),
                phase: Phase::Idle,
                load: 0,
                samples: 0,
                arrivals: Arrivals::default(),
                alive_at: Duration::ZERO,
                freed: VecDeque::new(),
                reports: Vec::new(),
                reported_loss: None,
            }))),
        }
    }
}

/// Result of waiting for a `hello`.
#[derive(Debug)]
pub enum Opened {
    /// The program is ready.
    Device(Box<ProcessDevice>),
    /// The program has sent nothing so far.
    NotYet(Opening),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Idle,
    Loading,
    Loaded,
    Starting,
    Playing,
    Stopping,
    /// Limp, without a program, which is restarted at `restart`.
    Lost {
        restart: Duration,
    },
    /// The restarted program has not sent its `hello`.
    Opening {
        since: Duration,
    },
}

impl Phase {
    fn as_str(self) -> &'static str {
        match self {
            Self::Idle => "nothing is loaded",
            Self::Loading => "it is loading",
            Self::Loaded => "it is waiting for the start",
            Self::Starting => "it is starting",
            Self::Playing => "it is playing",
            Self::Stopping => "it is stopping",
            Self::Lost { .. } | Self::Opening { .. } => "it does not answer",
        }
    }
}

impl ProcessDevice {
    /// Starts the program and waits for its `hello`.
    ///
    /// # Errors
    /// As [`Opening::begin`] and [`Opening::hello`].
    pub fn open(command: Vec<String>) -> Result<Self, DeviceError> {
        let mut opening = Opening::begin(command)?;
        loop {
            opening = match opening.hello(HELLO_TIMEOUT)? {
                Opened::Device(device) => return Ok(*device),
                Opened::NotYet(opening) => opening,
            };
        }
    }

    /// The program and its arguments.
    pub fn command(&self) -> &[String] {
        &self.command
    }

    /// What the program has told in its `hello`.
    pub fn told(&self) -> &Told {
        &self.told
    }

    fn send(&mut self, line: String, at: Duration) {
        let Some(child) = &mut self.child else { return };
        if let Err(failure) = child.send(line) {
            let reason = child.end(&failure);
            self.lose(reason, at);
        }
    }

    /// Ends the program. Repeated failures to restart it are reported only once.
    fn lose(&mut self, reason: String, at: Duration) {
        self.child = None;
        self.freed.clear();
        let absent = matches!(self.phase, Phase::Lost { .. } | Phase::Opening { .. });
        if !absent || self.reported_loss.as_ref() != Some(&reason) {
            self.reports.push(Report::Lost(reason.clone()));
            self.reported_loss = Some(reason);
        }
        self.phase = Phase::Lost {
            restart: at + RESTART_DELAY,
        };
    }

    fn receive(&mut self, at: Duration) {
        for _ in 0..MAX_LINES_PER_POLL {
            let Some(child) = &mut self.child else { return };
            let result = match message(child, Duration::ZERO) {
                Ok(None) => return,
                Ok(Some(message)) => self.handle(message, at).map_err(ChildFailure::from),
                Err(failure) => Err(failure),
            };
            if let (Err(failure), Some(child)) = (result, &mut self.child) {
                let reason = child.end(&failure);
                return self.lose(reason, at);
            }
        }
    }

    fn handle(&mut self, mut message: ChildMessage, at: Duration) -> Result<(), MessageError> {
        if let Phase::Opening { .. } = self.phase {
            let told = message.hello()?;
            if told.identity.id != self.told.identity.id {
                return Err(MessageError::OtherDevice(told.identity.id));
            }
            self.told = told;
            self.reported_loss = None;
            self.phase = Phase::Idle;
            self.reports.push(Report::Ready);
            return Ok(());
        }
        if let ChildMessage::Free { load, .. } = message {
            self.freed.retain(|(earlier, _)| *earlier > load);
            return Ok(());
        }
        if let ChildMessage::Outcome { load, outcome } = &mut message {
            let is_own = load.is_none_or(|load| load == self.load);
            let plays = matches!(self.phase, Phase::Playing | Phase::Stopping);
            let numbers = std::mem::take(&mut outcome.numbers);
            if !numbers.is_empty() {
                let outside = !(is_own && plays);
                self.reports.push(Report::Numbers { numbers, outside });
            }
            match (load, &outcome.playback) {
                // Numbers alone end nothing, and come when they come.
                (_, None) => return Ok(()),
                (None, Some(_)) => return Err(MessageError::NoLoad),
                (Some(_), Some(_)) => {}
            }
        }
        if message.load().is_some_and(|load| load != self.load) {
            return Ok(());
        }
        match (message, self.phase) {
            (ChildMessage::Fault { what, .. }, _) => {
                self.phase = Phase::Idle;
                self.reports.push(Report::Fault(what));
            }
            // Messages about a load that was canceled.
            (_, Phase::Idle) => {}
            (ChildMessage::Loaded { .. }, Phase::Loading) => {
                self.phase = Phase::Loaded;
                self.reports.push(Report::Loaded);
            }
            (ChildMessage::Refused { why, .. }, Phase::Loading) => {
                self.phase = Phase::Idle;
                self.reports.push(Report::Fault(format!(
                    "the device refuses the table: {why}"
                )));
            }
            (ChildMessage::Started { .. }, Phase::Starting) => {
                self.phase = Phase::Playing;
                self.reports.push(Report::Started);
            }
            // STOP may have been sent before the start was confirmed.
            (ChildMessage::Started { .. }, Phase::Stopping) => {}
            (ChildMessage::Samples { samples, .. }, Phase::Playing | Phase::Stopping) => {
                self.samples += samples.len() as u64;
                let samples: Vec<Sample> = samples.into_iter().map(Into::into).collect();
                if let Some(last) = samples.last() {
                    self.arrivals.add(at, last.t_s);
                }
                self.reports.push(Report::Telemetry(samples));
            }
            (
                ChildMessage::Progress {
                    strokes, clamps, ..
                },
                Phase::Playing | Phase::Stopping,
            ) => self.reports.push(Report::Progress { strokes, clamps }),
            (ChildMessage::Outcome { outcome, .. }, Phase::Playing | Phase::Stopping) => {
                self.phase = Phase::Idle;
                let stopped = outcome.playback.map(|playback| {
                    Report::Stopped(Playback {
                        samples: self.samples,
                        time_ratio: self.arrivals.time_ratio(),
                        ..playback.into()
                    })
                });
                self.reports.extend(stopped);
            }
            (message, phase) => {
                return Err(MessageError::WrongState {
                    message: message.as_str(),
                    state: phase.as_str(),
                });
            }
        }
        Ok(())
    }

    /// Ends a program that does not confirm that its force is off.
    fn await_free(&mut self, at: Duration) {
        let due =
            (self.freed.front()).is_some_and(|(_, sent)| at.saturating_sub(*sent) > FREE_TIMEOUT);
        if let (true, Some(child)) = (due, &mut self.child) {
            let timeout = FREE_TIMEOUT.as_secs();
            let why =
                format!("it has not confirmed within {timeout} s that its force is off (`free`)");
            let reason = child.end(&ChildFailure::Violation(why));
            self.lose(reason, at);
        }
    }

    fn wrong_state(&self, command: &'static str) -> DeviceError {
        match self.phase {
            Phase::Lost { .. } | Phase::Opening { .. } => {
                DeviceError::Lost("the program is being restarted".to_owned())
            }
            phase => DeviceError::WrongState {
                command,
                state: phase.as_str(),
            },
        }
    }

    /// Restarts a lost program when it is due.
    fn restart(&mut self, at: Duration) {
        match self.phase {
            Phase::Lost { restart } if at >= restart => match Running::start(&self.command) {
                Ok(child) => {
                    self.child = Some(child);
                    self.phase = Phase::Opening { since: at };
                }
                Err(error) => self.lose(error.to_string(), at),
            },
            Phase::Opening { since } if at.saturating_sub(since) > HELLO_TIMEOUT => {
                if let Some(child) = &mut self.child {
                    let reason = child.end(&ChildFailure::no_hello());
                    self.lose(reason, at);
                }
            }
            _ => {}
        }
    }
}

impl Drop for ProcessDevice {
    /// Sends `free` before the input is closed.
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // A program that has ended cannot receive it.
            let _ = child.send(messages::command(self.told.free(), self.load));
        }
    }
}

impl Device for ProcessDevice {
    fn identity(&self) -> Identity {
        self.told.identity.clone()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        if !matches!(self.phase, Phase::Idle | Phase::Loading | Phase::Loaded) {
            return Err(self.wrong_state("load"));
        }
        if what.table.is_some_and(|table| table.mechanism.is_some())
            && !self.told.identity.mechanisms
        {
            return Err(DeviceError::Refused(TableError::Mechanism.to_string()));
        }
        if what.table.is_some_and(|table| table.elements.is_some()) {
            return Err(DeviceError::Refused(TableError::Elements.to_string()));
        }
        self.load += 1;
        self.samples = 0;
        self.arrivals = Arrivals::default();
        self.phase = Phase::Loading;
        let limits = limits.capped_at(self.told.identity.limits);
        self.send(messages::load(self.load, what, limits), at);
        match self.phase {
            Phase::Loading => Ok(()),
            _ => Err(self.wrong_state("load")),
        }
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        if self.phase != Phase::Loaded {
            return Err(self.wrong_state("start"));
        }
        self.phase = Phase::Starting;
        self.send(messages::command("start", self.load), at);
        Ok(())
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        match self.phase {
            Phase::Starting | Phase::Playing => {
                self.phase = Phase::Stopping;
                self.send(messages::command("stop", self.load), at);
                Ok(())
            }
            // `stop` has been sent, or the end has been reported.
            Phase::Stopping | Phase::Idle | Phase::Lost { .. } => Ok(()),
            _ => Err(self.wrong_state("stop")),
        }
    }

    fn limp(&mut self, at: Duration) {
        self.send(messages::command(self.told.free(), self.load), at);
        if self.child.is_some() && !self.told.is_version_1 {
            self.freed.push_back((self.load, at));
        }
        // Later messages about this load are ignored.
        self.load += 1;
        if !matches!(self.phase, Phase::Lost { .. } | Phase::Opening { .. }) {
            self.phase = Phase::Idle;
        }
        self.reports.retain(Report::survives_limp);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        self.restart(at);
        self.receive(at);
        self.await_free(at);
        if at < self.alive_at || at - self.alive_at >= ALIVE_INTERVAL {
            self.alive_at = at;
            self.send(messages::command("alive", self.load), at);
        }
        std::mem::take(&mut self.reports)
    }
}
