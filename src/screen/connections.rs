//! The connections that are served: those of the participant's browser, and of everybody else.
//!
//! Of a new connection nothing is known until its request has arrived. Such connections have
//! places of their own, and a new one ends another of them; a request with the browser's cookie
//! leaves them at once, and nobody else can end it.

use std::io;
use std::net::{IpAddr, Shutdown, TcpStream};

/// How many connections of which nothing is known, or that are refused, are kept at a time. At 600
/// new ones a second each has a tenth of a second before it ends one that is older.
const UNKNOWN: usize = 64;
/// How many requests of the participant's browser are served at a time.
const OWN: usize = 24;

/// What is known of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Who {
    /// Nothing: its request has not arrived, or is that of a stranger.
    Unknown,
    /// The participant's browser.
    Browser,
    /// It is refused, and what it still sends is read for a moment.
    Refused,
}

/// A connection that is served.
#[derive(Debug)]
struct Connection {
    id: u64,
    stream: TcpStream,
    from: Option<IpAddr>,
    who: Who,
}

/// All of them, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Connections {
    open: Vec<Connection>,
    /// From where the participant's browser was heard last.
    browser: Option<IpAddr>,
}

impl Connections {
    /// Takes a new connection in.
    ///
    /// # Errors
    /// The stream cannot be shared between threads.
    pub(super) fn admit(&mut self, id: u64, stream: &TcpStream) -> io::Result<()> {
        let from = stream.peer_addr().map(|peer| peer.ip()).ok();
        let stream = stream.try_clone()?;
        let kinds: Vec<(Who, bool)> = (self.open.iter())
            .map(|c| (c.who, c.from.is_some() && c.from == self.browser))
            .collect();
        if let Some(ended) = victim(&kinds) {
            // Its thread finds it closed.
            let _ = self.open.remove(ended).stream.shutdown(Shutdown::Both);
        }
        self.open.push(Connection {
            id,
            stream,
            from,
            who: Who::Unknown,
        });
        Ok(())
    }

    /// The request has the browser's cookie. False if too many of them are served.
    pub(super) fn is_browsers(&mut self, id: u64) -> bool {
        if let Some(connection) = self.open.iter_mut().find(|c| c.id == id) {
            connection.who = Who::Browser;
            self.browser = connection.from;
        }
        let browsers = self.open.iter().filter(|c| c.who == Who::Browser);
        browsers.count() <= OWN
    }

    /// The request is refused.
    pub(super) fn is_refused(&mut self, id: u64) {
        if let Some(connection) = self.open.iter_mut().find(|c| c.id == id) {
            connection.who = Who::Refused;
        }
    }

    /// The connection has ended.
    pub(super) fn forget(&mut self, id: u64) {
        self.open.retain(|c| c.id != id);
    }
}

/// Which connection a new one ends, if any: a refused one, or else one that does not come from
/// where the browser is, or else the oldest of which nothing is known.
fn victim(open: &[(Who, bool)]) -> Option<usize> {
    let others = open.iter().filter(|(who, _)| *who != Who::Browser).count();
    if others < UNKNOWN {
        return None;
    }
    let refused = |(who, _): &(Who, bool)| *who == Who::Refused;
    let elsewhere = |(who, near): &(Who, bool)| *who == Who::Unknown && !near;
    let unknown = |(who, _): &(Who, bool)| *who == Who::Unknown;
    (open.iter().position(refused))
        .or_else(|| open.iter().position(elsewhere))
        .or_else(|| open.iter().position(unknown))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_stranger_ends_a_request_of_the_browser() {
        let mut open = vec![(Who::Browser, true); 200];
        assert_eq!(victim(&open), None);
        open.extend(vec![(Who::Unknown, true); UNKNOWN - 1]);
        assert_eq!(victim(&open), None, "there is room");
        open.push((Who::Unknown, true));
        assert_eq!(victim(&open), Some(200), "the oldest");
        open.push((Who::Unknown, false));
        assert_eq!(victim(&open), Some(200 + UNKNOWN), "from elsewhere first");
        open.push((Who::Refused, true));
        assert_eq!(victim(&open), Some(201 + UNKNOWN), "a refused one first");
    }
}
