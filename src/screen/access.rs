//! Who may talk to the page. No network and no clock: time is an argument.

use std::time::Duration;

/// Length of a token in bytes: 128 bits.
const BYTES: usize = 16;
/// Requests a second of the participant's browser, and how many at once.
const CLIENT: (f64, f64) = (50.0, 200.0);
/// Requests a second of everybody else together, and how many at once.
const STRANGERS: (f64, f64) = (20.0, 60.0);
/// How long after a request too many the page counts as besieged.
const SIEGE: Duration = Duration::from_secs(10);

/// A secret of 128 bits, as hexadecimal digits.
///
/// # Errors
/// The system has no randomness.
pub fn secret() -> Result<String, super::ScreenError> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(study_base::hex::hex(&bytes))
}

/// What is known about who may talk to the page.
#[derive(Debug)]
pub(super) struct Access {
    /// `None` once it is used.
    token: Option<String>,
    /// Name and value.
    cookie: (String, String),
    hosts: Vec<String>,
    client: Bucket,
    strangers: Bucket,
    /// Requests of strangers beyond their limit, and when the last one came.
    refused: u64,
    besieged: Option<Duration>,
}

impl Access {
    /// `cookie` is its name, which no other server of this computer has, and its value:
    /// browsers keep cookies by host, not by port.
    pub(super) fn new(token: String, cookie: (String, String), hosts: Vec<String>) -> Self {
        Self {
            token: Some(token),
            cookie,
            hosts,
            client: Bucket::full(CLIENT),
            strangers: Bucket::full(STRANGERS),
            refused: 0,
            besieged: None,
        }
    }

    /// Whether the name in a request is one of this server: another one may be that of a
    /// web site that points to this address.
    pub(super) fn knows_host(&self, host: &str) -> bool {
        self.hosts.iter().any(|h| h.eq_ignore_ascii_case(host))
    }

    /// Whether a page with this origin is one of this server.
    pub(super) fn knows_origin(&self, origin: &str) -> bool {
        let host = origin.strip_prefix("http://");
        host.is_some_and(|host| self.knows_host(host))
    }

    /// Whether a `Cookie` header has the cookie.
    pub(super) fn knows_cookie(&self, header: &str) -> bool {
        let pairs = header.split(';').filter_map(|pair| pair.split_once('='));
        let (own, secret) = &self.cookie;
        let mut values = pairs.filter(|(name, _)| name.trim() == own);
        values.any(|(_, value)| is_same(value.trim(), secret))
    }

    /// Exchanges the token for the cookie, `name=value`, once.
    pub(super) fn redeem(&mut self, given: &str) -> Option<String> {
        self.token.take_if(|token| is_same(given, token))?;
        let (name, secret) = &self.cookie;
        Some(format!("{name}={secret}"))
    }

    /// Whether the token was used.
    pub(super) fn is_open(&self) -> bool {
        self.token.is_none()
    }

    /// Whether one more request is within the limits at this time.
    pub(super) fn permits(&mut self, client: bool, at: Duration) -> bool {
        if client {
            return self.client.take(at);
        }
        let permitted = self.strangers.take(at);
        if !permitted {
            self.refused += 1;
            self.besieged = Some(at);
        }
        permitted
    }

    /// Requests of strangers beyond their limit.
    pub(super) fn refused(&self) -> u64 {
        self.refused
    }

    /// Whether one came a short time before this one.
    pub(super) fn is_besieged(&self, at: Duration) -> bool {
        self.besieged
            .is_some_and(|last| at.saturating_sub(last) < SIEGE)
    }
}

/// Compares in a time that does not depend on where two texts differ.
fn is_same(a: &str, b: &str) -> bool {
    let differs = a.bytes().zip(b.bytes()).fold(0, |d, (a, b)| d | (a ^ b));
    a.len() == b.len() && differs == 0
}

/// A number of requests that fills up with time.
#[derive(Debug)]
struct Bucket {
    left: f64,
    per_s: f64,
    most: f64,
    at: Duration,
}

impl Bucket {
    fn full((per_s, most): (f64, f64)) -> Self {
        Self {
            left: most,
            per_s,
            most,
            at: Duration::ZERO,
        }
    }

    fn take(&mut self, at: Duration) -> bool {
        let passed = at.saturating_sub(self.at).as_secs_f64();
        self.at = at;
        self.left = (self.left + passed * self.per_s).min(self.most);
        let has = self.left >= 1.0;
        if has {
            self.left -= 1.0;
        }
        has
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access() -> Access {
        Access::new(
            "t0".to_owned(),
            ("study-80".to_owned(), "c0".to_owned()),
            vec!["127.0.0.1:80".to_owned()],
        )
    }

    #[test]
    fn a_token_is_good_once() {
        let mut access = access();
        assert_eq!(access.redeem("t1"), None);
        assert_eq!(access.redeem(""), None);
        assert_eq!(access.redeem("t0 "), None);
        assert!(!access.is_open());
        assert_eq!(access.redeem("t0").as_deref(), Some("study-80=c0"));
        assert_eq!(access.redeem("t0"), None);
        assert!(access.is_open());
    }

    #[test]
    fn cookies_hosts_and_origins_are_compared_whole() {
        let access = access();
        assert!(access.knows_cookie("a=b; study-81=c1; study-80=c0"));
        for wrong in [
            "",
            "study-80=",
            "study-80=c",
            "study-80=c00",
            "xstudy-80=c0",
            "study-81=c0",
            "study-80",
        ] {
            assert!(!access.knows_cookie(wrong), "{wrong}");
        }
        assert!(access.knows_host("127.0.0.1:80"));
        assert!(!access.knows_host("127.0.0.1") && !access.knows_host("evil.example:80"));
        assert!(access.knows_origin("http://127.0.0.1:80"));
        for wrong in ["null", "http://evil.example", "https://127.0.0.1:80"] {
            assert!(!access.knows_origin(wrong), "{wrong}");
        }
    }

    #[test]
    fn strangers_cannot_use_up_the_requests_of_the_participant() {
        let mut access = access();
        let at = Duration::from_secs(5);
        let passed = (0..1000).filter(|_| access.permits(false, at)).count();
        assert_eq!((passed, access.refused()), (60, 940));
        assert!(access.is_besieged(at + SIEGE / 2) && !access.is_besieged(at + SIEGE));
        assert!(access.permits(true, at));
        assert!(!access.permits(false, at));
        assert!(access.permits(false, at + Duration::from_millis(51)));
    }

    #[test]
    fn secrets_are_128_bits_and_differ() {
        let (a, b) = (secret().unwrap(), secret().unwrap());
        assert_eq!(a.len(), 32);
        assert!(a.chars().all(|c| c.is_ascii_hexdigit()));
        assert_ne!(a, b);
    }
}
