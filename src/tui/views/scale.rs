//! Scales: numbers in boxes, or a line with a marker.

use crate::tui::theme::Theme;
use crate::tui::widgets::{cells, centre, frame, left, right, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::Widget;
use std::collections::BTreeMap;

/// Maximum number of boxes; a longer scale is drawn as a line.
pub const MOST_BOXES: i64 = 11;

/// Width of the narrowest box, in cells.
const NARROW: u16 = 5;
/// Width of the widest box, in cells.
const WIDE: u16 = 15;

/// A labelled scale of integers.
#[derive(Debug)]
pub struct Boxes<'a> {
    /// Smallest number.
    pub from: i64,
    /// Largest number.
    pub to: i64,
    /// Labels of some numbers.
    pub labels: &'a BTreeMap<i64, String>,
    /// The chosen number.
    pub chosen: Option<i64>,
    /// Height of a box, in rows.
    pub tall: u16,
    /// The styles.
    pub theme: Theme,
}

/// Whether a scale can be drawn as boxes in this width.
pub fn fits(from: i64, to: i64, columns: u16) -> bool {
    let Some(count) = to.checked_sub(from).map(|n| n.saturating_add(1)) else {
        return false;
    };
    (1..=MOST_BOXES).contains(&count)
        && i64::from(columns) >= count * i64::from(NARROW) + count - 1
        && [from, to].iter().all(|n| n.to_string().len() <= 3)
}

/// A number with a typographic minus sign.
fn number(n: i64) -> String {
    n.to_string().replace('-', "−")
}

impl Boxes<'_> {
    /// The box of each number.
    pub fn places(&self, area: Rect) -> Vec<(i64, Rect)> {
        if !fits(self.from, self.to, area.width) || area.height < 3 {
            return Vec::new();
        }
        let count = u16::try_from(self.to - self.from + 1).unwrap_or(1);
        let wide = ((area.width + 1) / count - 1).clamp(NARROW, WIDE);
        let wide = if wide.is_multiple_of(2) {
            wide - 1
        } else {
            wide
        };
        let gap = if wide >= 11 { 2 } else { 1 };
        let gap = if count * wide + (count - 1) * gap > area.width {
            1
        } else {
            gap
        };
        let all = count * wide + (count - 1) * gap;
        let start = area.x + (area.width - all) / 2;
        let height = self.tall.min(area.height);
        (self.from..=self.to)
            .zip(0u16..)
            .map(|(n, i)| (n, Rect::new(start + i * (wide + gap), area.y, wide, height)))
            .collect()
    }

    /// The number, columns and lines of each label.
    fn captions(&self, area: Rect) -> Vec<(i64, Rect, Vec<String>)> {
        let places = self.places(area);
        let below = self.tall.min(area.height);
        let of = |n: i64| places.iter().find(|(m, _)| *m == n).map(|(_, r)| *r);
        let labelled: Vec<(i64, Rect)> = self
            .labels
            .iter()
            .filter(|(_, label)| !label.trim().is_empty())
            .filter_map(|(n, _)| Some((*n, of(*n)?)))
            .collect();
        let (Some(first), Some(last)) = (places.first(), places.last()) else {
            return Vec::new();
        };
        let centre_of = |r: Rect| r.x + r.width / 2;
        let mut captions = Vec::new();
        for (i, (n, place)) in labelled.iter().enumerate() {
            // A label may extend halfway to the next one.
            let lower = match i.checked_sub(1).and_then(|j| labelled.get(j)) {
                Some((_, before)) => u16::midpoint(centre_of(*before), centre_of(*place)) + 1,
                None => first.1.x,
            };
            let upper = match labelled.get(i + 1) {
                Some((_, after)) => u16::midpoint(centre_of(*place), centre_of(*after)),
                None => last.1.right(),
            };
            let (x, end) = if *n == self.from {
                (place.x, upper.min(place.x + 24).max(place.x + 1))
            } else if *n == self.to {
                (lower.max(place.right().saturating_sub(24)), place.right())
            } else {
                let half = (centre_of(*place) - lower)
                    .min(upper.saturating_sub(centre_of(*place)))
                    .min(12);
                (centre_of(*place) - half, centre_of(*place) + half + 1)
            };
            let columns = Rect::new(x, area.y + below, end.saturating_sub(x).max(1), 0);
            let label = self.labels.get(n).map_or("", String::as_str);
            let lines = wrap::paragraph(label, usize::from(columns.width), 4);
            captions.push((*n, columns, lines));
        }
        captions
    }

    /// Height of the labels in rows, for a width in columns.
    pub fn caption_rows(&self, columns: u16) -> u16 {
        let area = Rect::new(0, 0, columns, 3);
        let most = self
            .captions(area)
            .into_iter()
            .map(|(_, _, l)| l.len())
            .max();
        u16::try_from(most.unwrap_or(0)).unwrap_or(4)
    }
}

impl Widget for &Boxes<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        for (n, place) in self.places(area) {
            let chosen = self.chosen == Some(n);
            let (border, text) = if chosen {
                (self.theme.chosen(), self.theme.chosen())
            } else {
                (self.theme.outline(), self.theme.strong())
            };
            frame(buf, place, chosen, border);
            let inside = rows(place, 1, place.height.saturating_sub(2));
            if inside.height >= 5 && place.width >= 11 {
                big(buf, inside, &number(n), text);
            } else {
                let label = styled(number(n), text);
                centre(buf, row(inside, inside.height / 2), &label);
            }
        }
        for (n, columns, lines) in self.captions(area) {
            for (i, line) in (0u16..).zip(&lines) {
                let at = Rect::new(columns.x, columns.y + i, columns.width, 1);
                if at.y >= area.bottom() {
                    break;
                }
                let line = styled(line.as_str(), self.theme.text());
                if n == self.from {
                    left(buf, at, &line);
                } else if n == self.to {
                    right(buf, at, &line);
                } else {
                    centre(buf, at, &line);
                }
            }
        }
    }
}

/// A digit of three by three half blocks.
fn glyph(c: char) -> [&'static str; 3] {
    match c {
        '0' => ["█▀█", "█ █", "▀▀▀"],
        '1' => ["▄█ ", " █ ", "▀▀▀"],
        '2' => ["▀▀█", "█▀▀", "▀▀▀"],
        '3' => ["▀▀█", " ▀█", "▀▀▀"],
        '4' => ["█ █", "▀▀█", "  ▀"],
        '5' => ["█▀▀", "▀▀█", "▀▀▀"],
        '6' => ["█▀▀", "█▀█", "▀▀▀"],
        '7' => ["▀▀█", "  █", "  ▀"],
        '8' => ["█▀█", "█▀█", "▀▀▀"],
        '9' => ["█▀█", "▀▀█", "▀▀▀"],
        _ => ["   ", "▀▀▀", "   "],
    }
}

fn big(buf: &mut Buffer, area: Rect, text: &str, style: ratatui::style::Style) {
    let top = area.height.saturating_sub(3) / 2;
    for i in 0..3u16 {
        let line: Vec<&str> = text.chars().map(|c| glyph(c)[usize::from(i)]).collect();
        let line = styled(line.join(" "), style);
        centre(buf, row(area, top + i), &line);
    }
}

/// A scale drawn as a line, with a marker at the value.
#[derive(Debug)]
pub struct Track<'a> {
    /// Left end.
    pub from: f64,
    /// Right end.
    pub to: f64,
    /// Label of the left end.
    pub low: &'a str,
    /// Label of the right end.
    pub high: &'a str,
    /// The value.
    pub value: Option<f64>,
    /// The styles.
    pub theme: Theme,
}

/// Height of a track without its labels, in rows: value, line, ends.
pub const TRACK_ROWS: u16 = 3;

impl Track<'_> {
    /// The area of the line itself.
    pub fn line(area: Rect) -> Rect {
        let all = row(area, 1);
        let margin = (all.width / 12).min(6);
        Rect {
            x: all.x + margin,
            width: all.width - 2 * margin,
            ..all
        }
    }

    /// The value at a column.
    pub fn value_at(&self, area: Rect, x: u16) -> f64 {
        let line = Self::line(area);
        let steps = f64::from(line.width.saturating_sub(1).max(1));
        let part = f64::from(x.saturating_sub(line.x)) / steps;
        self.from + part.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// Height of the labels, in rows.
    pub fn caption_rows(&self, columns: u16) -> u16 {
        let (low, high) = self.captions(columns);
        u16::try_from(low.len().max(high.len())).unwrap_or(4)
    }

    fn captions(&self, columns: u16) -> (Vec<String>, Vec<String>) {
        let half = usize::from(columns / 2).saturating_sub(2).clamp(1, 30);
        let lines = |text: &str| {
            if text.trim().is_empty() {
                Vec::new()
            } else {
                wrap::paragraph(text, half, 4)
            }
        };
        (lines(self.low), lines(self.high))
    }
}

impl Widget for &Track<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let line = Track::line(area);
        if line.is_empty() {
            return;
        }
        let dashes = "─".repeat(usize::from(line.width.saturating_sub(2)));
        let track = styled(format!("├{dashes}┤"), self.theme.outline());
        left(buf, line, &track);
        if let Some(value) = self.value.filter(|v| v.is_finite()) {
            let part = ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
            let part = if part.is_nan() { 0.0 } else { part };
            let column = (part * f64::from(line.width.saturating_sub(1))).round() as u16;
            let x = line.x + column;
            let mark = styled("●", self.theme.chosen());
            left(
                buf,
                Rect {
                    x,
                    width: 1,
                    ..line
                },
                &mark,
            );
            let text = styled(value.to_string().replace('-', "−"), self.theme.chosen());
            let wide = cells(&text);
            let start = x
                .saturating_sub(wide / 2)
                .clamp(area.x, area.right().saturating_sub(wide).max(area.x));
            let above = Rect {
                x: start,
                width: area.right() - start,
                ..row(area, 0)
            };
            left(buf, above, &text);
        }
        let ends = Rect {
            x: line.x,
            width: line.width,
            ..row(area, 2)
        };
        let end = |n: f64| {
            let text = n.to_string().replace('-', "−");
            styled(wrap::one_line(&text, 12), self.theme.strong())
        };
        left(buf, ends, &end(self.from));
        right(buf, ends, &end(self.to));
        let (low, high) = self.captions(area.width);
        for (side, lines) in [(false, low), (true, high)] {
            for (i, text) in (0u16..).zip(&lines) {
                let at = row(area, TRACK_ROWS + i);
                let at = Rect {
                    x: line.x,
                    width: line.width.min(at.width),
                    ..at
                };
                let text = styled(text.as_str(), self.theme.text());
                if side {
                    right(buf, at, &text);
                } else {
                    left(buf, at, &text);
                }
            }
        }
    }
}
