//! The user interface without a terminal: events in, inputs and cells out.
//!
//! Everything that the terminal shows and does is here, so that a test can drive whole
//! sessions by keys.

use super::desk::{Desk, Doing, Say, Strip};
use super::theme::{ColorDepth, Theme};
use super::ui_state::UiState;
use super::views::Page;
use crossterm::event::{Event, KeyEvent, KeyModifiers, MouseButton, MouseEventKind};
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::widgets::Widget as _;
use std::borrow::Cow;
use study_session::page::{self, same_page};
use study_session::session::view::DeviceState;
use study_session::session::{Input, Screen, View};

/// The state of the interface, its styles and its size.
#[derive(Debug, Clone)]
pub struct Surface {
    state: UiState,
    theme: Theme,
    area: Rect,
    screen: Option<Screen>,
    live: bool,
    waits: bool,
    /// What the experimenter's desk knows, if there is one, and the course of the session.
    desk: Option<Box<(Desk, Strip)>>,
}

impl Surface {
    /// An empty interface of size 0.
    pub fn new(color: ColorDepth) -> Self {
        Self {
            state: UiState::default(),
            theme: Theme::new(color),
            area: Rect::ZERO,
            screen: None,
            live: false,
            waits: false,
            desk: None,
        }
    }

    /// The same, which shows whether telemetry arrives.
    #[must_use]
    pub fn with_live(mut self, live: bool) -> Self {
        self.live = live;
        self
    }

    /// The same, which shows the desk in place of what the participant reads on a page of their own.
    #[must_use]
    pub fn with_desk(mut self, desk: Desk) -> Self {
        let elsewhere = Say::NotHere.get(desk.language);
        self.state.set_desk(elsewhere.to_owned());
        self.desk = Some(Box::new((desk, Strip::default())));
        self
    }

    /// A view with the fixed sentences in the experimenter's language, if there is a desk.
    pub fn translated<'v>(&self, view: &'v View) -> Cow<'v, View> {
        match self.desk.as_ref().and_then(|desk| desk.0.words.clone()) {
            None => Cow::Borrowed(view),
            Some(words) => Cow::Owned(View {
                words,
                ..view.clone()
            }),
        }
    }

    /// Whether a view has another page than the last one that was followed.
    pub fn turns(&self, view: &View) -> bool {
        let old = self.screen.as_ref();
        old.is_none_or(|old| !same_page(old, &view.screen))
    }

    /// Sets whether an Enter would not advance now; the page then does not offer it.
    pub fn set_waits(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// The state of the interface.
    pub fn state(&self) -> &UiState {
        &self.state
    }

    /// Whether Ctrl-Z was pressed since this was last asked.
    pub fn take_suspend(&mut self) -> bool {
        self.state.take_suspend()
    }

    /// Adapts to the screen of a view and to a size.
    pub fn follow(&mut self, view: &View, area: Rect) {
        self.area = area;
        if let Some(desk) = &mut self.desk
            && view.line.device != DeviceState::Unknown
        {
            desk.1.add(view.line.elapsed_s, Doing::of(&view.screen));
        }
        let old = self.screen.as_ref();
        if self.state.follow(view, old) {
            self.screen = Some(view.screen.clone());
        }
        self.measure(view);
    }

    fn page<'a>(&'a self, view: &'a View) -> Page<'a> {
        Page {
            view,
            content: page::page(view),
            state: &self.state,
            live: self.live,
            desk: self.desk.as_deref(),
            waits: self.waits,
            theme: self.theme,
        }
    }

    fn measure(&mut self, view: &View) {
        let room = self.page(view).room(self.area);
        self.state.set_room(room.most, room.page);
        if let Some(columns) = room.columns {
            self.state.set_columns(columns);
        }
    }

    /// A click on the hint of a key as that key.
    pub fn as_key(&self, event: &Event, view: &View) -> Option<Event> {
        let Event::Mouse(mouse) = event else {
            return None;
        };
        if mouse.kind != MouseEventKind::Down(MouseButton::Left) {
            return None;
        }
        let place = Position::new(mouse.column, mouse.row);
        let code = self.page(view).key_at(self.area, place)?;
        Some(Event::Key(KeyEvent::new(code, KeyModifiers::NONE)))
    }

    /// The inputs that an event causes.
    pub fn event(&mut self, event: &Event, view: &View) -> Vec<Input> {
        self.follow(view, self.area);
        let key = self.as_key(event, view);
        let event = key.as_ref().unwrap_or(event);
        if self.page(view).is_small(self.area) {
            return self.state.blind(event, view);
        }
        let Event::Mouse(mouse) = event else {
            let inputs = self.state.key(event, view);
            self.measure(view);
            return inputs;
        };
        match mouse.kind {
            MouseEventKind::Down(MouseButton::Left) => {
                let place = Position::new(mouse.column, mouse.row);
                let hit = self.page(view).hit(self.area, place);
                if let Some(target) = hit {
                    self.state.pick(target, view);
                }
            }
            MouseEventKind::ScrollDown => self.state.scroll(true),
            MouseEventKind::ScrollUp => self.state.scroll(false),
            _ => {}
        }
        self.measure(view);
        Vec::new()
    }

    /// Draws everything; returns the position of the terminal's cursor.
    pub fn draw(&self, view: &View, area: Rect, buf: &mut Buffer) -> Option<Position> {
        let page = self.page(view);
        page.render(area, buf);
        let cursor = page.cursor(area.intersection(buf.area));
        cursor.filter(|at| buf.area.contains(*at))
    }
}
