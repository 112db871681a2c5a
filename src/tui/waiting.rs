//! The page before a session that is shown while a child program starts.

use super::keys::{self, Key};
use super::terminal::Terminal;
use super::theme::Theme;
use super::views::prose::{Prose, ProseView};
use super::widgets::{center, hints, row, rows};
use super::{Options, TuiError};
use crate::tui::ui_state::Reading;
use crossterm::event::Event;
use ratatui::Frame;
use ratatui::widgets::Widget as _;
use std::time::Duration;

/// How long one check for a key takes.
const SLICE: Duration = Duration::from_millis(20);

/// A terminal that shows a waiting page.
pub struct Waiting {
    terminal: Terminal,
    theme: Theme,
}

impl Waiting {
    /// Opens the terminal.
    ///
    /// # Errors
    /// [`TuiError`] if there is none or it cannot be used.
    pub fn open(options: Options) -> Result<Self, TuiError> {
        Ok(Self {
            terminal: Terminal::open(false)?,
            theme: Theme::new(options.color),
        })
    }

    /// Shows that a program has not sent its hello yet. True if the user cancels or the
    /// terminal is gone.
    pub fn leaves(&mut self, program: &str, since: Duration, at_most: Duration) -> bool {
        if self.terminal.take_signal().is_some() || self.terminal.check().is_err() {
            return true;
        }
        let words = words(program, since, at_most);
        let theme = self.theme;
        let drawn = self.terminal.draw(|frame| draw(frame, &words, theme));
        match self.terminal.event(SLICE) {
            Ok(Some((Event::Key(key), _))) => matches!(
                keys::read(&key),
                Some(Key::Esc | Key::Quit | Key::Char('q' | 'Q'))
            ),
            Ok(_) => drawn.is_err(),
            Err(_) => true,
        }
    }
}

fn words(program: &str, since: Duration, at_most: Duration) -> Prose {
    Prose {
        title: "Waiting for the device.".to_owned(),
        body: format!(
            "`{program}` has not said hello yet: {} of at most {} s.",
            since.as_secs(),
            at_most.as_secs()
        ),
        ..Prose::default()
    }
}

fn draw(frame: &mut Frame<'_>, prose: &Prose, theme: Theme) {
    let area = frame.area();
    let view = ProseView {
        prose,
        reading: Reading::default(),
        theme,
    };
    let buf = frame.buffer_mut();
    view.render(rows(area, 1, area.height.saturating_sub(5)), buf);
    let keys = hints(theme, &[("Esc", "quit")], area.width);
    center(buf, row(area, area.height.saturating_sub(3)), &keys);
}
