//! A whole session of adjustment in a pseudo-terminal, by keys alone, as in `parts_by_keys`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::parts_by_keys::{PROMPT, events, of, start_with, written_newest};
use crate::plain::Lines;
use crate::support::player::{play, quit};
use crate::support::{PATIENCE, Terminal, study};
use serde_json::Value as Json;
use std::path::Path;
use std::time::{Duration, Instant};
use study::tui::pace::TYPED;

/// The step of the ladder that is the standard, 2.0.
const STANDARD: usize = 11;

/// A key that had no effect for so long was not read; it is pressed again.
const NOT_READ: Duration = Duration::from_secs(5);

fn count(folder: &Path, event: &str) -> usize {
    events(folder).iter().filter(|e| of(e, event)).count()
}

/// The step that is felt, or comes next.
fn step(folder: &Path) -> usize {
    let events = events(folder);
    let begun = events.iter().rposition(|e| of(e, "attempt_started"));
    let attempt = &events[begun.unwrap()..];
    let level = |e: &&Json| of(e, "adjusted") && e["standard"] != true;
    let model = match attempt.iter().rfind(level) {
        Some(adjusted) => &adjusted["to"],
        None => &attempt[0]["intervals"][1],
    };
    let (_, step) = model.as_str().unwrap().rsplit_once('.').unwrap();
    step.parse().unwrap()
}

/// Whether the standard was felt again.
fn compared(folder: &Path) -> bool {
    let events = events(folder);
    events.iter().any(|e| e["standard"] == true)
}

fn level_is_felt(page: &str) -> bool {
    page.contains("→  stronger") && page.contains("Enter: equal now")
}

/// Presses a key until an event follows, but no longer than a key takes to be read.
fn press(terminal: &mut Terminal, folder: &Path, key: &str, event: &str) {
    let before = count(folder, event);
    std::thread::sleep(2 * TYPED);
    terminal.keys(key);
    let pressed = Instant::now();
    while count(folder, event) == before && pressed.elapsed() < NOT_READ {
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Goes towards the standard, feels it again once, and confirms its level, until a page is there.
fn set_until(terminal: &mut Terminal, folder: &Path, there: impl Fn(&str) -> bool) {
    let begun = Instant::now();
    while terminal.runs() {
        let page = terminal.shown();
        if there(&page.text) {
            return;
        }
        assert!(
            begun.elapsed() < 3 * PATIENCE,
            "it does not end:\n{}",
            page.text
        );
        if !level_is_felt(&page.text) {
            play(terminal, "P01", &page);
            std::thread::sleep(Duration::from_millis(3));
            continue;
        }
        let (key, event) = match step(folder) {
            STANDARD if !compared(folder) => ("s", "playback_started"),
            STANDARD => ("\r", "trial_done"),
            low if low < STANDARD => ("\u{1b}[C", "playback_started"),
            _ => ("-", "playback_started"),
        };
        press(terminal, folder, key, event);
    }
    panic!("the session ended before");
}

/// A study of one part, with a setting from below and one from above.
fn adjustment(folder: &Path) {
    let part = format!(
        r#"[[families]]
id = "f"
from = "models/static.toml"
vary = "b"
range = [1.0, 3.0]
steps = 21
[[parts]]
id = "answer"
kind = "adjustment"
prompt = "{PROMPT}"
lower = "weaker"
higher = "stronger"
confirm = "equal now"
family = "f"
standard = 2.0
start_below = [1.7]
start_above = [2.3]
repetitions = 1
gap_s = 0.2
"#
    );
    written_newest(folder, &part);
}

/// A step that is typed while the next level is loaded is forgotten with that page. The Enter after it is no confirmation.
#[test]
fn the_enter_of_a_forgotten_step_confirms_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    adjustment(folder);
    let run = ["run", "p", "--operator", "lw", "--plain"];
    let mut lines = Lines::start(folder, &run, None);
    let asked = lines.play(Some("Enter alone: equal now"));
    assert!(asked.contains("stronger"), "{}", lines.seen);
    let until = |event: &str, n: usize| {
        let since = Instant::now();
        while count(folder, event) < n {
            assert!(since.elapsed() < PATIENCE, "no {event}");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let played = count(folder, "playback_started");
    lines.types("+\n");
    until("adjusted", 1);
    // The fall of 0.4 s and the stop are over, and half a second of loading is not.
    std::thread::sleep(Duration::from_millis(600));
    lines.types("+");
    until("playback_started", played + 1);
    // It is felt, and long enough for an Enter to be meant for it.
    std::thread::sleep(Duration::from_millis(600));
    lines.types("\n");
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(count(folder, "answered"), 0);
    lines.types("\n");
    until("trial_done", 1);
    lines.child.kill().unwrap();
    lines.child.wait().unwrap();
}

/// From below and from above, with a session that is left while a level is felt.
#[test]
fn adjustment_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    adjustment(folder);
    let mut terminal = start_with(folder, &[]);
    set_until(&mut terminal, folder, |page| {
        level_is_felt(page) && count(folder, "adjusted") >= 1
    });
    quit(&mut terminal);
    assert_eq!(count(folder, "trial_done"), 0);
    // The trial begins again, at its start.
    let mut terminal = start_with(folder, &[]);
    set_until(&mut terminal, folder, |page| page.contains("Enter: close"));
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    assert_eq!(count(folder, "trial_done"), 2);
    assert!(compared(folder));

    let arguments = ["analyze", "results", "--include", "pilot", "--json"];
    let (_, out, _) = study(&arguments, folder);
    let document: Json = serde_json::from_str(&out).unwrap();
    let values = &document["parts"][0]["values"];
    let value = |id: &str| values[format!("adjustment/{id}")].as_f64().unwrap();
    assert_eq!(value("n"), 2.0);
    // Three steps from each side.
    assert!(value("changes") >= 3.0, "{}", value("changes"));
    for (id, expected) in [("pse", 2.0), ("error/mean", 0.0), ("start/difference", 0.0)] {
        assert!((value(id) - expected).abs() < 1e-9, "{id}: {}", value(id));
    }
}

/// On the simulated device each level but the confirmed one ends with a force that falls. Its force is judged, and no level is
/// called wrong.
#[test]
fn every_level_but_the_confirmed_one_ends_with_a_fall() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    adjustment(folder);
    let arguments = [
        "rehearse",
        "p",
        "--participants",
        "2",
        "--out",
        "r",
        "--telemetry",
        "1000",
    ];
    let (code, out, err) = study(&arguments, folder);
    assert_eq!(code, 0, "{out}{err}");
    let (mut falls, mut stops) = (0, 0);
    for participant in ["SIM001", "SIM002"] {
        let journal = format!("r/p/sessions/{participant}/1/journal.jsonl");
        let text = std::fs::read_to_string(folder.join(journal)).unwrap();
        let lines = text.lines();
        let events: Vec<Json> = lines
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        for two in events
            .windows(2)
            .filter(|two| of(&two[0], "playback_ended"))
        {
            let ended = &two[0];
            let verdict = ended["rendering"]["verdict"].as_str().unwrap();
            assert!(!matches!(verdict, "flag" | "fault"), "{ended}");
            let whole_s = ended["playback"]["exploration_s"].as_f64().unwrap();
            match ended["rendering"]["faded_from_s"].as_f64() {
                Some(from_s) => {
                    falls += 1;
                    assert!((whole_s - from_s - 0.4).abs() < 1e-6, "{ended}");
                }
                None => {
                    stops += 1;
                    assert!(of(&two[1], "answered"), "{ended}");
                }
            }
        }
    }
    // Two settings each, and a look at the standard before each of them.
    assert_eq!(stops, 4);
    assert!(falls >= 8, "{falls}");
}
