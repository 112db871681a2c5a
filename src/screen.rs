//! A page of the participant's own, in the browser of a tablet or a second screen.
//!
//! [`Screen`] serves the page beside a terminal ([`crate::runner::beside`]). Nothing of the page
//! is stored; the journal is the same. [`study_session::page`] says what the page shows and what
//! a reply means; the files here are the server. docs/screen.md describes the limits.

mod access;
mod board;
mod code;
mod connections;
mod http;
mod media;
mod server;

pub use access::secret;
pub use media::Gallery;

use crate::runner::beside::Own;
use board::Board;
use media::Stage;
use server::Server;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use study_plan::protocol::phrases::Words;
use study_session::session::cue::Shows;
use study_session::session::{Input, View};

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
    stage: Arc<Stage>,
}

impl Screen {
    /// Serves the page at an address, in the language of the study, with its media.
    ///
    /// # Errors
    /// [`ScreenError`].
    pub fn open(
        at: Address,
        lang: Option<&str>,
        words: &Words,
        gallery: Gallery,
    ) -> Result<Self, ScreenError> {
        let board = Arc::new(Board::new(secret()?));
        let stage = Arc::new(Stage::new(gallery));
        let server = Server::open(at, lang, words, (board.clone(), stage.clone()))?;
        Ok(Self {
            server,
            board,
            stage,
        })
    }

    /// What the page shows and plays of each realization; `None` if the study has no media.
    pub fn shows(&self) -> Option<Arc<Shows>> {
        self.stage.shows()
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
}

impl Own for Screen {
    fn show(&mut self, view: &View) {
        self.board.with(|exchange| exchange.show(view));
    }

    fn inputs(&mut self, view: &View) -> Vec<Input> {
        let input = self.board.with(|exchange| exchange.input(view));
        // A reply is about what was shown: what is said of the media comes after it.
        input.into_iter().chain(self.stage.inputs()).collect()
    }

    fn notice(&self) -> Option<String> {
        let silent = self.board.silent_for().is_some_and(|s| s > SILENCE);
        if silent {
            return Some("the participant's page has no connection".to_owned());
        }
        if let Some(what) = self.stage.notice() {
            return Some(what);
        }
        // A line that seldom changes: a power of ten.
        let refused = 10_u64.pow(self.server.refused_now()?.checked_ilog10()?);
        Some(format!(
            "others on the network call the participant's page: {refused} requests and more were refused"
        ))
    }
}
