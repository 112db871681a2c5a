//! Key handling: first keys that work everywhere, then the topmost dialog, then the
//! screen.

use super::dialog::{Confirm, Dialog, DialogResult};
use super::{Focus, UiState};
use crate::tui::editor::{Editor, Handled};
use crate::tui::keys::{self, Key};
use crossterm::event::Event;
use study_base::text::QuestionId;
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{Answer, Question, Turn};
use study_session::outcome::Choice;
use study_session::page::{self, NOT_BEGUN};
use study_session::session::{Input, Roster, Screen, View};

impl UiState {
    /// The inputs that a key causes.
    pub(super) fn press(&mut self, key: Key, view: &View) -> Vec<Input> {
        match key {
            Key::Esc => {
                self.dialogs.pop();
                return vec![Input::Stop];
            }
            Key::Char(' ') if view.armed && !self.is_text() => return vec![Input::Stop],
            Key::Quit if self.dialogs.is_empty() && page::before_leaving(view).is_none() => {
                return vec![Input::Quit];
            }
            Key::Quit => {
                let quit = Dialog::Confirm(Confirm::Quit);
                self.dialogs.retain(|open| *open != quit);
                self.dialogs.push(quit);
                return Vec::new();
            }
            Key::Suspend => {
                self.suspend = true;
                return vec![Input::Pause];
            }
            Key::Pause if matches!(view.screen, Screen::Who { .. }) => {
                return self.notify(NOT_BEGUN);
            }
            Key::Pause => return vec![Input::Pause],
            Key::Help if self.dialog() != Some(&Dialog::Help) => {
                self.dialogs.push(Dialog::Help);
                return Vec::new();
            }
            // The help names the keys of the page below it.
            key if is_command(key) && self.dialog() == Some(&Dialog::Help) => {
                self.dialogs.pop();
                return self.press(key, view);
            }
            _ => {}
        }
        if !self.dialogs.is_empty() {
            return self.press_in_dialog(key, view);
        }
        if key == Key::Desk && self.desk.is_some() {
            self.asks_page = !self.asks_page;
            return Vec::new();
        }
        if let Some(opened) = self.command(key, view) {
            match opened {
                Ok(dialog) => self.dialogs.push(dialog),
                Err(why) => self.notice = Some(why),
            }
            return Vec::new();
        }
        self.press_on_screen(key, view)
    }

    /// The inputs that a key causes in a terminal that is too small to draw a page: stop,
    /// or quit after confirmation. Nothing can be answered there.
    pub fn blind(&mut self, event: &Event, view: &View) -> Vec<Input> {
        let Event::Key(event) = event else {
            return Vec::new();
        };
        let leaving = self.dialog() == Some(&Dialog::Confirm(Confirm::Quit));
        match keys::read(event) {
            Some(Key::Char(' ')) if view.armed => vec![Input::Stop],
            Some(key @ (Key::Esc | Key::Quit | Key::Desk)) => self.press(key, view),
            Some(key @ Key::Char(_)) if leaving => self.press(key, view),
            _ => Vec::new(),
        }
    }

    /// Whether a character, including Space, is text at the moment.
    pub fn is_text(&self) -> bool {
        match (self.dialog(), self.focus) {
            (Some(dialog), _) => dialog.is_text(),
            (None, Focus::Who) => true,
            (None, Focus::Form) => self
                .form()
                .and_then(|form| form.fields.get(form.focus))
                .is_some_and(super::Field::is_text),
            (None, Focus::None) => false,
        }
    }

    /// The dialog that a key opens, or why it cannot be opened; `None` for other keys.
    fn command(&self, key: Key, view: &View) -> Option<Result<Dialog, String>> {
        let not_begun = matches!(view.screen, Screen::Who { .. });
        Some(match key {
            Key::Char('?') if !self.is_text() => Ok(Dialog::Help),
            Key::Remark | Key::Correct | Key::MarkBad if not_begun => Err(NOT_BEGUN.to_owned()),
            Key::Remark => Ok(Dialog::remark()),
            Key::Correct if view.correctable.is_empty() => {
                Err(view.words.get(Phrase::NothingToCorrect).to_owned())
            }
            Key::Correct => Ok(Dialog::correct(view)),
            Key::MarkBad => match &view.can_mark_bad {
                Some(trial) => Ok(Dialog::MarkBad {
                    trial: trial.clone(),
                    reason: Editor::new(""),
                }),
                None => Err("There is no trial to mark as bad.".to_owned()),
            },
            // What is declined or felt again is asked for on a page that is not on the screen.
            Key::Decline | Key::Replay if self.at_desk => {
                Err(self.desk.clone().unwrap_or_default())
            }
            Key::Decline => match &view.screen {
                Screen::Form { form, .. } if form.can_be_declined() => Ok(Dialog::Decline {
                    reason: Editor::new(""),
                }),
                _ => Err(view.words.get(Phrase::PlainNoQuestion).to_owned()),
            },
            Key::Replay => match &view.screen {
                Screen::Form { .. } if view.can_replay => return None,
                Screen::Stopped { .. } => return None,
                _ => Err(page::why_not_again(view).to_owned()),
            },
            _ => return None,
        })
    }

    fn press_in_dialog(&mut self, key: Key, view: &View) -> Vec<Input> {
        let Some(dialog) = self.dialogs.last_mut() else {
            return Vec::new();
        };
        match dialog.key(key, view) {
            DialogResult::Open(Handled::No) if is_command(key) => {
                self.notify(view.words.get(Phrase::FinishFirst))
            }
            DialogResult::Open(handled) => {
                self.show_notice(handled, &view.words);
                Vec::new()
            }
            DialogResult::Done(inputs) => {
                self.dialogs.pop();
                inputs
            }
            DialogResult::Closed => {
                self.dialogs.pop();
                Vec::new()
            }
            DialogResult::Declined(reason) => {
                self.dialogs.pop();
                match &view.screen {
                    Screen::Form { questions, .. } => {
                        self.submit(questions, Some(reason), &view.words)
                    }
                    _ => Vec::new(),
                }
            }
        }
    }

    fn press_on_screen(&mut self, key: Key, view: &View) -> Vec<Input> {
        if self.at_desk {
            return self.press_at_desk(key);
        }
        let read = self.reading.scrolled >= self.reading.most;
        match &view.screen {
            Screen::Who {
                claiming, roster, ..
            } => self.press_who(key, *claiming, roster.as_deref(), &view.words),
            Screen::ResumeChoice { restart, .. } => match key {
                Key::Char('b' | 'B') if *restart => vec![Input::Resume(Choice::RestartBlock)],
                Key::Char('c' | 'C') => vec![Input::Resume(Choice::Continue)],
                Key::Char('d' | 'D') => self.confirm(Confirm::DropOut),
                Key::Enter if *restart => self.notify("Choose b, c or d."),
                Key::Enter => self.notify("Choose c or d."),
                _ => Vec::new(),
            },
            Screen::Consent { .. } => match key {
                // Nobody agrees to a text whose end was not on the screen.
                key if keys::is_yes(key, &view.words) => match read {
                    true => vec![Input::Consent(true)],
                    false => self.press_reading(Key::Enter, view),
                },
                Key::Char('n' | 'N') => self.confirm(Confirm::Refuse),
                Key::Enter if read => self.notify(view.words.get(Phrase::ChooseYesOrNo)),
                // The text may be long.
                key => self.press_reading(key, view),
            },
            // Elsewhere it is explained.
            Screen::Form { .. } | Screen::Stopped { .. } if key == Key::Replay => {
                vec![Input::PlayAgain]
            }
            Screen::Form { questions, .. } => self.press_form(key, questions, view),
            Screen::Message { .. } | Screen::End { .. } | Screen::Break { .. } => {
                self.press_reading(key, view)
            }
            Screen::Stopped { can_rate } => match key {
                Key::Enter => vec![Input::PlayAgain],
                Key::Char('r' | 'R') if *can_rate => vec![Input::RateStopped],
                _ => Vec::new(),
            },
            Screen::SaveTrouble { .. } => match key {
                Key::Enter => vec![Input::RetrySave],
                _ => Vec::new(),
            },
            Screen::Playing { .. } => match turn(key, view) {
                Some(turn) => vec![Input::Adjust(turn)],
                None => advance(key, view),
            },
            Screen::Reference { .. }
            | Screen::Loading { .. }
            | Screen::Mount { .. }
            | Screen::Stopping
            | Screen::DeviceTrouble { .. }
            | Screen::Saving
            | Screen::Paused { .. } => advance(key, view),
        }
    }

    /// Keys at the desk: nobody answers or goes on on a page that is not on the screen.
    fn press_at_desk(&mut self, key: Key) -> Vec<Input> {
        if matches!(key, Key::Enter | Key::Tab | Key::BackTab | Key::Char(_)) {
            self.notice.clone_from(&self.desk);
        }
        Vec::new()
    }

    fn press_who(
        &mut self,
        key: Key,
        claiming: bool,
        roster: Option<&Roster>,
        words: &Words,
    ) -> Vec<Input> {
        let Some((_, who)) = &mut self.who else {
            return Vec::new();
        };
        if claiming {
            return Vec::new();
        }
        match key {
            Key::Tab | Key::BackTab | Key::Up | Key::Down => who.on_operator = !who.on_operator,
            Key::Enter if who.participant.is_blank() => {
                who.on_operator = false;
                match roster.and_then(Roster::proposed) {
                    // The id that is proposed; another Enter goes on with it.
                    Some(id) => who.participant = Editor::line(id.as_str()),
                    None => return self.notify("Type the participant's id first."),
                }
            }
            Key::Enter if !who.on_operator && who.operator.is_blank() => who.on_operator = true,
            Key::Enter => {
                return vec![Input::Identify {
                    participant: who.participant.text().trim().to_owned(),
                    operator: who.operator.text().trim().to_owned(),
                }];
            }
            // The id that is proposed.
            Key::Right if !who.on_operator && who.participant.text().is_empty() => {
                if let Some(id) = roster.and_then(Roster::proposed) {
                    who.participant = Editor::line(id.as_str());
                }
            }
            key => {
                let handled = who.focused().key(key);
                self.show_notice(handled, words);
            }
        }
        Vec::new()
    }

    fn press_form(&mut self, key: Key, questions: &[Question], view: &View) -> Vec<Input> {
        let words = &view.words;
        let Some((_, form)) = &mut self.form else {
            return Vec::new();
        };
        let count = form.fields.len().max(1);
        match key {
            Key::Enter => return self.submit(questions, None, words),
            Key::Tab => form.focus = (form.focus + 1) % count,
            Key::BackTab if view.can_go_back && form.focus == 0 => return vec![Input::Back],
            Key::BackTab => form.focus = (form.focus + count - 1) % count,
            key => {
                let at = form.focus;
                let (Some(question), Some(field)) = (questions.get(at), form.fields.get_mut(at))
                else {
                    return Vec::new();
                };
                match field.key(question, key, words) {
                    Handled::No if key == Key::PageUp && view.can_go_back => {
                        return vec![Input::Back];
                    }
                    Handled::No if key == Key::Down => form.focus = (at + 1).min(count - 1),
                    Handled::No if key == Key::Up => form.focus = at.saturating_sub(1),
                    handled => self.show_notice(handled, words),
                }
            }
        }
        Vec::new()
    }

    /// Sends the form, or shows what is missing. With a reason, the first question is
    /// declined and the other answers are sent with it.
    fn submit(
        &mut self,
        questions: &[Question],
        declined: Option<String>,
        words: &Words,
    ) -> Vec<Input> {
        let Some((_, form)) = &mut self.form else {
            return Vec::new();
        };
        let mut answers: Vec<(QuestionId, Answer)> = Vec::new();
        for (at, (question, field)) in questions.iter().zip(&form.fields).enumerate() {
            let answer = match &declined {
                Some(reason) if at == 0 => Ok(Some(Answer::Declined {
                    reason: reason.clone(),
                })),
                _ => field.answer(question),
            };
            match answer {
                Ok(Some(answer)) => answers.push((question.id.clone(), answer)),
                Ok(None) => {}
                Err(why) => {
                    form.focus = at;
                    return self.notify(&why.words(words));
                }
            }
        }
        vec![Input::Answer(answers)]
    }

    /// Keys of a long text: it must be scrolled to its end before Enter advances.
    fn press_reading(&mut self, key: Key, view: &View) -> Vec<Input> {
        let super::Reading {
            scrolled,
            most,
            page,
        } = self.reading;
        let page = page.saturating_sub(1).max(1);
        self.reading.scrolled = match key {
            Key::Up => scrolled.saturating_sub(1),
            Key::Down => (scrolled + 1).min(most),
            Key::PageUp => scrolled.saturating_sub(page),
            Key::PageDown => (scrolled + page).min(most),
            Key::Enter if scrolled < most => (scrolled + page).min(most),
            Key::Home => 0,
            Key::End => most,
            key => return advance(key, view),
        };
        Vec::new()
    }

    fn confirm(&mut self, what: Confirm) -> Vec<Input> {
        self.dialogs.push(Dialog::Confirm(what));
        Vec::new()
    }

    fn notify(&mut self, what: &str) -> Vec<Input> {
        self.notice = Some(what.to_owned());
        Vec::new()
    }
}

/// Whether a key asks for something of the page and has no other meaning in a dialog.
fn is_command(key: Key) -> bool {
    matches!(
        key,
        Key::Remark | Key::Correct | Key::MarkBad | Key::Decline | Key::Replay | Key::Desk
    )
}

/// What a key changes where a level is set.
fn turn(key: Key, view: &View) -> Option<Turn> {
    let own = view.adjusting.as_ref().filter(|own| !own.at_standard)?;
    match key {
        Key::Left | Key::Char('-') if own.can_lower => Some(Turn::Lower),
        Key::Right | Key::Char('+') if own.can_higher => Some(Turn::Higher),
        Key::Char('s' | 'S') if own.has_standard => Some(Turn::Standard),
        _ => None,
    }
}

fn advance(key: Key, view: &View) -> Vec<Input> {
    if key == Key::Enter && view.can_advance {
        vec![Input::Advance]
    } else {
        Vec::new()
    }
}
