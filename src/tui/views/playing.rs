//! The screen during playback: the prompt and the elapsed time.

use crate::tui::theme::Theme;
use crate::tui::widgets::{BIG_ROWS, bar, big, center, center_all, middle, row, rows, styled};
use crate::tui::{keys, wrap};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Block, BorderType, Widget};
use study_session::page::{Button, Interval, Kind, Page};

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
        let turns: Vec<&Button> = (page.buttons.iter())
            .filter(|b| b.does.turn().is_some())
            .collect();
        let turn_rows = u16::try_from(turns.len()).unwrap_or(0);
        let tall = match page.interval.is_some() {
            true => 16,
            false => 10 + turn_rows,
        };
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
        let columns = usize::from(area.width).max(1);
        let attend = wrap::paragraph(attend, columns, 2);
        let more = u16::try_from(attend.len()).unwrap_or(1).saturating_sub(1);
        // A second line goes above, so that nothing else moves.
        y = y.saturating_sub(more);
        center_all(buf, rows(area, y, more + 1), &attend, self.theme.strong());
        y += more;
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
        for (n, button) in (0..).zip(turns) {
            let text = format!("{}  {}", keys::of(button.does), button.label);
            let style = match button.enabled {
                true => self.theme.key(),
                false => self.theme.quiet(),
            };
            center(buf, row(area, y + 10 + n), &styled(text, style));
        }
    }
}
