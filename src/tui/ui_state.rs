//! What is typed and chosen but not yet sent, and what a key does to it.
//!
//! A [`UiState`] is the state of the screen's surface and nothing else: it has no
//! terminal, no clock and no knowledge of the study beyond the [`View`] it is
//! given. Its only effects are the [`Input`]s that it returns.
//!
//! Invariants: Esc always sends [`Input::Stop`]; Space sends it while a table is
//! loaded or playing unless a text has the focus, and never advances; nothing is
//! preset, and without a choice Enter sends nothing. What was typed into a form
//! survives pauses, troubles and dialogs until another form is shown.

pub mod dialog;
pub mod field;
mod key_handling;

use super::editor::{Editor, Handled};
use super::keys;
use crossterm::event::Event;
use dialog::Dialog;
use field::Field;
use study_base::text::QuestionId;
use study_core::outcome::Place;
use study_core::session::{Input, Screen, View};

/// The surface's state.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UiState {
    form: Option<(FormKey, Form)>,
    who: Option<((String, String), Who)>,
    focus: Focus,
    dialogs: Vec<Dialog>,
    /// Dialogs that a trouble has put aside.
    parked: Vec<Dialog>,
    notice: Option<String>,
    reading: Reading,
    suspend: bool,
}

/// Where text without a dialog goes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Focus {
    /// Into the first screen.
    Who,
    /// Into the form.
    Form,
    /// Nowhere.
    #[default]
    None,
}

/// Which form a draft belongs to.
type FormKey = (Place, u32, Vec<QuestionId>);

/// The answers to a form.
#[derive(Debug, Clone, PartialEq)]
pub struct Form {
    /// One for each question.
    pub fields: Vec<Field>,
    /// Which has the focus.
    pub focus: usize,
}

/// The first screen's two fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Who {
    /// Pseudonym.
    pub participant: Editor,
    /// Initials or code.
    pub operator: Editor,
    /// Whether the operator's field has the focus.
    pub on_operator: bool,
}

/// How far a long text is read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reading {
    /// Lines that are scrolled away.
    pub scrolled: usize,
    /// Most lines that can be.
    pub most: usize,
    /// Lines that fit on the page.
    pub page: usize,
}

/// What the mouse can hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// A number on the scale of a question.
    Number(usize, f64),
    /// An option of a question's list.
    Option(usize, usize),
    /// A field of the form.
    Field(usize),
}

impl UiState {
    /// The form on the screen, if there is one.
    pub fn form(&self) -> Option<&Form> {
        self.form.as_ref().map(|(_, form)| form)
    }

    /// The first screen's fields.
    pub fn who(&self) -> Option<&Who> {
        self.who.as_ref().map(|(_, who)| who)
    }

    /// The dialog that is on top.
    pub fn dialog(&self) -> Option<&Dialog> {
        self.dialogs.last()
    }

    /// Something to say about the last key.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// How far a long text is read.
    pub fn reading(&self) -> Reading {
        self.reading
    }

    /// Tells how much of the text on the screen fits.
    pub fn set_room(&mut self, most: usize, page: usize) {
        self.reading.most = most;
        self.reading.page = page;
        self.reading.scrolled = self.reading.scrolled.min(most);
    }

    /// Tells how wide the text with the focus is drawn.
    pub fn set_columns(&mut self, columns: usize) {
        if let Some(editor) = self.editor() {
            editor.drawn_in(columns);
        }
    }

    /// Whether the program was asked to go to the background, once.
    pub fn take_suspend(&mut self) -> bool {
        std::mem::take(&mut self.suspend)
    }

    /// Follows the view to another screen. Returns whether it was another one.
    pub fn follow(&mut self, view: &View, old: Option<&Screen>) -> bool {
        self.focus = Focus::None;
        match &view.screen {
            Screen::Form {
                place,
                questions,
                page,
                ..
            } => {
                let ids = questions.iter().map(|q| q.id.clone()).collect();
                let key = (*place, *page, ids);
                if self.form.as_ref().is_none_or(|(old, _)| *old != key) {
                    let form = Form {
                        fields: questions.iter().map(Field::new).collect(),
                        focus: 0,
                    };
                    self.form = Some((key, form));
                }
                self.focus = Focus::Form;
            }
            Screen::Who {
                participant,
                operator,
                ..
            } => {
                let preset = (participant.clone(), operator.clone());
                if self.who.as_ref().is_none_or(|(old, _)| *old != preset) {
                    let who = Who {
                        participant: Editor::line(participant),
                        operator: Editor::line(operator),
                        on_operator: !participant.is_empty() && operator.is_empty(),
                    };
                    self.who = Some((preset, who));
                }
                self.focus = Focus::Who;
            }
            _ => {}
        }
        // A trouble must not hide behind a dialog, nor what is typed be lost.
        if is_trouble(&view.screen) {
            if !old.is_some_and(is_trouble) {
                self.parked.append(&mut self.dialogs);
            }
        } else {
            let mut back = std::mem::take(&mut self.parked);
            back.append(&mut self.dialogs);
            self.dialogs = back;
        }
        let other = old.is_none_or(|old| !same_page(old, &view.screen));
        if other {
            self.reading = Reading::default();
            self.notice = None;
        }
        other
    }

    /// What an event means. Mouse clicks come through [`UiState::pick`].
    pub fn key(&mut self, event: &Event, view: &View) -> Vec<Input> {
        match event {
            Event::Key(event) => {
                let Some(key) = keys::read(event) else {
                    return Vec::new();
                };
                self.notice = None;
                self.press(key, view)
            }
            Event::Paste(text) => {
                self.notice = None;
                let taken = match self.editor() {
                    Some(editor) => editor.insert(text),
                    None => Handled::Notice("There is no text field to paste into.".to_owned()),
                };
                self.say(taken);
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// Takes a click.
    pub fn pick(&mut self, target: Target, view: &View) {
        let Screen::Form { questions, .. } = &view.screen else {
            return;
        };
        let Some((_, form)) = &mut self.form else {
            return;
        };
        if !self.dialogs.is_empty() {
            return;
        }
        self.notice = None;
        let (Target::Number(at, _) | Target::Option(at, _) | Target::Field(at)) = target;
        let (Some(field), Some(question)) = (form.fields.get_mut(at), questions.get(at)) else {
            return;
        };
        form.focus = at;
        match target {
            Target::Number(_, number) => field.set_number(question, number),
            Target::Option(_, option) => field.toggle(question, option),
            Target::Field(_) => {}
        }
    }

    /// Scrolls a long text with the wheel.
    pub fn scroll(&mut self, down: bool) {
        let Reading { scrolled, most, .. } = self.reading;
        self.reading.scrolled = if down {
            (scrolled + 3).min(most)
        } else {
            scrolled.saturating_sub(3)
        };
    }

    fn say(&mut self, taken: Handled) {
        if let Handled::Notice(what) = taken {
            self.notice = Some(what);
        }
    }

    fn editor(&mut self) -> Option<&mut Editor> {
        if let Some(dialog) = self.dialogs.last_mut() {
            return dialog.editor();
        }
        match self.focus {
            Focus::Form => self.form.as_mut()?.1.focused()?.editor(),
            Focus::Who => Some(self.who.as_mut()?.1.focused()),
            Focus::None => None,
        }
    }
}

impl Form {
    fn focused(&mut self) -> Option<&mut Field> {
        self.fields.get_mut(self.focus)
    }
}

impl Who {
    fn focused(&mut self) -> &mut Editor {
        if self.on_operator {
            &mut self.operator
        } else {
            &mut self.participant
        }
    }
}

/// Whether two screens are the same one with other numbers on it.
fn same_page(a: &Screen, b: &Screen) -> bool {
    match (a, b) {
        (
            Screen::Form {
                place: p1,
                page: n1,
                questions: q1,
                ..
            },
            Screen::Form {
                place: p2,
                page: n2,
                questions: q2,
                ..
            },
        ) => (p1, n1, q1) == (p2, n2, q2),
        (Screen::Message { kind: a, .. }, Screen::Message { kind: b, .. }) => a == b,
        (a, b) => std::mem::discriminant(a) == std::mem::discriminant(b),
    }
}

/// Whether the screen reports something that must not be overlooked.
fn is_trouble(screen: &Screen) -> bool {
    matches!(
        screen,
        Screen::DeviceTrouble { .. } | Screen::SaveTrouble { .. }
    )
}
