//! Faults of the device or the disk: what happened, what it means, what to do.

use super::dialogs::unsaved_lines;
use crate::tui::theme::Theme;
use crate::tui::widgets::{centre, frame, left_all, middle, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Rect};
use ratatui::widgets::Widget;
use study_core::protocol::DeviceKind;
use study_core::session::{Screen, View};

/// Columns for the name of something that is not saved.
const NAME: usize = 40;

/// A framed message about a fault.
#[derive(Debug)]
pub struct Trouble<'a> {
    title: &'static str,
    what: &'a str,
    then: String,
    theme: Theme,
}

impl<'a> Trouble<'a> {
    /// The message for a view; `None` if its screen reports no fault.
    pub fn new(view: &'a View, theme: Theme) -> Option<Self> {
        let (title, what, then) = match &view.screen {
            Screen::DeviceTrouble { what, can_go_on } => (
                "DEVICE TROUBLE",
                what,
                (if *can_go_on {
                    "The device produces no force. Check the device, then press Enter: an \
                     interrupted trial is repeated later. No answer is lost."
                } else if view.device == DeviceKind::Process {
                    "Let go of the device: the state of its motor is unknown while its \
                     program does not run. The program is restarted every second, and the \
                     session continues when it answers. If it never does, start it by hand \
                     to see why. F10 quits: the session can be resumed later, and no answer \
                     is lost."
                } else {
                    "The device should produce no force: use its emergency switch if it does. Check \
                     its power and its cable; the session continues when it answers again. F10 quits: the session can \
                     be resumed later, and no answer is lost."
                })
                .to_owned(),
            ),
            Screen::SaveTrouble { what } => (
                "NOT SAVED",
                what,
                format!(
                    "In memory only: {}. Do not close this window. Free space on the disk or \
                     reconnect it, then press Enter to try again.",
                    unsaved_lines(&view.unsaved, 4, NAME).join("; ")
                ),
            ),
            _ => return None,
        };
        Some(Self {
            title,
            what,
            then,
            theme,
        })
    }

    /// Title, message, and what to do.
    pub fn words(&self) -> (&str, &str, &str) {
        (self.title, self.what, &self.then)
    }
}

impl Widget for &Trouble<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let wide = area.width.saturating_sub(8).min(72);
        let columns = usize::from(wide.saturating_sub(6)).max(1);
        let room = usize::from(area.height.saturating_sub(6) / 2).max(1);
        let what = wrap::paragraph(self.what, columns, room);
        let then = wrap::paragraph(&self.then, columns, room.max(6));
        let what_rows = u16::try_from(what.len()).unwrap_or(1);
        let then_rows = u16::try_from(then.len()).unwrap_or(1);
        let place = middle(area, wide, what_rows + then_rows + 7);
        frame(buf, place, true, self.theme.trouble_frame());
        let inside = place.inner(Margin::new(3, 1));
        let title = styled(format!("  {}  ", self.title), self.theme.trouble());
        centre(buf, row(inside, 1), &title);
        left_all(buf, rows(inside, 3, what_rows), &what, self.theme.strong());
        let then_area = rows(inside, 4 + what_rows, then_rows);
        left_all(buf, then_area, &then, self.theme.text());
    }
}
