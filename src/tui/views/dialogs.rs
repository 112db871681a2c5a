//! Dialogs: drawn above a screen.

use super::answer::AnswerField;
use crate::tui::theme::Theme;
use crate::tui::ui_state::dialog::{Confirm, Correct, Dialog, Step};
use crate::tui::widgets::{TextField, dialog, hints, left, left_all, middle, row, rows, styled};
use crate::tui::wrap;
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Position, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use study_base::text::capital;
use study_plan::protocol::Answer;
use study_plan::protocol::phrases::{Phrase, Words};
use study_session::outcome::Author;
use study_session::page::unsaved_lines;

/// A dialog above a page.
#[derive(Debug)]
pub struct DialogView<'a> {
    /// The dialog.
    pub dialog: &'a Dialog,
    /// Whether Esc also stops a loaded or playing device.
    pub armed: bool,
    /// What is asked before the program is left.
    pub leave: &'a str,
    /// What is in memory only because saving has failed.
    pub unsaved: &'a [String],
    /// The fixed sentences that a participant reads.
    pub words: &'a Words,
    /// The styles.
    pub theme: Theme,
}

/// The keys listed by the help dialog: key, alternative, action.
fn keys(words: &Words) -> Vec<(&'static str, &'static str, String)> {
    let save = format!(
        "{}, {}",
        words.get(Phrase::Continue),
        words.get(Phrase::Save)
    );
    let keys = [
        ("Esc", "Space", Phrase::CommandStop),
        ("1–9", "← →  ↑ ↓", Phrase::Choose),
        ("Tab", "", Phrase::OtherField),
        ("Shift-Tab", "PgUp", Phrase::CommandBack),
        ("F7", "Ctrl-F", Phrase::FeelAgain),
        ("Alt-Enter", "Ctrl-J", Phrase::NewLine),
        ("F2", "Ctrl-R", Phrase::CommandRemark),
        ("F3", "Ctrl-E", Phrase::CommandCorrect),
        ("F4", "Ctrl-B", Phrase::CommandBad),
        ("F5", "Ctrl-P", Phrase::CommandPause),
        ("F6", "Ctrl-D", Phrase::CommandDecline),
        ("F10", "Ctrl-Q", Phrase::CommandQuit),
        ("F1", "?", Phrase::Help),
    ];
    let keys = keys.map(|(key, other, what)| (key, other, words.get(what).to_owned()));
    [vec![("Enter", "", save)], keys.to_vec()].concat()
}

/// An answer as one line of safe text, at most `columns` cells wide.
pub fn answer_words(answer: &Answer, columns: usize, words: &Words) -> String {
    match answer {
        Answer::Declined { reason } => {
            let declined = words.get(Phrase::Declined);
            wrap::one_line(&format!("{declined}: {reason}"), columns)
        }
        Answer::Text(text) if text.trim().is_empty() => "–".to_owned(),
        other => wrap::one_line(&other.cell(), columns),
    }
}

impl DialogView<'_> {
    /// The title and the area of the dialog.
    fn place(&self, area: Rect) -> (String, Rect) {
        let (title, width, height) = match self.dialog {
            Dialog::Help => (self.words.get(Phrase::Help), 76, 18),
            Dialog::Remark { .. } => (self.words.get(Phrase::Remark), 68, 11),
            Dialog::Correct(correct) => {
                let title = self.words.get(Phrase::CorrectTitle);
                match &correct.step {
                    Step::List => (title, 76, 16),
                    Step::Answer(_) => (title, 76, 18),
                    Step::Reason { .. } => (title, 76, 12),
                }
            }
            Dialog::MarkBad { .. } => ("Mark as bad", 68, 10),
            Dialog::Decline { .. } => (self.words.get(Phrase::DeclineTitle), 68, 10),
            Dialog::Confirm(Confirm::Quit) if !self.unsaved.is_empty() => ("NOT SAVED", 72, 15),
            Dialog::Confirm(_) => (self.words.get(Phrase::Sure), 60, 8),
        };
        (capital(title), middle(area, width, height.min(area.height)))
    }

    fn inside(&self, area: Rect) -> Rect {
        self.place(area).1.inner(Margin::new(3, 1))
    }

    /// The text field and its area.
    fn field(&self, area: Rect) -> Option<(TextField<'_>, Rect)> {
        let (editor, from) = match self.dialog {
            Dialog::Help | Dialog::Confirm(_) => return None,
            Dialog::Remark { text, .. } => (text, 3),
            Dialog::MarkBad { reason, .. } | Dialog::Decline { reason } => (reason, 3),
            Dialog::Correct(correct) => match &correct.step {
                Step::Reason { reason, .. } => (reason, 5),
                _ => return None,
            },
        };
        let field = TextField {
            editor,
            focused: true,
            theme: self.theme,
        };
        let inside = self.inside(area);
        let height = inside.height.saturating_sub(from + 2);
        Some((field, rows(inside, from, height)))
    }

    fn answer<'b>(&'b self, area: Rect) -> Option<(AnswerField<'b>, Rect)> {
        let Dialog::Correct(correct) = self.dialog else {
            return None;
        };
        let (Step::Answer(field), Some(item)) = (&correct.step, correct.item()) else {
            return None;
        };
        let inside = self.inside(area);
        let answer = AnswerField {
            question: &item.question,
            field,
            focused: true,
            tall: 3,
            centered: true,
            words: self.words,
            theme: self.theme,
        };
        Some((answer, rows(inside, 6, inside.height.saturating_sub(8))))
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, area: Rect) -> Option<Position> {
        if let Some((field, at)) = self.field(area) {
            return field.cursor(at);
        }
        let (answer, at) = self.answer(area)?;
        answer.cursor(at)
    }

    /// Width of the text field with the focus.
    pub fn columns(&self, area: Rect) -> Option<usize> {
        if let Some((_, at)) = self.field(area) {
            return Some(TextField::columns(at));
        }
        let (answer, at) = self.answer(area)?;
        Some(answer.columns(at))
    }

    fn keys(&self, buf: &mut Buffer, inside: Rect, keys: &[(&str, &str)]) {
        let last = row(inside, inside.height.saturating_sub(1));
        let close = self.words.get(Phrase::Close);
        let stop = self.words.get(Phrase::Stop).to_uppercase();
        let stop = match self.armed {
            true => format!("{close}, {stop}"),
            false => close.to_owned(),
        };
        let esc = ("Esc", stop.as_str());
        let mut keys = keys.to_vec();
        match self.dialog {
            Dialog::Confirm(_) => {}
            Dialog::Help if !self.armed => {}
            _ => keys.push(esc),
        }
        left(buf, last, &hints(self.theme, &keys, inside.width));
    }

    fn by(&self, by: Author) -> Line<'static> {
        let mark = |author| if by == author { "(●)" } else { "( )" };
        let style = |author| {
            if by == author {
                self.theme.chosen()
            } else {
                self.theme.text()
            }
        };
        let one =
            |author, name: &str| Span::styled(format!("{} {name}   ", mark(author)), style(author));
        Line::from(vec![
            Span::styled(
                format!("{:<6}", self.words.get(Phrase::By)),
                self.theme.quiet(),
            ),
            one(Author::Experimenter, self.words.get(Phrase::Experimenter)),
            one(Author::Participant, self.words.get(Phrase::Participant)),
        ])
    }

    fn help(&self, buf: &mut Buffer, inside: Rect) {
        for (y, (key, other, what)) in (1u16..).zip(keys(self.words)) {
            let both = if other.is_empty() {
                key.to_owned()
            } else {
                format!("{key}  {other}")
            };
            let line = Line::from(vec![
                Span::styled(format!("{both:<19}"), self.theme.key()),
                Span::styled(what, self.theme.text()),
            ]);
            left(buf, row(inside, y), &line);
        }
        self.keys(buf, inside, &[("Enter", self.words.get(Phrase::Close))]);
    }

    fn correct(&self, buf: &mut Buffer, inside: Rect, correct: &Correct) {
        let quiet = self.theme.quiet();
        if correct.step == Step::List {
            let height = inside.height.saturating_sub(4);
            let first = (correct.cursor + 1).saturating_sub(usize::from(height));
            let items = correct.items.iter().enumerate().skip(first);
            for (y, (i, item)) in (1..=height).zip(items) {
                let here = i == correct.cursor;
                let style = if here {
                    self.theme.chosen()
                } else {
                    self.theme.text()
                };
                let answer = answer_words(
                    &item.answer,
                    usize::from(inside.width).saturating_sub(34),
                    self.words,
                );
                // The title stands once for the answers of a form.
                let before = i.checked_sub(1).and_then(|b| correct.items.get(b));
                let title = match before {
                    Some(before) if before.form == item.form && i > first => "",
                    _ => &item.title,
                };
                let words = format!(
                    "{} {:<11} {:<18} {answer}",
                    if here { "›" } else { " " },
                    wrap::one_line(title, 11),
                    wrap::one_line(item.question.id.as_str(), 18),
                );
                left(buf, row(inside, y), &styled(words, style));
            }
            let keys = [
                ("↑ ↓", self.words.get(Phrase::Select)),
                ("0–9", self.words.get(Phrase::Answer)),
                ("Enter", self.words.get(Phrase::CorrectIt)),
            ];
            self.keys(buf, inside, &keys);
            return;
        }
        let Some(item) = correct.item() else {
            return;
        };
        let columns = usize::from(inside.width);
        let prompt = wrap::one_line(&item.question.prompt, columns);
        left(buf, row(inside, 1), &styled(prompt, self.theme.strong()));
        let now = answer_words(&item.answer, columns.saturating_sub(20), self.words);
        let title = wrap::one_line(&item.title, 12);
        let arrow = match &correct.step {
            Step::Reason { answer, .. } => match answer {
                Some(new) => {
                    let new = answer_words(new, columns.saturating_sub(40), self.words);
                    format!("  →  {new}")
                }
                None => format!("  →  {}", self.words.get(Phrase::Declined)),
            },
            _ => String::new(),
        };
        let line = Line::from(vec![
            Span::styled(format!("{title}: "), quiet),
            Span::styled(format!("{now}{arrow}"), self.theme.text()),
        ]);
        left(buf, row(inside, 2), &line);
        match &correct.step {
            Step::Reason { by, answer, .. } => {
                left(buf, row(inside, 3), &self.by(*by));
                let default = match answer {
                    Some(_) => format!(
                        " {}: {}.",
                        self.words.get(Phrase::PlainEnterAlone),
                        self.words.get(Phrase::Slip)
                    ),
                    None => String::new(),
                };
                let why = self.words.get(Phrase::BothKept);
                let why = styled(format!("{why}{default}"), quiet);
                left(buf, row(inside, 4), &why);
                let keys = [
                    ("Enter", self.words.get(Phrase::CorrectIt)),
                    ("Tab", self.words.get(Phrase::Author)),
                ];
                self.keys(buf, inside, &keys);
            }
            _ => {
                let new = styled(self.words.get(Phrase::NewAnswer), quiet);
                left(buf, row(inside, 4), &new);
                let keys = [
                    ("Enter", self.words.get(Phrase::Continue)),
                    ("F6", self.words.get(Phrase::Decline)),
                ];
                self.keys(buf, inside, &keys);
            }
        }
    }

    /// Asks whether to quit although saving has failed.
    fn leave_unsaved(&self, buf: &mut Buffer, inside: Rect) {
        let columns = usize::from(inside.width);
        let words = "This is in memory only, not on the disk:";
        left(buf, row(inside, 1), &styled(words, self.theme.trouble()));
        let names = unsaved_lines(self.unsaved, 5, columns);
        left_all(buf, rows(inside, 2, 5), &names, self.theme.strong());
        let words = "Enter on the page below tries to save it again. If you quit, it is tried \
                     once more; what still cannot be saved is written to a file elsewhere, in \
                     your home folder if that can be written, and the program says where.";
        let lines = wrap::paragraph(words, columns.max(1), 4);
        left_all(buf, rows(inside, 8, 4), &lines, self.theme.text());
        self.keys(buf, inside, &[("y", "quit"), ("n", "back")]);
    }

    fn ask(&self, buf: &mut Buffer, inside: Rect, words: &str, keys: &[(&str, &str)]) {
        let lines = wrap::paragraph(words, usize::from(inside.width).max(1), 3);
        left_all(buf, rows(inside, 1, 3), &lines, self.theme.text());
        self.keys(buf, inside, keys);
    }
}

impl Widget for &DialogView<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let (title, place) = self.place(area);
        let inside = dialog(buf, place, &title, self.theme);
        match self.dialog {
            Dialog::Help => self.help(buf, inside),
            Dialog::Remark { by, .. } => {
                left(buf, row(inside, 1), &self.by(*by));
                let keys = [
                    ("Enter", self.words.get(Phrase::Save)),
                    ("Tab", self.words.get(Phrase::Author)),
                ];
                self.keys(buf, inside, &keys);
            }
            Dialog::Correct(correct) => self.correct(buf, inside, correct),
            Dialog::MarkBad { trial, .. } => {
                let trial = wrap::one_line(trial, 20);
                let words = format!("Why is {trial} bad? It does not count and is repeated later.");
                self.ask(buf, inside, &words, &[("Enter", "mark as bad")]);
            }
            Dialog::Decline { .. } => {
                let words = self.words.get(Phrase::DeclineWhy);
                let keys = [("Enter", self.words.get(Phrase::Decline))];
                self.ask(buf, inside, words, &keys);
            }
            Dialog::Confirm(Confirm::Quit) if !self.unsaved.is_empty() => {
                self.leave_unsaved(buf, inside);
            }
            Dialog::Confirm(confirm) => {
                let back = self.words.get(Phrase::Back);
                let (words, yes) = match confirm {
                    Confirm::Quit => (self.leave, self.words.get(Phrase::Quit)),
                    Confirm::DropOut => (
                        "Does the participant drop out? This ends their part in the study.",
                        "drop out",
                    ),
                    Confirm::Refuse => {
                        let refuse = self.words.get(Phrase::RefuseConfirm);
                        let keys = [("Enter", refuse), ("y", back)];
                        self.ask(buf, inside, self.words.get(Phrase::RefuseSure), &keys);
                        return;
                    }
                };
                self.ask(buf, inside, words, &[("y", yes), ("n", back)]);
            }
        }
        if let Some((field, at)) = self.field(area) {
            field.render(at, buf);
        }
        if let Some((answer, at)) = self.answer(area) {
            answer.render(at, buf);
        }
    }
}
