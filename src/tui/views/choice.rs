//! A list of options; it scrolls if it is taller than its area.

use crate::tui::theme::Theme;
use crate::tui::ui_state::field::key_of;
use crate::tui::widgets::{left, row, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use study_plan::protocol::Pick;

/// A list of options, each with a check mark.
#[derive(Debug)]
pub struct List<'a> {
    /// The options.
    pub options: &'a [String],
    /// How many options can be chosen.
    pub pick: Pick,
    /// The option that the keys act on.
    pub cursor: Option<usize>,
    /// The chosen options, in the order in which they were chosen.
    pub marked: &'a [usize],
    /// The styles.
    pub theme: Theme,
}

/// Cells before the text of an option: key, cursor and mark.
const MARGIN: u16 = 8;
/// Maximum number of lines of one option.
const LINES: usize = 3;

impl List<'_> {
    /// The wrapped text of each option.
    fn lines(&self, columns: u16) -> Vec<Vec<String>> {
        let columns = usize::from(columns.saturating_sub(MARGIN)).max(1);
        let lay = |option: &String| wrap::paragraph(option, columns, LINES);
        self.options.iter().map(lay).collect()
    }

    /// Height of the whole list, in rows.
    pub fn rows(&self, columns: u16) -> u16 {
        let all: usize = self.lines(columns).iter().map(Vec::len).sum();
        u16::try_from(all).unwrap_or(u16::MAX)
    }

    /// Width of the widest option, in columns.
    pub fn columns(&self) -> u16 {
        let widest = self
            .options
            .iter()
            .map(|o| wrap::width(&wrap::one_line(o, 400)));
        u16::try_from(widest.max().unwrap_or(0)).unwrap_or(400) + MARGIN
    }

    /// The first visible row of the list; the cursor stays visible.
    fn scrolled(&self, lines: &[Vec<String>], height: u16) -> usize {
        let height = usize::from(height);
        let until = self.cursor.unwrap_or(0) + 1;
        let end: usize = lines.iter().take(until).map(Vec::len).sum();
        let all: usize = lines.iter().map(Vec::len).sum();
        // Show one line below the cursor, if there is one.
        (end + 1).min(all).saturating_sub(height)
    }

    /// The visible rows: option and area.
    pub fn places(&self, area: Rect) -> Vec<(usize, Rect)> {
        let lines = self.lines(area.width);
        let first = self.scrolled(&lines, area.height);
        let mut at = 0;
        let mut places = Vec::new();
        for (i, option) in lines.iter().enumerate() {
            for _ in option {
                if at >= first && at - first < usize::from(area.height) {
                    let y = u16::try_from(at - first).unwrap_or(u16::MAX);
                    places.push((i, row(area, y)));
                }
                at += 1;
            }
        }
        places
    }
}

impl Widget for &List<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let lines = self.lines(area.width);
        let first = self.scrolled(&lines, area.height);
        let mut at = 0;
        for (i, option) in lines.iter().enumerate() {
            let marked = self.marked.contains(&i);
            let here = self.cursor == Some(i);
            let mark = match (self.pick, marked) {
                (Pick::Many, true) => "[✓]",
                (Pick::Many, false) => "[ ]",
                (Pick::One, true) => "(●)",
                (Pick::One, false) => "( )",
            };
            for (j, words) in option.iter().enumerate() {
                let y = at;
                at += 1;
                if y < first || y - first >= usize::from(area.height) {
                    continue;
                }
                let style = if marked {
                    self.theme.chosen()
                } else if here {
                    self.theme.strong()
                } else {
                    self.theme.text()
                };
                let mut spans = if j == 0 {
                    let key = key_of(i).unwrap_or(' ').to_string();
                    let pointer = if here { "›" } else { " " };
                    vec![
                        Span::styled(key, self.theme.quiet()),
                        Span::styled(format!(" {pointer} "), self.theme.focus()),
                        Span::styled(format!("{mark} "), style),
                    ]
                } else {
                    vec![Span::raw(" ".repeat(usize::from(MARGIN)))]
                };
                spans.push(Span::styled(words.as_str(), style));
                let y = u16::try_from(y - first).unwrap_or(u16::MAX);
                left(buf, row(area, y), &Line::from(spans));
            }
        }
        // Arrows in the last column show that there is more above or below.
        let more = |y: u16, arrow: &'static str, buf: &mut Buffer| {
            let line = styled(arrow, self.theme.key());
            crate::tui::widgets::right(buf, row(area, y), &line);
        };
        if first > 0 {
            more(0, "↑", buf);
        }
        if at > first + usize::from(area.height) {
            more(area.height.saturating_sub(1), "↓", buf);
        }
    }
}
