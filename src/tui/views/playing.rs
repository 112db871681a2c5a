//! The screen during playback: the prompt and the elapsed time.

use crate::tui::theme::Theme;
use crate::tui::widgets::{centre, clock, middle, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Widget};
use study_core::protocol::DeviceKind;
use study_core::protocol::phrases::Phrase;
use study_core::session::{Screen, View};

/// The screen while the device plays, or loads one of several intervals.
#[derive(Debug)]
pub struct Playing<'a> {
    view: &'a View,
    /// Time since the confirmed start, s; `None` before it.
    since_s: Option<f64>,
    /// Whether more exploration is required.
    keep_exploring: bool,
    /// The interval, from 1, and their number, if there are several.
    interval: Option<(u32, u32)>,
    theme: Theme,
}

impl<'a> Playing<'a> {
    /// The screen, if it is one of these.
    pub fn of(view: &'a View, theme: Theme) -> Option<Self> {
        let (since_s, keep_exploring, interval) = match &view.screen {
            Screen::Playing {
                since_s,
                keep_exploring,
                interval,
            } => (Some(*since_s), *keep_exploring, *interval),
            Screen::Loading {
                interval: Some(interval),
            } => (None, false, Some(*interval)),
            _ => return None,
        };
        Some(Self {
            view,
            since_s,
            keep_exploring,
            interval,
            theme,
        })
    }

    /// Which interval it is, large: in a box of its own.
    fn interval(&self, area: Rect, at: u32, buf: &mut Buffer) {
        let word = self.view.words.get(ordinal(at)).to_uppercase();
        let block = Block::bordered()
            .border_type(BorderType::Thick)
            .border_style(self.theme.strong());
        let columns = u16::try_from(wrap::width(&word)).unwrap_or(0);
        let place = middle(area, columns.saturating_add(16).max(28), 5);
        block.render(place, buf);
        centre(buf, row(place, 2), &styled(word, self.theme.strong()));
    }
}

/// "first", "second", "third": no trial has more intervals.
pub fn ordinal(interval: u32) -> Phrase {
    match interval {
        1 => Phrase::First,
        2 => Phrase::Second,
        _ => Phrase::Third,
    }
}

impl Widget for &Playing<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let words = &self.view.words;
        let by_hand = self.view.device == DeviceKind::Manual;
        let tall = if self.interval.is_some() { 11 } else { 5 };
        let mut y = area.height.saturating_sub(tall) / 2;
        if let Some((at, _)) = self.interval {
            self.interval(rows(area, y, 5), at, buf);
            y += 6;
        }
        let (what, now) = if by_hand {
            (Phrase::FeelSample, Phrase::Exploring)
        } else {
            (Phrase::FeelDevice, Phrase::Playing)
        };
        let Some(since_s) = self.since_s else {
            let wait = styled(words.get(Phrase::OneMoment), self.theme.text());
            return centre(buf, row(area, y), &wait);
        };
        let title = Span::styled(words.get(what), self.theme.strong());
        centre(buf, row(area, y), &Line::from(title));
        let playing = Line::from(vec![
            Span::styled(format!("●  {}", words.get(now)), self.theme.playing()),
            Span::styled(format!("   {}", clock(since_s)), self.theme.text()),
        ]);
        centre(buf, row(area, y + 2), &playing);
        if self.keep_exploring {
            let more = styled(words.get(Phrase::KeepExploring), self.theme.text());
            centre(buf, row(area, y + 4), &more);
        }
    }
}
