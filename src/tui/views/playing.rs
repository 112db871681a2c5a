//! The screen during playback: the prompt and the elapsed time.

use crate::tui::theme::Theme;
use crate::tui::widgets::{centre, clock, row, styled};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use study_core::protocol::DeviceKind;
use study_core::protocol::phrases::Phrase;
use study_core::session::View;

/// The screen while the device plays.
#[derive(Debug)]
pub struct Playing<'a> {
    /// The view.
    pub view: &'a View,
    /// Time since the confirmed start, s.
    pub since_s: f64,
    /// Whether more exploration is required.
    pub keep_exploring: bool,
    /// The styles.
    pub theme: Theme,
}

impl Widget for &Playing<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let words = &self.view.words;
        let by_hand = self.view.device == DeviceKind::Manual;
        let y = area.height.saturating_sub(5) / 2;
        let (what, now) = if by_hand {
            (Phrase::FeelSample, Phrase::Exploring)
        } else {
            (Phrase::FeelDevice, Phrase::Playing)
        };
        let title = Span::styled(words.get(what), self.theme.strong());
        centre(buf, row(area, y), &Line::from(title));
        let playing = Line::from(vec![
            Span::styled(format!("●  {}", words.get(now)), self.theme.playing()),
            Span::styled(format!("   {}", clock(self.since_s)), self.theme.text()),
        ]);
        centre(buf, row(area, y + 2), &playing);
        if self.keep_exploring {
            let more = styled(words.get(Phrase::KeepExploring), self.theme.text());
            centre(buf, row(area, y + 4), &more);
        }
    }
}
