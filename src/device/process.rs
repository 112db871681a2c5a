//! A child program that plays: a lab keeps its own controller, in any language.
//!
//! It speaks JSON, one object a line, on its standard streams; `docs/devices.md`
//! is the description. Threads of their own read and write, so that nothing waits
//! for the child: a child that does not read, says something else than what is
//! described, says too much or ends is killed, and that is a lost device. A new one
//! is started after a second.
//!
//! The host cannot make limp what it cannot reach. It says `limp`, it says `alive`
//! as long as it polls, and it closes the child's input when it ends: the child has
//! to go limp at the first, without the second and at the third.

mod words;

use super::{Device, DeviceError, Identity, Report, Stimulus};
use crate::limits::Limits;
use crate::outcome::Playback;
use crate::text::Untrusted;
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use words::{Hello, Say};

pub use words::FORMAT;

/// Longest line of a child, bytes.
const MAX_LINE: u64 = 256 * 1024;
/// Lines that wait to be taken in, and to be read by the child.
const WAITING: usize = 256;
/// Lines that one poll takes in.
const A_POLL: usize = 2048;
/// Between two `alive`.
const ALIVE: Duration = Duration::from_millis(20);
/// How long a child may take from its start to its `hello`.
const HELLO_WITHIN: Duration = Duration::from_secs(10);
/// How long after a loss a new child is started.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// How long a child may take to end by itself once its input is closed.
const END_WITHIN: Duration = Duration::from_millis(300);
/// What is kept of the child's standard error, bytes.
const LAST_WORDS: usize = 1024;

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
    /// `command` is the program and its arguments; no shell is in between.
    ///
    /// # Errors
    /// [`DeviceError::Lost`] if it cannot be started or does not introduce itself.
    pub fn open(command: Vec<String>) -> Result<Self, DeviceError> {
        let child = Running::start(&command).map_err(DeviceError::Lost)?;
        let said = match child.lines.recv_timeout(HELLO_WITHIN) {
            Ok(said) => said,
            Err(RecvTimeoutError::Timeout) => Said::Gone(format!(
                "it has not said hello within {} s",
                HELLO_WITHIN.as_secs()
            )),
            Err(RecvTimeoutError::Disconnected) => Said::Gone("it has ended".to_owned()),
        };
        let mut child = child;
        let hello = child.understand(said).and_then(Say::hello);
        let hello = hello.map_err(|why| DeviceError::Lost(child.kill(&why)))?;
        Ok(Self {
            identity: identity(hello),
            command,
            child: Some(child),
            phase: Phase::Idle,
            load: 0,
            samples: 0,
            told_alive: Duration::ZERO,
            reports: Vec::new(),
        })
    }

    fn say(&mut self, words: String, at: Duration) {
        let said = match &self.child {
            Some(child) => child.words.try_send(words),
            None => return,
        };
        if said.is_err() {
            self.lose("it does not read what it is told", at);
        }
    }

    /// No child is better than one that is not understood.
    fn lose(&mut self, why: &str, at: Duration) {
        let why = match self.child.take() {
            Some(mut child) => child.kill(why),
            None => why.to_owned(),
        };
        if !matches!(self.phase, Phase::Lost { .. } | Phase::Opening { .. }) {
            self.reports.push(Report::Lost(why));
        }
        self.phase = Phase::Lost {
            again: at + AGAIN_AFTER,
        };
    }

    fn hear(&mut self, at: Duration) {
        for _ in 0..A_POLL {
            let Some(child) = &mut self.child else { return };
            let said = match child.lines.try_recv() {
                Ok(said) => said,
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => Said::Gone("it has ended".to_owned()),
            };
            let taken = child.understand(said).and_then(|say| self.take(say));
            if let Err(why) = taken {
                return self.lose(&why, at);
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
            Phase::Lost { again } if at >= again => {
                self.phase = match Running::start(&self.command) {
                    Ok(child) => {
                        self.child = Some(child);
                        Phase::Opening { since: at }
                    }
                    Err(_) => Phase::Lost {
                        again: at + AGAIN_AFTER,
                    },
                };
            }
            Phase::Opening { since } if at.saturating_sub(since) > HELLO_WITHIN => {
                self.lose("it has not said hello", at);
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

/// A child with the threads that read and write.
#[derive(Debug)]
struct Running {
    child: Child,
    lines: Receiver<Said>,
    /// Dropped to close the child's input.
    words: SyncSender<String>,
    last_words: Arc<Mutex<Vec<u8>>>,
    /// Lines so far.
    heard: u64,
}

#[derive(Debug)]
enum Said {
    Line(Vec<u8>),
    Gone(String),
}

impl Running {
    fn start(command: &[String]) -> Result<Self, String> {
        let (program, arguments) = command.split_first().ok_or("no program is named")?;
        let cannot = |e: std::io::Error| {
            format!(
                "the program `{}` cannot be started: {e}",
                Untrusted(program)
            )
        };
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(cannot)?;
        let (Some(mut input), Some(output), Some(mut errors)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err("the program has no standard streams".to_owned());
        };
        let (say, lines) = sync_channel(WAITING);
        std::thread::spawn(move || {
            let mut output = BufReader::new(output);
            loop {
                let said = next_line(&mut output);
                let over = matches!(said, Said::Gone(_));
                if say.send(said).is_err() || over {
                    return;
                }
            }
        });
        let (words, to_write) = sync_channel::<String>(WAITING);
        std::thread::spawn(move || {
            while let Ok(line) = to_write.recv() {
                // a child that has ended shows on its output
                if input.write_all(line.as_bytes()).is_err() || input.flush().is_err() {
                    return;
                }
            }
        });
        let last_words = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&last_words);
        std::thread::spawn(move || {
            let mut bytes = [0; 512];
            while let Ok(n @ 1..) = errors.read(&mut bytes) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&bytes[..n]);
                let excess = kept.len().saturating_sub(LAST_WORDS);
                kept.drain(..excess);
            }
        });
        Ok(Self {
            child,
            lines,
            words,
            last_words,
            heard: 0,
        })
    }

    fn understand(&mut self, said: Said) -> Result<Say, String> {
        let line = match said {
            Said::Line(line) => line,
            Said::Gone(why) => return Err(why),
        };
        self.heard += 1;
        words::read(&line).map_err(|why| format!("its line {} is wrong: {why}", self.heard))
    }

    /// Ends it; says why, with what it had to say itself.
    fn kill(&mut self, why: &str) -> String {
        // it may have ended by itself
        let _ = self.child.kill();
        let ended = self.child.wait();
        let mut text = why.to_owned();
        if let Ok(status) = ended
            && status.code().is_some()
        {
            text.push_str(&format!(" ({status})"));
        }
        let last = self
            .last_words
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let last = String::from_utf8_lossy(&last);
        if let Some(line) = last.lines().rev().find(|l| !l.trim().is_empty()) {
            text.push_str(&format!("; its last words: {}", words::short_text(line)));
        }
        text
    }
}

impl Drop for Running {
    /// Limp, then a moment to end by itself with its input closed, then none.
    fn drop(&mut self) {
        if self.child.try_wait().is_ok_and(|ended| ended.is_some()) {
            return;
        }
        let _ = self.words.try_send(words::short("limp", u64::MAX));
        let (closed, _) = sync_channel(0);
        self.words = closed;
        let slice = Duration::from_millis(5);
        for _ in 0..(END_WITHIN.as_millis() / slice.as_millis()) {
            if self.child.try_wait().is_ok_and(|ended| ended.is_some()) {
                return;
            }
            std::thread::sleep(slice);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn next_line(output: &mut impl std::io::BufRead) -> Said {
    let mut line = Vec::new();
    match output.take(MAX_LINE).read_until(b'\n', &mut line) {
        Err(e) => Said::Gone(format!("it cannot be read: {e}")),
        Ok(0) => Said::Gone("it has ended".to_owned()),
        Ok(_) if line.last() == Some(&b'\n') => Said::Line(line),
        Ok(n) if n as u64 == MAX_LINE => {
            Said::Gone(format!("a line is longer than {MAX_LINE} bytes"))
        }
        Ok(_) => Said::Gone("it has ended in the middle of a line".to_owned()),
    }
}
