//! Scales: numbers in boxes, or a line with a marker.

use crate::tui::theme::Theme;
use crate::tui::widgets::{BIG_ROWS, big, cells, center, frame, left, right, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Rect};
use ratatui::widgets::Widget;
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;

/// Maximum number of boxes; a longer scale is drawn as a line.
pub const MOST_BOXES: i64 = 11;

/// Width of the narrowest box, in cells.
const NARROW: u16 = 5;
/// Width of the widest box, in cells.
const WIDE: u16 = 15;

/// A labeled scale of integers.
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
    /// Whether the smallest number is on the right.
    pub from_right: bool,
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
            .map(|(n, i)| {
                let place = Rect::new(start + i * (wide + gap), area.y, wide, height);
                match self.from_right {
                    true => (n, mirrored(place, area)),
                    false => (n, place),
                }
            })
            .collect()
    }

    /// The labels below the boxes.
    fn captions(&self, area: Rect) -> Vec<Caption> {
        let places = self.places(area);
        let label = |(n, place): &(i64, Rect)| Some((*place, self.labels.get(n)?.as_str()));
        let mut labeled: Vec<(Rect, &str)> = places.iter().filter_map(label).collect();
        labeled.small_sort_by_key(|(place, _)| place.x);
        captions(&labeled, covering(&places), 24)
    }

    /// Height of the labels in rows, for a width in columns.
    pub fn caption_rows(&self, columns: u16) -> u16 {
        let area = Rect::new(0, 0, columns, 3);
        caption_rows(&self.captions(area))
    }
}

/// The area from the first place to the last.
fn covering<T>(places: &[(T, Rect)]) -> Rect {
    let all = places.iter().map(|(_, place)| *place);
    all.reduce(Rect::union).unwrap_or_default()
}

/// A label below a scale.
#[derive(Debug)]
struct Caption {
    /// Where its first line is.
    place: Rect,
    /// Which side of its place it keeps to.
    side: Side,
    lines: Vec<String>,
}

#[derive(Debug, Clone, Copy)]
enum Side {
    Left,
    Middle,
    Right,
}

/// The labels of these places, from left to right: those at the ends of `all` keep to its
/// edges, and each may extend halfway to the next one, `widest` columns at most.
fn captions(labeled: &[(Rect, &str)], all: Rect, widest: u16) -> Vec<Caption> {
    let labeled: Vec<&(Rect, &str)> = (labeled.iter())
        .filter(|(_, label)| !label.trim().is_empty())
        .collect();
    let center_of = |r: Rect| r.x + r.width / 2;
    let caption = |(i, (place, label)): (usize, &&(Rect, &str))| {
        let center = center_of(*place);
        let lower = match i.checked_sub(1).and_then(|j| labeled.get(j)) {
            Some((before, _)) => u16::midpoint(center_of(*before), center) + 1,
            None => all.x,
        };
        let upper = match labeled.get(i + 1) {
            Some((after, _)) => u16::midpoint(center, center_of(*after)),
            None => all.right(),
        };
        let (side, x, end) = if place.x == all.x {
            (Side::Left, place.x, upper.min(place.x + widest))
        } else if place.right() == all.right() {
            let x = lower.max(place.right().saturating_sub(widest));
            (Side::Right, x, place.right())
        } else {
            let half = (center - lower)
                .min(upper.saturating_sub(center))
                .min(widest / 2);
            (Side::Middle, center - half, center + half + 1)
        };
        let width = end.saturating_sub(x).max(1);
        Caption {
            place: Rect::new(x, all.y, width, 1),
            side,
            lines: wrap::paragraph(label, usize::from(width), 4),
        }
    };
    labeled.iter().enumerate().map(caption).collect()
}

fn caption_rows(captions: &[Caption]) -> u16 {
    let most = captions.iter().map(|c| c.lines.len()).max();
    u16::try_from(most.unwrap_or(0)).unwrap_or(4)
}

/// Draws captions from a row of an area on.
fn draw_captions(captions: &[Caption], area: Rect, from: u16, theme: Theme, buf: &mut Buffer) {
    for caption in captions {
        for (i, line) in (0u16..).zip(&caption.lines) {
            let below = row(area, from + i);
            let place = Rect {
                y: below.y,
                height: below.height,
                ..caption.place
            };
            let line = styled(line.as_str(), theme.text());
            match caption.side {
                _ if below.is_empty() => {}
                Side::Left => left(buf, place, &line),
                Side::Middle => center(buf, place, &line),
                Side::Right => right(buf, place, &line),
            }
        }
    }
}

/// A place on the other side of an area.
fn mirrored(place: Rect, area: Rect) -> Rect {
    Rect {
        x: area.x + area.right() - place.right(),
        ..place
    }
}

impl Widget for &Boxes<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        for (n, place) in self.places(area) {
            let chosen = self.chosen == Some(n);
            let (border, text) = match self.chosen {
                Some(_) if chosen => (self.theme.chosen(), self.theme.filled()),
                Some(_) => (self.theme.outline(), self.theme.quiet()),
                None => (self.theme.outline(), self.theme.strong()),
            };
            frame(buf, place, chosen, border);
            let inside = place.inner(Margin::new(1, 1));
            if chosen {
                buf.set_style(inside.intersection(buf.area), text);
            }
            if inside.height >= 5 && place.width >= 11 {
                big(buf, inside, &number(n), text);
            } else {
                let label = styled(number(n), text);
                center(buf, row(inside, inside.height / 2), &label);
            }
        }
        let below = self.tall.min(area.height);
        draw_captions(&self.captions(area), area, below, self.theme, buf);
    }
}

/// A scale drawn as a line, with a marker at the value.
#[derive(Debug)]
pub struct Track<'a> {
    /// Smallest number.
    pub from: f64,
    /// Largest number.
    pub to: f64,
    /// Labels of some numbers.
    pub labels: Vec<(f64, &'a str)>,
    /// The value.
    pub value: Option<f64>,
    /// Whether the value is drawn large.
    pub large: bool,
    /// Whether the smallest number is on the right.
    pub from_right: bool,
    /// The styles.
    pub theme: Theme,
}

impl Track<'_> {
    /// Height without the labels, in rows: value, line, numbers.
    pub fn rows(&self) -> u16 {
        self.value_rows() + 2
    }

    fn value_rows(&self) -> u16 {
        if self.large { BIG_ROWS + 1 } else { 1 }
    }

    /// The area of the line itself.
    pub fn line(&self, area: Rect) -> Rect {
        let all = row(area, self.value_rows());
        let margin = (all.width / 12).min(6);
        Rect {
            x: all.x + margin,
            width: all.width - 2 * margin,
            ..all
        }
    }

    /// The value at a column.
    pub fn value_at(&self, area: Rect, x: u16) -> f64 {
        let line = self.line(area);
        let steps = f64::from(line.width.saturating_sub(1).max(1));
        let part = f64::from(x.saturating_sub(line.x)) / steps;
        let part = part.clamp(0.0, 1.0);
        let part = if self.from_right { 1.0 - part } else { part };
        self.from + part * (self.to - self.from)
    }

    /// The column of a value.
    fn place_of(&self, line: Rect, value: f64) -> Rect {
        let part = ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        let part = if part.is_nan() { 0.0 } else { part };
        let column = (part * f64::from(line.width.saturating_sub(1))).round() as u16;
        let place = Rect {
            x: line.x + column,
            width: 1,
            ..line
        };
        match self.from_right {
            true => mirrored(place, line),
            false => place,
        }
    }

    /// Height of the labels, in rows.
    pub fn caption_rows(&self, columns: u16) -> u16 {
        caption_rows(&self.captions(Rect::new(0, 0, columns, 20)))
    }

    fn captions(&self, area: Rect) -> Vec<Caption> {
        let line = self.line(area);
        let labels = self.labels.iter();
        let mut places: Vec<(Rect, &str)> = labels
            .map(|(at, label)| (self.place_of(line, *at), *label))
            .collect();
        places.small_sort_by_key(|(place, _)| place.x);
        captions(&places, line, 30)
    }

    /// The value above the line, large or at the marker.
    fn draw_value(&self, area: Rect, mark: Rect, value: f64, buf: &mut Buffer) {
        let text = value.to_string().replace('-', "−");
        if self.large {
            return big(buf, rows(area, 0, BIG_ROWS), &text, self.theme.chosen());
        }
        let text = styled(text, self.theme.chosen());
        let wide = cells(&text);
        let start = (mark.x.saturating_sub(wide / 2))
            .clamp(area.x, area.right().saturating_sub(wide).max(area.x));
        let above = Rect {
            x: start,
            width: area.right() - start,
            ..row(area, 0)
        };
        left(buf, above, &text);
    }
}

impl Widget for &Track<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let line = self.line(area);
        if line.is_empty() {
            return;
        }
        let dashes = "─".repeat(usize::from(line.width.saturating_sub(2)));
        let track = styled(format!("├{dashes}┤"), self.theme.outline());
        left(buf, line, &track);
        let inner = |at: &f64| *at > self.from && *at < self.to;
        for (at, _) in self.labels.iter().filter(|(at, _)| inner(at)) {
            let tick = styled("┼", self.theme.outline());
            left(buf, self.place_of(line, *at), &tick);
        }
        if let Some(value) = self.value.filter(|v| v.is_finite()) {
            let mark = self.place_of(line, value);
            let begin = self.place_of(line, self.from);
            let (low, high) = (begin.x.min(mark.x), begin.x.max(mark.x));
            for x in low..=high {
                let cell = Rect { x, ..mark };
                left(buf, cell, &styled("━", self.theme.chosen()));
            }
            left(buf, mark, &styled("●", self.theme.chosen()));
            self.draw_value(area, mark, value, buf);
        }
        let numbers = Rect {
            x: line.x,
            width: line.width,
            ..row(area, self.value_rows() + 1)
        };
        let end = |n: f64| {
            let text = n.to_string().replace('-', "−");
            styled(wrap::one_line(&text, 12), self.theme.strong())
        };
        let (on_left, on_right) = match self.from_right {
            true => (self.to, self.from),
            false => (self.from, self.to),
        };
        left(buf, numbers, &end(on_left));
        right(buf, numbers, &end(on_right));
        draw_captions(&self.captions(area), area, self.rows(), self.theme, buf);
    }
}
