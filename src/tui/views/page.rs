//! The page: banner and progress, the screen, a notice, the keys, the experimenter's
//! status line, and a dialog above them. A terminal that is too small shows a message.

use super::MINIMUM;
use super::desk::{self, DeskView};
use super::dialogs::DialogView;
use super::form::FormView;
use super::playing::Playing;
use super::prose::{ProseView, prose};
use super::status::{Status, Top};
use super::trouble::Trouble;
use super::who::WhoView;
use crate::tui::desk::{Desk, Say, Strip, covers};
use crate::tui::keys;
use crate::tui::theme::Theme;
use crate::tui::ui_state::dialog::{Confirm, Dialog};
use crate::tui::ui_state::{Target, UiState};
use crate::tui::widgets::{cap, center, hint_gap, hints, hints_fit, middle, row, rows, styled};
use crate::tui::wrap;
use crossterm::event::KeyCode;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::widgets::{Clear, Widget};
use study_plan::protocol::Entry;
use study_plan::protocol::phrases::Phrase;
use study_session::page::{self, Button, Kind};
use study_session::session::view::DeviceState;
use study_session::session::{Screen, View};

/// Rows of a notice. A longer one is cut, so the most important words come first.
const NOTICE_ROWS: usize = 3;
/// Keys that are always shown where the experimenter enters the answers.
const COMMANDS: &str = "F2: remark  ·  F3: correct  ·  F4: bad trial  ·  F5: pause  ·  F6: decline";

/// Everything that the terminal shows.
#[derive(Debug)]
pub struct Page<'a> {
    /// What the session shows.
    pub view: &'a View,
    /// What it says.
    pub content: page::Page,
    /// What has been entered.
    pub state: &'a UiState,
    /// Whether it shows that telemetry arrives.
    pub live: bool,
    /// What the experimenter's desk knows, if there is one, and the course of the session.
    pub desk: Option<&'a (Desk, Strip)>,
    /// Whether an Enter would not advance now.
    pub waits: bool,
    /// The styles.
    pub theme: Theme,
}

/// Sizes of a page that scrolling and text editing need.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TextRoom {
    /// Largest scroll position, in lines.
    pub most: usize,
    /// Lines of a long text that fit on the page.
    pub page: usize,
    /// Width of the text field with the focus.
    pub columns: Option<usize>,
}

/// A key and what it does.
type Hint = (String, String);

impl<'a> Page<'a> {
    /// What is drawn in the place of the participant's page, if that is the desk.
    fn at_desk(&self) -> Option<&'a (Desk, Strip)> {
        self.desk.filter(|_| self.state.at_desk())
    }

    /// The smallest area in which the screen is drawn: columns and rows.
    fn minimum(&self) -> (u16, u16) {
        match self.at_desk() {
            Some(_) => desk::MINIMUM,
            None => MINIMUM,
        }
    }

    /// Whether an area is too small for the screen.
    pub fn is_small(&self, area: Rect) -> bool {
        let (columns, rows) = self.minimum();
        area.width < columns || area.height < rows
    }

    /// The area of the screen.
    fn body(area: Rect) -> Rect {
        rows(area, 1, area.height.saturating_sub(5))
    }

    fn form(&self) -> Option<FormView<'_>> {
        match &self.view.screen {
            Screen::Form {
                questions,
                to_experimenter,
                ..
            } if self.at_desk().is_none() => Some(FormView {
                view: self.view,
                page: &self.content,
                questions,
                to_experimenter: *to_experimenter,
                form: self.state.form()?,
                focused: self.state.dialog().is_none(),
                theme: self.theme,
            }),
            _ => None,
        }
    }

    fn who(&self) -> Option<WhoView<'a>> {
        match &self.view.screen {
            Screen::Who {
                claiming, roster, ..
            } => Some(WhoView {
                roster: roster.as_deref(),
                who: self.state.who()?,
                claiming: *claiming,
                focused: self.state.dialog().is_none(),
                theme: self.theme,
            }),
            _ => None,
        }
    }

    fn dialog(&self) -> Option<DialogView<'a>> {
        Some(DialogView {
            dialog: self.state.dialog()?,
            armed: self.view.armed,
            leave: page::before_leaving(self.view).unwrap_or_default(),
            words: &self.view.words,
            unsaved: &self.view.unsaved,
            theme: self.theme,
        })
    }

    /// The keys that have an effect now; where the line is too narrow for all, the first
    /// ones are left to the help.
    fn offered(&self, columns: u16) -> Vec<Hint> {
        let mut keys = self.keys();
        keys.retain(|(key, _)| !(self.waits && key == "Enter"));
        while keys.len() > 1 && !hints_fit(&borrowed(&keys), columns) {
            keys.remove(0);
        }
        keys
    }

    /// The key whose hint is at a position.
    pub fn key_at(&self, area: Rect, place: Position) -> Option<KeyCode> {
        let line = row(area, area.height.saturating_sub(3));
        if self.is_small(area) || self.state.dialog().is_some() || place.y != line.y {
            return None;
        }
        let keys = self.offered(area.width);
        let wide = |(key, what): &Hint| {
            let cells = wrap::width(key) + 2 + wrap::width(what);
            u16::try_from(cells).unwrap_or(u16::MAX)
        };
        // As `hints` and `caps` place them.
        let (edge, gap) = match self.has_caps() {
            true => (4, 3),
            false => (0, hint_gap(&borrowed(&keys), area.width)),
        };
        let count = u16::try_from(keys.len()).unwrap_or(u16::MAX);
        let wide = |key: &Hint| wide(key).saturating_add(2 * edge);
        let all = keys.iter().map(wide).sum::<u16>() + gap * count.saturating_sub(1);
        let mut x = area.x + area.width.saturating_sub(all) / 2;
        for key in &keys {
            if (x..x.saturating_add(wide(key))).contains(&place.x) {
                return Some(match key.0.as_str() {
                    "Enter" => KeyCode::Enter,
                    "Esc" => KeyCode::Esc,
                    "Tab" => KeyCode::Tab,
                    "Shift-Tab" => KeyCode::BackTab,
                    "F2" => KeyCode::F(2),
                    "F3" => KeyCode::F(3),
                    "F5" => KeyCode::F(5),
                    "F7" => KeyCode::F(7),
                    "F9" => KeyCode::F(9),
                    "F10" => KeyCode::F(10),
                    _ => return None,
                });
            }
            x = x.saturating_add(wide(key) + gap);
        }
        None
    }

    /// The target at a position.
    pub fn hit(&self, area: Rect, place: Position) -> Option<Target> {
        if self.is_small(area) || self.state.dialog().is_some() {
            return None;
        }
        self.form()?.hit(Self::body(area), place)
    }

    /// The position of the terminal's cursor.
    pub fn cursor(&self, area: Rect) -> Option<Position> {
        if self.is_small(area) {
            return None;
        }
        let body = Self::body(area);
        if let Some(dialog) = self.dialog() {
            return dialog.cursor(body);
        }
        if let Some(form) = self.form() {
            return form.cursor(body);
        }
        self.who()?.cursor(body)
    }

    /// The sizes of this page in an area.
    pub fn room(&self, area: Rect) -> TextRoom {
        if self.is_small(area) {
            return TextRoom::default();
        }
        let body = Self::body(area);
        let (most, page) = match prose(&self.content).filter(|_| self.at_desk().is_none()) {
            Some(prose) => self.prose(&prose).room(body),
            None => (0, 0),
        };
        let columns = match (self.dialog(), self.form()) {
            (Some(dialog), _) => dialog.columns(body),
            (None, Some(form)) => form.columns(body),
            (None, None) => None,
        };
        TextRoom {
            most,
            page,
            columns,
        }
    }

    fn prose<'b>(&self, prose: &'b super::prose::Prose) -> ProseView<'b> {
        ProseView {
            prose,
            reading: self.state.reading(),
            theme: self.theme,
        }
    }

    fn screen(&self, area: Rect, buf: &mut Buffer) {
        if let Some((desk, strip)) = self.at_desk() {
            let desk = DeskView {
                view: self.view,
                page: &self.content,
                desk,
                strip,
                theme: self.theme,
            };
            desk.render(area, buf);
        } else if let Some(form) = self.form() {
            form.render(area, buf);
        } else if let Some(who) = self.who() {
            who.render(area, buf);
        } else if let Some(trouble) = Trouble::of(&self.content, self.theme) {
            trouble.render(area, buf);
        } else if let Some(playing) = Playing::of(&self.content, self.theme) {
            playing.render(area, buf);
        } else if let Some(prose) = prose(&self.content) {
            self.prose(&prose).render(area, buf);
        }
    }

    /// The keys at the foot of the screen.
    fn keys(&self) -> Vec<Hint> {
        let Some((desk, _)) = self.desk.filter(|_| covers(&self.view.screen)) else {
            return self.page_keys();
        };
        let words = &self.view.words;
        let hint = |key: &str, what: Phrase| (key.to_owned(), words.get(what).to_owned());
        let own = |key: &str, what: Say| (key.to_owned(), what.get(desk.language).to_owned());
        if self.at_desk().is_none() {
            return [vec![own("F9", Say::DeskKey)], self.page_keys()].concat();
        }
        let mut all = vec![
            hint("F3", Phrase::CorrectIt),
            hint("F2", Phrase::Remark),
            own("F5", Say::PauseKey),
            own("F9", Say::PageKey),
        ];
        if self.view.armed {
            all.push(hint("Esc", Phrase::Stop));
        }
        all
    }

    /// Those of the page.
    fn page_keys(&self) -> Vec<Hint> {
        let words = &self.view.words;
        let hint = |key: &str, what: Phrase| (key.to_owned(), words.get(what).to_owned());
        if let Some(form) = self.form() {
            return form.hints();
        }
        let reading = self.state.reading();
        match self.content.kind {
            Kind::Who if self.who().is_some_and(|who| !who.claiming) => {
                return vec![
                    hint("Tab", Phrase::OtherField),
                    hint("Enter", Phrase::Begin),
                ];
            }
            Kind::Consent if reading.scrolled < reading.most => {
                return vec![hint("Enter", Phrase::ReadOn), hint("↑ ↓", Phrase::Scroll)];
            }
            // Chosen by a letter.
            Kind::Resume | Kind::Consent | Kind::Stopped => return Vec::new(),
            _ if reading.scrolled < reading.most => {
                return vec![hint("Enter", Phrase::ReadOn), hint("↑ ↓", Phrase::Scroll)];
            }
            _ => {}
        }
        // What changes a level is drawn above.
        let offered = |b: &&Button| b.enabled && b.does.turn().is_none();
        let enabled = self.content.buttons.iter().filter(offered);
        let mut all: Vec<Hint> = enabled
            .map(|b| (keys::of(b.does).to_owned(), b.label.clone()))
            .collect();
        if matches!(
            self.content.kind,
            Kind::Playing | Kind::Loading | Kind::Mount
        ) {
            all.push(hint("Esc", Phrase::Stop));
        }
        all
    }

    /// Whether the page is the participant's: not the experimenter's own ones, nor with
    /// `--live`. On the desk everything is above the status line.
    fn own(&self) -> bool {
        if self.desk.is_some() {
            return self.at_desk().is_some();
        }
        self.view.entry == Entry::Participant
            && !self.live
            && !self.content.is_of_experimenter(self.view)
    }

    /// The keys of a playing device as caps, large: the participant looks elsewhere.
    fn caps(&self, area: Rect, keys: &[(&str, &str)], buf: &mut Buffer) {
        let wide = |(key, what): &(&str, &str)| {
            let cells = wrap::width(key) + wrap::width(what) + 2;
            u16::try_from(cells).unwrap_or(u16::MAX).saturating_add(8)
        };
        let gap = 3;
        let all = keys.iter().map(wide).sum::<u16>() + gap * (keys.len() as u16).saturating_sub(1);
        let mut x = area.x + area.width.saturating_sub(all) / 2;
        for key in keys {
            let place = Rect {
                x,
                width: wide(key),
                ..area
            };
            let border = match key.0 {
                "Esc" => self.theme.trouble_frame(),
                _ => self.theme.key(),
            };
            cap(buf, place.intersection(area), *key, border, self.theme);
            x += place.width + gap;
        }
    }

    /// Whether the keys are drawn as caps.
    fn has_caps(&self) -> bool {
        let plays = self.content.kind == Kind::Playing && self.view.entry == Entry::Participant;
        plays && self.at_desk().is_none()
    }

    fn small(&self, area: Rect, buf: &mut Buffer) {
        let stop = if self.view.armed {
            "Esc or Space stops the device."
        } else {
            "Esc stops the device."
        };
        let leave = if self.state.dialog() == Some(&Dialog::Confirm(Confirm::Quit)) {
            if self.view.unsaved.is_empty() {
                "Quit the session? y: yes, n: no."
            } else {
                "The last answer is NOT SAVED. Quit the session? y: yes, n: no."
            }
        } else {
            ""
        };
        let (w, h) = self.minimum();
        let lines = [
            format!(
                "This window has {} × {} cells; {w} × {h} are needed.",
                area.width, area.height
            ),
            "Make the window larger.".to_owned(),
            stop.to_owned(),
            leave.to_owned(),
        ];
        let columns = usize::from(area.width).max(1);
        let wrapped: Vec<String> = lines
            .iter()
            .flat_map(|line| wrap::paragraph(line, columns, 3))
            .collect();
        let height = u16::try_from(wrapped.len()).unwrap_or(3);
        let place = middle(area, area.width, height);
        crate::tui::widgets::center_all(buf, place, &wrapped, self.theme.text());
    }
}

fn borrowed(hints: &[Hint]) -> Vec<(&str, &str)> {
    let hints = hints.iter().map(|(key, what)| (&**key, &**what));
    hints.collect()
}

impl Widget for &Page<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let area = area.intersection(buf.area);
        if area.is_empty() {
            return;
        }
        if self.is_small(area) {
            self.small(area, buf);
            return;
        }
        let top = Top {
            page: &self.content,
            progress: self.view.progress,
            theme: self.theme,
        };
        top.render(row(area, 0), buf);
        let body = Page::body(area);
        self.screen(body, buf);
        let keys = self.offered(area.width);
        let keys = borrowed(&keys);
        if self.state.dialog().is_none() {
            if self.has_caps() {
                self.caps(rows(area, area.height - 4, 3), &keys, buf);
            } else {
                let line = hints(self.theme, &keys, area.width);
                center(buf, row(area, area.height - 3), &line);
            }
            if self.view.entry == Entry::Experimenter
                && self.view.line.device != DeviceState::Unknown
            {
                let line = styled(COMMANDS, self.theme.quiet());
                center(buf, row(area, area.height - 2), &line);
            }
        }
        if let Some(dialog) = self.dialog() {
            dialog.render(body, buf);
        }
        let notice = self.state.notice().or(self.view.notice.as_deref());
        if let Some(notice) = notice {
            let columns = usize::from(area.width).saturating_sub(8);
            let lines = wrap::paragraph(notice, columns, NOTICE_ROWS);
            for (up, words) in (0..).zip(lines.into_iter().rev()) {
                let place = row(area, area.height - 4 - up);
                Clear.render(place, buf);
                let line = styled(words, self.theme.notice());
                center(buf, place, &line);
            }
        }
        let status = Status {
            line: &self.view.line,
            text: self.state.is_text(),
            own: self.own(),
            live: self.live || self.desk.is_some(),
            unsaved: self.content.kind == Kind::SaveTrouble,
            words: &self.view.words,
            theme: self.theme,
        };
        status.render(row(area, area.height - 1), buf);
    }
}
