//! The screen during playback: the prompt and the elapsed time.

use super::prose::attending;
use crate::tui::theme::Theme;
use crate::tui::widgets::{BIG_ROWS, bar, big, centre, clock, middle, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Widget};
use study_core::protocol::phrases::Phrase;
use study_core::protocol::{DeviceKind, Exposure};
use study_core::session::{Screen, View};

/// The screen while the device plays, or loads one of several intervals.
#[derive(Debug)]
pub struct Playing<'a> {
    view: &'a View,
    /// Time since the confirmed start, s; `None` before it.
    since_s: Option<f64>,
    /// Whether more exploration is required.
    keep_exploring: bool,
    exposure: Exposure,
    /// The interval, from 1, and their number, if there are several.
    interval: Option<(u32, u32)>,
    theme: Theme,
}

impl<'a> Playing<'a> {
    /// The screen, if it is one of these.
    pub fn of(view: &'a View, theme: Theme) -> Option<Self> {
        let (since_s, keep_exploring, exposure, interval) = match &view.screen {
            Screen::Playing {
                since_s,
                keep_exploring,
                exposure,
                interval,
            } => (Some(*since_s), *keep_exploring, *exposure, *interval),
            Screen::Loading {
                interval: Some(interval),
            } => (None, false, Exposure::default(), Some(*interval)),
            _ => return None,
        };
        Some(Self {
            view,
            since_s,
            keep_exploring,
            exposure,
            interval,
            theme,
        })
    }

    /// Which interval it is, large: in a box of its own.
    fn interval(&self, area: Rect, at: u32, buf: &mut Buffer) {
        let word = self.view.interval_name(at).to_uppercase();
        let block = Block::bordered()
            .border_type(BorderType::Thick)
            .border_style(self.theme.strong());
        let columns = u16::try_from(wrap::width(&word)).unwrap_or(0);
        let place = middle(area, columns.saturating_add(16).max(28), 5);
        block.render(place, buf);
        centre(buf, row(place, 2), &styled(word, self.theme.strong()));
    }
}

impl Playing<'_> {
    /// The part of the exposure that is over, and which: until Enter works, or until the
    /// device stops by itself.
    fn part(&self, since_s: f64) -> Option<f64> {
        let Exposure { min_s, max_s, .. } = self.exposure;
        match max_s {
            Some(max_s) => Some(since_s / max_s),
            None => (min_s > 0.0).then_some(since_s / min_s),
        }
    }
}

impl Widget for &Playing<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let words = &self.view.words;
        let by_hand = self.view.device == DeviceKind::Manual;
        // A constant height, so that nothing moves while it plays.
        let tall = if self.interval.is_some() { 16 } else { 10 };
        let mut y = area.height.saturating_sub(tall) / 2;
        if let Some((at, _)) = self.interval {
            self.interval(rows(area, y, 5), at, buf);
            y += 6;
        }
        let Some(since_s) = self.since_s else {
            let wait = styled(words.get(Phrase::OneMoment), self.theme.text());
            return centre(buf, row(area, y), &wait);
        };
        let (what, more) = attending(self.view);
        let title = Span::styled(words.get(what), self.theme.strong());
        centre(buf, row(area, y), &Line::from(title));
        let now = if by_hand {
            Phrase::Exploring
        } else {
            Phrase::Playing
        };
        let left_s = self.exposure.left_s(since_s);
        let time = clock(left_s.map_or(since_s, f64::ceil));
        let mut playing = format!("●  {}", words.get(now));
        if left_s.is_some() {
            let left = words.fill(Phrase::TimeLeft, &[("time", &time)]);
            playing.push_str(&format!("  ·  {left}"));
        }
        let playing = styled(playing, self.theme.playing());
        centre(buf, row(area, y + 2), &playing);
        big(buf, rows(area, y + 4, BIG_ROWS), &time, self.theme.strong());
        if let Some(part) = self.part(since_s) {
            let place = middle(row(area, y + 8), 40, 1);
            bar(buf, place, part, words.scales_from_right(), self.theme);
        }
        if self.keep_exploring {
            let more = styled(words.get(more), self.theme.text());
            centre(buf, row(area, y + 9), &more);
        }
    }
}
