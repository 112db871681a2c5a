//! A session in plain lines, for screen readers, dumb terminals and pipes.
//!
//! [`Plain`] is an operator like [`crate::tui::Tui`]: it shows the same [`View`] and gives
//! the same inputs, so that the journal is the same. It only appends lines: nothing is
//! drawn over, and it prints no control character. [`pages`] puts a view into words,
//! [`dialogue`] interprets what is typed, `input` reads it.

pub mod answers;
pub mod dialogue;
mod input;
pub mod pages;

use crate::runner::{Operator, OperatorError};
use crate::tui::TuiError;
use dialogue::Dialogue;
use input::{Lines, Typed};
use std::io::{self, Write};
use std::time::{Duration, Instant};
use study_session::outcome::Channel;
use study_session::session::{Input, View};

/// A line that ends within this time after a new page is held, repeated or pasted.
const UNREAD: Duration = Duration::from_millis(300);
/// How long Ctrl-Z waits for the device to stop before the program stops.
const SUSPEND_WAIT: Duration = Duration::from_secs(2);

/// An [`Operator`] that reads and writes lines.
pub struct Plain {
    dialogue: Dialogue,
    input: Lines,
    /// When the last page was printed.
    said: Instant,
    /// How long after that an Enter is not yet meant for it.
    unread: Duration,
    /// Whether the begin of a line was forgotten with the page before: the Enter that ends the
    /// line means nothing.
    cut: bool,
    suspend_since: Option<Instant>,
}

impl Plain {
    /// Takes standard input and output.
    ///
    /// # Errors
    /// [`TuiError`] if they cannot be read or signals cannot be caught.
    /// `hurry` is how many times as fast lines may follow each other: 1 except in tests.
    pub fn open(live: bool, hurry: u32) -> Result<Self, TuiError> {
        let input = Lines::open().map_err(TuiError::Terminal)?;
        Ok(Self {
            dialogue: Dialogue::new(input.has_keys(), live),
            input,
            said: Instant::now(),
            unread: UNREAD / hurry.max(1),
            cut: false,
            suspend_since: None,
        })
    }

    fn say(&mut self, lines: &[String]) -> Result<(), OperatorError> {
        let mut out = io::stdout().lock();
        let written = lines
            .iter()
            .try_for_each(|line| writeln!(out, "{line}"))
            .and_then(|()| out.flush());
        written.map_err(|e| OperatorError(format!("the output cannot be written: {e}")))
    }

    /// What was typed, in the order of its arrival, as inputs.
    fn typed(&mut self, typed: Typed, view: &View) -> Result<Vec<Input>, OperatorError> {
        let line = match typed {
            Typed::Stop => return Ok(vec![Input::Stop]),
            Typed::Line(line) => line,
        };
        let unread = self.input.has_keys() && self.said.elapsed() < self.unread;
        let cut = std::mem::take(&mut self.cut) && line.trim().is_empty();
        if cut || (unread && !line.starts_with('/')) {
            if cut || !line.trim().is_empty() {
                self.dialogue.repeat();
            }
            return Ok(Vec::new());
        }
        let (inputs, lines) = self.dialogue.line(&line, view);
        self.say(&lines)?;
        Ok(inputs)
    }

    /// Stops the program, as Ctrl-Z asks, once the device has stopped.
    fn suspend_if_asked(&mut self, view: &View) -> Result<Option<Input>, OperatorError> {
        if self.input.take_suspend() {
            self.suspend_since = Some(Instant::now());
            return Ok(Some(Input::Pause));
        }
        match self.suspend_since {
            Some(since) if !view.armed || since.elapsed() >= SUSPEND_WAIT => {
                self.suspend_since = None;
                let stopped = self.input.suspend();
                stopped
                    .map_err(|e| OperatorError(format!("the program cannot be suspended: {e}")))?;
                self.dialogue.repeat();
            }
            _ => {}
        }
        Ok(None)
    }
}

impl Operator for Plain {
    fn channel(&self) -> Option<Channel> {
        Some(Channel::Plain)
    }

    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        if let Some(signal) = self.input.take_signal() {
            return Ok(vec![Input::Abort(format!("the program received {signal}"))]);
        }
        if let Some(pause) = self.suspend_if_asked(view)? {
            return Ok(vec![pause]);
        }
        let said = self.dialogue.follow(view);
        if said.new_page {
            // What was typed before a page was printed is not meant for it.
            self.cut |= self.input.forget();
            self.said = Instant::now();
        }
        self.say(&said.lines)?;
        self.input.single_keys(view.armed).map_err(unusable)?;
        match self.input.next(timeout).map_err(unusable)? {
            Some(typed) => self.typed(typed, view),
            None => Ok(Vec::new()),
        }
    }
}

fn unusable(error: io::Error) -> OperatorError {
    OperatorError(match error.kind() {
        io::ErrorKind::UnexpectedEof => "the input has ended".to_owned(),
        _ => format!("the input cannot be read: {error}"),
    })
}
