//! A child program that plays: a lab keeps its own controller, in any language.
//!
//! It speaks JSON, one object a line, on its standard streams; `docs/devices.md`
//! is the description. Threads of their own read and write, so that nothing waits
//! for the child: a child that does not read, says something else than what is
//! described, says too much or ends is killed, and that is a lost device. A new one
//! is started after a second. `child` has the threads, `words` the language.
//!
//! The host cannot make limp what it cannot reach. It says `limp`, it says `alive`
//! as long as it polls, and it closes the child's input when it ends: the child has
//! to go limp at the first, without the second and at the third.

mod child;
mod words;

use super::{Device, DeviceError, Identity, Report, Stimulus};
use child::{Running, Why};
use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_base::text::Untrusted;
use study_core::outcome::Playback;
use words::{Hello, Say};

pub use words::FORMAT;

/// Lines that one poll takes in.
const A_POLL: usize = 2048;
/// Between two `alive`.
const ALIVE: Duration = Duration::from_millis(20);
/// How long a child may take from its start to its `hello`.
pub const HELLO_WITHIN: Duration = Duration::from_secs(10);
/// How long after a loss a new child is started.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// A controller of the lab's, behind its standard streams.
#[derive(Debug)]
pub struct ProcessDevice {
    command: Vec<String>,
    identity: Identity,
    child: Option<Running>,
    phase: Phase,
    /// Numbers the loads: what the child says of an earlier one is not heard.
    load: u64,
    /// Samples of the present playback.
    samples: u64,
    told_alive: Duration,
    reports: Vec<Report>,
    /// Why there is no child, as it was last told.
    told: Option<String>,
}

/// A child that was started and has not said who it is.
#[derive(Debug)]
pub struct Opening {
    command: Vec<String>,
    child: Running,
    since: Instant,
}

impl Opening {
    /// Starts the child.
    ///
    /// `command` is the program and its arguments; no shell is in between.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if it cannot be started.
    pub fn begin(command: Vec<String>) -> Result<Self, DeviceError> {
        let child = Running::start(&command).map_err(DeviceError::Lost)?;
        Ok(Self {
            command,
            child,
            since: Instant::now(),
        })
    }

    /// Waits at most so long for its `hello`. From its start a child may take
    /// [`HELLO_WITHIN`].
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if it ends, says something else or takes too long.
    pub fn hello(mut self, within: Duration) -> Result<Opened, DeviceError> {
        let heard = match self.child.listen(within) {
            Ok(None) if self.since.elapsed() < HELLO_WITHIN => return Ok(Opened::NotYet(self)),
            Ok(None) => Err(Why::no_hello()),
            Ok(Some(say)) => say.hello().map_err(Why::Wrong),
            Err(why) => Err(why),
        };
        match heard {
            Err(why) => Err(DeviceError::Lost(self.child.end(&why))),
            Ok(hello) => Ok(Opened::Device(Box::new(ProcessDevice {
                identity: identity(hello),
                command: self.command,
                child: Some(self.child),
                phase: Phase::Idle,
                load: 0,
                samples: 0,
                told_alive: Duration::ZERO,
                reports: Vec::new(),
                told: None,
            }))),
        }
    }
}

/// What came of waiting for a `hello`.
#[derive(Debug)]
pub enum Opened {
    /// It is there.
    Device(Box<ProcessDevice>),
    /// It has not said anything.
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
    /// Limp, and no child; a new one is started then.
    Lost {
        again: Duration,
    },
    /// A new child has not said who it is.
    Opening {
        since: Duration,
    },
}

impl Phase {
    fn as_str(self) -> &'static str {
        match self {
            Self::Idle => "nothing is loaded",
            Self::Loading => "it loads",
            Self::Loaded => "it waits for its start",
            Self::Starting => "it is about to play",
            Self::Playing => "it plays",
            Self::Stopping => "it is about to stop",
            Self::Lost { .. } | Self::Opening { .. } => "it does not answer",
        }
    }
}

impl ProcessDevice {
    /// Starts the child and waits for its `hello`.
    ///
    /// # Errors
    /// As [`Opening::begin`] and [`Opening::hello`].
    pub fn open(command: Vec<String>) -> Result<Self, DeviceError> {
        let mut opening = Opening::begin(command)?;
        loop {
            opening = match opening.hello(HELLO_WITHIN)? {
                Opened::Device(device) => return Ok(*device),
                Opened::NotYet(opening) => opening,
            };
        }
    }

    /// The program and its arguments.
    pub fn command(&self) -> &[String] {
        &self.command
    }

    fn say(&mut self, words: String, at: Duration) {
        let Some(child) = &mut self.child else { return };
        if let Err(why) = child.tell(words) {
            let why = child.end(&why);
            self.lose(why, at);
        }
    }

    /// No child is better than one that is not understood. While none is there, only
    /// what is new is told.
    fn lose(&mut self, why: String, at: Duration) {
        self.child = None;
        let away = matches!(self.phase, Phase::Lost { .. } | Phase::Opening { .. });
        if !away || self.told.as_ref() != Some(&why) {
            self.reports.push(Report::Lost(why.clone()));
            self.told = Some(why);
        }
        self.phase = Phase::Lost {
            again: at + AGAIN_AFTER,
        };
    }

    fn hear(&mut self, at: Duration) {
        for _ in 0..A_POLL {
            let Some(child) = &mut self.child else { return };
            let taken = match child.listen(Duration::ZERO) {
                Ok(None) => return,
                Ok(Some(say)) => self.take(say).map_err(Why::Wrong),
                Err(why) => Err(why),
            };
            if let (Err(why), Some(child)) = (taken, &mut self.child) {
                let why = child.end(&why);
                return self.lose(why, at);
            }
        }
    }

    fn take(&mut self, say: Say) -> Result<(), String> {
        if let Phase::Opening { .. } = self.phase {
            let identity = identity(say.hello()?);
            if identity.id != self.identity.id {
                return Err(format!(
                    "it is another device than before, `{}`",
                    Untrusted(&identity.id)
                ));
            }
            self.identity = identity;
            self.told = None;
            self.phase = Phase::Idle;
            self.reports.push(Report::Ready);
            return Ok(());
        }
        if say.load().is_some_and(|load| load != self.load) {
            return Ok(());
        }
        match (say, self.phase) {
            (Say::Fault { what, .. }, _) => {
                self.phase = Phase::Idle;
                self.reports.push(Report::Fault(what));
            }
            // a load that was taken back
            (_, Phase::Idle) => {}
            (Say::Loaded { .. }, Phase::Loading) => {
                self.phase = Phase::Loaded;
                self.reports.push(Report::Loaded);
            }
            (Say::Refused { why, .. }, Phase::Loading) => {
                self.phase = Phase::Idle;
                self.reports
                    .push(Report::Fault(format!("the device refuses it: {why}")));
            }
            (Say::Started { .. }, Phase::Starting) => {
                self.phase = Phase::Playing;
                self.reports.push(Report::Started);
            }
            // a stop may have been asked for before the start was confirmed
            (Say::Started { .. }, Phase::Stopping) => {}
            (Say::Samples { samples, .. }, Phase::Playing | Phase::Stopping) => {
                self.samples += samples.len() as u64;
                let samples = samples.into_iter().map(Into::into).collect();
                self.reports.push(Report::Telemetry(samples));
            }
            (
                Say::Progress {
                    strokes, clamps, ..
                },
                Phase::Playing | Phase::Stopping,
            ) => self.reports.push(Report::Progress { strokes, clamps }),
            (Say::Stopped { outcome, .. }, Phase::Playing | Phase::Stopping) => {
                self.phase = Phase::Idle;
                self.reports.push(Report::Stopped(Playback {
                    samples: self.samples,
                    ..outcome.into()
                }));
            }
            (say, phase) => {
                return Err(format!("it says `{}` while {}", say.word(), phase.as_str()));
            }
        }
        Ok(())
    }

    fn wrong(&self, command: &'static str) -> DeviceError {
        match self.phase {
            Phase::Lost { .. } | Phase::Opening { .. } => {
                DeviceError::Lost("the program is being started again".to_owned())
            }
            phase => DeviceError::WrongState {
                command,
                state: phase.as_str(),
            },
        }
    }

    /// A new child in place of a lost one.
    fn reopen(&mut self, at: Duration) {
        match self.phase {
            Phase::Lost { again } if at >= again => match Running::start(&self.command) {
                Ok(child) => {
                    self.child = Some(child);
                    self.phase = Phase::Opening { since: at };
                }
                Err(why) => self.lose(why, at),
            },
            Phase::Opening { since } if at.saturating_sub(since) > HELLO_WITHIN => {
                if let Some(child) = &mut self.child {
                    let why = child.end(&Why::no_hello());
                    self.lose(why, at);
                }
            }
            _ => {}
        }
    }
}

fn identity(hello: Hello) -> Identity {
    Identity {
        id: hello.id,
        simulated: hello.simulated,
        telemetry: hello.telemetry,
        limits: hello.limits,
    }
}

impl Device for ProcessDevice {
    fn identity(&self) -> Identity {
        self.identity.clone()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        if !matches!(self.phase, Phase::Idle | Phase::Loading | Phase::Loaded) {
            return Err(self.wrong("load"));
        }
        self.load += 1;
        self.samples = 0;
        self.phase = Phase::Loading;
        let limits = limits.capped_at(self.identity.limits);
        self.say(words::load(self.load, what, limits), at);
        match self.phase {
            Phase::Loading => Ok(()),
            _ => Err(self.wrong("load")),
        }
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        if self.phase != Phase::Loaded {
            return Err(self.wrong("start"));
        }
        self.phase = Phase::Starting;
        self.say(words::short("start", self.load), at);
        Ok(())
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        match self.phase {
            Phase::Starting | Phase::Playing => {
                self.phase = Phase::Stopping;
                self.say(words::short("stop", self.load), at);
                Ok(())
            }
            // on its way, or its end has been told
            Phase::Stopping | Phase::Idle | Phase::Lost { .. } => Ok(()),
            _ => Err(self.wrong("stop")),
        }
    }

    fn limp(&mut self, at: Duration) {
        self.say(words::short("limp", self.load), at);
        // what it still says of this load is not heard any more
        self.load += 1;
        if !matches!(self.phase, Phase::Lost { .. } | Phase::Opening { .. }) {
            self.phase = Phase::Idle;
        }
        self.reports
            .retain(|r| matches!(r, Report::Fault(_) | Report::Lost(_) | Report::Ready));
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        self.reopen(at);
        self.hear(at);
        if at.saturating_sub(self.told_alive) >= ALIVE {
            self.told_alive = at;
            self.say(words::short("alive", self.load), at);
        }
        std::mem::take(&mut self.reports)
    }
}
