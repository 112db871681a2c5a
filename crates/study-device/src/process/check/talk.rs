//! A conversation with a program, message by message.

use super::{QUIET, ZERO_N};
use crate::process::error::MessageError;
use crate::process::hello::Told;
use crate::process::messages::{self, ChildMessage, SampleRow};
use crate::{DeviceError, Stimulus};
use std::time::{Duration, Instant};
use study_base::child::{ChildFailure, HELLO_TIMEOUT, Running};
use study_base::limits::Limits;
use study_base::text::Untrusted;
use study_haptics::model::Realization;
use study_session::outcome::Sample;

/// Time for an answer to `load` and `start`.
const ANSWER: Duration = Duration::from_secs(5);
/// For how long something is awaited that comes too late.
const LATEST: Duration = Duration::from_secs(3);
/// Time between two `alive`.
const ALIVE_INTERVAL: Duration = Duration::from_millis(20);
/// Time between two looks at the messages.
const POLL: Duration = Duration::from_millis(2);

/// Why a clause is not passed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failed {
    /// The program does not do what is required.
    #[error("{0}")]
    Wrong(String),
    /// It does it too late, which a busy computer may have caused.
    #[error("{0}")]
    Late(String),
    /// Nothing can be said.
    #[error("not judged: {0}")]
    NotJudged(String),
}

/// A program, and what it has sent in a test.
pub(super) struct Talk {
    command: Vec<String>,
    /// `None` after its end.
    child: Option<Running>,
    pub(super) told: Told,
    load: u64,
    /// Whether `alive` is sent.
    is_alive: bool,
    alive_at: Instant,
    /// Samples of the current load.
    samples: Vec<Sample>,
    started: bool,
    /// It could not be started again.
    gone: bool,
}

impl Talk {
    pub(super) fn open(command: &[String]) -> Result<Self, DeviceError> {
        let (child, told) = begin(command).map_err(DeviceError::Lost)?;
        Ok(Self {
            command: command.to_vec(),
            child: Some(child),
            told,
            load: 0,
            is_alive: false,
            alive_at: Instant::now(),
            samples: Vec::new(),
            started: false,
            gone: false,
        })
    }

    /// Whether no further test is possible.
    pub(super) fn is_gone(&self) -> bool {
        self.gone
    }

    /// A program without force, started again if it has ended.
    pub(super) fn reset(&mut self) -> Result<(), Failed> {
        if self.child.is_some() && self.load > 0 {
            self.is_alive = true;
            // Whatever it answers; the clauses judge that.
            let _ = self.free(LATEST);
        }
        if self.child.is_none() {
            match begin(&self.command) {
                Ok((child, told)) => (self.child, self.told) = (Some(child), told),
                Err(why) => {
                    self.gone = true;
                    return Err(Failed::Wrong(why));
                }
            }
        }
        Ok(())
    }

    fn write(&mut self, line: String) -> Result<(), Failed> {
        let child = self.child.as_mut().ok_or_else(ended)?;
        child.send(line).map_err(|failure| self.lose(&failure))
    }

    /// The program has ended, or is ended.
    fn lose(&mut self, failure: &ChildFailure) -> Failed {
        match self.child.take() {
            Some(mut child) => Failed::Wrong(child.end(failure)),
            None => ended(),
        }
    }

    /// Sends a command about the current load.
    pub(super) fn say(&mut self, command: &str) -> Result<(), Failed> {
        self.write(messages::command(command, self.load))
    }

    /// The next message about the current load, within a short time.
    fn next(&mut self) -> Result<Option<ChildMessage>, Failed> {
        if self.is_alive && self.alive_at.elapsed() >= ALIVE_INTERVAL {
            self.alive_at = Instant::now();
            self.say("alive")?;
        }
        let child = self.child.as_mut().ok_or_else(ended)?;
        let line = match child.receive(POLL) {
            Ok(None) => return Ok(None),
            Ok(Some(line)) => line,
            Err(failure) => return Err(self.lose(&failure)),
        };
        let message = match messages::read(&line) {
            Ok(message) => message,
            Err(why) => {
                let failure = child.invalid(why);
                return Err(self.lose(&failure));
            }
        };
        if matches!(message, ChildMessage::Hello(_)) {
            return Err(self.lose(&ChildFailure::Violation("it sends hello twice".to_owned())));
        }
        if message.load().is_some_and(|load| load != self.load) {
            return Ok(None);
        }
        match message {
            ChildMessage::Samples { samples, .. } => {
                self.samples.extend(samples.into_iter().map(Sample::from));
                Ok(None)
            }
            ChildMessage::Progress { .. } => Ok(None),
            ChildMessage::Started { .. } => {
                self.started = true;
                Ok(Some(message))
            }
            message => Ok(Some(message)),
        }
    }

    /// Waits for a message, and how long it took; others on the way are skipped, except a fault.
    fn await_message<T>(
        &mut self,
        name: &str,
        wait: Duration,
        mut want: impl FnMut(&ChildMessage) -> Option<T>,
    ) -> Result<(T, Duration), Failed> {
        let since = Instant::now();
        while since.elapsed() < wait {
            let Some(message) = self.next()? else {
                continue;
            };
            if let Some(found) = want(&message) {
                return Ok((found, since.elapsed()));
            }
            if let ChildMessage::Fault { what } | ChildMessage::Refused { why: what, .. } = message
            {
                return Err(Failed::NotJudged(format!(
                    "instead of `{name}` it says: {}",
                    Untrusted(&what)
                )));
            }
        }
        // One that does not play cannot be tested further.
        self.gone |= ["loaded", "started"].contains(&name);
        Err(Failed::Wrong(format!(
            "no `{name}` within {:.1} s",
            wait.as_secs_f64()
        )))
    }

    fn send_load(&mut self, table: &Realization, force_n: f64) -> Result<(), Failed> {
        let limits = Limits::new(force_n, 1000.0).map_err(|e| Failed::NotJudged(e.to_string()))?;
        self.load += 1;
        self.samples.clear();
        self.started = false;
        let limits = limits.capped_at(self.told.identity.limits);
        self.write(messages::load(
            self.load,
            &Stimulus::of_table(table),
            limits,
        ))
    }

    /// Sends a table, without waiting for the answer.
    pub(super) fn load(&mut self, table: &Realization, force_n: f64) -> Result<(), Failed> {
        self.send_load(table, force_n)
    }

    /// Sends a table that has to be refused: the reason, or `None` if it is loaded.
    pub(super) fn refusal(
        &mut self,
        table: &Realization,
        force_n: f64,
    ) -> Result<Option<String>, Failed> {
        self.send_load(table, force_n)?;
        let answer = |m: &ChildMessage| match m {
            ChildMessage::Loaded { .. } => Some(None),
            ChildMessage::Refused { why, .. } => Some(Some(Untrusted(why).to_string())),
            _ => None,
        };
        Ok(self.await_message("refused", ANSWER, answer)?.0)
    }

    /// Loads a table and starts it.
    pub(super) fn play(&mut self, table: &Realization, force_n: f64) -> Result<(), Failed> {
        self.send_load(table, force_n)?;
        self.is_alive = true;
        let loaded = |m: &ChildMessage| matches!(m, ChildMessage::Loaded { .. }).then_some(());
        self.await_message("loaded", ANSWER, loaded)?;
        self.say("start")?;
        let started = |m: &ChildMessage| matches!(m, ChildMessage::Started { .. }).then_some(());
        self.await_message("started", ANSWER, started)?;
        Ok(())
    }

    /// Whether it has said so since the last call of [`Talk::free`].
    pub(super) fn started(&self) -> bool {
        self.started
    }

    /// The samples that come in a time.
    pub(super) fn samples_for(&mut self, time: Duration) -> Result<Vec<Sample>, Failed> {
        self.samples.clear();
        let since = Instant::now();
        while since.elapsed() < time {
            if let Some(ChildMessage::Fault { what }) = self.next()? {
                // A hand that leaves the range is no fault of the program.
                let what = Untrusted(&what);
                return Err(Failed::NotJudged(format!("it says: {what}")));
            }
        }
        Ok(self.samples.clone())
    }

    /// Stops: how long the playback lasted by the outcome, s, and how long that took.
    pub(super) fn stop(&mut self, wait: Duration) -> Result<(f64, Duration), Failed> {
        self.say("stop")?;
        let outcome = |m: &ChildMessage| match m {
            ChildMessage::Outcome { outcome, .. } => outcome
                .playback
                .as_ref()
                .map(|playback| playback.duration_s),
            _ => None,
        };
        let answer = self.await_message("outcome", LATEST.max(wait), outcome)?;
        in_time("outcome", answer.1, wait)?;
        Ok(answer)
    }

    /// Switches the force off and waits for the confirmation of version 2. The messages of the
    /// load that follow still count.
    pub(super) fn free(&mut self, wait: Duration) -> Result<String, Failed> {
        self.say(self.told.free())?;
        if self.told.is_version_1 {
            self.samples_for(QUIET)?;
            self.started = false;
            return Ok("version 1 does not confirm it".to_owned());
        }
        let (sample, took) = self.confirmed(wait)?;
        self.started = false;
        in_time("free", took, wait)?;
        self.limp(sample)?;
        Ok(format!("after {:.0} ms", 1e3 * took.as_secs_f64()))
    }

    /// Waits for the confirmation of `free`: its sample, and how long it took.
    fn confirmed(&mut self, wait: Duration) -> Result<(Option<Sample>, Duration), Failed> {
        let free = |m: &ChildMessage| match m {
            ChildMessage::Free { sample, .. } => Some(sample.as_ref().map(sample_of)),
            _ => None,
        };
        self.await_message("free", LATEST.max(wait), free)
    }

    /// How long a program without a load takes to confirm `free`.
    pub(super) fn trip(&mut self) -> Result<Duration, Failed> {
        self.say(self.told.free())?;
        Ok(self.confirmed(LATEST)?.1)
    }

    /// Whether the sample after the end of the force has none.
    fn limp(&self, sample: Option<Sample>) -> Result<(), Failed> {
        match sample {
            None if self.told.identity.telemetry => {
                Err(Failed::Wrong("`free` has no sample".to_owned()))
            }
            Some(s) if s.force_command_n.abs() > ZERO_N => Err(Failed::Wrong(format!(
                "the sample of `free` has {:.2} N",
                s.force_command_n
            ))),
            _ => Ok(()),
        }
    }

    /// Sends no more `alive` until the program says that it is limp: how long that took after the
    /// last one. It has also done so if it has ended, or with version 1 if its samples do.
    pub(super) fn silence(&mut self, wait: Duration) -> Result<Duration, Failed> {
        self.alive_at = Instant::now();
        self.say("alive")?;
        self.is_alive = false;
        let since = Instant::now();
        let mut forceful = since;
        let mut seen = self.samples.len();
        let took = loop {
            match self.next() {
                Ok(Some(ChildMessage::Fault { .. })) => break since.elapsed(),
                Ok(_) => {}
                Err(_) if self.child.is_none() => break since.elapsed(),
                Err(failed) => return Err(failed),
            }
            let new = self.samples.get(seen..).unwrap_or_default();
            if new.iter().any(|s| s.force_command_n.abs() > ZERO_N) {
                forceful = Instant::now();
            }
            seen = self.samples.len();
            if since.elapsed() > LATEST {
                if self.told.is_version_1 && since.elapsed() - (forceful - since) > 2 * QUIET {
                    break forceful - since;
                }
                self.is_alive = true;
                let playing = forceful - since > wait;
                return Err(Failed::Wrong(match playing {
                    true => format!("it plays on for {:.1} s", LATEST.as_secs_f64()),
                    false => "it does not say that it is limp (`fault`)".to_owned(),
                }));
            }
        };
        if self.child.is_none() {
            self.reset()?;
        }
        self.is_alive = true;
        in_time("fault", took, wait)?;
        Ok(took)
    }

    /// Closes the input of the program, which has to be limp then and to end by itself.
    pub(super) fn end_of_input(&mut self, wait: Duration) -> Result<String, Failed> {
        let mut child = self.child.take().ok_or_else(ended)?;
        child.close_input();
        let since = Instant::now();
        let mut freed = None;
        let mut forceful = false;
        let ended = loop {
            match child.receive(POLL) {
                Ok(None) if since.elapsed() > LATEST => break None,
                Ok(None) => {}
                Ok(Some(line)) => match messages::read(&line) {
                    Ok(ChildMessage::Free { sample, .. }) => {
                        freed = Some(sample.as_ref().map(sample_of));
                    }
                    Ok(ChildMessage::Samples { samples, .. }) if freed.is_some() => {
                        let mut samples = samples.into_iter().map(Sample::from);
                        forceful |= samples.any(|s| s.force_command_n.abs() > ZERO_N);
                    }
                    Ok(_) => {}
                    Err(why) => return Err(Failed::Wrong(why.to_string())),
                },
                Err(_) => break child.wait_for_exit(LATEST),
            }
        };
        let took = since.elapsed();
        let Some(status) = ended else {
            return Err(Failed::Wrong(format!(
                "it runs on for {:.0} s",
                LATEST.as_secs_f64()
            )));
        };
        if !status.success() {
            return Err(Failed::Wrong(format!("it ends with {status}")));
        }
        if forceful {
            return Err(Failed::Wrong(
                "samples with a force after `free`".to_owned(),
            ));
        }
        match freed {
            None if !self.told.is_version_1 => {
                return Err(Failed::Wrong("it ends without `free`".to_owned()));
            }
            Some(sample) => self.limp(sample)?,
            None => {}
        }
        in_time("end", took, wait)?;
        Ok(format!("after {:.0} ms", 1e3 * took.as_secs_f64()))
    }
}

fn ended() -> Failed {
    Failed::Wrong("the program has ended".to_owned())
}

fn in_time(what: &str, took: Duration, allowed: Duration) -> Result<(), Failed> {
    let [took_ms, allowed_ms] = [took, allowed].map(|t| 1e3 * t.as_secs_f64());
    match took > allowed {
        true => Err(Failed::Late(format!(
            "`{what}` comes after {took_ms:.0} ms of {allowed_ms:.0} ms"
        ))),
        false => Ok(()),
    }
}

fn sample_of(row: &SampleRow) -> Sample {
    row.clone().into()
}

/// Starts a program and reads its `hello`.
fn begin(command: &[String]) -> Result<(Running, Told), String> {
    let mut child = Running::start(command).map_err(|e| e.to_string())?;
    let hello = match child.receive(HELLO_TIMEOUT) {
        Ok(None) => Err(ChildFailure::no_hello()),
        Err(failure) => Err(failure),
        Ok(Some(line)) => messages::read(&line)
            .and_then(ChildMessage::hello)
            .map_err(|why: MessageError| child.invalid(why)),
    };
    match hello {
        Ok(told) => Ok((child, told)),
        Err(failure) => Err(child.end(&failure)),
    }
}
