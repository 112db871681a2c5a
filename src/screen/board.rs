//! What the session's thread and the server's threads share: the page that is shown, and
//! the replies to it.

use super::replies::Reply;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How many replies are remembered: a repeated one must not count twice.
const REMEMBERED: usize = 512;
/// How many replies may wait at a time.
const WAITING: usize = 8;
/// How many requests may wait for another page at a time.
const WATCHING: usize = 4;

/// What became of a reply.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Outcome {
    /// It was taken, and everything is on disk.
    Saved,
    /// It is for another page than the one that is shown.
    Stale,
    /// It is not accepted, with what can be done instead.
    Refused(String),
}

/// The shared state.
#[derive(Debug, Default)]
pub(super) struct Board {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// The page as JSON.
    shown: String,
    revision: u64,
    replies: VecDeque<Known>,
    watching: usize,
    /// When the page was last asked for.
    seen: Option<Instant>,
    /// Whether a stop was requested.
    stop: bool,
    closed: bool,
}

/// A reply that has arrived.
#[derive(Debug)]
struct Known {
    key: String,
    /// Until it is taken.
    reply: Option<Reply>,
    outcome: Option<Outcome>,
}

impl Board {
    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is whole between any two statements that change it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows a page, as JSON without its revision.
    pub(super) fn show(&self, page: &str) {
        let mut state = self.lock();
        state.revision += 1;
        let begin = page.strip_prefix('{').unwrap_or(page);
        state.shown = format!("{{\"revision\":{},{begin}", state.revision);
        drop(state);
        self.changed.notify_all();
    }

    /// Requests a stop, which waits for nothing.
    pub(super) fn stop(&self) {
        self.lock().stop = true;
    }

    /// Whether a stop was requested since the last call.
    pub(super) fn take_stop(&self) -> bool {
        std::mem::take(&mut self.lock().stop)
    }

    /// Ends all waiting.
    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    pub(super) fn is_closed(&self) -> bool {
        self.lock().closed
    }

    /// How long ago the page was asked for; `None` if never. A request that waits counts.
    pub(super) fn silent_for(&self) -> Option<Duration> {
        let state = self.lock();
        let seen = state.seen?;
        Some(match state.watching {
            0 => seen.elapsed(),
            _ => Duration::ZERO,
        })
    }

    /// The page once it is newer than a revision, at the latest after a time.
    pub(super) fn newer(&self, than: u64, at_most: Duration) -> String {
        let mut state = self.lock();
        if state.watching < WATCHING {
            state.watching += 1;
            let same = |s: &mut State| s.revision == than && !s.closed;
            let waited = self.changed.wait_timeout_while(state, at_most, same);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            state.watching -= 1;
        }
        state.seen = Some(Instant::now());
        state.shown.clone()
    }

    /// Hands a reply over and waits for what becomes of it. A key that is known gives the
    /// outcome of the first reply with it. `None` if it is not known in time.
    pub(super) fn reply(&self, reply: Reply, at_most: Duration) -> Option<Outcome> {
        let key = reply.key.clone();
        let mut state = self.lock();
        if !state.replies.iter().any(|known| known.key == key) {
            let waiting = state.replies.iter().filter(|k| k.outcome.is_none()).count();
            if waiting >= WAITING {
                return None;
            }
            if state.replies.len() >= REMEMBERED {
                let done = state.replies.iter().position(|k| k.outcome.is_some());
                done.and_then(|at| state.replies.remove(at));
            }
            state.replies.push_back(Known {
                key: key.clone(),
                reply: Some(reply),
                outcome: None,
            });
        }
        let outcome = |state: &State| {
            let known = state.replies.iter().find(|known| known.key == key)?;
            known.outcome.clone()
        };
        let open = |s: &mut State| outcome(s).is_none() && !s.closed;
        let waited = self.changed.wait_timeout_while(state, at_most, open);
        outcome(&waited.unwrap_or_else(PoisonError::into_inner).0)
    }

    /// The first reply that was not taken yet.
    pub(super) fn take(&self) -> Option<Reply> {
        let mut state = self.lock();
        state
            .replies
            .iter_mut()
            .find_map(|known| known.reply.take())
    }

    /// Tells what became of a reply.
    pub(super) fn settle(&self, key: &str, outcome: Outcome) {
        let mut state = self.lock();
        let known = state.replies.iter_mut().find(|known| known.key == key);
        if let Some(known) = known {
            known.outcome = Some(outcome);
        }
        drop(state);
        self.changed.notify_all();
    }
}
