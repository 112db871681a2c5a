//! Who should not be there, and what should not be sent.

use super::{Browser, Session, acts, count, exchange, is_rating, patient};
use crate::support::{PATIENCE, changed_protocol, study};
use serde_json::json;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;

#[test]
fn nobody_is_let_in() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = patient(folder.path());
    let mut session = Session::start(folder.path(), &protocol, &[]);
    let token = session.token.clone();
    let browser = &mut session.browser;
    assert_eq!(token.len(), 32, "128 bits");
    for wrong in ["", "0", &"0".repeat(32), &token[1..], &format!("{token}0")] {
        assert_eq!(browser.open(wrong), 403, "{wrong}");
    }
    assert_eq!(browser.get("/view?after=0").status, 401);
    assert_eq!(browser.post("/reply", &json!({})).status, 401);

    // Without the right names and types even the right token does not help.
    let host = browser.address.clone();
    let body = json!(token).to_string();
    let raw = |host_header: &str, more: &str| {
        let request = format!(
            "POST /open HTTP/1.1\r\nHost: {host_header}\r\n{more}Content-Length: {}\r\n\r\n{body}",
            body.len()
        );
        exchange(&host, request.as_bytes()).unwrap().status
    };
    let json_type = "Content-Type: application/json\r\n";
    assert_eq!(raw("evil.example", json_type), 421);
    let (ip, port) = host.split_once(':').unwrap();
    for rebound in [ip, &format!("{ip}:1"), &format!("evil.example:{port}")] {
        assert_eq!(raw(rebound, json_type), 421, "{rebound}");
    }
    assert_eq!(raw(&host, ""), 403, "a form of another site");
    assert_eq!(raw(&host, "Content-Type: text/plain\r\n"), 403);
    let foreign = format!("{json_type}Origin: http://evil.example\r\n");
    assert_eq!(raw(&host, &foreign), 403);
    assert_eq!(raw(&host, &format!("{json_type}Origin: null\r\n")), 403);

    // The token is good once; a second browser is refused, the first stays.
    assert_eq!(browser.open(&token), 200);
    let mut second = Browser {
        address: browser.address.clone(),
        ..Browser::default()
    };
    assert_eq!(second.open(&token), 403);
    assert_eq!(second.get("/view?after=0").status, 401);
    let (name, secret) = browser.cookie.split_once('=').unwrap();
    second.cookie = format!("{name}={}", "0".repeat(32));
    assert_eq!(second.get("/view?after=0").status, 401);
    second.cookie.clone_from(&browser.cookie);
    second.cookie.pop();
    assert_eq!(second.get("/view?after=0").status, 401);
    assert_eq!(browser.get("/view?after=0").status, 200);

    for (target, status) in [
        ("/", 200),
        ("/page.js", 200),
        ("/page.css", 200),
        ("/../etc", 404),
    ] {
        let answer = second.get(target);
        assert_eq!(answer.status, status, "{target}");
        for header in [
            "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'",
            "Referrer-Policy: no-referrer",
            "X-Content-Type-Options: nosniff",
            "Cache-Control: no-store",
        ] {
            assert!(answer.head.contains(header), "{target}: {}", answer.head);
        }
        // What everybody may read says nothing of the session, its study or its secrets.
        for secret in [&token, secret, "switch", "P01", "lambda"] {
            assert!(!answer.body.contains(secret), "{target}: {secret}");
        }
    }
    // Nothing was recorded by all this.
    browser.wait_for("a page with a button", acts);
    assert_eq!(count(folder.path(), "answered"), 0);
}

#[test]
fn large_slow_and_odd_requests_do_not_hold_up_the_participant() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = patient(folder.path());
    let mut session = Session::opened(folder.path(), &protocol, &[]);
    let address = session.browser.address.clone();
    let browser = &mut session.browser;

    // 10 MB, told and not told.
    let large = vec![b'x'; 10_000_000];
    let head = |length: usize| {
        format!(
            "POST /reply HTTP/1.1\r\nHost: {address}\r\nCookie: {}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n\r\n",
            browser.cookie
        )
    };
    let told = [head(large.len()).into_bytes(), large.clone()].concat();
    assert!(exchange(&address, &told).is_none_or(|a| a.status == 413));
    assert!(exchange(&address, &large).is_none_or(|a| [400, 431].contains(&a.status)));
    for odd in [
        "\r\n\r\n",
        "GET / HTTP/1.0\r\n\r\n",
        "GET /\r\n\r\n",
        "\u{0}\u{1}\r\n\r\n",
        "POST /reply HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n",
        "POST /reply HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    ] {
        assert_eq!(
            exchange(&address, odd.as_bytes()).unwrap().status,
            400,
            "{odd:?}"
        );
    }
    for body in ["", "[]", "{}", "{\"page\":1}", "\u{1}"] {
        let request = format!("{}{body}", head(body.len()));
        assert_eq!(
            exchange(&address, request.as_bytes()).unwrap().status,
            400,
            "{body:?}"
        );
    }
    let deep = "[".repeat(60_000);
    let request = format!("{}{deep}", head(deep.len()));
    assert_eq!(exchange(&address, request.as_bytes()).unwrap().status, 400);

    // Slow loris: more connections than are served, each with half a request.
    let slow: Vec<TcpStream> = (0..100)
        .filter_map(|_| {
            let mut stream = TcpStream::connect(&address).ok()?;
            stream.write_all(b"GET / HTTP/1.1\r\nHo").ok()?;
            Some(stream)
        })
        .collect();
    assert!(slow.len() > 50);
    let page = browser.play("a rating beside slow connections", is_rating);
    let reply = browser.reply(&page, "answer", json!({"answers": {"realism": "5"}}));
    assert_eq!(browser.post("/reply", &reply).status, 200);
    // None of them is kept for longer than a request may take.
    for mut stream in slow {
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let _ = stream.read_to_end(&mut Vec::new());
    }

    // A flood of strangers is refused, and the participant is not.
    let stranger = Browser {
        address: address.clone(),
        ..Browser::default()
    };
    let statuses: Vec<u16> = (0..200).map(|_| stranger.get("/").status).collect();
    assert!(statuses.contains(&429), "{statuses:?}");
    assert_eq!(browser.get("/view?after=0").status, 200);
    assert_eq!(count(folder.path(), "\"rating\""), 1);
}

#[test]
fn what_cannot_work_is_refused_before_the_session() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = patient(folder.path());
    let path = protocol.to_str().unwrap();
    for all in [
        "0.0.0.0",
        "::",
        "[::]:8080",
        "0.0.0.0:80",
        "::ffff:0.0.0.0",
        "255.255.255.255",
    ] {
        let (code, _, err) = study(&["run", path, &format!("--screen={all}")], folder.path());
        assert_eq!(code, 2, "{all}: {err}");
        assert!(err.contains("one address of this computer"), "{all}: {err}");
    }
    let (code, _, err) = study(&["run", path, "--screen=tablet.example"], folder.path());
    assert_eq!(code, 2, "{err}");
    // An address of documentation, which no computer has.
    let (code, _, err) = study(&["run", path, "--screen=192.0.2.1"], folder.path());
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("no page can be served at 192.0.2.1"), "{err}");
    let dictated = folder.path().join("dictated");
    let entry = ("entry = \"participant\"", "entry = \"experimenter\"");
    changed_protocol("turn-signal", &dictated, &[entry]);
    let (code, _, err) = study(
        &["run", dictated.to_str().unwrap(), "--screen"],
        folder.path(),
    );
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("the experimenter types the answers"), "{err}");
    assert!(!folder.path().join("results").exists());
}
