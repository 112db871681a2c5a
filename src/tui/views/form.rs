//! A page of questions: the first in full, optional text fields below it.
//!
//! A participant sees it large and centered; an experimenter who enters the answers
//! sees a compact page with the earlier answers.

use super::answer::AnswerField;
use crate::tui::theme::Theme;
use crate::tui::ui_state::{Form, Target};
use crate::tui::widgets::{center_all, left, left_all, middle, row, rows, styled};
use crate::tui::{keys, wrap};
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use study_plan::protocol::phrases::Phrase;
use study_plan::protocol::{Entry, Question};
use study_session::page::{Button, Does, Page};
use study_session::session::View;

/// The form on the screen.
#[derive(Debug)]
pub struct FormView<'a> {
    /// The view: mode of entry and earlier answers.
    pub view: &'a View,
    /// What the page says.
    pub page: &'a Page,
    /// The questions.
    pub questions: &'a [Question],
    /// Whether the experimenter is asked.
    pub to_experimenter: bool,
    /// The answers entered so far.
    pub form: &'a Form,
    /// Whether the form has the focus.
    pub focused: bool,
    /// The styles.
    pub theme: Theme,
}

/// The areas of the parts of a form.
struct Placed {
    prompt: Rect,
    words: Vec<String>,
    tall: u16,
    answers: Vec<(usize, Option<Rect>, Rect)>,
}

impl FormView<'_> {
    fn compact(&self) -> bool {
        self.to_experimenter || self.view.entry == Entry::Experimenter
    }

    fn answer(&self, at: usize, tall: u16) -> Option<AnswerField<'_>> {
        Some(AnswerField {
            question: self.questions.get(at)?,
            field: self.form.fields.get(at)?,
            focused: self.focused && self.form.focus == at,
            tall,
            centered: !self.compact(),
            words: &self.view.words,
            theme: self.theme,
        })
    }

    /// The column of the body that the form uses.
    fn column(&self, area: Rect) -> Rect {
        if self.compact() {
            let left = 2.min(area.width);
            Rect {
                x: area.x + left,
                width: area
                    .width
                    .saturating_sub(left + self.panel_width(area) + 1)
                    .min(100),
                ..area
            }
        } else {
            let width = area.width.saturating_sub(12).min(120);
            middle(area, width, area.height)
        }
    }

    /// Width of the experimenter's panel; 0 where a long question needs all of the page.
    fn panel_width(&self, body: Rect) -> u16 {
        let prompt = self.questions.first().map_or("", |q| q.prompt.as_str());
        let columns = usize::from(body.width.saturating_sub(PANEL + 11)).clamp(1, 72);
        let short = wrap::paragraph(prompt, columns, usize::MAX).len() <= LONG_PROMPT;
        if short { PANEL } else { 0 }
    }

    /// Height of a rating box, in rows, for the rows that are free.
    fn tall(&self, rows: u16) -> u16 {
        match rows {
            _ if self.compact() => 3,
            ..14 => 3,
            14..26 => 5,
            _ => 7,
        }
    }

    fn place(&self, body: Rect) -> Placed {
        let area = self.column(body);
        let later = u16::try_from(self.questions.len().saturating_sub(1)).unwrap_or(0);
        // A prompt is not cut while there is room for it and an answer.
        let most = usize::from(area.height.saturating_sub(5 + later * 4)).max(3);
        let prompt = self.questions.first().map_or("", |q| q.prompt.as_str());
        let label = if self.compact() { 8 } else { 0 };
        let columns = usize::from(area.width).saturating_sub(label).min(72);
        let words = wrap::paragraph(prompt, columns.max(1), most);
        let prompt_rows = u16::try_from(words.len()).unwrap_or(1);
        let mut space = area.height.saturating_sub(prompt_rows);
        let tall = self.tall(space);

        // The preferred height of each answer, reduced where the page is full.
        let reserved = later * 3;
        let mut heights: Vec<u16> = Vec::new();
        for at in 0..self.questions.len() {
            let Some(answer) = self.answer(at, tall) else {
                break;
            };
            let titled = u16::from(at > 0);
            let most = if at == 0 {
                space.saturating_sub(reserved)
            } else {
                space.saturating_sub(titled).min(3)
            };
            let height = answer.rows(area.width, most);
            space = space.saturating_sub(height + titled);
            heights.push(height);
        }
        let wanted = 1 + later;
        let gap = (space / (wanted + 1)).min(if self.compact() { 1 } else { 2 });

        let used: u16 = heights.iter().sum::<u16>() + prompt_rows + later + gap * wanted;
        let top = if self.compact() {
            1.min(area.height.saturating_sub(used))
        } else {
            area.height.saturating_sub(used) * 2 / 5
        };
        let mut y = top;
        let prompt = rows(area, y, prompt_rows);
        y += prompt_rows + gap;
        let mut answers = Vec::new();
        // Fields below a scale of boxes are aligned with its edges.
        let boxes = self.answer(0, tall).and_then(|a| a.edges(area));
        let below = boxes.filter(|edges| edges.width >= 48);
        let below = below.map_or(area, |edges| Rect {
            width: edges.width.min(TEXT),
            ..edges
        });
        for (at, height) in heights.iter().enumerate() {
            let area = if at > 0 { below } else { area };
            let title = (at > 0).then(|| {
                let title = row(area, y);
                y += 1;
                title
            });
            answers.push((at, title, rows(area, y, *height)));
            y += height + gap;
        }
        Placed {
            prompt,
            words,
            tall,
            answers,
        }
    }

    /// The target at a position.
    pub fn hit(&self, body: Rect, place: Position) -> Option<Target> {
        let placed = self.place(body);
        placed.answers.into_iter().find_map(|(at, title, area)| {
            if title.is_some_and(|t| t.contains(place)) {
                return Some(Target::Field(at));
            }
            self.answer(at, placed.tall)?.hit(area, at, place)
        })
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, body: Rect) -> Option<Position> {
        let placed = self.place(body);
        let (at, _, area) = placed.answers.get(self.form.focus)?;
        self.answer(*at, placed.tall)?.cursor(*area)
    }

    /// Width of the text field with the focus.
    pub fn columns(&self, body: Rect) -> Option<usize> {
        let placed = self.place(body);
        let (at, _, area) = placed.answers.get(self.form.focus)?;
        Some(self.answer(*at, 3)?.columns(*area))
    }

    /// The keys of this page and their actions.
    pub fn hints(&self) -> Vec<(String, String)> {
        let at = self.form.focus;
        let answer = self.answer(at, 3);
        let mut keys = answer.map_or_else(Vec::new, |answer| answer.hints());
        if self.questions.len() > 1 {
            let other = if at == 0 {
                Phrase::Comment
            } else {
                Phrase::Back
            };
            let is_comment = self
                .questions
                .iter()
                .skip(1)
                .any(|q| q.id.as_str() == "comment");
            let other = if at == 0 && !is_comment {
                Phrase::Next
            } else {
                other
            };
            keys.push(("Tab".to_owned(), other));
        }
        let words = &self.view.words;
        let mut hints: Vec<(String, String)> = keys
            .into_iter()
            .map(|(key, what)| (key, words.get(what).to_owned()))
            .collect();
        // A step back leads from a later field to the one before.
        let offered = |b: &&Button| at == 0 || b.does != Does::Back;
        let buttons = self.page.buttons.iter().rev().filter(offered);
        hints.extend(buttons.map(|b| (keys::of(b.does).to_owned(), b.label.clone())));
        hints
    }

    /// The experimenter's panel on the right: trial, device, earlier answers, remarks.
    fn panel(&self, buf: &mut Buffer, area: Rect) {
        let theme = self.theme;
        for y in 0..area.height {
            left(buf, row(area, y), &styled("│", theme.outline()));
        }
        let inside = Rect {
            x: area.x + 2,
            width: area.width.saturating_sub(2),
            ..area
        };
        let columns = usize::from(inside.width);
        let mut lines = Vec::new();
        if let Some(progress) = self.view.progress {
            let of = progress.total.map_or(String::new(), |n| format!(" of {n}"));
            let what = if progress.practice {
                "Practice"
            } else {
                "Trial"
            };
            let words = format!("{what} {}{of}", progress.current);
            lines.push(styled(words, theme.strong()));
        }
        let device = super::status::device(self.view.line.device, false);
        lines.push(styled(device, theme.quiet()));
        let mut section = |title: &'static str, items: Vec<String>| {
            if !items.is_empty() {
                lines.push(Line::default());
                lines.push(styled(title, theme.text()));
                lines.extend(items.into_iter().map(|item| styled(item, theme.quiet())));
            }
        };
        let answers = self.view.correctable.iter().take(8).map(|earlier| {
            let answer = super::dialogs::answer_words(&earlier.answer, columns, &self.view.words);
            let id = earlier.question.id.as_str();
            wrap::one_line(&format!("{}: {id} {answer}", earlier.title), columns)
        });
        section("Earlier answers", answers.collect());
        let remarks = self.view.remarks.iter();
        let remarks = remarks.map(|remark| wrap::one_line(remark, columns));
        section("Remarks", remarks.collect());
        for (y, line) in (0..inside.height).zip(&lines) {
            left(buf, row(inside, y), line);
        }
    }
}

/// Largest width of a text field and of its title, in cells.
const TEXT: u16 = 72;
/// Width of the experimenter's panel, in cells.
const PANEL: u16 = 28;
/// Lines of a question beside which the panel is shown.
const LONG_PROMPT: usize = 6;

impl Widget for &FormView<'_> {
    fn render(self, body: Rect, buf: &mut Buffer) {
        let placed = self.place(body);
        if self.compact() {
            let ask = if self.to_experimenter {
                "Set up"
            } else {
                "Ask"
            };
            let label = styled(ask, self.theme.quiet());
            left(buf, row(placed.prompt, 0), &label);
            let indented = Rect {
                x: placed.prompt.x + 8.min(placed.prompt.width),
                width: placed.prompt.width.saturating_sub(8),
                ..placed.prompt
            };
            left_all(buf, indented, &placed.words, self.theme.strong());
        } else {
            center_all(buf, placed.prompt, &placed.words, self.theme.strong());
        }
        for (at, title, area) in &placed.answers {
            let Some(answer) = self.answer(*at, placed.tall) else {
                continue;
            };
            if let Some(title) = title {
                let question = answer.question;
                let words = wrap::one_line(
                    &question.prompt,
                    usize::from(title.width).saturating_sub(11),
                );
                let mut spans = vec![Span::styled(words, self.theme.text())];
                if !question.required {
                    let optional = format!(" ({})", self.view.words.get(Phrase::Optional));
                    spans.push(Span::styled(optional, self.theme.quiet()));
                }
                let title = if self.compact() {
                    *title
                } else {
                    middle(*title, TEXT, 1)
                };
                left(buf, title, &Line::from(spans));
            }
            answer.render(*area, buf);
        }
        let wide = self.panel_width(body);
        if self.compact() && wide > 0 {
            let x = body.right().saturating_sub(wide);
            let panel = Rect {
                x,
                width: body.right() - x,
                ..body
            };
            self.panel(buf, rows(panel, 1, panel.height));
        }
    }
}
