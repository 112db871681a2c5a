//! Faults of the device or the disk: what happened, what it means, what to do.

use crate::tui::theme::Theme;
use crate::tui::widgets::{center, frame, left_all, middle, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Rect};
use ratatui::widgets::Widget;
use study_session::page::Page;

/// A framed message about a fault.
#[derive(Debug)]
pub struct Trouble<'a> {
    page: &'a Page,
    advice: &'a str,
    theme: Theme,
}

impl<'a> Trouble<'a> {
    /// The message of a page; `None` if it reports no fault.
    pub fn of(page: &'a Page, theme: Theme) -> Option<Self> {
        let advice = page.advice.as_deref()?;
        Some(Self {
            page,
            advice,
            theme,
        })
    }
}

impl Widget for &Trouble<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let wide = area.width.saturating_sub(8).min(72);
        let columns = usize::from(wide.saturating_sub(6)).max(1);
        let room = usize::from(area.height.saturating_sub(6) / 2).max(1);
        let what = wrap::paragraph(&self.page.text, columns, room);
        let then = wrap::paragraph(self.advice, columns, room.max(6));
        let what_rows = u16::try_from(what.len()).unwrap_or(1);
        let then_rows = u16::try_from(then.len()).unwrap_or(1);
        let place = middle(area, wide, what_rows + then_rows + 7);
        frame(buf, place, true, self.theme.trouble_frame());
        let inside = place.inner(Margin::new(3, 1));
        let title = styled(format!("  {}  ", self.page.title), self.theme.trouble());
        center(buf, row(inside, 1), &title);
        left_all(buf, rows(inside, 3, what_rows), &what, self.theme.strong());
        let then_area = rows(inside, 4 + what_rows, then_rows);
        left_all(buf, then_area, &then, self.theme.text());
    }
}
