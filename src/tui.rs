//! The terminal interface of a session.
//!
//! [`Tui`] shows a session's [`View`] and turns keys, clicks and pasted text into
//! its [`Input`]s. It knows neither device nor store, decides nothing about the study,
//! and shows nothing but the view and what was typed. It has two parts: the
//! [`Surface`], which has no side effects and holds everything that is shown and typed,
//! and the terminal, which [`Tui::open`] opens and which is restored on every way out:
//! drop, panic in any thread, signal, Ctrl-Z, a closed terminal.
//!
//! Untrusted text (protocol, comments, messages of a device) passes through
//! [`study_base::text::Untrusted`] in [`wrap`] before it reaches a cell.

pub mod desk;
pub mod editor;
pub mod keys;
pub mod pace;
pub mod surface;
mod terminal;
pub mod theme;
pub mod ui_state;
pub mod views;
pub mod waiting;
pub mod watching;
pub mod widgets;
pub mod wrap;

pub use surface::Surface;
pub use theme::ColorDepth;

use crate::runner::{Operator, OperatorError};
use crossterm::event::{Event, MouseEventKind};
use desk::Desk;
use pace::Pace;
use std::time::{Duration, Instant};
use study_session::outcome::Channel;
use study_session::session::{Input, Screen, View};
use terminal::Terminal;
pub(crate) use terminal::{Signals, survive_file_size_limit};

/// Options of the terminal interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Whether the mouse can choose. Selecting text in the terminal then needs Shift.
    pub mouse: bool,
    /// Whether the page shows that telemetry arrives.
    pub live: bool,
    /// The colors to use.
    pub color: ColorDepth,
    /// How many times as fast keys may follow each other: 1 except in tests.
    pub hurry: u32,
}

/// Why a terminal cannot be used for a session.
#[derive(Debug, thiserror::Error)]
pub enum TuiError {
    /// Input or output is a file or a pipe.
    #[error("a session needs a terminal, and standard input or output is not one")]
    NoTerminal,
    /// The terminal cannot position text.
    #[error("the terminal (TERM={0:?}) cannot show a page")]
    DumbTerminal(String),
    /// Another error of the terminal.
    #[error("the terminal cannot be used: {0}")]
    Terminal(#[source] std::io::Error),
}

impl TuiError {
    /// What the user can do.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NoTerminal => {
                "start it in a terminal window, or use --plain to read and write lines; \
                 `study rehearse` needs no terminal"
            }
            Self::DumbTerminal(_) => {
                "use a terminal such as xterm, or set TERM to its actual type, or use \
                 --plain; `study rehearse` needs no terminal"
            }
            Self::Terminal(_) => "try another terminal window",
        }
    }
}

/// How often the terminal is checked while nothing happens.
const SLICE: Duration = Duration::from_millis(50);
/// How long Ctrl-Z waits for the device to stop before the program stops.
const SUSPEND_WAIT: Duration = Duration::from_secs(2);

/// An [`Operator`] at a terminal.
pub struct Tui {
    terminal: Terminal,
    surface: Surface,
    /// The last page, and whether it did not offer Enter.
    drawn: Option<(View, bool)>,
    pace: Pace,
    suspend_since: Option<Instant>,
}

impl Tui {
    /// Opens the terminal.
    ///
    /// # Errors
    /// [`TuiError`] if there is none or it cannot be used.
    pub fn open(options: Options) -> Result<Self, TuiError> {
        Ok(Self {
            terminal: Terminal::open(options.mouse)?,
            surface: Surface::new(options.color).with_live(options.live),
            drawn: None,
            pace: Pace::new(Instant::now()).hurried(options.hurry),
            suspend_since: None,
        })
    }

    /// The same as the experimenter's desk, beside a page of the participant's own.
    #[must_use]
    pub fn with_desk(mut self, desk: Desk) -> Self {
        self.surface = self.surface.with_desk(desk);
        self
    }

    /// Draws the view if anything visible has changed.
    fn draw(&mut self, view: &View) -> Result<(), OperatorError> {
        let surface = &mut self.surface;
        let turns = surface.turns(view);
        let waits = turns || self.pace.waits(Instant::now());
        let now = (as_shown(view), waits);
        if self.drawn.as_ref() == Some(&now) {
            return Ok(());
        }
        surface.set_waits(waits);
        let drawn = self.terminal.draw(|frame| {
            let area = frame.area();
            surface.follow(view, area);
            if let Some(at) = surface.draw(view, area, frame.buffer_mut()) {
                frame.set_cursor_position(at);
            }
        });
        drawn?;
        if turns {
            let of_lines = matches!(view.screen, Screen::Who { .. });
            self.pace.turned(Instant::now(), of_lines);
        }
        self.terminal.allow_paste(!view.armed);
        self.drawn = Some(now);
        Ok(())
    }

    /// Goes to the background once the device has stopped.
    fn suspend_if_asked(&mut self, view: &View) -> Result<(), OperatorError> {
        if self.surface.take_suspend() {
            self.suspend_since = Some(Instant::now());
        }
        let Some(since) = self.suspend_since else {
            return Ok(());
        };
        if view.armed && since.elapsed() < SUSPEND_WAIT {
            return Ok(());
        }
        self.suspend_since = None;
        self.drawn = None;
        Ok(self.terminal.suspend()?)
    }
}

impl Operator for Tui {
    fn channel(&self) -> Option<Channel> {
        Some(Channel::Terminal)
    }

    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        let until = Instant::now() + timeout;
        let translated = self.surface.translated(view);
        let view = &*translated;
        self.suspend_if_asked(view)?;
        loop {
            if let Some(signal) = self.terminal.take_signal() {
                return Ok(vec![Input::Abort(format!("the program received {signal}"))]);
            }
            if self.terminal.check()? {
                self.drawn = None;
            }
            self.draw(view)?;
            let left = until.saturating_duration_since(Instant::now());
            match self.terminal.event(left.min(SLICE))? {
                Some((Event::Mouse(mouse), _)) if mouse.kind == MouseEventKind::Moved => {}
                Some((event, at)) => {
                    // A click on a hint counts like its key, and is as quickly repeated.
                    let event = self.surface.as_key(&event, view).unwrap_or(event);
                    let dialog = self.surface.state().dialog().is_some();
                    if !self.pace.accepts(&event, at, dialog, view.armed) {
                        continue;
                    }
                    self.drawn = None;
                    let inputs = self.surface.event(&event, view);
                    if !inputs.is_empty() {
                        return Ok(inputs);
                    }
                }
                None if left.is_zero() => return Ok(Vec::new()),
                None => {}
            }
        }
    }
}

/// The view with its times rounded as they are drawn, so that equal pages are not
/// drawn again.
fn as_shown(view: &View) -> View {
    let mut view = view.clone();
    view.line.elapsed_s = view.line.elapsed_s.floor();
    match &mut view.screen {
        Screen::Playing {
            since_s, exposure, ..
        } => {
            // A bar moves with it.
            let steps = match exposure.min_s > 0.0 || exposure.max_s.is_some() {
                true => 10.0,
                false => 1.0,
            };
            *since_s = (*since_s * steps).floor() / steps;
        }
        Screen::Paused { since_s } => *since_s = since_s.floor(),
        Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } => {
            *wait_s = wait_s.ceil();
        }
        _ => {}
    }
    view
}
