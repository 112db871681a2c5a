//! The experimenter's status line, the banner and the progress.

use crate::tui::theme::Theme;
use crate::tui::widgets::{cells, center, left, right, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use std::fmt::Display;
use study_plan::protocol::phrases::{Phrase, Words};
use study_session::page::{Page, clock};
use study_session::session::view::{DeviceState, Mirror, Progress, StatusLine, Telemetry};

/// The status line, in the last row.
#[derive(Debug)]
pub struct Status<'a> {
    /// Its content.
    pub line: &'a StatusLine,
    /// Whether it shows that telemetry arrives.
    pub live: bool,
    /// Whether `?` is text at the moment.
    pub text: bool,
    /// Whether the participant sits at the terminal: who takes part, the clock and the
    /// device are shown only where something is wrong with it.
    pub own: bool,
    /// Whether saving has failed.
    pub unsaved: bool,
    /// The fixed sentences that a participant reads.
    pub words: &'a Words,
    /// The styles.
    pub theme: Theme,
}

/// The state of the device in words.
pub(super) fn device(state: DeviceState, live: bool) -> &'static str {
    match state {
        DeviceState::Unknown => "no session yet",
        DeviceState::Limp => "device limp",
        DeviceState::Loading => "device loading",
        DeviceState::Ready => "device ready",
        DeviceState::Running(Telemetry::Arrives) if live => "running · telemetry arrives",
        DeviceState::Running(Telemetry::Silent) if live => "running · NO TELEMETRY",
        DeviceState::Running(_) => "running",
        DeviceState::Stopping => "device stopping",
        DeviceState::Fault => "DEVICE FAULT",
        DeviceState::Lost => "DEVICE LOST",
        DeviceState::ByHand => "samples by hand",
        DeviceState::Felt => "sample felt",
    }
}

impl Widget for &Status<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let inside = area.inner(Margin::new(1, 0));
        let quiet = self.theme.quiet();
        let line = self.line;
        let who = [&line.participant, &line.operator]
            .into_iter()
            .filter(|name| !name.is_empty())
            .map(|name| wrap::one_line(name, 12))
            .collect::<Vec<_>>()
            .join(" · ");
        if !self.own {
            left(buf, inside, &styled(who, quiet));
        }

        let bad = matches!(line.device, DeviceState::Fault | DeviceState::Lost);
        let mut spans = Vec::new();
        if bad || !self.own {
            let style = match bad {
                true => self.theme.trouble_frame(),
                false => quiet,
            };
            spans.push(Span::styled(device(line.device, self.live), style));
        }
        if line.device != DeviceState::Unknown {
            if !self.own {
                spans.push(Span::styled(format!(" · {}", clock(line.elapsed_s)), quiet));
            }
            let (saved, answered) = (line.trials_saved, line.trials_answered);
            let values = [("n", &saved as &dyn Display), ("total", &answered)];
            if self.unsaved {
                let words = format!(" · NOT SAVED {saved} of {answered}");
                spans.push(Span::styled(words, self.theme.trouble_frame()));
            } else if !line.all_saved {
                let words = self.words.fill(Phrase::SavingCount, &values);
                spans.push(Span::styled(format!(" · {words}"), quiet));
            } else if answered > 0 {
                let words = self.words.fill(Phrase::SavedCount, &values);
                let (before, after) = words.split_once("{mark}").unwrap_or((&words, ""));
                spans.push(Span::styled(format!(" · {before}"), quiet));
                let mark = match line.mirror {
                    Some(Mirror::InStep) => "✓✓",
                    _ => "✓",
                };
                spans.push(Span::styled(mark, self.theme.saved()));
                spans.push(Span::styled(after.to_owned(), quiet));
            }
        }
        // Nothing stands before the first part.
        if let Some(first) = spans.first_mut() {
            let text = first.content.trim_start_matches(" · ").to_owned();
            first.content = text.into();
        }
        let behind = match line.mirror {
            Some(Mirror::OnlyResults) => " · NO MIRROR",
            Some(Mirror::OnlyMirror) => " · ONLY IN MIRROR",
            Some(Mirror::InStep) | None => "",
        };
        spans.push(Span::styled(behind, self.theme.trouble_frame()));
        center(buf, inside, &Line::from(spans));

        let help = vec![
            Span::styled(if self.text { "F1" } else { "?" }, self.theme.key()),
            Span::styled(format!(" {}", self.words.get(Phrase::Help)), quiet),
        ];
        right(buf, inside, &Line::from(help));
    }
}

/// The first row: the banner of pilots and simulations, and the progress.
#[derive(Debug)]
pub struct Top<'a> {
    /// The page.
    pub page: &'a Page,
    /// The progress of the view, which has the length of a block.
    pub progress: Option<Progress>,
    /// The styles.
    pub theme: Theme,
}

impl Top<'_> {
    /// The closed trials as a bar, with a tick after each block.
    fn bar(&self, area: Rect, progress: Progress, total: u32, buf: &mut Buffer) {
        let wide = f64::from(area.width);
        let column = |trials: u32| (f64::from(trials) / f64::from(total.max(1)) * wide).round();
        let done = column(progress.current.saturating_sub(1)) as u16;
        let ticks: Vec<u16> = match progress.block {
            Some(block) if total / block.max(1) <= 10 => (1..)
                .map(|n| n * block)
                .take_while(|trials| *trials < total)
                .map(|trials| column(trials) as u16)
                .collect(),
            _ => Vec::new(),
        };
        for x in 0..area.width {
            // A tick is the last cell of its block.
            let tick = ticks.contains(&(x + 1));
            let symbol = match (x < done, tick) {
                (true, false) => "━",
                (true, true) => "┿",
                (false, false) => "─",
                (false, true) => "┼",
            };
            let style = match x < done {
                true => self.theme.chosen(),
                false => self.theme.outline(),
            };
            buf.set_string(area.x + x, area.y, symbol, style);
        }
    }
}

impl Widget for &Top<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let parts = [&self.page.sheet, &self.page.progress]
            .into_iter()
            .flatten();
        let words: Vec<&str> = parts.map(|part| part.words.as_str()).collect();
        let words = words.join(" · ");
        let mut taken_left = 3;
        if let Some(banner) = &self.page.banner {
            // Where there is no room for both, the banner is its first word.
            let whole = wrap::width(banner) + wrap::width(&words) + 6;
            let shown = match banner.split_once(" — ") {
                Some((short, _)) if whole > usize::from(area.width) => short,
                _ => banner,
            };
            let shown = format!(" {shown} ");
            taken_left += wrap::width(&shown);
            let at = area.inner(Margin::new(1, 0));
            left(buf, at, &styled(shown, self.theme.banner()));
        }
        if !words.is_empty() {
            let words = styled(words, self.theme.quiet());
            let at = Rect {
                width: area.width.saturating_sub(1),
                ..area
            };
            right(buf, at, &words);
            if let Some((progress, total)) = self.progress.and_then(|p| Some((p, p.total?))) {
                let taken = cells(&words) + 2;
                let wide = u16::try_from(total).unwrap_or(u16::MAX).clamp(10, 30);
                let room = at.width.saturating_sub(taken);
                if usize::from(room) >= usize::from(wide) + taken_left {
                    let place = Rect {
                        x: at.right() - taken - wide,
                        width: wide,
                        ..at
                    };
                    self.bar(place, progress, total, buf);
                }
            }
        }
    }
}
