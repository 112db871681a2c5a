//! The wire format over TCP, with a simulated device that is another process.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::play_to_end;
use crate::support::simulator::Simulator;
use crate::support::{PATIENT, Terminal, changed_protocol, study};
use std::fs;
use std::path::Path;

/// The text of all files in a folder.
fn all_text(folder: &Path) -> String {
    let mut text = String::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text.push_str(&all_text(&path));
        } else {
            text.push_str(&String::from_utf8_lossy(&fs::read(&path).unwrap()));
        }
    }
    text
}

#[test]
fn a_device_at_an_address_conforms_and_plays_a_session() {
    let mut device = Simulator::start_tcp(&[]);
    let port = device.port.to_str().unwrap().to_owned();
    let (token, place) = port
        .strip_prefix("tcp://")
        .unwrap()
        .split_once('@')
        .unwrap();
    let home = tempfile::tempdir().unwrap();
    // On a busy machine the check may miss a time limit.
    let check = [
        "device",
        "check",
        "--without-rendering",
        "--save",
        "--port",
        &port,
    ];
    let mut tries = (0..5).map(|_| study(&check, home.path()));
    let (_, out, _) = tries.find(|(code, ..)| *code == 0).unwrap();
    assert!(out.contains("31 of 31 tests passed"), "{out}");

    let protocol = home.path().join("protocol");
    let changes = [
        ("repetitions = 3", "repetitions = 1"),
        ("\"simulated\"", "\"serial\""),
        PATIENT,
    ];
    changed_protocol("turn-signal", &protocol, &changes);
    let protocol = protocol.to_str().unwrap();
    let run = ["run", protocol, "--operator", "lw", "--port", &port];
    let mut terminal = Terminal::start(&run, home.path(), 24, 80);
    terminal.wait_for("Who takes part?");
    let seen = play_to_end(&mut terminal, "P01");
    assert!(!seen.concat().contains(token), "the token is on a page");
    drop(terminal);
    let (code, out, err) = study(&["verify", "results"], home.path());
    assert_eq!(code, 0, "{out}{err}");
    let files = all_text(home.path());
    assert!(files.contains("31 of 31 tests passed"));
    assert!(!files.contains(token), "the token is in a file");

    // Plugged in again, it is found at the same address.
    device.control("unplug");
    let info = |port: &str| study(&["device", "info", "--port", port], home.path());
    let (code, _, err) = info(&port);
    assert_eq!(code, 3);
    let gone = format!("tcp://{place}: no device listens there");
    assert!(err.contains(&gone), "{err}");
    device.control("plug");
    let (code, out, err) = info(&port);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("simulated-1"), "{out}");
    for wrong in [format!("tcp://{place}"), format!("tcp://0{token}@{place}")] {
        let (code, _, err) = info(&wrong);
        assert_eq!(code, 3, "{wrong}");
        assert!(!err.contains(token), "{err}");
    }
    let (code, _, err) = info("tcp://example.org:80");
    assert_eq!(code, 2);
    assert!(err.contains("use tcp://HOST:PORT"), "{err}");
}
