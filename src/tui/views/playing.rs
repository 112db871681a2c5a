//! The screen during playback: the prompt, the elapsed time, and the live strip if
//! requested.

use crate::runner::Strip;
use crate::tui::theme::Theme;
use crate::tui::widgets::{centre, clock, middle, right, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use ratatui::widgets::canvas::{Canvas, Line as Stroke};
use study_core::protocol::DeviceKind;
use study_core::session::View;

/// The screen while the device plays.
#[derive(Debug)]
pub struct Playing<'a> {
    /// The view.
    pub view: &'a View,
    /// Time since the confirmed start, s.
    pub since_s: f64,
    /// Full strokes that are still required.
    pub strokes_missing: u32,
    /// Recent telemetry.
    pub strip: Option<&'a Strip>,
    /// The styles.
    pub theme: Theme,
}

impl Widget for &Playing<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let by_hand = self.view.device == DeviceKind::Manual;
        // a mounted sample has no force to draw
        let strip_rows = match self.strip.filter(|_| !by_hand) {
            Some(_) if area.height >= 14 => (area.height / 2).min(14),
            _ => 0,
        };
        let words = rows(area, 0, area.height - strip_rows);
        let y = words.height.saturating_sub(5) / 2;
        let (what, now) = if by_hand {
            ("Feel the sample.", "●  exploring")
        } else {
            ("Feel the device.", "●  playing")
        };
        let title = Span::styled(what, self.theme.strong());
        centre(buf, row(words, y), &Line::from(title));
        let playing = Line::from(vec![
            Span::styled(now, self.theme.playing()),
            Span::styled(format!("   {}", clock(self.since_s)), self.theme.text()),
        ]);
        centre(buf, row(words, y + 2), &playing);
        if self.strokes_missing > 0 {
            let strokes = if self.strokes_missing == 1 {
                "1 more full stroke, from end to end".to_owned()
            } else {
                format!(
                    "{} more full strokes, from end to end",
                    self.strokes_missing
                )
            };
            let line = styled(strokes, self.theme.text());
            centre(buf, row(words, y + 4), &line);
        }
        if let Some(strip) = self.strip.filter(|_| strip_rows > 0) {
            let place = rows(area, words.height, strip_rows);
            let wide = place.width.saturating_sub(12).min(100);
            let trace = Trace {
                strip,
                theme: self.theme,
            };
            trace.render(middle(place, wide, place.height), buf);
        }
    }
}

/// Force over position.
#[derive(Debug)]
struct Trace<'a> {
    strip: &'a Strip,
    theme: Theme,
}

/// Columns of the force axis.
const AXIS: u16 = 9;

impl Widget for &Trace<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let Strip {
            samples,
            force_limit_n: limit,
            x_range_mm: [from, to],
        } = self.strip;
        let usable = limit.is_finite() && *limit > 0.0 && from.is_finite() && to.is_finite();
        if !usable || from >= to || area.width < AXIS + 10 || area.height < 4 {
            return;
        }
        let plot = Rect {
            x: area.x + AXIS,
            width: area.width - AXIS,
            height: area.height - 1,
            ..area
        };
        let colour = self.theme.trace();
        Canvas::default()
            .marker(Marker::Braille)
            .x_bounds([*from, *to])
            .y_bounds([-limit, *limit])
            .paint(|canvas| {
                for pair in samples.windows(2) {
                    let [(x1, y1), (x2, y2)] = [pair[0], pair[1]];
                    if [x1, y1, x2, y2].iter().all(|n| n.is_finite()) {
                        canvas.draw(&Stroke {
                            x1: x1.clamp(*from, *to),
                            y1: y1.clamp(-limit, *limit),
                            x2: x2.clamp(*from, *to),
                            y2: y2.clamp(-limit, *limit),
                            color: colour,
                        });
                    }
                }
            })
            .render(plot, buf);
        let last = plot.height - 1;
        for y in 0..plot.height {
            let label = match y {
                0 => format!("N {:>4} ┤", short(*limit)),
                y if y == last / 2 => "0 ┤".to_owned(),
                y if y == last => format!("{:>4} ┤", short(-limit)),
                _ => "│".to_owned(),
            };
            let at = Rect {
                width: AXIS - 1,
                ..row(area, y)
            };
            right(buf, at, &styled(label, self.theme.quiet()));
        }
        let foot = Rect {
            x: plot.x,
            width: plot.width,
            ..row(area, area.height - 1)
        };
        let quiet = |text: String| styled(text, self.theme.quiet());
        crate::tui::widgets::left(buf, foot, &quiet(short(*from)));
        centre(buf, foot, &quiet(short(f64::midpoint(*from, *to))));
        right(buf, foot, &quiet(format!("{} mm", short(*to))));
    }
}

fn short(n: f64) -> String {
    let text = if n.fract() == 0.0 {
        format!("{n:.0}")
    } else {
        format!("{n:.1}")
    };
    wrap::one_line(&text.replace('-', "−"), 7)
}
