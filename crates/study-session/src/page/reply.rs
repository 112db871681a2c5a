//! What a participant's screen sends back, and what becomes of it.
//!
//! [`Exchange`] is the one state machine between a session and a screen of the participant's
//! own, the browser or the program of somebody else. It has no clock, no thread and no
//! connection: those who have them hand over views and replies. A reply counts once, belongs to
//! the page on which it was chosen, and is settled when everything is on disk.

use super::{Does, Page, participant, same_page};
use crate::session::{Input, Screen, View};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use study_base::text::QuestionId;
use study_plan::protocol::answer::tidy;
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{Answer, Given, Question, Refusal, Turn};

/// Version of the pages and replies that docs/page.md specifies.
pub const FORMAT: &str = "study-page/1";

/// A reply sooner after its page appeared is a repeated tap, ms.
const UNREAD_MS: u64 = 250;
/// Longest key of a reply, bytes.
const MOST_KEY: usize = 64;
/// How many replies are remembered: a repeated one must not count twice.
const REMEMBERED: usize = 512;
/// How many replies may wait at a time.
const WAITING: usize = 8;

/// A reply to a page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reply {
    /// The page on which it was chosen.
    pub page: String,
    /// Names this reply: sent again with the same key, it is the same reply.
    pub key: String,
    /// How long the page had been shown, ms, on the screen's clock.
    pub shown_ms: u64,
    /// What to do.
    pub does: Does,
    /// Answers by the id of their question.
    #[serde(default)]
    pub answers: BTreeMap<String, Given>,
    /// Why the question is declined.
    #[serde(default)]
    pub reason: String,
}

/// What a screen sends.
#[derive(Debug, Clone, PartialEq)]
pub enum Sent {
    /// A request to stop the device; it needs no page and no key.
    Stop,
    /// Anything else.
    Reply(Reply),
}

/// Why what is sent cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReplyError {
    /// Not JSON of a reply.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    /// No key, or too long a one.
    #[error("the key of a reply needs 1 to {MOST_KEY} bytes")]
    Key,
}

impl Sent {
    /// Reads what a screen sends.
    ///
    /// ```
    /// # use study_session::page::reply::Sent;
    /// // A stop needs no page and no key.
    /// assert!(matches!(Sent::read(br#"{"does":"stop"}"#), Ok(Sent::Stop)));
    /// assert!(Sent::read(b"{}").is_err());
    /// ```
    ///
    /// # Errors
    /// [`ReplyError`]; never if it asks to stop, whatever else it says.
    pub fn read(json: &[u8]) -> Result<Self, ReplyError> {
        #[derive(Deserialize)]
        struct Asks {
            does: Does,
        }
        if let Ok(Asks { does: Does::Stop }) = serde_json::from_slice(json) {
            return Ok(Self::Stop);
        }
        let reply: Reply = serde_json::from_slice(json)?;
        match reply.key.len() {
            1..=MOST_KEY => Ok(Self::Reply(reply)),
            _ => Err(ReplyError::Key),
        }
    }
}

/// What became of a reply.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "outcome", content = "why", rename_all = "kebab-case")]
pub enum Outcome {
    /// It was taken, and everything is on disk.
    Saved,
    /// It is for another page than the one that is shown, or came before anybody could read it, or
    /// as the session left its page.
    Stale,
    /// It is not accepted, with what can be done instead, in the language of the study; empty
    /// if the page does not offer it.
    Refused(String),
}

/// A page with its name, as it is sent.
#[derive(Debug, Serialize)]
pub struct Named<'a> {
    /// Counts what is shown, updates of a page too.
    pub revision: u64,
    /// Names the page; the same as long as only clocks and the like change.
    pub id: &'a str,
    /// What it says.
    #[serde(flatten)]
    pub page: &'a Page,
}

/// The pages of a session and the replies to them.
#[derive(Debug, Default)]
pub struct Exchange {
    /// The part of pages' ids that no other run has.
    run: String,
    pages: u64,
    revision: u64,
    settled: u64,
    shown: Option<Shown>,
    /// The reply whose input the session has.
    pending: Option<Pending>,
    replies: VecDeque<Arrived>,
    stop: bool,
}

/// The page that is shown.
#[derive(Debug)]
struct Shown {
    id: String,
    page: Page,
    screen: Screen,
}

/// A reply that the session has.
#[derive(Debug)]
struct Pending {
    key: String,
    /// The screen that must be gone once it is accepted.
    leaves: Option<Screen>,
    /// Whether it confirms a level: an answer that is recorded once the device has stopped.
    confirms: bool,
    /// The questions that it answers.
    answers: Vec<QuestionId>,
}

/// A reply that has arrived.
#[derive(Debug)]
struct Arrived {
    key: String,
    /// Until it is taken.
    reply: Option<Reply>,
    outcome: Option<Outcome>,
}

impl Exchange {
    /// Nothing shown yet. `run` is a word that no other run of the program has, so that a reply
    /// to a page of an earlier one is stale.
    pub fn new(run: String) -> Self {
        Self {
            run,
            ..Self::default()
        }
    }

    /// Shows a view.
    pub fn show(&mut self, view: &View) {
        self.settle_pending(view);
        let Some(page) = participant(view) else {
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
        self.revision += 1;
        let screen = view.screen.clone();
        self.shown = Some(Shown { id, page, screen });
    }

    /// The page that is shown; `None` before the first one.
    pub fn page(&self) -> Option<Named<'_>> {
        self.shown.as_ref().map(|shown| Named {
            revision: self.revision,
            id: &shown.id,
            page: &shown.page,
        })
    }

    /// How many pages and updates of pages have been shown.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// A number that grows with everything that the screen has to be told.
    pub fn changes(&self) -> u64 {
        self.revision + self.settled
    }

    /// Takes a reply in; one whose key is known is the same reply. False if too many wait.
    pub fn arrive(&mut self, sent: Sent) -> bool {
        let Sent::Reply(reply) = sent else {
            self.stop = true;
            return true;
        };
        if self.replies.iter().any(|known| known.key == reply.key) {
            return true;
        }
        let waiting = self.replies.iter().filter(|k| k.outcome.is_none()).count();
        if waiting >= WAITING {
            return false;
        }
        if self.replies.len() >= REMEMBERED {
            let done = self.replies.iter().position(|k| k.outcome.is_some());
            done.and_then(|at| self.replies.remove(at));
        }
        self.replies.push_back(Arrived {
            key: reply.key.clone(),
            outcome: (reply.shown_ms < UNREAD_MS).then_some(Outcome::Stale),
            reply: Some(reply).filter(|reply| reply.shown_ms >= UNREAD_MS),
        });
        true
    }

    /// What became of the reply with a key, once it is known.
    pub fn outcome(&self, key: &str) -> Option<&Outcome> {
        let known = self.replies.iter().find(|known| known.key == key)?;
        known.outcome.as_ref()
    }

    /// The input of the screen, if there is one: a stop before all others. The view is the one
    /// that was shown last.
    pub fn input(&mut self, view: &View) -> Option<Input> {
        if std::mem::take(&mut self.stop) {
            return Some(Input::Stop);
        }
        if self.pending.is_some() {
            return None;
        }
        let reply = self.replies.iter_mut().find_map(|k| k.reply.take())?;
        let shown = (self.shown.as_ref())
            .filter(|shown| shown.id == reply.page && same_page(&shown.screen, &view.screen));
        let outcome = match shown.map(|shown| input(&reply, &shown.page, view)) {
            None => Outcome::Stale,
            Some(Err(why)) => Outcome::Refused(why),
            Some(Ok(input)) => {
                let leaves = matches!(input, Input::Answer(_) | Input::Consent(_) | Input::Back);
                let sets = view.adjusting.as_ref().is_some_and(|own| !own.at_standard);
                self.pending = Some(Pending {
                    key: reply.key,
                    leaves: leaves.then(|| view.screen.clone()),
                    confirms: sets && matches!(input, Input::Advance | Input::RateStopped),
                    answers: match &input {
                        Input::Answer(answers) => answers.iter().map(|a| a.0.clone()).collect(),
                        _ => Vec::new(),
                    },
                });
                return Some(input);
            }
        };
        self.settle(&reply.key, outcome);
        None
    }

    /// The screen is gone: what it has sent and the session has not counts no more, and the next
    /// one may use the same keys.
    pub fn forget_replies(&mut self) {
        self.replies.clear();
        self.stop = false;
        if let Some(pending) = &mut self.pending {
            pending.key.clear();
        }
    }

    /// Settles the reply that the session has, once everything is on disk.
    fn settle_pending(&mut self, view: &View) {
        let done = view.line.all_saved && view.unsaved.is_empty();
        // Nothing follows what is saved when the program is left.
        let stops = matches!(view.screen, Screen::Stopping | Screen::Saving);
        let settled = |pending: &mut Pending| done && !(pending.confirms && stops);
        let Some(pending) = self.pending.take_if(settled) else {
            return;
        };
        let stays = |screen| same_page(screen, &view.screen);
        // A level is still to be set, or was lost with the device.
        let unset = view.adjusting.is_some() || matches!(view.screen, Screen::DeviceTrouble { .. });
        let lost = pending.confirms && unset;
        let outcome = if lost || pending.leaves.as_ref().is_some_and(stays) {
            Outcome::Refused(refusal(view))
        } else if pending.is_unanswered(view) {
            Outcome::Stale
        } else {
            Outcome::Saved
        };
        self.settle(&pending.key, outcome);
    }

    fn settle(&mut self, key: &str, outcome: Outcome) {
        let known = self.replies.iter_mut().find(|known| known.key == key);
        if let Some(known) = known {
            known.outcome = Some(outcome);
            self.settled += 1;
        }
    }
}

impl Pending {
    /// Whether the session does not have its answers: it had left the page when they came, such
    /// as after a standstill of the program, or they count no more. No view has initials.
    fn is_unanswered(&self, view: &View) -> bool {
        match &self.leaves {
            Some(Screen::Form { form, .. }) if form.can_be_declined() => {
                let mut answers = self.answers.iter();
                answers.any(|question| view.given(*form, question).is_none())
            }
            _ => false,
        }
    }
}

/// Why the session took no answer to the page on the screen; of other pages nothing is said.
fn refusal(view: &View) -> String {
    let words = (view.notice.as_ref()).filter(|_| matches!(view.screen, Screen::Form { .. }));
    words.cloned().unwrap_or_default()
}

/// The input that a reply means on the page of a view.
///
/// # Errors
/// What the participant can do instead; empty if the page does not offer it.
pub fn input(reply: &Reply, page: &Page, view: &View) -> Result<Input, String> {
    if !page.offers(reply.does) {
        return Err(String::new());
    }
    Ok(match reply.does {
        Does::Advance => Input::Advance,
        Does::Agree => Input::Consent(true),
        Does::Refuse => Input::Consent(false),
        Does::PlayAgain | Does::Replay => Input::PlayAgain,
        Does::Back => Input::Back,
        Does::RateStopped => Input::RateStopped,
        Does::Lower => Input::Adjust(Turn::Lower),
        Does::Higher => Input::Adjust(Turn::Higher),
        Does::Compare => Input::Adjust(Turn::Standard),
        Does::Stop => Input::Stop,
        // For the experimenter's terminal.
        Does::RestartBlock | Does::Continue | Does::DropOut | Does::RetrySave | Does::Quit => {
            return Err(String::new());
        }
        Does::Answer | Does::Decline => {
            let Screen::Form { questions, .. } = &view.screen else {
                return Err(String::new());
            };
            answers(reply, questions, &view.words)?
        }
    })
}

fn answers(reply: &Reply, questions: &[Question], words: &Words) -> Result<Input, String> {
    let known = |id: &String| questions.iter().any(|q| q.id.as_str() == id);
    if !reply.answers.keys().all(known) {
        return Err(Refusal::OtherKind.words(words));
    }
    let mut answers = Vec::new();
    for (n, question) in questions.iter().enumerate() {
        let answer = if n == 0 && reply.does == Does::Decline {
            let declined = Answer::Declined {
                reason: tidy(&reply.reason),
            };
            question.accepts(&declined).map(|()| Some(declined))
        } else {
            question.read(reply.answers.get(question.id.as_str()))
        };
        let answer = answer.map_err(|why| why.words(words))?;
        answers.extend(answer.map(|answer| (question.id.clone(), answer)));
    }
    Ok(Input::Answer(answers))
}
