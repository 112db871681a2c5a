//! What the session's thread and the server's threads share: the pages and the replies.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use study_session::page::reply::{Exchange, Outcome, Reply, Sent};

/// How many requests may wait for another page at a time.
const WATCHING: usize = 4;

/// The shared state.
#[derive(Debug)]
pub(super) struct Board {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    exchange: Exchange,
    watching: usize,
    /// When the page was last asked for.
    seen: Option<Instant>,
    closed: bool,
}

impl Board {
    /// `run` is a word that no other run has.
    pub(super) fn new(run: String) -> Self {
        Self {
            state: Mutex::new(State {
                exchange: Exchange::new(run),
                watching: 0,
                seen: None,
                closed: false,
            }),
            changed: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is whole between any two statements that change it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with the pages and replies, and tells those who wait for a change.
    pub(super) fn with<T>(&self, act: impl FnOnce(&mut Exchange) -> T) -> T {
        let mut state = self.lock();
        let before = state.exchange.changes();
        let done = act(&mut state.exchange);
        let changed = state.exchange.changes() != before;
        drop(state);
        if changed {
            self.changed.notify_all();
        }
        done
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

    /// The page as JSON once it is newer than a revision, at the latest after a time; empty
    /// before the first one.
    pub(super) fn newer(&self, than: u64, at_most: Duration) -> String {
        let mut state = self.lock();
        if state.watching < WATCHING {
            state.watching += 1;
            let same = |s: &mut State| s.exchange.revision() == than && !s.closed;
            let waited = self.changed.wait_timeout_while(state, at_most, same);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            state.watching -= 1;
        }
        state.seen = Some(Instant::now());
        // A page consists of texts and numbers, which JSON has.
        let json = |page| serde_json::to_string(&page).unwrap_or_default();
        state.exchange.page().map_or_else(String::new, json)
    }

    /// Hands a reply over and waits for what becomes of it. A key that is known gives the
    /// outcome of the first reply with it. `None` if it is not known in time.
    pub(super) fn reply(&self, reply: Reply, at_most: Duration) -> Option<Outcome> {
        let key = reply.key.clone();
        let mut state = self.lock();
        if !state.exchange.arrive(Sent::Reply(reply)) {
            return None;
        }
        let open = |state: &mut State| state.exchange.outcome(&key).is_none() && !state.closed;
        let waited = self.changed.wait_timeout_while(state, at_most, open);
        let state = waited.unwrap_or_else(PoisonError::into_inner).0;
        state.exchange.outcome(&key).cloned()
    }
}
