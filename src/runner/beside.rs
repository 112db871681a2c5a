//! A screen of the participant's own beside the experimenter's terminal, as one operator.

use super::{Operator, OperatorError};
use std::time::{Duration, Instant};
use study_session::outcome::Channel;
use study_session::session::{Input, View};

/// How long the terminal is asked before the other screen is.
const SLICE: Duration = Duration::from_millis(8);

/// A screen of the participant's own. It never waits.
pub trait Own {
    /// Shows a view.
    fn show(&mut self, view: &View);

    /// What was chosen on it. The view is the one that was shown last.
    fn inputs(&mut self, view: &View) -> Vec<Input>;

    /// What the experimenter has to know of it.
    fn notice(&self) -> Option<String>;
}

/// A terminal and a screen of the participant's own.
pub struct Beside {
    own: Box<dyn Own>,
    terminal: Box<dyn Operator>,
    /// Whether the last input was that of the participant's screen.
    by_own: bool,
}

impl Beside {
    /// Both give inputs, and both see every view.
    pub fn new(own: Box<dyn Own>, terminal: Box<dyn Operator>) -> Self {
        Self {
            own,
            terminal,
            by_own: false,
        }
    }
}

impl Operator for Beside {
    fn channel(&self) -> Option<Channel> {
        match self.by_own {
            true => Some(Channel::Page),
            false => self.terminal.channel(),
        }
    }

    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        let until = Instant::now() + timeout;
        self.own.show(view);
        let mut seen = view.clone();
        seen.notice = seen.notice.or_else(|| self.own.notice());
        loop {
            let inputs = self.own.inputs(view);
            self.by_own = !inputs.is_empty();
            if self.by_own {
                return Ok(inputs);
            }
            let left = until.saturating_duration_since(Instant::now());
            let inputs = self.terminal.next(&seen, left.min(SLICE))?;
            if !inputs.is_empty() || left.is_zero() {
                return Ok(inputs);
            }
        }
    }
}
