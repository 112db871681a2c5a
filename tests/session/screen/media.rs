//! Pictures and sounds on the page, over plain connections to the real binary.

use super::{Browser, Session, acts, is_over};
use crate::plain::events;
use crate::support::{PATIENCE, PATIENT, changed_protocol, study};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01\xff\xfe";
const WAV: &[u8] = b"RIFF\x24\0\0\0WAVEfmt \x10\0\0\0\xff";

/// The paper's study, each realization once: two show the same picture from two files, one plays a sound.
fn protocol(folder: &Path) -> PathBuf {
    let protocol = folder.join("shows");
    let model = |id: &str| format!("file = \"models/lambda-{id}.toml\"\n");
    let shows = |id: &str, media: &str| (model(id), format!("{}{media}\n", model(id)));
    let changes = [
        shows("0.9991", "picture = \"media/one.png\"\nalt = \"a lever\""),
        shows("0.9993", "picture = \"media/two.png\"\nalt = \"a lever\""),
        shows(
            "0.9995",
            "sound = \"media/click.wav\"\ncaption = \"a click\"",
        ),
    ];
    let mut all: Vec<(&str, &str)> = vec![
        ("study-protocol/1", "study-protocol/3"),
        ("repetitions = 3", "repetitions = 1"),
        PATIENT,
        (
            "exposure = { min_s = 2 }",
            // So long that a page which is silent is found out before.
            "exposure = { min_s = 0.2 }\nmedia_within_ms = 20000",
        ),
    ];
    all.extend(
        changes
            .iter()
            .map(|(old, new)| (old.as_str(), new.as_str())),
    );
    changed_protocol("turn-signal", &protocol, &all);
    fs::create_dir(protocol.join("media")).unwrap();
    for (name, bytes) in [("one.png", PNG), ("two.png", PNG), ("click.wav", WAV)] {
        fs::write(protocol.join("media").join(name), bytes).unwrap();
    }
    protocol
}

/// The head and the bytes of a file of the page.
fn file(browser: &Browser, target: &str) -> (String, Vec<u8>) {
    let (host, cookie) = (&browser.address, &browser.cookie);
    let request = format!("GET {target} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n\r\n");
    let mut stream = TcpStream::connect(host).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
    let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
    (head, bytes[end + 4..].to_vec())
}

/// A tab that says all the time that it is ready, until it is dropped.
struct Tab {
    here: Arc<AtomicBool>,
}

impl Tab {
    fn open(browser: &Browser) -> Self {
        let here = Arc::new(AtomicBool::new(true));
        let (stays, browser) = (here.clone(), browser.clone());
        beat(&browser, true);
        std::thread::spawn(move || {
            while stays.load(Ordering::Relaxed) {
                beat(&browser, false);
                std::thread::sleep(Duration::from_millis(200));
            }
        });
        Self { here }
    }
}

impl Drop for Tab {
    fn drop(&mut self) {
        self.here.store(false, Ordering::Relaxed);
    }
}

/// The time of the program's clock, ms, at which a sign of life arrived.
fn beat(browser: &Browser, first: bool) -> Option<f64> {
    let body = json!({"tab": "t", "first": first, "state": "ready"});
    let answer = browser.try_post("/clock", &body)?;
    let times: Value = serde_json::from_str(&answer.body).ok()?;
    times["arrived_ms"].as_f64()
}

/// What of a page is shown and played.
fn cue(page: &Value) -> Option<u64> {
    page["media"]["cue"].as_u64()
}

/// Plays to the last page; says of each presentation that all of it has just come.
fn play(browser: &mut Browser) -> BTreeMap<u64, Vec<Value>> {
    let mut told: BTreeMap<u64, Vec<Value>> = BTreeMap::new();
    loop {
        let new = |page: &Value| cue(page).is_some_and(|cue| !told.contains_key(&cue));
        let page = browser.wait_for("something to do", |page| {
            new(page) || acts(page) || is_over(page)
        });
        if is_over(&page) {
            return told;
        }
        let Some(cue) = cue(&page).filter(|_| new(&page)) else {
            browser.act(&page);
            continue;
        };
        let at_ms = beat(browser, false).unwrap();
        let media = page["media"]["media"].as_array().unwrap().clone();
        for shown in &media {
            let onset = json!({
                "says": "onset", "tab": "t", "cue": cue, "medium": shown["medium"],
                "at_ms": at_ms, "uncertainty_ms": 2.5,
            });
            assert_eq!(browser.post("/media", &onset).status, 200);
        }
        told.insert(cue, media);
        // The page is looked at again: it can be gone on from now.
        browser.revision = 0;
    }
}

#[test]
fn a_session_with_media_shows_them_and_records_when_they_came() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path());
    let mut session = Session::opened(folder.path(), &protocol, &[]);

    // The page may show what its script has loaded, and nothing else.
    let browser = session.browser.clone();
    let document = browser.get("/");
    let policy = "connect-src 'self'; img-src blob:; media-src blob:; base-uri 'none'";
    assert!(document.head.contains(policy), "{}", document.head);
    assert!(document.body.contains("/media.js"));
    let stranger = Browser {
        address: browser.address.clone(),
        ..Browser::default()
    };
    let list = browser.get("/media");
    let listed: Vec<Value> = serde_json::from_str(&list.body).unwrap();
    assert_eq!(listed.len(), 2, "what looks the same is one: {}", list.body);
    for word in ["one", "two", "click", "lambda", "lever", "0.999"] {
        assert!(!list.body.contains(word), "{}", list.body);
    }
    for file_of_list in &listed {
        let target = format!("/media/{}", file_of_list["id"].as_str().unwrap());
        let (head, bytes) = file(&browser, &target);
        let (content_type, content) = match file_of_list["medium"].as_str() {
            Some("picture") => ("Content-Type: image/png", PNG),
            _ => ("Content-Type: audio/wav", WAV),
        };
        assert!(head.contains(content_type), "{head}");
        assert!(head.contains("X-Content-Type-Options: nosniff"), "{head}");
        assert_eq!(bytes, content);
        assert_eq!(stranger.get(&target).status, 401);
    }
    assert_eq!(stranger.get("/media").status, 401);
    assert_eq!(stranger.post("/clock", &json!({})).status, 401);
    assert_eq!(browser.post("/clock", &json!({})).status, 400);
    for nothing in ["/media/", "/media/media/one.png", "/media/../protocol.toml"] {
        assert_eq!(browser.get(nothing).status, 404, "{nothing}");
    }

    // Nothing begins before the page is there.
    let waits = |page: &Value| page["kind"] == "reference" && !page["wait"].is_null();
    let page = session
        .browser
        .wait_for("a page that waits", |page| waits(page) || acts(page));
    assert!(waits(&page), "{page}");
    let reply = session.browser.reply(&page, "advance", json!({}));
    assert_eq!(session.browser.post("/reply", &reply).status, 422);

    let tab = Tab::open(&session.browser);
    let told = play(&mut session.browser);
    let shown: Vec<&Value> = told.values().flatten().collect();
    let pictures: Vec<_> = shown.iter().filter(|m| m["medium"] == "picture").collect();
    assert!(pictures.len() >= 2 && shown.len() > pictures.len());
    assert!(pictures.iter().all(|m| m["id"] == pictures[0]["id"]));
    drop(tab);
    session.types("");
    assert!(
        session.child.wait().unwrap().success(),
        "{}",
        session.said()
    );

    let journal = events(folder.path());
    let came: Vec<&Value> = (journal.iter())
        .filter(|event| event["event"] == "media_shown")
        .collect();
    assert!(came.len() >= 3, "{}", came.len());
    for event in &came {
        let offset = event["offset_ms"].as_f64().unwrap();
        assert!((0.0..=20_000.0).contains(&offset), "{event}");
        assert_eq!(event["uncertainty_ms"], 2.5);
    }
    let results = folder.path().join("results/turn-signal");
    let ratings = fs::read_to_string(results.join("ratings.csv")).unwrap();
    for column in ["media_offset_ms", "media_uncertainty_ms", "media_jitter_ms"] {
        assert!(
            ratings.lines().next().unwrap().contains(column),
            "{ratings}"
        );
    }
    // The files are frozen with the protocol, and a change of one is found.
    let frozen = results.join("protocol/1/media/one.png");
    assert_eq!(fs::read(&frozen).unwrap(), PNG);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    fs::write(&frozen, [PNG, b"more"].concat()).unwrap();
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_ne!(code, 0, "{out}{err}");
}

#[test]
fn a_page_that_goes_to_sleep_loses_the_attempt_and_no_answer_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path());
    let mut session = Session::opened(folder.path(), &protocol, &[]);
    let tab = Tab::open(&session.browser);
    let page = session
        .browser
        .play("something shown", |page| cue(page).is_some());
    let cue = cue(&page).unwrap();
    drop(tab);
    let begin = Instant::now();
    let failed = |events: &[Value]| events.iter().any(|e| e["failure"] == "media");
    while !failed(&events(folder.path())) {
        assert!(begin.elapsed() < PATIENCE, "{}", session.said());
        std::thread::sleep(Duration::from_millis(100));
    }
    // Awake again, it says that it slept, which changes nothing more.
    let browser = &mut session.browser;
    let tab = Tab::open(browser);
    let lost = json!({"says": "lost", "tab": "t", "cue": cue, "why": "asleep"});
    assert_eq!(browser.post("/media", &lost).status, 200);
    play(browser);
    drop(tab);
    session.types("");
    assert!(
        session.child.wait().unwrap().success(),
        "{}",
        session.said()
    );
    let journal = events(folder.path());
    let failed = journal.iter().find(|e| e["failure"] == "media").unwrap();
    let detail = failed["detail"].as_str().unwrap();
    assert!(detail.contains("no sign of life"), "{detail}");
    let of_failed = |e: &&Value| {
        let place = &e["place"]["trial"];
        place["trial"] == failed["trial"] && place["attempt"] == failed["attempt"]
    };
    let answered = journal.iter().filter(|e| e["event"] == "answered");
    assert_eq!(answered.filter(of_failed).count(), 0);
    let attempts = folder.path().join("results/turn-signal/attempts.csv");
    let attempts = fs::read_to_string(attempts).unwrap();
    assert!(attempts.contains(detail), "{attempts}");
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

#[test]
fn without_a_page_the_study_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path());
    let path = protocol.to_str().unwrap();
    for more in [&["--plain"][..], &[], &["--front", "true"]] {
        let run = [&["run", path][..], more].concat();
        let (code, out, err) = study(&run, folder.path());
        assert_ne!(code, 0, "{more:?}: {out}");
        assert!(
            err.contains("only the participant's page"),
            "{more:?}: {err}"
        );
        assert!(err.contains("--screen"), "{err}");
        assert!(!folder.path().join("results").exists(), "{more:?}");
    }
}

#[test]
fn a_rehearsal_goes_on_without_media_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = protocol(folder.path());
    let rehearse = [
        "rehearse",
        protocol.to_str().unwrap(),
        "--participants",
        "1",
        "--out",
        "out",
    ];
    let (code, out, err) = study(&rehearse, folder.path());
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("1 simulated participants"), "{out}");
    assert!(err.contains("neither shown nor played"), "{out}{err}");
}
