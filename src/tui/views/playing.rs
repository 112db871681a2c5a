//! The screen during playback: the prompt and the elapsed time.

use crate::tui::theme::Theme;
use crate::tui::widgets::{BIG_ROWS, bar, big, center, middle, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Widget};
use study_session::page::{Interval, Kind, Page};

/// The screen while the device plays, or loads one of several intervals.
#[derive(Debug)]
pub struct Playing<'a> {
    page: &'a Page,
    theme: Theme,
}

impl<'a> Playing<'a> {
    /// The screen, if it is one of these.
    pub fn of(page: &'a Page, theme: Theme) -> Option<Self> {
        let loads = page.kind == Kind::Loading && page.interval.is_some();
        (loads || page.kind == Kind::Playing).then_some(Self { page, theme })
    }

    /// Which interval it is, large: in a box of its own.
    fn interval(&self, area: Rect, interval: &Interval, buf: &mut Buffer) {
        let word = interval.name.to_uppercase();
        let block = Block::bordered()
            .border_type(BorderType::Thick)
            .border_style(self.theme.strong());
        let columns = u16::try_from(wrap::width(&word)).unwrap_or(0);
        let place = middle(area, columns.saturating_add(16).max(28), 5);
        block.render(place, buf);
        center(buf, row(place, 2), &styled(word, self.theme.strong()));
    }
}

impl Widget for &Playing<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let page = self.page;
        // A constant height, so that nothing moves while it plays.
        let tall = if page.interval.is_some() { 16 } else { 10 };
        let mut y = area.height.saturating_sub(tall) / 2;
        let mut attend = &page.title;
        if let Some(interval) = &page.interval {
            self.interval(rows(area, y, 5), interval, buf);
            y += 6;
            attend = &page.text;
        }
        let Some(playback) = &page.playback else {
            return center(buf, row(area, y), &styled(attend, self.theme.text()));
        };
        let title = Span::styled(attend, self.theme.strong());
        center(buf, row(area, y), &Line::from(title));
        let mut playing = format!("●  {}", playback.state);
        if let Some(left) = &playback.left {
            playing.push_str(&format!("  ·  {left}"));
        }
        let playing = styled(playing, self.theme.playing());
        center(buf, row(area, y + 2), &playing);
        let time = rows(area, y + 4, BIG_ROWS);
        big(buf, time, &playback.time, self.theme.strong());
        if let Some(part) = playback.part {
            let place = middle(row(area, y + 8), 40, 1);
            bar(buf, place, part, page.scales == "rtl", self.theme);
        }
        if let Some(more) = &page.wait {
            center(buf, row(area, y + 9), &styled(more, self.theme.text()));
        }
    }
}
