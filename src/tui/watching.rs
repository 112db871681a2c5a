//! Lines that are drawn again and again until a key ends it.

use super::TuiError;
use super::keys::{self, Key};
use super::terminal::Terminal;
use super::widgets::left_all;
use crossterm::event::Event;
use ratatui::style::Style;
use std::time::Duration;

/// A terminal that shows lines.
pub struct Watching {
    terminal: Terminal,
}

impl Watching {
    /// Opens the terminal.
    ///
    /// # Errors
    /// [`TuiError`] if there is none or it cannot be used.
    pub fn open() -> Result<Self, TuiError> {
        Ok(Self {
            terminal: Terminal::open(false)?,
        })
    }

    /// Draws the lines for so many columns and rows, which must be safe to print, and waits for a key.
    /// True if one ends it (q, Esc, F10, Ctrl-C), or if the terminal is gone.
    pub fn leaves(
        &mut self,
        lines: impl FnOnce(usize, usize) -> Vec<String>,
        wait: Duration,
    ) -> bool {
        if self.terminal.take_signal().is_some() || self.terminal.check().is_err() {
            return true;
        }
        let drawn = self.terminal.draw(|frame| {
            let area = frame.area();
            let lines = lines(area.width.into(), area.height.into());
            left_all(frame.buffer_mut(), area, &lines, Style::new());
        });
        match self.terminal.event(wait) {
            Ok(Some((Event::Key(key), _))) => matches!(
                keys::read(&key),
                Some(Key::Esc | Key::Quit | Key::Char('q' | 'Q'))
            ),
            Ok(_) => drawn.is_err(),
            Err(_) => true,
        }
    }
}
