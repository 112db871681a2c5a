//! A page of the participant's own, in the browser of a tablet or a second screen.
//!
//! [`Screen`] serves the page, and [`Both`] is an operator like [`crate::tui::Tui`]: it
//! gives the terminal's inputs and those of the page. Nothing of the page is stored; the
//! journal is the same. [`study_session::page`] says what the page shows, [`replies`] what
//! an answer means; the other files are the server. docs/screen.md describes the limits.

mod access;
mod board;
mod code;
mod http;
pub mod replies;
mod server;

use crate::runner::{Operator, OperatorError};
use board::{Board, Outcome};
use serde::Serialize;
use server::Server;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use study_plan::protocol::phrases::Words;
use study_session::outcome::Channel;
use study_session::page::{self, Page, same_page};
use study_session::session::{Input, View};

/// How long the terminal is asked before the page is.
const SLICE: Duration = Duration::from_millis(8);
/// A page that asks for nothing in this time has lost its connection.
const SILENCE: Duration = Duration::from_secs(20);

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ScreenError {
    /// Not one address of this computer.
    #[error("`{0}` is not one address of this computer")]
    Address(String),
    /// The address cannot be used.
    #[error("no page can be served at {at}: {source}")]
    Listen {
        /// The address.
        at: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// No token can be made.
    #[error("the system gives no random numbers: {0}")]
    Random(std::io::Error),
}

impl ScreenError {
    /// What the user can do.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Address(_) => {
                "name one, such as --screen=192.168.1.20 or --screen=192.168.1.20:8080; \
                 --screen alone is for a browser on this computer"
            }
            Self::Listen { .. } => {
                "use an address of this computer, as its network settings show, and a free port"
            }
            Self::Random(_) => "run without --screen",
        }
    }
}

/// One address of this computer, perhaps with a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address(SocketAddr);

impl Address {
    fn socket(self) -> SocketAddr {
        self.0
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0.port() {
            0 => self.0.ip().fmt(f),
            _ => self.0.fmt(f),
        }
    }
}

impl std::str::FromStr for Address {
    type Err = ScreenError;

    fn from_str(text: &str) -> Result<Self, ScreenError> {
        server::address(text)
    }
}

/// The participant's page.
#[derive(Debug)]
pub struct Screen {
    server: Server,
    board: Arc<Board>,
    /// The part of pages' ids that no other run has.
    run: String,
    pages: u64,
    shown: Option<Shown>,
    /// The reply whose input the session has.
    pending: Option<Pending>,
}

/// The page that is shown.
#[derive(Debug)]
struct Shown {
    id: String,
    page: Page,
    screen: study_session::session::Screen,
}

/// A reply that the session has.
#[derive(Debug)]
struct Pending {
    key: String,
    /// The screen that must be gone once it is accepted.
    leaves: Option<study_session::session::Screen>,
}

/// A page with its id.
#[derive(Serialize)]
struct Named<'a> {
    id: &'a str,
    #[serde(flatten)]
    page: &'a Page,
}

impl Screen {
    /// Serves the page at an address, in the language of the study.
    ///
    /// # Errors
    /// [`ScreenError`].
    pub fn open(at: Address, lang: Option<&str>, words: &Words) -> Result<Self, ScreenError> {
        let board = Arc::new(Board::default());
        let server = Server::open(at, lang, words, board.clone())?;
        Ok(Self {
            server,
            board,
            run: access::secret()?,
            pages: 0,
            shown: None,
            pending: None,
        })
    }

    /// The link that opens the page, once.
    pub fn link(&self) -> &str {
        self.server.link()
    }

    /// The link as a code for a camera, line by line.
    pub fn code(&self) -> Vec<String> {
        code::code(self.link()).unwrap_or_default()
    }

    /// Whether a browser has opened the page.
    pub fn is_open(&self) -> bool {
        self.server.is_open()
    }

    /// The page and a terminal as one operator.
    pub fn beside(self, terminal: Box<dyn Operator>) -> Both {
        Both {
            screen: self,
            terminal,
            by_page: false,
        }
    }

    /// Shows a view.
    fn show(&mut self, view: &View) {
        self.settle(view);
        let Some(page) = page::participant(view) else {
            return;
        };
        let same = self.shown.as_ref().is_some_and(|shown| {
            same_page(&shown.screen, &view.screen) && shown.page.still() == page.still()
        });
        if same && self.shown.as_ref().is_some_and(|s| s.page == page) {
            return;
        }
        let id = match self.shown.take().filter(|_| same) {
            Some(shown) => shown.id,
            None => {
                self.pages += 1;
                format!("{}.{}", self.run, self.pages)
            }
        };
        let named = Named {
            id: &id,
            page: &page,
        };
        // A page consists of texts and numbers, which JSON has.
        self.board
            .show(&serde_json::to_string(&named).unwrap_or_default());
        self.shown = Some(Shown {
            id,
            page,
            screen: view.screen.clone(),
        });
    }

    /// Tells the page what became of its last reply, once everything is on disk.
    fn settle(&mut self, view: &View) {
        let done = view.line.all_saved && view.unsaved.is_empty();
        let Some(pending) = self.pending.take_if(|_| done) else {
            return;
        };
        let stays = |screen| same_page(screen, &view.screen);
        let outcome = match pending.leaves.as_ref().is_some_and(stays) {
            true => Outcome::Refused(String::new()),
            false => Outcome::Saved,
        };
        self.board.settle(&pending.key, outcome);
    }

    /// The input of the page, if there is one. The view is the one that was shown last.
    fn input(&mut self, view: &View) -> Option<Input> {
        if self.board.take_stop() {
            return Some(Input::Stop);
        }
        let shown = self.shown.as_ref().filter(|_| self.pending.is_none())?;
        let reply = self.board.take()?;
        if reply.page != shown.id || !same_page(&shown.screen, &view.screen) {
            self.board.settle(&reply.key, Outcome::Stale);
            return None;
        }
        match replies::input(&reply, &shown.page, view) {
            Err(why) => {
                self.board.settle(&reply.key, Outcome::Refused(why));
                None
            }
            Ok(input) => {
                let leaves = matches!(input, Input::Answer(_) | Input::Consent(_) | Input::Back);
                self.pending = Some(Pending {
                    key: reply.key,
                    leaves: leaves.then(|| view.screen.clone()),
                });
                Some(input)
            }
        }
    }
}

/// A terminal and the participant's page.
pub struct Both {
    screen: Screen,
    terminal: Box<dyn Operator>,
    /// Whether the last input was that of the page.
    by_page: bool,
}

impl Operator for Both {
    fn channel(&self) -> Option<Channel> {
        match self.by_page {
            true => Some(Channel::Page),
            false => self.terminal.channel(),
        }
    }

    fn next(&mut self, view: &View, timeout: Duration) -> Result<Vec<Input>, OperatorError> {
        let until = Instant::now() + timeout;
        self.screen.show(view);
        let mut seen = view.clone();
        let silent = self.screen.board.silent_for();
        if seen.notice.is_none() && silent.is_some_and(|time| time > SILENCE) {
            seen.notice = Some("the participant's page has no connection".to_owned());
        }
        loop {
            self.by_page = false;
            if let Some(input) = self.screen.input(view) {
                self.by_page = true;
                return Ok(vec![input]);
            }
            let left = until.saturating_duration_since(Instant::now());
            let inputs = self.terminal.next(&seen, left.min(SLICE))?;
            if !inputs.is_empty() || left.is_zero() {
                return Ok(inputs);
            }
        }
    }
}
