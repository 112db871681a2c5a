//! The lines that are exchanged with a front: somebody else's program that shows the
//! participant's pages and replies to them. docs/page.md specifies them.
//!
//! [`Talk`] is what the lines mean, without the program; `study run --front` has the program.

use super::reply::{Exchange, FORMAT, Named, Outcome, ReplyError, Sent};
use crate::session::{Input, View};
use serde::{Deserialize, Serialize};
use study_base::text::{Untrusted, beginning};
use study_plan::protocol::phrases::{Phrase, Words, is_right_to_left};

/// Longest name of a front, characters.
const MAX_NAME: usize = 64;

/// Who a front is: its first line.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Hello {
    /// [`FORMAT`].
    pub format: String,
    /// Its name and version.
    pub front: String,
    /// Whether it answers by itself, so that no person takes part.
    #[serde(default)]
    pub simulated: bool,
}

/// A line to a front.
#[derive(Debug, Serialize)]
#[serde(tag = "say", rename_all = "kebab-case")]
enum Line<'a> {
    Hello {
        format: &'a str,
        lang: &'a str,
        dir: &'a str,
        words: Said<'a>,
    },
    Page(Named<'a>),
    Settled {
        key: &'a str,
        #[serde(flatten)]
        outcome: &'a Outcome,
    },
    Ping,
}

/// Fixed sentences about replies, in the language of the study.
#[derive(Debug, Serialize)]
struct Said<'a> {
    saving: &'a str,
    saved: &'a str,
    needed: &'a str,
    closed: &'a str,
}

/// A line of a front besides its replies.
#[derive(Debug, Deserialize)]
#[serde(tag = "does", rename_all = "kebab-case", deny_unknown_fields)]
enum Sign {
    Pong,
}

/// Why a line of a front is not accepted.
#[derive(Debug, thiserror::Error)]
pub enum FrontError {
    /// No reply.
    #[error(transparent)]
    Reply(#[from] ReplyError),
    /// Not its name as the first line.
    #[error("its first line says who it is: {0}")]
    Hello(serde_json::Error),
    /// Another version.
    #[error("it uses the format `{format}`; this program supports {FORMAT}", format = Untrusted(.0))]
    Format(String),
    /// No name, or too long a one.
    #[error("its name needs 1 to {MAX_NAME} characters")]
    Name,
    /// Not the front with which the session began.
    #[error("it is another front than before, `{name}`", name = Untrusted(.0))]
    Other(String),
    /// A reply although several are not settled.
    #[error("it sends replies without waiting for what becomes of them")]
    TooMany,
}

/// What is said to a front and what it says.
#[derive(Debug)]
pub struct Talk {
    exchange: Exchange,
    greeting: String,
    hello: Option<Hello>,
    /// Whether the program that runs now has said who it is.
    open: bool,
    /// The revision of the page that it has; `None` before it is greeted.
    told: Option<u64>,
    /// Keys of its replies that are not settled.
    asked: Vec<String>,
}

impl Talk {
    /// Nothing is said yet. `run` is a word that no other run of the program has; `lang` and
    /// `words` are those of the study.
    pub fn new(run: String, lang: Option<&str>, words: &Words) -> Self {
        let lang = lang.unwrap_or("en");
        let greeting = line(&Line::Hello {
            format: FORMAT,
            lang,
            dir: match is_right_to_left(lang) {
                true => "rtl",
                false => "ltr",
            },
            words: Said {
                saving: words.get(Phrase::Saving),
                saved: words.get(Phrase::Saved),
                needed: words.get(Phrase::PlainNeeded),
                closed: words.get(Phrase::PageClosed),
            },
        });
        Self {
            exchange: Exchange::new(run),
            greeting,
            hello: None,
            open: false,
            told: None,
            asked: Vec::new(),
        }
    }

    /// Who the front is, once it has said so.
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// Whether the program that runs now has said who it is.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// Whether nothing follows the page that is shown.
    pub fn is_over(&self) -> bool {
        self.exchange.page().is_some_and(|named| named.page.over)
    }

    /// Takes in a line of the front.
    ///
    /// # Errors
    /// [`FrontError`]; the front is then not to be trusted with a device that plays.
    pub fn hears(&mut self, line: &[u8]) -> Result<(), FrontError> {
        if !self.open {
            return self.meet(line);
        }
        if serde_json::from_slice::<Sign>(line).is_ok() {
            return Ok(());
        }
        let sent = Sent::read(line)?;
        if let Sent::Reply(reply) = &sent
            && !self.asked.contains(&reply.key)
        {
            self.asked.push(reply.key.clone());
        }
        match self.exchange.arrive(sent) {
            true => Ok(()),
            false => Err(FrontError::TooMany),
        }
    }

    fn meet(&mut self, line: &[u8]) -> Result<(), FrontError> {
        let hello: Hello = serde_json::from_slice(line).map_err(FrontError::Hello)?;
        if hello.format != FORMAT {
            return Err(FrontError::Format(beginning(&hello.format, MAX_NAME)));
        }
        if !(1..=MAX_NAME).contains(&hello.front.chars().count()) {
            return Err(FrontError::Name);
        }
        if self.hello.as_ref().is_some_and(|before| *before != hello) {
            return Err(FrontError::Other(hello.front));
        }
        (self.hello, self.open) = (Some(hello), true);
        Ok(())
    }

    /// The lines that the front is to be told now, each with its end.
    pub fn says(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        if !self.open {
            return lines;
        }
        let told = self.told.replace(self.exchange.revision());
        if told.is_none() {
            lines.push(self.greeting.clone());
        }
        self.asked.retain(|key| {
            let outcome = self.exchange.outcome(key);
            lines.extend(outcome.map(|outcome| line(&Line::Settled { key, outcome })));
            outcome.is_none()
        });
        if told != self.told {
            lines.extend(self.exchange.page().map(|page| line(&Line::Page(page))));
        }
        lines
    }

    /// A line that the front answers at once, so that it is known to run.
    pub fn ping() -> String {
        line(&Line::Ping)
    }

    /// The program has ended; the next one begins anew.
    pub fn begin_again(&mut self) {
        self.exchange.forget_replies();
        (self.open, self.told) = (false, None);
        self.asked.clear();
    }

    /// Shows a view.
    pub fn show(&mut self, view: &View) {
        self.exchange.show(view);
    }

    /// The input of the front, if there is one. The view is the one that was shown last.
    pub fn input(&mut self, view: &View) -> Option<Input> {
        self.exchange.input(view)
    }
}

/// A line as JSON; it consists of texts and numbers, which JSON has.
fn line(line: &Line<'_>) -> String {
    serde_json::to_string(line).unwrap_or_default() + "\n"
}
