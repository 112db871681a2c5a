//! The field in which a question of any kind is answered.

use super::choice::List;
use super::scale::{self, Boxes, Track};
use crate::tui::theme::Theme;
use crate::tui::ui_state::Target;
use crate::tui::ui_state::field::Field;
use crate::tui::widgets::{TextField, fits_big, left, middle, row, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::widgets::Widget;
use study_plan::protocol::answer::number;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Control, Pick, Question};

/// The field of a question.
#[derive(Debug)]
pub struct AnswerField<'a> {
    /// The question.
    pub question: &'a Question,
    /// The answer entered so far.
    pub field: &'a Field,
    /// Whether it has the focus.
    pub focused: bool,
    /// Height of the boxes of a rating, in rows.
    pub tall: u16,
    /// Whether it is centered; else left-aligned.
    pub centered: bool,
    /// The sentences of the study, which know the direction of its scales.
    pub words: &'a Words,
    /// The styles.
    pub theme: Theme,
}

impl<'a> AnswerField<'a> {
    fn boxes(&self, columns: u16) -> Option<Boxes<'a>> {
        match (self.question.kind.control(), self.field) {
            (Control::Boxes { from, to, labels }, Field::Boxes { chosen, .. })
                if scale::fits(from, to, columns) =>
            {
                Some(Boxes {
                    from,
                    to,
                    labels,
                    chosen: *chosen,
                    tall: self.tall,
                    from_right: self.words.scales_from_right(),
                    theme: self.theme,
                })
            }
            _ => None,
        }
    }

    fn track(&self) -> Option<Track<'a>> {
        let (from, to, value, labels) = match (self.question.kind.control(), self.field) {
            (Control::Boxes { from, to, labels }, Field::Boxes { chosen, .. }) => {
                let labels = labels.iter().map(|(n, label)| (*n as f64, label.as_str()));
                let value = chosen.map(|n| n as f64);
                (from as f64, to as f64, value, labels.collect())
            }
            (
                Control::Track {
                    from, to, labels, ..
                },
                Field::Track { value, .. },
            ) => (from, to, *value, labels),
            _ => return None,
        };
        let shown = value.unwrap_or(from).to_string().replace('-', "−");
        Some(Track {
            from,
            to,
            labels,
            value,
            large: self.tall >= 5 && fits_big(&shown, 40),
            from_right: self.words.scales_from_right(),
            theme: self.theme,
        })
    }

    fn list(&self) -> Option<List<'a>> {
        match (self.question.kind.control(), self.field) {
            (Control::List { options, pick }, Field::List { cursor, marked }) => Some(List {
                options,
                pick,
                cursor: *cursor,
                marked,
                theme: self.theme,
            }),
            _ => None,
        }
    }

    fn text(&self) -> Option<TextField<'a>> {
        match self.field {
            Field::Text(editor) | Field::Digits(editor) => Some(TextField {
                editor,
                focused: self.focused,
                theme: self.theme,
            }),
            _ => None,
        }
    }

    /// Its keys and what they do.
    pub fn hints(&self) -> Vec<(String, Phrase)> {
        let keys = |keys: &[(&str, Phrase)]| -> Vec<(String, Phrase)> {
            keys.iter()
                .map(|(key, does)| ((*key).to_owned(), *does))
                .collect()
        };
        match self.question.kind.control() {
            Control::Boxes { from, to, .. } => {
                let numbers = format!("{from}–{to}").replace('-', "−");
                vec![(numbers, Phrase::Choose)]
            }
            Control::Track { .. } => keys(&[("← →", Phrase::Move), ("0–9", Phrase::Choose)]),
            Control::List { pick, .. } => match pick {
                Pick::One => keys(&[("↑ ↓", Phrase::Choose)]),
                Pick::Many => keys(&[("↑ ↓", Phrase::Move), ("Space", Phrase::Mark)]),
            },
            Control::Text => keys(&[("Alt-Enter", Phrase::NewLine)]),
            Control::Digits { .. } => Vec::new(),
        }
    }

    /// The area from the first box to the last, if it is a scale of boxes.
    pub fn edges(&self, area: Rect) -> Option<Rect> {
        let at = Rect { height: 3, ..area };
        let places = self.boxes(area.width)?.places(at);
        let all = places.iter().map(|(_, place)| *place).reduce(Rect::union)?;
        Some(Rect {
            x: all.x,
            width: all.width,
            ..area
        })
    }

    /// Its height in rows for a width in columns; at most `most`.
    pub fn rows(&self, columns: u16, most: u16) -> u16 {
        let rows = if let Some(boxes) = self.boxes(columns) {
            self.tall + boxes.caption_rows(columns)
        } else if let Some(track) = self.track() {
            track.rows() + track.caption_rows(columns)
        } else if let Some(list) = self.list() {
            list.rows(self.inner(Rect::new(0, 0, columns, 1)).width)
        } else if self.field.is_text() {
            // A constant height, so that nothing moves while text is typed.
            8
        } else {
            2
        };
        rows.min(most)
    }

    /// The part of the area that lists and text fields use.
    fn inner(&self, area: Rect) -> Rect {
        let width = if let Some(list) = self.list() {
            list.columns().clamp(20, area.width.max(20))
        } else if matches!(self.field, Field::Digits(_)) {
            36
        } else {
            area.width.min(72)
        };
        if self.centered {
            middle(area, width, area.height)
        } else {
            Rect {
                width: width.min(area.width),
                ..area
            }
        }
    }

    /// The target at a position.
    pub fn hit(&self, area: Rect, at: usize, place: Position) -> Option<Target> {
        if !area.contains(place) {
            return None;
        }
        if let Some(boxes) = self.boxes(area.width) {
            let places = boxes.places(area);
            let hit = places.into_iter().find(|(_, r)| r.contains(place));
            return hit.map(|(n, _)| Target::Number(at, n as f64));
        }
        if let Some(track) = self.track() {
            let near = track.line(area);
            let hit = place.y <= near.y + 1 && place.x >= near.x && place.x < near.right();
            return hit.then(|| Target::Number(at, track.value_at(area, place.x)));
        }
        if let Some(list) = self.list() {
            let places = list.places(self.inner(area));
            let hit = places.into_iter().find(|(_, r)| r.contains(place));
            return hit.map(|(i, _)| Target::Option(at, i));
        }
        Some(Target::Field(at))
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, area: Rect) -> Option<Position> {
        let mut inner = self.inner(area);
        if matches!(self.field, Field::Digits(_)) {
            inner.height = inner.height.min(1);
        }
        self.text()?.cursor(inner)
    }

    /// Width of a text field, in columns.
    pub fn columns(&self, area: Rect) -> usize {
        TextField::columns(self.inner(area))
    }
}

impl Widget for &AnswerField<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        if let Some(boxes) = self.boxes(area.width) {
            boxes.render(area, buf);
        } else if let Some(track) = self.track() {
            track.render(area, buf);
        } else if let Some(list) = self.list() {
            list.render(self.inner(area), buf);
        } else if let (Some(text), Control::Digits { unit, .. }) =
            (self.text(), self.question.kind.control())
        {
            let inner = self.inner(area);
            text.render(row(inner, 0), buf);
            let unit = unit.unwrap_or_default();
            // The number as it was read: a comma may have been meant otherwise.
            let read = match number(text.editor.text()) {
                Some(number) => format!("= {number} {}", wrap::one_line(unit, 20)),
                None => wrap::one_line(unit, 24),
            };
            let line = styled(format!("  {read}"), self.theme.quiet());
            left(buf, row(inner, 1), &line);
        } else if let Some(text) = self.text() {
            text.render(self.inner(area), buf);
        }
    }
}
