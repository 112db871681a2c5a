//! The server of the participant's page: its threads, its addresses, its limits.

use super::access::{Access, secret};
use super::board::Board;
use super::connections::Connections;
use super::http::{self, Request, Response};
use super::media::Stage;
use super::{Address, ScreenError};
use maud::{DOCTYPE, html};
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use study_plan::protocol::phrases::{Phrase, Words, is_right_to_left};
use study_session::page::reply::{Outcome, Sent};

/// How long a request waits for another page.
const WATCH: Duration = Duration::from_secs(15);
/// How long a reply waits until it is saved.
const SAVE: Duration = Duration::from_secs(10);
const STACK: usize = 256 * 1024;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
const MEDIA_SCRIPT: &str = include_str!("media.js");

/// A running server; it ends when it is dropped.
#[derive(Debug)]
pub(super) struct Server {
    shared: Arc<Shared>,
    address: SocketAddr,
    link: String,
}

#[derive(Debug)]
struct Shared {
    board: Arc<Board>,
    stage: Arc<Stage>,
    access: Mutex<Access>,
    /// The document, which holds nothing of the session.
    document: String,
    begun: Instant,
    open: Mutex<Connections>,
}

impl Server {
    pub(super) fn open(
        at: Address,
        lang: Option<&str>,
        words: &Words,
        (board, stage): (Arc<Board>, Arc<Stage>),
    ) -> Result<Self, ScreenError> {
        let failed = |source| ScreenError::Listen {
            at: at.socket(),
            source,
        };
        let listener = TcpListener::bind(at.socket()).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let token = secret()?;
        let link = format!("http://{address}/#{token}");
        let shared = Arc::new(Shared {
            board,
            access: Mutex::new(Access::new(
                token,
                (format!("study-{}", address.port()), secret()?),
                hosts(address),
            )),
            document: document(lang, words, stage.is_needed()),
            stage,
            begun: Instant::now(),
            open: Mutex::default(),
        });
        let of_thread = shared.clone();
        std::thread::Builder::new()
            .name("page".to_owned())
            .spawn(move || accept(&listener, &of_thread))
            .map_err(failed)?;
        Ok(Self {
            shared,
            address,
            link,
        })
    }

    /// The link to the page, with its token.
    pub(super) fn link(&self) -> &str {
        &self.link
    }

    /// Whether a browser has opened the link.
    pub(super) fn is_open(&self) -> bool {
        self.shared.access().is_open()
    }

    /// How many requests of others than the participant's browser were refused because they
    /// were too many, while they go on.
    pub(super) fn refused_now(&self) -> Option<u64> {
        let access = self.shared.access();
        let besieged = access.is_besieged(self.shared.begun.elapsed());
        besieged.then(|| access.refused())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.board.close();
        // Wakes the thread that accepts, which then ends.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_millis(200));
    }
}

/// The names under which the server may be addressed.
fn hosts(address: SocketAddr) -> Vec<String> {
    let mut hosts = vec![address.to_string()];
    if address.ip().is_loopback() {
        hosts.push(format!("localhost:{}", address.port()));
    }
    if address.port() == 80 {
        let bare = |host: &String| host.trim_end_matches(":80").to_owned();
        let without: Vec<String> = hosts.iter().map(bare).collect();
        hosts.extend(without);
    }
    hosts
}

fn document(lang: Option<&str>, words: &Words, media: bool) -> String {
    let of_media = |phrase| media.then(|| words.get(phrase));
    let lang = lang.unwrap_or("en");
    let dir = match is_right_to_left(lang) {
        true => "rtl",
        false => "ltr",
    };
    html! {
        (DOCTYPE)
        html lang=(lang) dir=(dir) {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (words.get(Phrase::OneMoment)) }
                link rel="stylesheet" href="/page.css";
                @if media { script src="/media.js" defer {} }
                script src="/page.js" defer {}
            }
            body
                data-lost=(words.get(Phrase::PageLost))
                data-closed=(words.get(Phrase::PageClosed))
                data-saving=(words.get(Phrase::Saving))
                data-saved=(words.get(Phrase::Saved))
                data-needed=(words.get(Phrase::PlainNeeded))
                data-tap=[of_media(Phrase::PageTap)]
                data-moving=[of_media(Phrase::PageMoving)]
            {
                header { p id="where" {} progress id="bar" hidden aria-hidden="true" {} p id="banner" {} }
                main id="page" { h1 { (words.get(Phrase::OneMoment)) } }
                footer { p id="state" role="status" {} }
                noscript { p { "This page needs JavaScript." } }
            }
        }
    }
    .into_string()
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    for (id, stream) in (0..).zip(listener.incoming()) {
        if shared.board.is_closed() {
            return;
        }
        let Ok(stream) = stream else {
            // Out of descriptors, for example: some connections end soon.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        if shared.connections().admit(id, &stream).is_err() {
            continue;
        }
        let of_thread = shared.clone();
        let spawned = std::thread::Builder::new()
            .name("page-request".to_owned())
            .stack_size(STACK)
            .spawn(move || {
                of_thread.serve(id, stream);
                of_thread.connections().forget(id);
            });
        if spawned.is_err() {
            shared.connections().forget(id);
        }
    }
}

impl Shared {
    fn access(&self) -> MutexGuard<'_, Access> {
        self.access.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn connections(&self) -> MutexGuard<'_, Connections> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn serve(&self, id: u64, mut stream: TcpStream) {
        // Only a response that leaves late is the consequence.
        let _ = stream.set_nodelay(true);
        let request = http::read(&mut stream, |head| self.recognize(id, head));
        let arrived = Instant::now();
        match request {
            // A browser that is gone asks again.
            Ok(request) => {
                let _ = self.answer(id, &request, arrived).send(&mut stream);
            }
            // No browser sends this. It is told so as long as strangers have requests left.
            Err(status) => {
                self.connections().is_refused(id);
                let heard = self.access().permits(false, self.begun.elapsed());
                if heard && Response::empty(status).send(&mut stream).is_ok() {
                    http::drain(&mut stream);
                }
            }
        }
    }

    /// Keeps a place for a request of the participant's browser.
    fn recognize(&self, id: u64, head: &Request) {
        let access = self.access();
        let known = access.knows_host(&head.host) && access.knows_cookie(&head.cookie);
        drop(access);
        if known {
            self.connections().is_browsers(id);
        }
    }

    fn answer(&self, id: u64, request: &Request, arrived: Instant) -> Response {
        let known = {
            let mut access = self.access();
            let named = access.knows_host(&request.host);
            let known = named && access.knows_cookie(&request.cookie);
            // A stop is never held up.
            let stops = known && request.path == "/reply" && request.body.len() < 256;
            if !stops && !access.permits(known, self.begun.elapsed()) {
                return Response::empty(429);
            }
            if !named {
                return Response::empty(421);
            }
            if known && !self.connections().is_browsers(id) && !stops {
                return Response::empty(503);
            }
            known
        };
        if self.stage.is_needed()
            && let Some(response) = self.media(request, known, arrived)
        {
            return response;
        }
        match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/") => Response {
                shows_media: self.stage.is_needed(),
                ..Response::body("text/html; charset=utf-8", self.document.as_str())
            },
            ("GET", "/page.css") => Response::body("text/css; charset=utf-8", STYLE),
            ("GET", "/page.js") => Response::body("text/javascript; charset=utf-8", SCRIPT),
            ("GET", "/view") if known => {
                let than = request.query.strip_prefix("after=");
                let than = than.and_then(|n| n.parse().ok()).unwrap_or(0);
                Response::body("application/json", self.board.newer(than, WATCH))
            }
            ("POST", "/open" | "/reply") if !self.is_own(request) => Response::empty(403),
            ("POST", "/open") if known => Response::empty(200),
            ("POST", "/open") => self.open(request),
            ("POST", "/reply") if known => self.reply(request),
            ("GET", "/view") | ("POST", "/reply") => Response::empty(401),
            (_, "/" | "/page.css" | "/page.js" | "/view" | "/open" | "/reply") => {
                Response::empty(405)
            }
            _ => Response::empty(404),
        }
    }

    /// The answer to a request that is about media.
    fn media(&self, request: &Request, known: bool, arrived: Instant) -> Option<Response> {
        let path = request.path.as_str();
        let id = path.strip_prefix("/media/");
        if id.is_none() && !matches!(path, "/media" | "/media.js" | "/clock") {
            return None;
        }
        let json = |text: String| Response::body("application/json", text);
        Some(match (request.method.as_str(), path, id) {
            ("GET", "/media.js", _) => {
                Response::body("text/javascript; charset=utf-8", MEDIA_SCRIPT)
            }
            ("POST", "/clock" | "/media", _) if !self.is_own(request) => Response::empty(403),
            _ if !known => Response::empty(401),
            ("GET", "/media", _) => json(self.stage.list()),
            ("GET", _, Some(id)) => match self.stage.file(id) {
                Some((content_type, file)) => Response {
                    file: Some(file),
                    ..Response::body(content_type, Vec::new())
                },
                None => Response::empty(404),
            },
            ("POST", "/clock", _) => match self.stage.here(&request.body, arrived) {
                Ok(times) => json(times),
                Err(status) => Response::empty(status),
            },
            ("POST", "/media", _) => {
                let told = self.stage.told(&request.body);
                Response::empty(told.err().unwrap_or(200))
            }
            _ => Response::empty(405),
        })
    }

    /// Whether a request was made by a page of this server: no form of another site can
    /// send this type.
    fn is_own(&self, request: &Request) -> bool {
        let origin = request.origin.as_deref();
        request.content_type == "application/json"
            && origin.is_none_or(|origin| self.access().knows_origin(origin))
    }

    fn open(&self, request: &Request) -> Response {
        let token = serde_json::from_slice::<String>(&request.body).unwrap_or_default();
        match self.access().redeem(&token) {
            Some(cookie) => Response {
                cookie: Some(cookie),
                ..Response::empty(200)
            },
            None => Response::empty(403),
        }
    }

    fn reply(&self, request: &Request) -> Response {
        let reply = match Sent::read(&request.body) {
            Ok(Sent::Reply(reply)) => reply,
            Ok(stop) => {
                self.board.with(|exchange| exchange.arrive(stop));
                return Response::empty(200);
            }
            Err(_) => return Response::empty(400),
        };
        match self.board.reply(reply, SAVE) {
            Some(Outcome::Saved) => Response::empty(200),
            Some(Outcome::Stale) => Response::empty(409),
            Some(Outcome::Refused(why)) => Response {
                status: 422,
                ..Response::body("text/plain; charset=utf-8", why)
            },
            None => Response::empty(202),
        }
    }
}

/// Where a page may listen.
///
/// # Errors
/// [`ScreenError::Address`].
pub(super) fn address(text: &str) -> Result<Address, ScreenError> {
    let wrong = || ScreenError::Address(text.to_owned());
    let ip = text.trim_start_matches('[').trim_end_matches(']').parse();
    let socket = match (ip, text.parse::<SocketAddr>()) {
        (Ok(ip), _) => SocketAddr::new(ip, 0),
        (_, Ok(socket)) => socket,
        _ => return Err(wrong()),
    };
    let all = |ip: IpAddr| match ip {
        IpAddr::V4(ip) => ip.is_unspecified() || ip.is_multicast() || ip.is_broadcast(),
        IpAddr::V6(ip) => ip.is_unspecified() || ip.is_multicast(),
    };
    match all(socket.ip().to_canonical()) {
        true => Err(wrong()),
        false => Ok(Address(socket)),
    }
}

impl From<getrandom::Error> for ScreenError {
    fn from(error: getrandom::Error) -> Self {
        Self::Random(io::Error::from(error))
    }
}
