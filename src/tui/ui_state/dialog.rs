//! Dialogs: help, remark, correction, reason, confirmation. A dialog changes nothing
//! until it is confirmed; Esc closes it.

use super::field::Field;
use crate::tui::editor::{Editor, Handled};
use crate::tui::keys::{self, Key};
use study_plan::protocol::Answer;
use study_plan::protocol::phrases::{Phrase, Words};
use study_session::outcome::{Author, Choice};
use study_session::session::view::{Correctable, View};
use study_session::session::{Input, Screen};

/// The reason of a correction if none is typed.
pub const SLIP: &str = "a slip of the key";

/// A dialog.
#[derive(Debug, Clone, PartialEq)]
pub enum Dialog {
    /// The list of keys.
    Help,
    /// A remark.
    Remark {
        /// Its author.
        by: Author,
        /// Its text.
        text: Editor,
    },
    /// A correction of an earlier answer.
    Correct(Box<Correct>),
    /// Marks a trial as bad.
    MarkBad {
        /// Title of the trial, such as "trial 7".
        trial: String,
        /// The reason.
        reason: Editor,
    },
    /// Declines the question on the screen.
    Decline {
        /// The reason.
        reason: Editor,
    },
    /// Asks for confirmation.
    Confirm(Confirm),
}

/// An action that needs confirmation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Confirm {
    /// Quit the program.
    Quit,
    /// The participant drops out.
    DropOut,
    /// Refuse consent.
    Refuse,
}

/// A correction of an earlier answer, in steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Correct {
    /// Answers that can be corrected, newest first, as of the opening of the dialog.
    pub items: Vec<Correctable>,
    /// Index of the selected answer.
    pub cursor: usize,
    /// The current step.
    pub step: Step,
}

/// Steps of a correction.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Select an answer.
    List,
    /// Enter the new answer.
    Answer(Field),
    /// Enter the reason.
    Reason {
        /// The new answer; `None`: declined, with the same reason.
        answer: Option<Answer>,
        /// Who asks for it.
        by: Author,
        /// The reason.
        reason: Editor,
    },
}

/// The effect of a key on a dialog.
#[derive(Debug, Clone, PartialEq)]
pub enum DialogResult {
    /// It stays open.
    Open(Handled),
    /// It is confirmed and closes; the inputs are sent.
    Done(Vec<Input>),
    /// It closes, and the form on the screen is sent with its question declined.
    Declined(String),
    /// It closes.
    Closed,
}

impl Dialog {
    /// A remark by the experimenter; the author can be changed.
    pub fn remark() -> Self {
        Self::Remark {
            by: Author::Experimenter,
            text: Editor::new(""),
        }
    }

    /// A correction of one of the earlier answers of the view.
    pub fn correct(view: &View) -> Self {
        Self::Correct(Box::new(Correct {
            items: view.correctable.clone(),
            cursor: 0,
            step: Step::List,
        }))
    }

    /// Whether a character, including Space, is text in this dialog.
    pub fn is_text(&self) -> bool {
        match self {
            Self::Help | Self::Confirm(_) => false,
            Self::Remark { .. } | Self::MarkBad { .. } | Self::Decline { .. } => true,
            Self::Correct(correct) => match &correct.step {
                Step::List => false,
                Step::Answer(field) => field.is_text(),
                Step::Reason { .. } => true,
            },
        }
    }

    /// The text field, if there is one.
    pub fn editor(&mut self) -> Option<&mut Editor> {
        match self {
            Self::Help | Self::Confirm(_) => None,
            Self::Remark { text, .. } => Some(text),
            Self::MarkBad { reason, .. } | Self::Decline { reason } => Some(reason),
            Self::Correct(correct) => match &mut correct.step {
                Step::List => None,
                Step::Answer(field) => field.editor(),
                Step::Reason { reason, .. } => Some(reason),
            },
        }
    }

    /// The key that opens the dialog. It also closes an empty one, without stopping a
    /// playing device.
    fn own_key(&self) -> Option<Key> {
        Some(match self {
            Self::Help => Key::Help,
            Self::Remark { .. } => Key::Remark,
            Self::Correct(_) => Key::Correct,
            Self::MarkBad { .. } => Key::MarkBad,
            Self::Decline { .. } => Key::Decline,
            Self::Confirm(_) => return None,
        })
    }

    /// Handles a key. Esc is handled by the caller.
    pub fn key(&mut self, key: Key, view: &View) -> DialogResult {
        if self.own_key() == Some(key) {
            return match self.editor() {
                Some(editor) if !editor.is_blank() => {
                    missing("The text is not saved yet: Enter saves it, Ctrl-U deletes it.")
                }
                _ => DialogResult::Closed,
            };
        }
        match self {
            Self::Help => match key {
                Key::Enter | Key::Char('?' | 'q') => DialogResult::Closed,
                _ => DialogResult::Open(Handled::No),
            },
            Self::Remark { by, text } => match key {
                Key::Enter if text.is_blank() => missing("Type a remark first, or press Esc."),
                Key::Enter => DialogResult::Done(vec![Input::Remark {
                    by: *by,
                    text: text.text().to_owned(),
                }]),
                Key::Tab | Key::BackTab => other(by),
                key => DialogResult::Open(text.key(key)),
            },
            Self::MarkBad { reason, .. } => match key {
                Key::Enter if reason.is_blank() => missing("Type a reason first, or press Esc."),
                Key::Enter => DialogResult::Done(vec![Input::MarkBad {
                    reason: reason.text().to_owned(),
                }]),
                key => DialogResult::Open(reason.key(key)),
            },
            Self::Decline { reason } => match key {
                Key::Enter if reason.is_blank() => missing(view.words.get(Phrase::DeclineWhy)),
                Key::Enter => DialogResult::Declined(reason.text().to_owned()),
                key => DialogResult::Open(reason.key(key)),
            },
            Self::Confirm(confirm) => confirm.key(key, view),
            Self::Correct(correct) => correct.key(key, &view.words),
        }
    }
}

impl Confirm {
    fn key(self, key: Key, view: &View) -> DialogResult {
        let (screen, words) = (&view.screen, &view.words);
        // The keys of the page keep their meaning: y is not the answer to a refusal.
        if self == Self::Refuse {
            return match (key, screen) {
                (Key::Enter, Screen::Consent { .. }) => {
                    DialogResult::Done(vec![Input::Consent(false)])
                }
                (Key::Enter, _) => DialogResult::Closed,
                (key, _) if keys::is_yes(key, words) => DialogResult::Closed,
                _ => missing(&format!(
                    "Enter: {}  ·  y: {}",
                    words.get(Phrase::RefuseConfirm),
                    words.get(Phrase::Back)
                )),
            };
        }
        match key {
            key if keys::is_yes(key, words) => DialogResult::Done(match (self, screen) {
                (Self::Quit, _) => vec![Input::Quit],
                (Self::DropOut, Screen::ResumeChoice { .. }) => {
                    vec![Input::Resume(Choice::DropOut)]
                }
                // The screen has changed in the meantime.
                _ => Vec::new(),
            }),
            Key::Char('n' | 'N') => DialogResult::Closed,
            _ => missing(words.get(Phrase::ChooseYesOrNo)),
        }
    }
}

impl Correct {
    /// The selected answer.
    pub fn item(&self) -> Option<&Correctable> {
        self.items.get(self.cursor)
    }

    fn key(&mut self, key: Key, words: &Words) -> DialogResult {
        let last = self.items.len().saturating_sub(1);
        let Some(item) = self.items.get(self.cursor) else {
            return DialogResult::Closed;
        };
        match &mut self.step {
            Step::List => {
                self.cursor = match key {
                    Key::Up => self.cursor.saturating_sub(1),
                    Key::Down => (self.cursor + 1).min(last),
                    Key::PageUp => self.cursor.saturating_sub(8),
                    Key::PageDown => (self.cursor + 8).min(last),
                    Key::Home => 0,
                    Key::End => last,
                    Key::Enter => {
                        let field = Field::correcting(&item.question, &item.answer);
                        self.step = Step::Answer(field);
                        self.cursor
                    }
                    // The new answer can be typed at once.
                    Key::Char('0'..='9' | '-') => {
                        let mut field = Field::correcting(&item.question, &item.answer);
                        if field.is_text() {
                            return DialogResult::Open(Handled::No);
                        }
                        let handled = field.key(&item.question, key, words);
                        self.step = Step::Answer(field);
                        return DialogResult::Open(handled);
                    }
                    _ => return DialogResult::Open(Handled::No),
                };
                DialogResult::Open(Handled::Yes)
            }
            Step::Answer(field) => match key {
                Key::Enter => match field.answer(&item.question) {
                    Ok(Some(answer)) if answer == item.answer => {
                        missing(words.get(Phrase::AlreadyAnswer))
                    }
                    Ok(Some(answer)) => self.ask_why(Some(answer)),
                    Ok(None) if matches!(field, Field::Text(_)) => {
                        self.ask_why(Some(Answer::Text(String::new())))
                    }
                    Ok(None) => missing(words.get(Phrase::NewAnswerFirst)),
                    Err(why) => missing(&why.words(words)),
                },
                Key::Decline => self.ask_why(None),
                Key::BackTab => {
                    self.step = Step::List;
                    DialogResult::Open(Handled::Yes)
                }
                key => DialogResult::Open(field.key(&item.question, key, words)),
            },
            Step::Reason { answer, by, reason } => match key {
                Key::Enter if reason.is_blank() && answer.is_none() => {
                    missing(words.get(Phrase::ReasonFirst))
                }
                Key::Enter => {
                    let reason = match reason.is_blank() {
                        true => SLIP.to_owned(),
                        false => reason.text().to_owned(),
                    };
                    let declined = Answer::Declined {
                        reason: reason.clone(),
                    };
                    DialogResult::Done(vec![Input::Correct {
                        form: item.form,
                        question: item.question.id.clone(),
                        answer: answer.clone().unwrap_or(declined),
                        reason,
                        by: *by,
                    }])
                }
                Key::Tab | Key::BackTab => other(by),
                key => DialogResult::Open(reason.key(key)),
            },
        }
    }

    fn ask_why(&mut self, answer: Option<Answer>) -> DialogResult {
        self.step = Step::Reason {
            answer,
            by: Author::Experimenter,
            reason: Editor::new(""),
        };
        DialogResult::Open(Handled::Yes)
    }
}

fn missing(what: &str) -> DialogResult {
    DialogResult::Open(Handled::Notice(what.to_owned()))
}

fn other(by: &mut Author) -> DialogResult {
    *by = match by {
        Author::Experimenter => Author::Participant,
        Author::Participant => Author::Experimenter,
    };
    DialogResult::Open(Handled::Yes)
}
