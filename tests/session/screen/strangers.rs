//! Strangers on the network: malformed requests, half of them, and too many.

use super::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What no browser sends.
const MALFORMED: &[u8] = b"\r\n\r\n";

/// A connection of somebody who sends this and stays.
fn stranger(address: &str, bytes: &[u8]) -> Option<TcpStream> {
    let mut stream = TcpStream::connect(address).ok()?;
    stream.write_all(bytes).ok()?;
    Some(stream)
}

#[test]
fn strangers_who_stay_take_no_place_of_the_participants() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = patient(folder.path());
    let mut session = Session::opened(folder.path(), &protocol, &[]);
    let address = session.browser.address.clone();
    let strange: [&[u8]; 3] = [MALFORMED, b"GET / HTTP/1.1\r\nHo", b""];
    for bytes in strange {
        let stay: Vec<TcpStream> = (0..200).filter_map(|_| stranger(&address, bytes)).collect();
        assert!(stay.len() > 100, "{bytes:?}");
        for _ in 0..20 {
            assert_eq!(session.browser.get("/view?after=0").status, 200);
            let stop = session.browser.post("/reply", &json!({"does": "stop"}));
            assert_eq!(stop.status, 200, "{bytes:?}");
        }
    }
    // The experimenter is told, and how many they were.
    let begin = Instant::now();
    while !session
        .said()
        .contains("others on the network call the participant's page: 100 requests and more")
    {
        assert!(begin.elapsed() < PATIENCE, "{}", session.said());
        stranger(&address, MALFORMED);
        std::thread::sleep(Duration::from_millis(5));
    }
    let page = session.browser.play("a rating", is_rating);
    let reply = session
        .browser
        .reply(&page, "answer", json!({"answers": {"realism": "5"}}));
    assert_eq!(session.browser.post("/reply", &reply).status, 200);
    assert_eq!(count(folder.path(), "\"rating\""), 1);
}

/// Browsers keep cookies by address, not by port.
#[test]
fn two_pages_of_one_computer_do_not_take_each_others_cookie() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let sessions = folders.each_ref().map(|folder| {
        let protocol = patient(folder.path());
        Session::opened(folder.path(), &protocol, &[])
    });
    let names = sessions
        .each_ref()
        .map(|s| s.browser.cookie.split('=').next().unwrap());
    assert_ne!(names[0], names[1]);
    let both = sessions
        .each_ref()
        .map(|s| s.browser.cookie.as_str())
        .join("; ");
    for session in &sessions {
        let browser = Browser {
            cookie: both.clone(),
            ..session.browser.clone()
        };
        assert_eq!(browser.get("/view?after=0").status, 200);
    }
}

/// Calls made at an even rate by several threads, until they are told to stop.
fn attack(
    per_s: u32,
    over: &Arc<AtomicBool>,
    call: impl Fn(u64) + Send + Clone + 'static,
) -> Arc<AtomicUsize> {
    const THREADS: u32 = 4;
    let made = Arc::new(AtomicUsize::new(0));
    for thread in 0..THREADS {
        let (over, made, call) = (over.clone(), made.clone(), call.clone());
        std::thread::spawn(move || {
            let (begin, pause) = (Instant::now(), Duration::from_secs(1) * THREADS / per_s);
            for n in 0_u32.. {
                if over.load(Ordering::SeqCst) {
                    return;
                }
                std::thread::sleep((pause * n).saturating_sub(begin.elapsed()));
                call(u64::from(n * THREADS + thread));
                made.fetch_add(1, Ordering::SeqCst);
            }
        });
    }
    made
}

/// Bytes that follow from a number (splitmix64), half of them with the shape of a request.
fn random_request(seed: u64) -> Vec<u8> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let length = next() % 300;
    let noise: Vec<u8> = (0..length).map(|_| next() as u8).collect();
    let method = ["GET", "POST", "PUT", "\u{1}"][(next() % 4) as usize];
    let path = ["/", "/view", "/reply", "/open", "/%00", "*"][(next() % 6) as usize];
    let cookie = next();
    match next() % 2 {
        0 => noise,
        _ => [
            format!("{method} {path} HTTP/1.1\r\nHost: x\r\nCookie: study-1={cookie:x}\r\nContent-Length: {length}\r\n\r\n").into_bytes(),
            noise,
        ]
        .concat(),
    }
}

/// Sends bytes and waits for the end.
fn call(address: &str, bytes: &[u8]) {
    if let Some(mut stream) = stranger(address, bytes) {
        let _ = stream.set_read_timeout(Some(Duration::from_secs(1)));
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let _ = stream.read_to_end(&mut Vec::new());
    }
}

/// Measured, not part of the suite: `cargo test --release --test session -- --ignored siege
/// --nocapture`.
#[test]
#[ignore = "measures the machine"]
fn a_stop_does_not_wait_for_a_siege() {
    const STOPS: usize = 400;
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("questions");
    let asked: String = (0..200)
        .map(|n| format!("[[intake]]\nid = \"q{n}\"\nkind = \"rating\"\nprompt = \"How?\"\nfrom = 1\nto = 7\n\n"))
        .collect();
    let with_intake = format!("{asked}[analysis]\n");
    let changes = [PATIENT, ("[analysis]\n", with_intake.as_str())];
    changed_protocol("turn-signal", &protocol, &changes);
    let mut session = Session::opened(folder.path(), &protocol, &[]);
    let address = session.browser.address.clone();
    let of = || address.clone();
    type Call = Arc<dyn Fn(u64) + Send + Sync>;
    let kept: Arc<Mutex<Vec<TcpStream>>> = Arc::default();
    let (a, b, c, d) = (of(), of(), of(), of());
    let attacks: [(&str, u32, Call); 5] = [
        ("nobody", 1, Arc::new(|_: u64| {})),
        (
            "malformed",
            600,
            Arc::new(move |_: u64| call(&a, MALFORMED)),
        ),
        ("malformed, and they stay", 600, {
            let kept = kept.clone();
            Arc::new(move |n: u64| {
                let mut kept = kept.lock().unwrap();
                kept.extend(stranger(&b, MALFORMED));
                if n % 300 == 299 {
                    kept.clear();
                }
            })
        }),
        ("half-open", 600, {
            let kept = kept.clone();
            Arc::new(move |n: u64| {
                let mut kept = kept.lock().unwrap();
                kept.extend(stranger(&c, b"POST /reply HTTP/1.1\r\nHo"));
                if n % 300 == 299 {
                    kept.clear();
                }
            })
        }),
        (
            "random",
            1000,
            Arc::new(move |n: u64| call(&d, &random_request(n))),
        ),
    ];
    let (mut answered, mut quiet_kb) = (0, u64::MAX);
    for (name, per_s, attack_call) in attacks {
        let over = Arc::new(AtomicBool::new(false));
        let begin = Instant::now();
        let made = attack(per_s, &over, move |n| attack_call(n));
        std::thread::sleep(Duration::from_millis(500));
        let browser = &mut session.browser;
        let (mut stops, mut taps) = (Vec::new(), Vec::new());
        let least = if name == "random" { 10_000 } else { 0 };
        while stops.len() < STOPS || made.load(Ordering::SeqCst) < least {
            let begin = Instant::now();
            assert_eq!(browser.post("/reply", &json!({"does": "stop"})).status, 200);
            stops.push(begin.elapsed());
            std::thread::sleep(Duration::from_millis(10));
            if stops.len() % 20 == 0 && answered < 190 {
                let page = browser.play("a question", |p| {
                    let id = p["questions"][0]["id"].as_str().unwrap_or_default();
                    id.starts_with('q')
                });
                let reply = browser.reply(&page, "answer", json!({"answers": answers(&page)}));
                let begin = Instant::now();
                assert_eq!(browser.post("/reply", &reply).status, 200);
                taps.push(begin.elapsed());
                answered += 1;
            }
        }
        let rate = made.load(Ordering::SeqCst) as f64 / begin.elapsed().as_secs_f64();
        over.store(true, Ordering::SeqCst);
        kept.lock().unwrap().clear();
        stops.sort();
        taps.sort();
        let (p99, most) = (stops[stops.len() * 99 / 100], stops[stops.len() - 1]);
        let slowest = taps.last().copied().unwrap_or_default();
        let resident = tap::resident_kb(session.child.id());
        println!(
            "{name} ({rate:.0}/s): stop median {:?}, p99 {p99:?}, most {most:?} of {}; answer most {slowest:?} of {}; resident {resident} kB",
            stops[stops.len() / 2],
            stops.len(),
            taps.len()
        );
        assert!(p99 <= Duration::from_millis(50), "{name}: {p99:?}");
        assert!(most <= Duration::from_millis(200), "{name}: {most:?}");
        assert!(slowest <= Duration::from_millis(200), "{name}: {slowest:?}");
        quiet_kb = quiet_kb.min(resident);
        assert!(resident < quiet_kb + 10_000, "{name}: {resident} kB");
    }
    // Nothing was lost and nothing doubled.
    assert_eq!(count(folder.path(), "\"event\":\"answered\""), answered);
}
