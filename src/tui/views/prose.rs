//! Screens that consist of text: instructions, prompts, pauses, choices by a letter.

use crate::tui::theme::Theme;
use crate::tui::ui_state::Reading;
use crate::tui::widgets::{
    BIG_ROWS, big, center, center_all, left_all, middle, right, row, rows, styled,
};
use crate::tui::{keys, wrap};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use study_session::page::{Button, Does, Kind, Page};

/// Width of the widest text column, in cells.
const COLUMN: u16 = 84;

/// Text in the middle of the page.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Prose {
    /// A dim line above the title.
    pub above: String,
    /// The title.
    pub title: String,
    /// The text below the title.
    pub body: String,
    /// Whether the body is a long text: left-aligned and scrollable.
    pub long: bool,
    /// A time below a long text, drawn large.
    pub big: String,
    /// The last line of a long text's page.
    pub below: String,
    /// Keys in a column: the key, its action, an explanation.
    pub choices: Vec<(&'static str, String, &'static str)>,
}

/// The text of a page; `None` for pages that show more than text.
pub fn prose(page: &Page) -> Option<Prose> {
    let signs = page.kind == Kind::Consent && page.text.contains('\n');
    let long = signs || matches!(page.kind, Kind::Message | Kind::Break | Kind::End);
    let body = match page.kind {
        Kind::Who | Kind::Questions | Kind::Playing | Kind::DeviceTrouble | Kind::SaveTrouble => {
            return None;
        }
        Kind::Loading if page.interval.is_some() => return None,
        _ if long => wrap::flow(&page.text),
        Kind::Reference => page.wait.as_ref().unwrap_or(&page.text).clone(),
        Kind::Paused => page.clock.clone().unwrap_or_default(),
        _ => page.text.clone(),
    };
    let instruction = page.instruction.unwrap_or_default().to_owned();
    let (above, title) = match (long, page.kind) {
        (true, Kind::Consent) => (instruction, Some(page.title.clone())),
        (true, _) if instruction.is_empty() => (page.title.clone(), page.wait.clone()),
        (_, Kind::Stopped) => (instruction, Some(format!("■  {}", page.title))),
        (_, _) => (instruction, Some(page.title.clone())),
    };
    let choices = choices(page);
    let below = match signs {
        // The choices in one line.
        true => {
            let each = choices
                .iter()
                .map(|(key, what, _)| format!("{key}  {what}"));
            Some(each.collect::<Vec<String>>().join("  ·  "))
        }
        false => page.done.as_ref().map(|done| done.words.clone()),
    };
    Some(Prose {
        above,
        title: title.unwrap_or_default(),
        body,
        long,
        big: page.wait_clock.clone().filter(|_| long).unwrap_or_default(),
        below: below.unwrap_or_default(),
        choices,
    })
}

/// What is chosen by a letter, with the keys: the key, its action, an explanation.
pub fn choices(page: &Page) -> Vec<(&'static str, String, &'static str)> {
    if !matches!(page.kind, Kind::Resume | Kind::Consent | Kind::Stopped) {
        return Vec::new();
    }
    let choice = |b: &Button| (keys::of(b.does), b.label.clone(), b.note);
    let mut choices: Vec<_> = page.buttons.iter().map(choice).collect();
    if let Some(refuse) = &page.refuse {
        choices.push((keys::of(Does::Refuse), refuse.open.clone(), ""));
    }
    choices
}

/// The widget that draws a [`Prose`].
#[derive(Debug)]
pub struct ProseView<'a> {
    /// The text.
    pub prose: &'a Prose,
    /// How far a long text is scrolled.
    pub reading: Reading,
    /// The styles.
    pub theme: Theme,
}

impl ProseView<'_> {
    /// The lines of a long text and their area.
    fn text(&self, area: Rect) -> (Vec<String>, Rect) {
        let column = middle(area, COLUMN.min(area.width.saturating_sub(8)), area.height);
        let lines = wrap::paragraph(&self.prose.body, usize::from(column.width), usize::MAX);
        let head = u16::from(!self.prose.above.is_empty()) * 2;
        let foot = self.foot();
        let room = area.height.saturating_sub(head + foot).max(1);
        let height = u16::try_from(lines.len()).unwrap_or(u16::MAX).min(room);
        let widest = lines.iter().map(|l| wrap::width(l)).max().unwrap_or(0);
        let used = height + head + foot;
        let top = head + area.height.saturating_sub(used) * 2 / 5;
        let narrow = u16::try_from(widest).unwrap_or(column.width);
        (lines, middle(rows(column, top, height), narrow, height))
    }

    /// Rows below a long text.
    fn foot(&self) -> u16 {
        let prose = self.prose;
        let some = |text: &str| u16::from(!text.is_empty());
        some(&prose.title) * 2 + some(&prose.big) * (BIG_ROWS + 1) + some(&prose.below) * 2
    }

    /// The largest scroll position and the number of lines on a page.
    pub fn room(&self, area: Rect) -> (usize, usize) {
        if !self.prose.long {
            return (0, 0);
        }
        let (lines, place) = self.text(area);
        let page = usize::from(place.height);
        (lines.len().saturating_sub(page), page)
    }

    fn long(&self, area: Rect, buf: &mut Buffer) {
        let (lines, place) = self.text(area);
        let page = usize::from(place.height);
        let from = self.reading.scrolled.min(lines.len().saturating_sub(page));
        let style = self.theme.text();
        if place.y >= area.y + 2 && !self.prose.above.is_empty() {
            let above = Rect {
                y: place.y - 2,
                height: 1,
                ..area
            };
            let line = styled(self.prose.above.as_str(), self.theme.quiet());
            center(buf, above, &line);
        }
        if lines.len() <= 2 {
            let wide = Rect {
                x: area.x,
                width: area.width,
                ..place
            };
            center_all(buf, wide, &lines, self.theme.strong());
        } else {
            left_all(buf, place, &lines[from..], style);
        }
        let more = lines.len() > from + page;
        let mut foot = Rect {
            y: place.bottom() + 1,
            height: area.bottom().saturating_sub(place.bottom() + 1),
            ..area
        };
        if !self.prose.big.is_empty() {
            let time = rows(foot, 0, BIG_ROWS);
            big(buf, time, &self.prose.big, self.theme.strong());
            foot = rows(foot, BIG_ROWS + 1, foot.height);
        }
        for text in [&self.prose.title, &self.prose.below] {
            if !text.is_empty() {
                center(
                    buf,
                    row(foot, 0),
                    &styled(text.as_str(), self.theme.quiet()),
                );
                foot = rows(foot, 2, foot.height);
            }
        }
        let arrow = |text: &'static str| styled(text, self.theme.key());
        if from > 0 {
            right(buf, row(area, 0), &arrow("↑  "));
        }
        if more {
            right(buf, row(area, area.height.saturating_sub(1)), &arrow("↓  "));
        }
    }
}

impl Widget for &ProseView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let prose = self.prose;
        if prose.long {
            self.long(area, buf);
            return;
        }
        let columns = usize::from(area.width.saturating_sub(8).min(COLUMN)).max(1);
        let room = usize::from(area.height / 2).max(1);
        let above = wrap::paragraph(&prose.above, columns, 1);
        let title = wrap::paragraph(&prose.title, columns, room);
        let body = if prose.body.is_empty() {
            Vec::new()
        } else {
            wrap::paragraph(&prose.body, columns, room)
        };
        let len = |lines: &[String]| u16::try_from(lines.len()).unwrap_or(0);
        let has_above = !prose.above.is_empty();
        let choice_rows = u16::try_from(prose.choices.len() * 2).unwrap_or(0);
        let used = u16::from(has_above) * 2 + len(&title) + 2 + len(&body) + 1 + choice_rows;
        let mut y = area.height.saturating_sub(used) * 2 / 5;
        if has_above {
            center_all(buf, rows(area, y, 1), &above, self.theme.quiet());
            y += 2;
        }
        center_all(buf, rows(area, y, len(&title)), &title, self.theme.strong());
        y += len(&title) + 1;
        center_all(buf, rows(area, y, len(&body)), &body, self.theme.text());
        y += len(&body) + 2;
        let widest = |(key, what, more): &(&str, String, &str)| {
            let more = if more.is_empty() {
                0
            } else {
                wrap::width(more) + 3
            };
            wrap::width(key).max(5) + 2 + wrap::width(what) + more
        };
        let wide = prose.choices.iter().map(widest).max().unwrap_or(0);
        let wide = u16::try_from(wide).unwrap_or(u16::MAX);
        for (key, what, more) in &prose.choices {
            let mut spans = vec![
                Span::styled(format!("{key:>5}"), self.theme.key()),
                Span::styled(format!("  {what}"), self.theme.text()),
            ];
            if !more.is_empty() {
                spans.push(Span::styled(format!(" – {more}"), self.theme.quiet()));
            }
            let at = middle(row(area, y), wide, 1);
            crate::tui::widgets::left(buf, at, &Line::from(spans));
            y += 2;
        }
    }
}
