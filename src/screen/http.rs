//! As much of HTTP/1.1 as the page needs: one request a connection, everything bounded.

use std::io::{self, Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest request line with headers, bytes.
const MOST_HEAD: usize = 8 * 1024;
/// Longest body, bytes: the longest texts of a page with every character escaped.
const MOST_BODY: usize = 64 * 1024;
/// How long a request may take to arrive.
pub(super) const ARRIVAL: Duration = Duration::from_secs(5);
/// How long a response may take to leave.
const DEPARTURE: Duration = Duration::from_secs(5);
/// How long a browser keeps the cookie, s: longer than a session, and not for ever, since each
/// run has one of its own.
const COOKIE_S: u32 = 12 * 3600;
/// How much of a refused request is read, so that the other side sees the refusal.
const DRAINED: usize = 1024 * 1024;

/// A request.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Request {
    pub(super) method: String,
    /// Path without the query.
    pub(super) path: String,
    pub(super) query: String,
    pub(super) host: String,
    pub(super) origin: Option<String>,
    pub(super) cookie: String,
    pub(super) content_type: String,
    pub(super) body: Vec<u8>,
}

/// A response.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Response {
    pub(super) status: u16,
    pub(super) content_type: &'static str,
    /// Name and value of a cookie.
    pub(super) cookie: Option<String>,
    pub(super) body: Vec<u8>,
    /// Instead of a body: the content of a file, which other requests share.
    pub(super) file: Option<Arc<[u8]>>,
    /// Whether it is a document that shows and plays what its script has loaded.
    pub(super) shows_media: bool,
}

impl Response {
    /// A status without a body.
    pub(super) fn empty(status: u16) -> Self {
        Self {
            status,
            ..Self::default()
        }
    }

    /// A body.
    pub(super) fn body(content_type: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status: 200,
            content_type,
            body: body.into(),
            ..Self::default()
        }
    }

    /// Sends the response.
    pub(super) fn send(&self, stream: &mut TcpStream) -> io::Result<()> {
        let body: &[u8] = self.file.as_deref().unwrap_or(&self.body);
        // The script makes these addresses of what it has loaded; no server has any.
        let media = match self.shows_media {
            true => " img-src blob:; media-src blob:;",
            false => "",
        };
        let mut head = format!(
            "HTTP/1.1 {} {}\r\n\
             Content-Length: {}\r\n\
             Connection: close\r\n\
             Cache-Control: no-store\r\n\
             Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; \
             connect-src 'self';{media} base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\n\
             Referrer-Policy: no-referrer\r\n\
             X-Content-Type-Options: nosniff\r\n",
            self.status,
            reason(self.status),
            body.len(),
        );
        if !self.content_type.is_empty() {
            head.push_str(&format!("Content-Type: {}\r\n", self.content_type));
        }
        if let Some(cookie) = &self.cookie {
            head.push_str(&format!(
                "Set-Cookie: {cookie}; Path=/; Max-Age={COOKIE_S}; HttpOnly; SameSite=Strict\r\n"
            ));
        }
        head.push_str("\r\n");
        stream.set_write_timeout(Some(DEPARTURE))?;
        let mut bytes = head.into_bytes();
        if self.file.is_some() {
            stream.write_all(&bytes)?;
            stream.write_all(body)?;
            return stream.flush();
        }
        bytes.extend_from_slice(body);
        stream.write_all(&bytes)?;
        stream.flush()
    }
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        202 => "Accepted",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        413 => "Content Too Large",
        421 => "Misdirected Request",
        422 => "Unprocessable Content",
        429 => "Too Many Requests",
        431 => "Request Header Fields Too Large",
        _ => "Service Unavailable",
    }
}

/// Reads one request. Its head is looked at before its body has arrived.
///
/// # Errors
/// The status to refuse it with.
pub(super) fn read(stream: &mut TcpStream, look: impl FnOnce(&Request)) -> Result<Request, u16> {
    let until = Instant::now() + ARRIVAL;
    let mut bytes = Vec::new();
    let end = loop {
        if let Some(end) = find(&bytes, b"\r\n\r\n") {
            break end;
        }
        if bytes.len() > MOST_HEAD {
            return Err(431);
        }
        more(stream, &mut bytes, until)?;
    };
    let head = std::str::from_utf8(&bytes[..end]).map_err(|_| 400_u16)?;
    let (mut request, length) = parse(head)?;
    if length > MOST_BODY {
        return Err(413);
    }
    look(&request);
    let mut body = bytes.split_off(end + 4);
    while body.len() < length {
        more(stream, &mut body, until)?;
    }
    body.truncate(length);
    request.body = body;
    Ok(request)
}

/// Reads what else a refused sender sends, within limits: a connection that is closed
/// with unread bytes takes the refusal with it.
pub(super) fn drain(stream: &mut TcpStream) {
    let _ = stream.shutdown(std::net::Shutdown::Write);
    let until = Instant::now() + Duration::from_secs(1);
    let mut bytes = Vec::new();
    let mut read = 0;
    while read < DRAINED && more(stream, &mut bytes, until).is_ok() {
        read += bytes.len();
        bytes.clear();
    }
}

/// Reads what has arrived, until a time.
fn more(stream: &mut TcpStream, bytes: &mut Vec<u8>, until: Instant) -> Result<(), u16> {
    let left = until.saturating_duration_since(Instant::now());
    if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
        return Err(408);
    }
    let mut chunk = [0; 4096];
    match stream.read(&mut chunk) {
        Ok(n @ 1..) => {
            bytes.extend_from_slice(&chunk[..n]);
            Ok(())
        }
        Err(e) if e.kind() == io::ErrorKind::Interrupted => Ok(()),
        _ => Err(408),
    }
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|w| w == what)
}

/// The request of a head, with the length of its body.
fn parse(head: &str) -> Result<(Request, usize), u16> {
    let mut lines = head.split("\r\n");
    let mut first = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(target), Some("HTTP/1.1"), None) =
        (first.next(), first.next(), first.next(), first.next())
    else {
        return Err(400);
    };
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let mut request = Request {
        method: method.to_owned(),
        path: path.to_owned(),
        query: query.to_owned(),
        ..Request::default()
    };
    let (mut host, mut length) = (None, None);
    for line in lines {
        let (name, value) = line.split_once(':').ok_or(400_u16)?;
        let value = value.trim();
        match name.to_ascii_lowercase().as_str() {
            "host" if host.is_some() => return Err(400),
            "host" => host = Some(value.to_owned()),
            "content-length" if length.is_some() => return Err(400),
            "content-length" => {
                let digits = !value.is_empty() && value.bytes().all(|b| b.is_ascii_digit());
                // Too many digits for a number is too long.
                length = Some(value.parse().unwrap_or(usize::MAX));
                if !digits {
                    return Err(400);
                }
            }
            "transfer-encoding" => return Err(400),
            "cookie" => request.cookie = value.to_owned(),
            "origin" => request.origin = Some(value.to_owned()),
            "content-type" => request.content_type = value.to_owned(),
            _ => {}
        }
    }
    request.host = host.ok_or(400_u16)?;
    Ok((request, length.unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_read_strictly() {
        let (request, length) =
            parse("POST /reply?x HTTP/1.1\r\nHost: a\r\ncontent-length: 12\r\nX: y").unwrap();
        assert_eq!(
            (request.path.as_str(), request.query.as_str()),
            ("/reply", "x")
        );
        assert_eq!((request.host.as_str(), length), ("a", 12));
        for bad in [
            "",
            "GET /",
            "GET / HTTP/1.0\r\nHost: a",
            "GET / HTTP/1.1",
            "GET / HTTP/1.1 x\r\nHost: a",
            "GET / HTTP/1.1\r\nHost: a\r\nHost: b",
            "GET / HTTP/1.1\r\nHost: a\r\nno colon",
            "GET / HTTP/1.1\r\nHost: a\r\nContent-Length: +1",
            "GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2",
            "GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked",
        ] {
            assert_eq!(parse(bad).unwrap_err(), 400, "{bad}");
        }
        let long = "POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 99999999999999999999999";
        assert_eq!(parse(long).unwrap().1, usize::MAX);
    }
}
