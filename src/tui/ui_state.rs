//! What is typed and chosen but not yet sent, and how keys change it.
//!
//! A [`UiState`] has no terminal, no clock and no knowledge of the study beyond the
//! [`View`] it is given. Its only effects are the [`Input`]s that it returns.
//!
//! Invariants: Esc always sends [`Input::Stop`]; Space sends it while a table is
//! loaded or playing unless a text field has the focus, and never advances; no answer is
//! preset, and without a choice Enter sends nothing. What was typed into a form is kept
//! during pauses, faults and dialogs until another form is shown.

pub mod dialog;
pub mod field;
mod key_handling;

use super::desk;
use super::editor::{Editor, Handled};
use super::keys;
use crossterm::event::Event;
use dialog::Dialog;
use field::Field;
use study_base::text::QuestionId;
use study_plan::protocol::answer::MAX_TEXT_BYTES;
use study_plan::protocol::phrases::{Phrase, Words};
use study_session::outcome::FormId;
use study_session::page::same_page;
use study_session::session::{Input, Screen, View};

/// The state of the interface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UiState {
    form: Option<(FormKey, Form)>,
    who: Option<((String, String), Who)>,
    focus: Focus,
    dialogs: Vec<Dialog>,
    /// Dialogs that are hidden while a fault is shown.
    parked: Vec<Dialog>,
    notice: Option<String>,
    reading: Reading,
    suspend: bool,
    /// At the experimenter's desk: what is said of a key that acts on the participant's page.
    desk: Option<String>,
    /// Whether the participant's page is asked for in place of the desk.
    asks_page: bool,
    /// Whether the desk is in the place of the page.
    at_desk: bool,
}

/// Where typed text goes while no dialog is open.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Focus {
    /// The first screen.
    Who,
    /// The form.
    Form,
    /// Nowhere.
    #[default]
    None,
}

/// Identifies the form that the answers belong to.
type FormKey = (FormId, u32, Vec<QuestionId>);

/// The answers to a form.
#[derive(Debug, Clone, PartialEq)]
pub struct Form {
    /// One field for each question.
    pub fields: Vec<Field>,
    /// Index of the field with the focus.
    pub focus: usize,
}

/// The first screen's two fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Who {
    /// The pseudonym.
    pub participant: Editor,
    /// The initials or code of the operator.
    pub operator: Editor,
    /// Whether the operator's field has the focus.
    pub on_operator: bool,
}

/// The scroll position of a long text.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reading {
    /// Lines above the visible part.
    pub scrolled: usize,
    /// Largest value of `scrolled`.
    pub most: usize,
    /// Visible lines.
    pub page: usize,
}

/// Targets of the mouse.
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

    /// The topmost dialog.
    pub fn dialog(&self) -> Option<&Dialog> {
        self.dialogs.last()
    }

    /// Shows the desk in place of what the participant reads; the text is said of keys that act on
    /// their page.
    pub fn set_desk(&mut self, elsewhere: String) {
        self.desk = Some(elsewhere);
    }

    /// Whether the desk is in the place of the participant's page: nothing on that page is drawn, and no
    /// key acts on it.
    pub fn at_desk(&self) -> bool {
        self.at_desk
    }

    /// A notice about the last key.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// The scroll position of a long text.
    pub fn reading(&self) -> Reading {
        self.reading
    }

    /// Sets the largest scroll position and the visible lines.
    pub fn set_room(&mut self, most: usize, page: usize) {
        self.reading.most = most;
        self.reading.page = page;
        self.reading.scrolled = self.reading.scrolled.min(most);
    }

    /// Sets the width of the text field with the focus, in cells.
    pub fn set_columns(&mut self, columns: usize) {
        if let Some(editor) = self.editor() {
            editor.set_width(columns);
        }
    }

    /// Whether Ctrl-Z was pressed since the last call.
    pub fn take_suspend(&mut self) -> bool {
        std::mem::take(&mut self.suspend)
    }

    /// Adapts to the screen of a view. Returns whether it differs from the last one.
    pub fn follow(&mut self, view: &View, old: Option<&Screen>) -> bool {
        self.focus = Focus::None;
        match &view.screen {
            Screen::Form {
                form,
                questions,
                page,
                ..
            } => {
                let ids = questions.iter().map(|q| q.id.clone()).collect();
                let form_id = *form;
                let key = (form_id, *page, ids);
                if self.form.as_ref().is_none_or(|(old, _)| *old != key) {
                    let form = Form {
                        fields: questions
                            .iter()
                            .map(|q| Field::with(q, view.given(form_id, &q.id)))
                            .collect(),
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
        self.at_desk = self.desk.is_some() && !self.asks_page && desk::covers(&view.screen);
        if self.at_desk {
            self.focus = Focus::None;
        }
        // A dialog must not cover a fault, and typed text must not be lost.
        if is_fault(&view.screen) {
            if !old.is_some_and(is_fault) {
                self.parked.append(&mut self.dialogs);
            }
        } else {
            let mut back = std::mem::take(&mut self.parked);
            back.append(&mut self.dialogs);
            self.dialogs = back;
        }
        let changed = old.is_none_or(|old| !same_page(old, &view.screen));
        if changed {
            self.reading = Reading::default();
            self.notice = None;
        }
        changed
    }

    /// The inputs that an event causes. Mouse clicks are handled by [`UiState::pick`].
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
                let handled = match self.editor() {
                    Some(editor) => editor.insert(text),
                    None => Handled::Notice("There is no text field to paste into.".to_owned()),
                };
                self.show_notice(handled, &view.words);
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// Handles a click on a target.
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

    /// Scrolls a long text with the mouse wheel.
    pub fn scroll(&mut self, down: bool) {
        let Reading { scrolled, most, .. } = self.reading;
        self.reading.scrolled = if down {
            (scrolled + 3).min(most)
        } else {
            scrolled.saturating_sub(3)
        };
    }

    fn show_notice(&mut self, handled: Handled, words: &Words) {
        match handled {
            Handled::Notice(what) => self.notice = Some(what),
            Handled::Cut => {
                let kib = MAX_TEXT_BYTES / 1024;
                self.notice = Some(words.fill(Phrase::TextCut, &[("kib", &kib)]));
            }
            Handled::No | Handled::Yes => {}
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

/// Whether the screen reports a fault.
fn is_fault(screen: &Screen) -> bool {
    matches!(
        screen,
        Screen::DeviceTrouble { .. } | Screen::SaveTrouble { .. }
    )
}
