//! Building blocks of several screens. Each draws inside its area only.

use super::editor::Editor;
use super::theme::Theme;
use super::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::style::Style;
use ratatui::symbols::border;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Widget};
use std::borrow::Cow;

/// A centered part of `area`, at most `width` by `height` cells.
pub fn middle(area: Rect, width: u16, height: u16) -> Rect {
    let width = width.min(area.width);
    let height = height.min(area.height);
    Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    }
}

/// The `y`-th row of `area`; empty if there is none.
pub fn row(area: Rect, y: u16) -> Rect {
    if y >= area.height {
        return Rect::new(area.x, area.bottom(), 0, 0);
    }
    Rect::new(area.x, area.y + y, area.width, 1)
}

/// `area` without its first `y` rows, at most `height` tall.
pub fn rows(area: Rect, y: u16, height: u16) -> Rect {
    let y = y.min(area.height);
    Rect::new(area.x, area.y + y, area.width, height.min(area.height - y))
}

/// Text of one style as a line.
pub fn styled<'a>(text: impl Into<Cow<'a, str>>, style: Style) -> Line<'a> {
    Line::from(Span::styled(text, style))
}

/// Draws a left-aligned line. The text must already be safe.
pub fn left(buf: &mut Buffer, area: Rect, line: &Line<'_>) {
    let area = area.intersection(buf.area);
    if !area.is_empty() {
        buf.set_line(area.x, area.y, line, area.width);
    }
}

/// The cells that a line takes. Some letters that a font joins, such as those of لا, are
/// counted as one column by [`Line::width`], and are two cells.
pub fn cells(line: &Line<'_>) -> u16 {
    let wide = line.spans.iter().map(|span| wrap::width(&span.content));
    u16::try_from(wide.sum::<usize>()).unwrap_or(u16::MAX)
}

/// Draws a centered line.
pub fn center(buf: &mut Buffer, area: Rect, line: &Line<'_>) {
    left(buf, middle(area, cells(line), area.height), line);
}

/// Draws a right-aligned line.
pub fn right(buf: &mut Buffer, area: Rect, line: &Line<'_>) {
    let width = cells(line).min(area.width);
    let x = area.right() - width;
    left(buf, Rect { x, width, ..area }, line);
}

/// Draws wrapped lines, each centered.
pub fn center_all(buf: &mut Buffer, area: Rect, lines: &[String], style: Style) {
    for (y, line) in (0..area.height).zip(lines) {
        let line = styled(line.as_str(), style);
        center(buf, row(area, y), &line);
    }
}

/// Draws wrapped lines, left-aligned.
pub fn left_all(buf: &mut Buffer, area: Rect, lines: &[String], style: Style) {
    for (y, line) in (0..area.height).zip(lines) {
        let line = styled(line.as_str(), style);
        left(buf, row(area, y), &line);
    }
}

/// Keys and their actions: `Enter: save   ·   Tab: comment`.
pub fn hints(theme: Theme, keys: &[(&str, &str)], columns: u16) -> Line<'static> {
    let side = " ".repeat(usize::from(hint_gap(keys, columns) / 2));
    let mut spans = Vec::new();
    for (key, what) in keys {
        if !spans.is_empty() {
            spans.push(Span::styled(format!("{side}·{side}"), theme.quiet()));
        }
        spans.push(Span::styled((*key).to_owned(), theme.key()));
        spans.push(Span::styled(format!(": {what}"), theme.quiet()));
    }
    Line::from(spans)
}

/// The width of hints with `gap` cells between them.
fn hints_width(keys: &[(&str, &str)], gap: u16) -> usize {
    let wide = |(key, what): &(&str, &str)| wrap::width(key) + 2 + wrap::width(what);
    let gaps = usize::from(gap) * keys.len().saturating_sub(1);
    keys.iter().map(wide).sum::<usize>() + gaps
}

/// The cells between two hints: 7, or 3 where they would not fit into `columns`.
pub fn hint_gap(keys: &[(&str, &str)], columns: u16) -> u16 {
    match hints_width(keys, 7) <= usize::from(columns) {
        true => 7,
        false => 3,
    }
}

/// Whether hints fit into `columns`.
pub fn hints_fit(keys: &[(&str, &str)], columns: u16) -> bool {
    hints_width(keys, 3) <= usize::from(columns)
}

/// Draws a frame; a thick one marks what is chosen or urgent without color.
pub fn frame(buf: &mut Buffer, area: Rect, thick: bool, style: Style) {
    let area = area.intersection(buf.area);
    if area.is_empty() {
        return;
    }
    let set = if thick { border::THICK } else { border::PLAIN };
    Block::bordered()
        .border_set(set)
        .border_style(style)
        .render(area, buf);
}

/// Clears and frames the area of a dialog. Returns the inner area.
pub fn dialog(buf: &mut Buffer, area: Rect, title: &str, theme: Theme) -> Rect {
    let area = area.intersection(buf.area);
    if area.is_empty() {
        return area;
    }
    ratatui::widgets::Clear.render(area, buf);
    let block = Block::bordered()
        .border_set(border::ROUNDED)
        .border_style(theme.focus())
        .title(Span::styled(format!(" {title} "), theme.strong()));
    let inside = block.inner(area);
    block.render(area, buf);
    Rect {
        x: inside.x.saturating_add(2).min(inside.right()),
        width: inside.width.saturating_sub(4),
        ..inside
    }
}

/// A character of [`big`] in half blocks.
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
        ':' => ["▄", "▄", " "],
        '.' => [" ", " ", "▀"],
        _ => ["   ", "▀▀▀", "   "],
    }
}

/// Height of [`big`] text, in rows.
pub const BIG_ROWS: u16 = 3;

/// Whether a text can be drawn by [`big`] in a width: a number or a time.
pub fn fits_big(text: &str, width: u16) -> bool {
    let drawn = |c: char| matches!(c, '0'..='9' | ':' | '.' | '-' | '−');
    let columns = text.chars().map(|c| glyph(c)[0].chars().count() + 1);
    text.chars().all(drawn) && columns.sum::<usize>() <= usize::from(width) + 1
}

/// Draws a number or a time in three rows of half blocks, in the middle of an area.
pub fn big(buf: &mut Buffer, area: Rect, text: &str, style: Style) {
    let top = area.height.saturating_sub(BIG_ROWS) / 2;
    for i in 0..BIG_ROWS {
        let line: Vec<&str> = text.chars().map(|c| glyph(c)[usize::from(i)]).collect();
        let line = styled(line.join(" "), style);
        center(buf, row(area, top + i), &line);
    }
}

/// Draws a bar that is filled from the left, or from the right.
pub fn bar(buf: &mut Buffer, area: Rect, part: f64, from_right: bool, theme: Theme) {
    let area = area.intersection(buf.area);
    let filled = (part.clamp(0.0, 1.0) * f64::from(area.width)).round() as u16;
    for x in 0..area.width {
        let at = if from_right { area.width - 1 - x } else { x };
        let (symbol, style) = if at < filled {
            ("━", theme.chosen())
        } else {
            ("─", theme.outline())
        };
        buf.set_string(area.x + x, area.y, symbol, style);
    }
}

/// The cap of a key: its name and action in a box.
pub fn cap(buf: &mut Buffer, area: Rect, (key, what): (&str, &str), border: Style, theme: Theme) {
    frame(buf, area, false, border);
    let line = Line::from(vec![
        Span::styled(
            key.to_owned(),
            border.add_modifier(ratatui::style::Modifier::BOLD),
        ),
        Span::styled(format!(": {what}"), theme.text()),
    ]);
    center(buf, row(area, area.height / 2), &line);
}

/// A text field: a bar at its left, thick if it has the focus, and the text.
#[derive(Debug)]
pub struct TextField<'a> {
    /// The text.
    pub editor: &'a Editor,
    /// Whether it has the focus.
    pub focused: bool,
    /// The styles.
    pub theme: Theme,
}

impl TextField<'_> {
    /// Width of the text in an area, in cells.
    pub fn columns(area: Rect) -> usize {
        usize::from(area.width.saturating_sub(3)).max(1)
    }

    /// The lines, the first visible one, and the cursor's line and column.
    fn window(&self, area: Rect) -> (Vec<wrap::Line>, usize, usize, usize) {
        let (lines, line, column) = self.editor.layout(Self::columns(area));
        let height = usize::from(area.height);
        let first = (line + 1).saturating_sub(height);
        (lines, first, line, column)
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, area: Rect) -> Option<Position> {
        if !self.focused || area.width < 3 || area.height == 0 {
            return None;
        }
        let (_, first, line, column) = self.window(area);
        let x = area.x + 2 + u16::try_from(column).ok()?;
        let y = area.y + u16::try_from(line - first).ok()?;
        Some(Position::new(x.min(area.right() - 1), y))
    }
}

impl Widget for &TextField<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let (lines, first, _, _) = self.window(area);
        let (bar, style) = if self.focused {
            ("┃", self.theme.focus())
        } else {
            ("│", self.theme.outline())
        };
        for y in 0..area.height {
            let text = lines.get(first + usize::from(y));
            let shown = text.map_or("", |line| line.shown.as_str());
            let line = Line::from(vec![
                Span::styled(bar, style),
                Span::raw(" "),
                Span::styled(shown, self.theme.text()),
            ]);
            left(buf, row(area, y), &line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arabic_with_ligatures_is_drawn_whole() {
        let question = "هل لا لا لا لا نهاية؟";
        for draw in [center, right] {
            let mut buf = Buffer::empty(Rect::new(0, 0, 40, 1));
            let area = buf.area;
            draw(&mut buf, area, &styled(question, Style::new()));
            let drawn: String = buf.content().iter().map(|cell| cell.symbol()).collect();
            assert_eq!(drawn.trim(), question);
        }
    }

    #[test]
    fn a_row_outside_is_empty() {
        let area = Rect::new(3, 4, 10, 2);
        assert!(row(area, 2).is_empty());
        assert!(rows(area, 5, 3).is_empty());
        assert_eq!(middle(area, 20, 20), area);
    }
}
