//! A front of somebody else as the participant's screen: a program that is told the pages in lines
//! of JSON and replies in lines. docs/page.md specifies them.
//!
//! A front that ends, violates the specification or does not answer is lost: the device stops,
//! the experimenter is told, and the program is started again. Nothing waits for it.

use crate::runner::beside::Own;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};
use study_base::child::{ChildFailure, HELLO_TIMEOUT, RESTART_DELAY, Running, StartError};
use study_plan::protocol::phrases::Words;
use study_session::page::front::{Hello, Talk};
use study_session::session::{Input, View};

/// Most lines of a front at a time; as many wait in its queue only if it floods.
const MOST_LINES: usize = 256;
/// Time between two pings.
const PING: Duration = Duration::from_secs(1);
/// Time that a front has to answer one.
const SILENCE: Duration = Duration::from_secs(5);

/// Why a front cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FrontError {
    /// It cannot be started.
    #[error(transparent)]
    Start(#[from] StartError),
    /// It does not begin as specified.
    #[error("{0}")]
    Lost(String),
}

/// A front, connected by its standard streams.
#[derive(Debug)]
pub struct Front {
    command: Vec<String>,
    talk: Talk,
    phase: Phase,
    /// The ping that is not answered yet.
    unanswered: Option<Instant>,
    pinged: Instant,
    /// What the session has to be told.
    inputs: Vec<Input>,
    /// Why no front runs.
    lost: Option<String>,
}

#[derive(Debug)]
enum Phase {
    /// It was started then.
    Running(Running, Instant),
    /// It is being ended, which gives the reason.
    Ending(Receiver<String>),
    /// It is started again then.
    Lost(Instant),
    /// The session is over, and so is the front.
    Over,
}

impl Front {
    /// Starts a front and waits until it says who it is. `run` is a word that no other run has;
    /// `lang` and `words` are those of the study.
    ///
    /// # Errors
    /// [`FrontError`].
    pub fn open(
        command: Vec<String>,
        run: String,
        lang: Option<&str>,
        words: &Words,
    ) -> Result<Self, FrontError> {
        let mut child = Running::start(&command)?;
        let mut talk = Talk::new(run, lang, words);
        let first = match child.receive(HELLO_TIMEOUT) {
            Ok(Some(line)) => talk.hears(&line).map_err(|why| child.invalid(why)),
            Ok(None) => Err(ChildFailure::no_hello()),
            Err(failure) => Err(failure),
        };
        first.map_err(|failure| FrontError::Lost(child.end(&failure)))?;
        let now = Instant::now();
        Ok(Self {
            command,
            talk,
            phase: Phase::Running(child, now),
            unanswered: None,
            pinged: now,
            inputs: Vec::new(),
            lost: None,
        })
    }

    /// Who it is.
    pub fn hello(&self) -> Option<&Hello> {
        self.talk.hello()
    }

    /// Hears what it has sent and tells it what is new.
    fn exchange(&mut self) -> Result<(), ChildFailure> {
        let Phase::Running(child, since) = &mut self.phase else {
            return Ok(());
        };
        for line in 0.. {
            let Some(heard) = child.receive(Duration::ZERO)? else {
                break;
            };
            if line == MOST_LINES {
                return Err(ChildFailure::Violation("it sends too much".to_owned()));
            }
            self.unanswered = None;
            self.talk.hears(&heard).map_err(|why| child.invalid(why))?;
        }
        if !self.talk.is_open() {
            return match since.elapsed() > HELLO_TIMEOUT {
                true => Err(ChildFailure::no_hello()),
                false => Ok(()),
            };
        }
        self.lost = None;
        for line in self.talk.says() {
            child.send(line)?;
        }
        if self.unanswered.is_some_and(|ping| ping.elapsed() > SILENCE) {
            let why = format!("it has answered no ping for {} s", SILENCE.as_secs());
            return Err(ChildFailure::Violation(why));
        }
        if self.unanswered.is_none() && self.pinged.elapsed() > PING {
            child.send(Talk::ping())?;
            self.pinged = Instant::now();
            self.unanswered = Some(self.pinged);
        }
        Ok(())
    }

    /// Stops the device before all else, and ends the program meanwhile.
    fn lose(&mut self, failure: ChildFailure) {
        let over = self.talk.is_over();
        let (tell, reason) = sync_channel(1);
        let next = match over {
            true => Phase::Over,
            false => Phase::Ending(reason),
        };
        if let Phase::Running(mut child, _) = std::mem::replace(&mut self.phase, next) {
            std::thread::spawn(move || tell.send(child.end(&failure)));
        }
        // One that does not come back stops the device once.
        if self.talk.is_open() && !over {
            self.inputs.push(Input::Stop);
            self.lost = Some("the participant's front is lost".to_owned());
        }
        self.talk.begin_again();
        self.unanswered = None;
    }

    /// Starts a lost front again when it is due.
    fn restart(&mut self) {
        match &self.phase {
            Phase::Ending(reason) => {
                let Ok(reason) = reason.try_recv() else {
                    return;
                };
                self.is_lost(format!("the participant's front is lost: {reason}"));
            }
            Phase::Lost(due) if Instant::now() >= *due => match Running::start(&self.command) {
                Ok(child) => self.phase = Phase::Running(child, Instant::now()),
                Err(error) => self.is_lost(format!("the participant's front is lost: {error}")),
            },
            _ => {}
        }
    }

    fn is_lost(&mut self, why: String) {
        if self.lost.as_ref() != Some(&why) {
            self.inputs.push(Input::Notice(why.clone()));
        }
        self.lost = Some(why);
        self.phase = Phase::Lost(Instant::now() + RESTART_DELAY);
    }
}

impl Own for Front {
    fn show(&mut self, view: &View) {
        self.talk.show(view);
    }

    fn inputs(&mut self, view: &View) -> Vec<Input> {
        self.restart();
        if let Err(failure) = self.exchange() {
            self.lose(failure);
        }
        let mut inputs = std::mem::take(&mut self.inputs);
        inputs.extend(self.talk.input(view));
        inputs
    }

    fn notice(&self) -> Option<String> {
        self.lost.clone()
    }
}
