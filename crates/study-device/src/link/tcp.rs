//! The wire format over TCP, on every system.
//!
//! An address is `tcp://HOST:PORT` or `tcp://TOKEN@HOST:PORT`, where HOST is an address of the
//! Internet Protocol or `localhost`. With a token the host first sends it in a line of its own, and
//! the device closes the connection of a host that does not know it: on a computer that others
//! use as well, anybody can reach a port. After the line both sides send frames as on
//! a serial port. The token appears in no message, journal or record.

use super::cable::{Cable, MAX_WAITING};
use super::{Link, LinkError, Opener};
use std::fmt;
use std::io::{self, Read as _, Write as _};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// How an address begins.
pub const SCHEME: &str = "tcp://";
/// How long a connection may take to be made.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(1);
/// A connection that accepts no bytes for this time counts as lost.
const WRITE_TIMEOUT: Duration = Duration::from_millis(50);
/// Longest single wait. Sockets are asked without waiting, because the shortest wait that a system
/// offers for them may be far longer.
const SLICE: Duration = Duration::from_millis(1);
/// Time within which a host has to send the token.
const TOKEN_TIMEOUT: Duration = Duration::from_secs(2);

/// A secret that a device and its hosts share: 1 to 64 letters and digits.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// Largest number of characters.
    pub const LONGEST: usize = 64;

    /// Checks a token.
    ///
    /// # Errors
    /// [`AddressError::Token`].
    pub fn new(given: &str) -> Result<Self, AddressError> {
        let good = (1..=Self::LONGEST).contains(&given.len())
            && given.bytes().all(|b| b.is_ascii_alphanumeric());
        match good {
            true => Ok(Self(given.to_owned())),
            false => Err(AddressError::Token),
        }
    }

    /// The token as text, to be shown to the user who starts a device, and to nobody else.
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// Whether bytes are the token; the time does not tell how far they agree.
    fn is(&self, given: &[u8]) -> bool {
        let expected = self.0.as_bytes();
        let differ = expected
            .iter()
            .zip(given)
            .fold(0, |all, (a, b)| all | (a ^ b));
        expected.len() == given.len() && differ == 0
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

/// Why a text is not the address of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// Not a host and a port.
    #[error("use tcp://HOST:PORT, where HOST is an address such as 127.0.0.1, [::1] or localhost")]
    Syntax,
    /// Not a token.
    #[error("a token has 1 to {} letters and digits", Token::LONGEST)]
    Token,
}

/// Where a device is reached over TCP.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TcpAddress {
    at: SocketAddr,
    token: Option<Token>,
}

impl TcpAddress {
    /// Reads an address; `None` if the text does not begin with [`SCHEME`].
    ///
    /// # Errors
    /// [`AddressError`].
    pub fn read(text: &str) -> Option<Result<Self, AddressError>> {
        Some(Self::read_rest(text.strip_prefix(SCHEME)?))
    }

    fn read_rest(text: &str) -> Result<Self, AddressError> {
        let (token, place) = match text.rsplit_once('@') {
            Some((token, place)) => (Some(Token::new(token)?), place),
            None => (None, text),
        };
        let at = match place.strip_prefix("localhost:") {
            Some(port) => {
                let port = port.parse().map_err(|_| AddressError::Syntax)?;
                SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port)
            }
            None => place.parse().map_err(|_| AddressError::Syntax)?,
        };
        Ok(Self { at, token })
    }
}

impl fmt::Display for TcpAddress {
    /// Without the token.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{SCHEME}{}", self.at)
    }
}

impl Opener for TcpAddress {
    fn open(&mut self) -> Result<Box<dyn Link>, LinkError> {
        Ok(Box::new(TcpLink::open(self)?))
    }

    fn address(&self) -> String {
        self.to_string()
    }
}

/// An open connection to a device.
#[derive(Debug)]
pub struct TcpLink {
    stream: TcpStream,
}

impl TcpLink {
    /// Connects to a device and sends the token, if there is one.
    ///
    /// # Errors
    /// [`LinkError`] if nobody listens there, or the connection fails.
    pub fn open(address: &TcpAddress) -> Result<Self, LinkError> {
        let stream =
            TcpStream::connect_timeout(&address.at, CONNECT_TIMEOUT).map_err(|e| {
                match e.kind() {
                    io::ErrorKind::ConnectionRefused => LinkError::NobodyListens,
                    _ => LinkError::System(e.to_string()),
                }
            })?;
        prepare(&stream).map_err(|e| io_error(&e))?;
        let mut link = Self { stream };
        if let Some(token) = &address.token {
            link.write(format!("{}\n", token.reveal()).as_bytes())?;
        }
        Ok(link)
    }
}

/// Small frames leave at once, and no call waits.
fn prepare(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_nonblocking(true)
}

fn io_error(error: &io::Error) -> LinkError {
    match error.kind() {
        io::ErrorKind::ConnectionReset
        | io::ErrorKind::ConnectionAborted
        | io::ErrorKind::BrokenPipe
        | io::ErrorKind::NotConnected => LinkError::Unplugged,
        _ => LinkError::System(error.to_string()),
    }
}

impl Link for TcpLink {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, LinkError> {
        let until = Instant::now() + wait;
        loop {
            match self.stream.read(buffer) {
                Ok(0) => return Err(LinkError::Unplugged),
                Ok(count) => return Ok(count),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) if e.kind() == io::ErrorKind::WouldBlock => {
                    let left = until.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Ok(0);
                    }
                    std::thread::sleep(left.min(SLICE));
                }
                Err(e) => return Err(io_error(&e)),
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let mut left = bytes;
        let begun = Instant::now();
        while !left.is_empty() {
            match self.stream.write(left) {
                Ok(count) => left = &left[count..],
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) if e.kind() == io::ErrorKind::WouldBlock => {
                    if begun.elapsed() >= WRITE_TIMEOUT {
                        return Err(LinkError::WriteTimeout);
                    }
                    std::thread::sleep(SLICE);
                }
                Err(e) => return Err(io_error(&e)),
            }
        }
        Ok(())
    }
}

/// The device's end: it waits for one host at a time and refuses others while one is connected.
#[derive(Debug)]
pub(crate) struct Listening {
    listener: TcpListener,
    address: SocketAddr,
    path: String,
    token: Token,
    host: Option<Host>,
}

/// A connected host.
#[derive(Debug)]
struct Host {
    stream: TcpStream,
    /// Since when it is connected.
    since: Instant,
    /// What it has sent before the end of the line with the token; `None` after that.
    greeting: Option<Vec<u8>>,
    /// Bytes that it has not read.
    waiting: Vec<u8>,
}

impl Listening {
    /// Listens at an address of this computer.
    pub(crate) fn open(at: SocketAddr, token: Token) -> Result<Self, LinkError> {
        let failed = |e: io::Error| match e.kind() {
            io::ErrorKind::AddrInUse => LinkError::InUse,
            _ => LinkError::System(e.to_string()),
        };
        let listener = TcpListener::bind(at).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self {
            listener,
            address,
            path: format!("{SCHEME}{}@{address}", token.reveal()),
            token,
            host: None,
        })
    }

    /// The address, with its port.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    fn accept(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            // A second host is refused: it is dropped.
            if self.host.is_none() && prepare(&stream).is_ok() {
                self.host = Some(Host {
                    stream,
                    since: Instant::now(),
                    greeting: Some(Vec::new()),
                    waiting: Vec::new(),
                });
            }
        }
    }
}

impl Host {
    /// What it has sent since the last call; `None` once it is gone or does not know the token.
    fn read(&mut self, token: &Token) -> Option<Vec<u8>> {
        let mut bytes = vec![0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => return None,
            Ok(count) => bytes.truncate(count),
            Err(e) => match e.kind() {
                io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => bytes.clear(),
                _ => return None,
            },
        }
        let Some(greeting) = &mut self.greeting else {
            return Some(bytes);
        };
        greeting.extend(bytes);
        let Some(end) = greeting.iter().position(|b| *b == b'\n') else {
            let may_follow =
                greeting.len() <= Token::LONGEST && self.since.elapsed() < TOKEN_TIMEOUT;
            return may_follow.then(Vec::new);
        };
        let rest = greeting.split_off(end + 1);
        let known = token.is(&greeting[..end]);
        self.greeting = None;
        known.then_some(rest)
    }

    /// Whether it is still there.
    fn write(&mut self, bytes: &[u8]) -> bool {
        if self.greeting.is_some() {
            return true;
        }
        if self.waiting.len() + bytes.len() <= MAX_WAITING {
            self.waiting.extend_from_slice(bytes);
        }
        while !self.waiting.is_empty() {
            match self.stream.write(&self.waiting) {
                Ok(count) => drop(self.waiting.drain(..count)),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return e.kind() == io::ErrorKind::WouldBlock,
            }
        }
        true
    }
}

impl Cable for Listening {
    fn path(&self) -> &str {
        &self.path
    }

    fn read(&mut self) -> Vec<u8> {
        self.accept();
        let read = self.host.as_mut().and_then(|host| host.read(&self.token));
        if read.is_none() {
            self.host = None;
        }
        read.unwrap_or_default()
    }

    fn write(&mut self, bytes: &[u8]) {
        if self.host.as_mut().is_some_and(|host| !host.write(bytes)) {
            self.host = None;
        }
    }

    fn wait(&mut self, wait: Duration) {
        std::thread::sleep(wait.min(SLICE));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANY: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

    fn listening() -> (Listening, TcpAddress) {
        let device = Listening::open(ANY, Token::new("secret1").unwrap()).unwrap();
        let address = TcpAddress::read(device.path()).unwrap().unwrap();
        (device, address)
    }

    /// Reads at the device until something arrives or time is up.
    fn arrives(device: &mut Listening) -> Vec<u8> {
        let begun = Instant::now();
        let mut bytes = Vec::new();
        while bytes.is_empty() && begun.elapsed() < Duration::from_secs(5) {
            bytes = device.read();
            device.wait(SLICE);
        }
        bytes
    }

    #[test]
    fn an_address_is_a_host_a_port_and_perhaps_a_token() {
        let shown = |text: &str| match TcpAddress::read(text)? {
            Ok(address) => Some(format!("{address} {}", address.token.is_some())),
            Err(error) => Some(format!("{error:?}")),
        };
        assert_eq!(shown("/dev/ttyUSB0"), None);
        assert_eq!(shown("COM3"), None);
        let cases = [
            ("tcp://127.0.0.1:5000", "tcp://127.0.0.1:5000 false"),
            ("tcp://localhost:5000", "tcp://127.0.0.1:5000 false"),
            ("tcp://ab12@[::1]:5000", "tcp://[::1]:5000 true"),
            ("tcp://127.0.0.1", "Syntax"),
            ("tcp://example.org:80", "Syntax"),
            ("tcp://localhost:99999", "Syntax"),
            ("tcp://@127.0.0.1:1", "Token"),
            ("tcp://a b@127.0.0.1:1", "Token"),
        ];
        for (text, expected) in cases {
            assert_eq!(shown(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn the_token_is_not_shown() {
        let address = TcpAddress::read("tcp://secret1@127.0.0.1:5000")
            .unwrap()
            .unwrap();
        let shown = format!("{address} {address:?} {}", Opener::address(&address));
        assert!(!shown.contains("secret1"), "{shown}");
    }

    #[test]
    fn bytes_pass_in_both_directions_and_unplugging_ends_the_link() {
        let (mut device, address) = listening();
        let mut link = TcpLink::open(&address).unwrap();
        link.write(&[0, 1, 255, 3, 10, 0]).unwrap();
        assert_eq!(arrives(&mut device), [0, 1, 255, 3, 10, 0]);
        device.write(&[13, 10, 4, 0]);
        let mut buffer = [0; 64];
        let count = link.read(&mut buffer, Duration::from_secs(5)).unwrap();
        assert_eq!(buffer[..count], [13, 10, 4, 0]);
        assert_eq!(link.read(&mut buffer, SLICE), Ok(0));
        drop(device);
        let end = link.read(&mut buffer, Duration::from_secs(5)).unwrap_err();
        assert_eq!(end, LinkError::Unplugged);
        let gone = TcpLink::open(&address).unwrap_err();
        assert_eq!(gone, LinkError::NobodyListens);
    }

    #[test]
    fn a_host_without_the_token_and_a_second_host_are_refused() {
        let (mut device, address) = listening();
        for wrong in [None, Some(Token::new("secret2").unwrap())] {
            let mut other = TcpLink::open(&TcpAddress {
                token: wrong,
                ..address.clone()
            })
            .unwrap();
            other.write(b"secret1secret1\n").unwrap();
            let mut buffer = [0; 8];
            let mut end = Ok(0);
            let begun = Instant::now();
            while end == Ok(0) && begun.elapsed() < Duration::from_secs(5) {
                assert!(device.read().is_empty(), "nothing is passed on");
                device.write(&[1, 2, 3]);
                end = other.read(&mut buffer, SLICE);
            }
            assert_eq!(end, Err(LinkError::Unplugged));
        }
        let mut first = TcpLink::open(&address).unwrap();
        first.write(&[1]).unwrap();
        assert_eq!(arrives(&mut device), [1]);
        let mut second = TcpLink::open(&address).unwrap();
        let mut end = Ok(0);
        let begun = Instant::now();
        while end == Ok(0) && begun.elapsed() < Duration::from_secs(5) {
            assert!(device.read().is_empty());
            end = second.read(&mut [0; 8], SLICE);
        }
        assert_eq!(end, Err(LinkError::Unplugged));
        first.write(&[2]).unwrap();
        assert_eq!(arrives(&mut device), [2], "the first stays connected");
    }

    /// A side that does not read cannot block the other.
    #[test]
    fn a_device_that_does_not_read_ends_the_link_and_a_host_that_does_not_read_loses_bytes() {
        let (mut device, address) = listening();
        let mut link = TcpLink::open(&address).unwrap();
        link.write(&[1]).unwrap();
        assert_eq!(arrives(&mut device), [1]);
        let full = (0..1_000_000).find_map(|_| link.write(&[7; 10_000]).err());
        assert_eq!(full, Some(LinkError::WriteTimeout));
        for _ in 0..10_000 {
            device.write(&[7; 1000]);
        }
        assert!(device.host.unwrap().waiting.len() <= MAX_WAITING);
    }
}
