//! Whole sessions of parts in a pseudo-terminal of 80×24, by keys alone: each with a failed
//! interval, a correction, a quit and a resume, after which a track is the one that
//! `study schedule --answers` finds for the same observer.
//!
//! The participant ends each interval: one that ended by itself could pass between two looks
//! at the screen of a busy machine.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::{correct_newest, enter, mark_bad, play, quit};
use crate::support::simulator::Simulator;
use crate::support::{PATIENCE, Terminal, repository, study};
use serde_json::Value as Json;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// What every form of a trial asks.
pub(crate) const PROMPT: &str = "Which is it now?";

/// How a trial is answered, and another answer for the correction.
type Observer = fn(&Json) -> (String, String);

/// A study of one part in `folder`, with the tables that the parts need.
pub(crate) fn written(folder: &Path, rest: &str) {
    let models = folder.join("p/models");
    fs::create_dir_all(&models).unwrap();
    let shipped =
        |name: &str| fs::read_to_string(repository(&format!("protocols/{name}"))).unwrap();
    for name in ["0.9991", "0.9993", "0.9995", "0.9997", "0.9999"] {
        let file = format!("lambda-{name}.toml");
        let text = shipped(&format!("turn-signal/models/{file}"));
        fs::write(models.join(file), text).unwrap();
    }
    let table = shipped("turn-signal-extended/models/static.toml");
    fs::write(models.join("static.toml"), &table).unwrap();
    let text = format!(
        r#"format = "study-protocol/2"
study = {{ id = "p", title = "A part", seed = 5 }}
design = {{ participants = 2, max_attempts = 50 }}
analysis = {{ primary = "answer" }}
[device]
kind = "simulated"
limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }}
uncertified = {{ play = true, force_n = 9.0, reason = "a test" }}
{rest}"#
    );
    fs::write(folder.join("p/protocol.toml"), text).unwrap();
}

/// The same as [`written`], in the newest format.
pub(crate) fn written_newest(folder: &Path, rest: &str) {
    written(folder, rest);
    let file = folder.join("p/protocol.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("study-protocol/2", "study-protocol/3")).unwrap();
}

/// A track of two intervals on a family.
fn track(vary: &str, procedure: &str) -> String {
    format!(
        r#"[[families]]
id = "f"
from = "models/static.toml"
vary = "{vary}"
range = [1.0, 3.0]
steps = 21
[[parts]]
id = "answer"
kind = "discrimination"
prompt = "{PROMPT}"
tracks = ["up"]
gap_s = 0.2
[[tracks]]
id = "up"
method = "2ifc"
family = "f"
standard = 1.0
procedure = {procedure}
"#
    )
}

pub(crate) fn models() -> String {
    let of = |name: &str| {
        format!("[[models]]\nid = \"l{name}\"\nfile = \"models/lambda-0.{name}.toml\"\n")
    };
    ["9991", "9993", "9995", "9997", "9999"].map(of).concat()
}

/// The events of the session so far.
pub(crate) fn events(folder: &Path) -> Vec<Json> {
    // Of several sessions, the last.
    let sessions = folder.join("results/p/sessions/P01");
    let session = ["2", "1"].map(|number| sessions.join(number));
    let session = session.iter().find(|path| path.exists());
    let session = session.unwrap_or(&sessions).clone();
    // A resumed session goes on in another segment.
    let segment = |number: u32| match number {
        1 => fs::read_to_string(session.join("journal.jsonl")),
        n => fs::read_to_string(session.join(format!("journal-{n}.jsonl"))),
    };
    let text: Vec<String> = (1..).map_while(|number| segment(number).ok()).collect();
    // A line may be half written.
    let event = |line: &str| serde_json::from_str(line).ok();
    text.concat().lines().filter_map(event).collect()
}

pub(crate) fn of(event: &Json, name: &str) -> bool {
    event["event"] == name
}

fn done(folder: &Path) -> usize {
    let events = events(folder);
    events.iter().filter(|e| of(e, "trial_done")).count()
}

/// The attempts that were completed, in order, as they were started.
fn completed(folder: &Path) -> Vec<Json> {
    let events = events(folder);
    let started = |done: &Json| {
        let same = |e: &&Json| {
            of(e, "attempt_started")
                && e["trial"] == done["trial"]
                && e["attempt"] == done["attempt"]
        };
        events.iter().find(same).unwrap().clone()
    };
    let trials = events.iter().filter(|e| of(e, "trial_done"));
    trials.map(started).collect()
}

/// Waits for a text that the page shows after what was typed.
fn typed(terminal: &mut Terminal, keys: &str, shown: &str) {
    terminal.keys(keys);
    terminal.wait_for(shown);
}

/// Plays, answers as the observer does, and stops at the first page on which `there` holds.
fn play_until(
    terminal: &mut Terminal,
    folder: &Path,
    observer: Observer,
    there: impl Fn(&str) -> bool,
) {
    let mut since = Instant::now();
    let mut before = String::new();
    while terminal.runs() {
        let shown = terminal.shown();
        let page = &shown.text;
        if there(page) {
            return;
        }
        let now = page.replace(|c: char| c.is_ascii_digit(), "");
        if now != before {
            (before, since) = (now, Instant::now());
        }
        assert!(since.elapsed() < PATIENCE, "nothing happens:\n{page}");
        if page.contains(PROMPT) && page.contains("Enter: save") {
            let events = events(folder);
            let attempt = events.iter().rfind(|e| of(e, "attempt_started")).unwrap();
            let answer = observer(attempt).0;
            // A slider gets its marker, an option is marked, a number is read back.
            let shown = if page.contains("0–9: choose") {
                "●"
            } else if page.contains("choose") {
                "(●)"
            } else {
                "= "
            };
            typed(terminal, &answer, shown);
            terminal.wait_for("Enter: save");
            enter(terminal);
            terminal.wait_until("the next page", |s| !s.contains(PROMPT));
        } else if !page.contains(PROMPT) {
            play(terminal, "P01", &shown);
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    panic!("the session ended before");
}

pub(crate) fn start_with(folder: &Path, more: &[&str]) -> Terminal {
    let arguments = [&["run", "p", "--operator", "lw"], more].concat();
    // The clock of a hurried session runs ahead: not where a serial device or the time between
    // two sessions counts.
    if more.is_empty() {
        return Terminal::hurried(&arguments, folder);
    }
    let mut terminal = Terminal::start(&arguments, folder, 24, 80);
    terminal.wait_for("Who takes part?");
    terminal
}

/// A session with a failed interval, a correction, a quit during a trial and a resume. The
/// columns of `ratings.csv` of the counted trials.
pub(crate) fn eventful(folder: &Path, observer: Observer) -> Vec<csv::StringRecord> {
    eventful_with(folder, observer, &[])
}

/// The same of a program that is started with further arguments.
fn eventful_with(folder: &Path, observer: Observer, more: &[&str]) -> Vec<csv::StringRecord> {
    let mut terminal = start_with(folder, more);
    // An interval fails: the last of the trial, where it has several.
    play_until(&mut terminal, folder, observer, |s| {
        done(folder) >= 1
            && (s.contains("SECOND")
                || s.contains("THIRD")
                || (s.contains("Feel the") && !s.contains("FIRST")))
    });
    mark_bad(&mut terminal, "somebody came in");
    // The newest answer is corrected.
    play_until(&mut terminal, folder, observer, |s| {
        done(folder) >= 3 && s.contains("Enter: when ready")
    });
    let last = completed(folder).pop().unwrap();
    correct_newest(&mut terminal, &observer(&last).1, "mistyped");
    // Quit while a trial is under way, and resume.
    play_until(&mut terminal, folder, observer, |s| {
        done(folder) >= 4 && (s.contains("FIRST") || s.contains("Feel the"))
    });
    quit(&mut terminal);
    let mut terminal = start_with(folder, more);
    play_until(&mut terminal, folder, observer, |s| {
        s.contains("Enter: close")
    });
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);

    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    let (code, out, err) = study(&["analyze", "results", "--include", "pilot"], folder);
    assert_eq!(code, 0, "{out}{err}");
    let attempts = fs::read_to_string(folder.join("results/p/attempts.csv")).unwrap();
    assert_eq!(
        attempts.matches("somebody came in").count(),
        1,
        "{attempts}"
    );
    let mut table = csv::Reader::from_path(folder.join("results/p/ratings.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (status, corrected) = (at("status"), at("corrected"));
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    assert!(rows.iter().all(|r| &r[status] == "ok"));
    assert_eq!(rows.iter().filter(|r| &r[corrected] == "true").count(), 1);
    assert_eq!(rows.len(), completed(folder).len());
    rows
}

/// Hears a comparison of 1.5 and above; of less the other interval is said.
fn hears(attempt: &Json) -> (String, String) {
    let comparison = attempt["intervals"][0] != "up.standard";
    let heard = attempt["level"]["presented"].as_f64().unwrap() >= 1.5;
    let (first, second) = ("1".to_owned(), "2".to_owned());
    // The comparison is first, or second; `comparison == heard` says "first".
    if comparison == heard {
        (first, second)
    } else {
        (second, first)
    }
}

/// The levels that this observer gets from the rule, trial by trial, from outside.
fn expected(folder: &Path) -> Vec<(f64, f64)> {
    let mut answers = "answer\n".to_owned();
    let mut levels = Vec::new();
    // The first answer is a guess that is replaced once the first level is known.
    let replay = |answers: &str| -> Json {
        fs::write(folder.join("answers.csv"), answers).unwrap();
        let arguments = [
            "schedule",
            "p",
            "--answers",
            "answers.csv",
            "--json",
            "--results",
            "none",
        ];
        let (code, out, err) = study(&arguments, folder);
        assert_eq!(code, 0, "{err}");
        serde_json::from_str(&out).unwrap()
    };
    let first = replay("answer\n1\n")["tracks"][0]["trials"][0].clone();
    let mut next = first;
    while !next.is_null() {
        let level = |key: &str| next[key].as_f64().unwrap();
        levels.push((level("proposed"), level("presented")));
        answers += if level("presented") >= 1.5 {
            "1\n"
        } else {
            "0\n"
        };
        next = replay(&answers)["tracks"][0]["next"].clone();
    }
    levels
}

/// The track of a session with trouble is that of a session without.
fn track_by_keys(vary: &str, procedure: &str) {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &track(vary, procedure));
    eventful(folder.path(), hears);
    let levels = levels(folder.path());
    assert_eq!(levels, expected(folder.path()));
    assert!(levels.len() > 5, "{levels:?}");
}

/// The levels of the trials of the track so far.
fn levels(folder: &Path) -> Vec<(f64, f64)> {
    let level = |a: &Json, key: &str| a["level"][key].as_f64();
    let both = |a: &Json| Some((level(a, "proposed")?, level(a, "presented")?));
    completed(folder).iter().filter_map(both).collect()
}

#[test]
fn a_staircase_on_damping_by_keys() {
    let rule = r#"{ rule = "staircase", up = 1, down = 2, start = 2.0, steps = [0.4, 0.2], stop = { reversals = 3, max_trials = 9 }, estimate_last = 2 }"#;
    track_by_keys("b", rule);
}

#[test]
fn a_quest_plus_track_on_detent_strength_by_keys() {
    track_by_keys("detent", r#"{ rule = "quest+", trials = 7 }"#);
}

/// The device fails while an interval is felt: its stop button, its cable, its power. A
/// session that is left in mid-track with the cable out is continued.
#[test]
fn a_track_with_faults_of_the_device_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rule = r#"{ rule = "quest+", trials = 5 }"#;
    written(folder, &track("b", rule));
    let mut device = Simulator::start(folder, &[]);
    let port = device.port.to_str().unwrap().to_owned();
    let more = ["--device", "serial", "--port", &port];
    let mut terminal = start_with(folder, &more);
    for (trials, interval, fault) in [
        (1, "SECOND", "trip"),
        (2, "FIRST", "unplug"),
        (3, "SECOND", "reset"),
    ] {
        play_until(&mut terminal, folder, hears, |s| {
            done(folder) >= trials && s.contains(interval) && s.contains("Feel the")
        });
        device.control(fault);
        terminal.wait_for("DEVICE TROUBLE");
        if fault == "unplug" {
            quit(&mut terminal);
            device.control("plug");
            terminal = start_with(folder, &more);
        }
    }
    play_until(&mut terminal, folder, hears, |s| s.contains("Enter: close"));
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    let attempts = fs::read_to_string(folder.join("results/p/attempts.csv")).unwrap();
    let failed = attempts.lines().filter(|line| line.contains(",failure,"));
    assert!(failed.count() >= 3, "{attempts}");
    assert_eq!(levels(folder), expected(folder));
    assert_eq!(levels(folder).len(), 5);
}

#[test]
fn two_sessions_of_a_group_with_a_track_by_keys() {
    two_sessions("tracks", 1);
}

#[test]
fn two_sessions_of_a_group_with_a_track_and_pairs_by_keys() {
    two_sessions("both", 2);
}

/// A study of two groups in two sessions: one has a staircase, the other pairs after it. The track
/// of each session is one of its own.
fn two_sessions(group: &str, parts: usize) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rule = r#"{ rule = "staircase", up = 1, down = 2, start = 2.0, steps = [0.4, 0.2], stop = { reversals = 3, max_trials = 6 }, estimate_last = 2 }"#;
    let rest = format!(
        r#"{}{}[[parts]]
id = "which"
kind = "pairs"
prompt = "{PROMPT}"
models = ["l9991", "l9995", "l9999"]
repetitions = 1
gap_s = 0.2
[groups]
assign = "given"
[[groups.list]]
id = "tracks"
parts = ["answer"]
[[groups.list]]
id = "both"
[[sessions]]
id = "one"
[[sessions]]
id = "two"
max_gap_h = 72
"#,
        models(),
        track("b", rule)
    );
    written(folder, &rest);
    let more = ["--group", group];
    eventful_with(folder, hears_or_prefers, &more);
    let first = levels(folder);
    assert_eq!(first, expected(folder));
    let pairs = |of: Vec<Json>| of.iter().filter(|a| a["level"].is_null()).count();
    assert_eq!(pairs(completed(folder)), if parts == 2 { 3 } else { 0 });
    let mut terminal = start_with(folder, &more);
    typed(&mut terminal, "P01", "┃ P01");
    terminal.wait_for("next: session two, one of 2");
    terminal.keys("\u{15}");
    terminal.wait_until("the empty field", |s| !s.contains("┃ P01"));
    play_until(&mut terminal, folder, hears_or_prefers, |s| {
        s.contains("SECOND") && done(folder) == 1
    });
    quit(&mut terminal);
    let mut terminal = start_with(folder, &more);
    play_until(&mut terminal, folder, hears_or_prefers, |s| {
        s.contains("Enter: close")
    });
    terminal.keys("\r");
    assert_eq!(terminal.exit_code(), 0);
    assert!(folder.join("results/p/sessions/P01/2").exists());
    assert_eq!(levels(folder), first);
    let (code, out, err) = study(&["verify", "results"], folder);
    assert_eq!(code, 0, "{out}{err}");
    let analyze = ["analyze", "results", "--include", "pilot", "--json"];
    let (code, out, err) = study(&analyze, folder);
    assert_eq!(code, 0, "{err}");
    let document: Json = serde_json::from_str(&out).unwrap();
    let values = &document["parts"][0]["values"];
    for session in ["one", "two"] {
        let n = values[format!("psy/P01/up@{session}/n_trials")].as_f64();
        assert_eq!(n, Some(first.len() as f64), "{session}");
    }
    let pairs = document["parts"][1]["trials"].as_u64().unwrap_or(0);
    assert_eq!(pairs, if parts == 2 { 6 } else { 0 });
}

/// Of a pair, the realization whose name comes first; of a track as [`hears`].
fn hears_or_prefers(attempt: &Json) -> (String, String) {
    if !attempt["level"].is_null() {
        return hears(attempt);
    }
    let name = |i: usize| attempt["intervals"][i].as_str().unwrap().to_owned();
    let answers = ("1".to_owned(), "2".to_owned());
    match name(0) < name(1) {
        true => answers,
        false => (answers.1, answers.0),
    }
}

#[test]
fn abx_of_two_realizations_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let part = format!(
        r#"{}[[parts]]
id = "answer"
kind = "discrimination"
prompt = "{PROMPT}"
tracks = ["abx"]
gap_s = 0.2
[[tracks]]
id = "abx"
method = "abx"
models = ["l9991", "l9999"]
procedure = {{ rule = "constant", repetitions = 6 }}
"#,
        models()
    );
    written(folder.path(), &part);
    let third = |attempt: &Json| {
        let intervals = &attempt["intervals"];
        let answers = ("1".to_owned(), "2".to_owned());
        match intervals[0] == intervals[2] {
            true => answers,
            false => (answers.1, answers.0),
        }
    };
    let rows = eventful(folder.path(), third);
    assert_eq!(rows.len(), 6);
    // All answers were right, and one was corrected to a wrong one.
    let correct = rows.iter().filter(|r| r.iter().any(|cell| cell == "abx"));
    assert_eq!(correct.count(), 6);
    let (_, out, _) = study(
        &["analyze", "results", "--include", "pilot", "--json"],
        folder.path(),
    );
    let document: Json = serde_json::from_str(&out).unwrap();
    assert!(document["parts"][0]["values"]["sdt/P01/abx/d_differencing"].is_number());
}

#[test]
fn all_pairs_of_five_realizations_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let part = format!(
        r#"{}[[parts]]
id = "answer"
kind = "pairs"
prompt = "{PROMPT}"
repetitions = 1
tie = true
gap_s = 0.2
"#,
        models()
    );
    written(folder.path(), &part);
    // The realization whose name comes first is preferred.
    let smaller = |attempt: &Json| {
        let name = |i: usize| attempt["intervals"][i].as_str().unwrap().to_owned();
        let first = name(0) < name(1);
        let answers = ("1".to_owned(), "2".to_owned());
        if first {
            answers
        } else {
            (answers.1, answers.0)
        }
    };
    let rows = eventful(folder.path(), smaller);
    assert_eq!(rows.len(), 10, "each pair once");
    let pairs: std::collections::BTreeSet<Vec<String>> = (completed(folder.path()).iter())
        .map(|a| {
            let names = a["intervals"].as_array().unwrap().iter();
            let mut names: Vec<String> = names.map(|n| n.to_string()).collect();
            names.sort();
            names
        })
        .collect();
    assert_eq!(pairs.len(), 10);
}

#[test]
fn magnitude_estimation_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let part = format!(
        r#"[[families]]
id = "f"
from = "models/static.toml"
vary = "detent"
levels = [0.5, 1.0, 2.0]
[[parts]]
id = "answer"
kind = "magnitude"
prompt = "{PROMPT}"
family = "f"
repetitions = 2
"#
    );
    written(folder.path(), &part);
    // Ten times the level, which the name of the realization has as its step.
    let tenfold = |attempt: &Json| {
        let number = match attempt["model"].as_str().unwrap() {
            "f.1" => "5",
            "f.2" => "10",
            _ => "20",
        };
        (number.to_owned(), "\u{15}7,5".to_owned())
    };
    let rows = eventful(folder.path(), tenfold);
    assert_eq!(rows.len(), 6);
    let cell = |row: &csv::StringRecord, text: &str| row.iter().any(|cell| cell == text);
    assert_eq!(rows.iter().filter(|r| cell(r, "7.5")).count(), 1);
    let (_, out, _) = study(
        &["analyze", "results", "--include", "pilot", "--json"],
        folder.path(),
    );
    let document: Json = serde_json::from_str(&out).unwrap();
    let part = &document["parts"][0];
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"magnitude".into(), &6.into())
    );
    assert!(part["values"]["magnitude/exponent"].as_f64().unwrap() > 0.3);
}

/// Five labels by the keys of their places; after each trial the right one is told.
#[test]
fn identification_by_keys() {
    let folder = tempfile::tempdir().unwrap();
    let label = |name: &str| format!("{{ label = \"lever {name}\", models = [\"l{name}\"] }}");
    let labels = ["9991", "9993", "9995", "9997", "9999"]
        .map(label)
        .join(", ");
    let part = format!(
        r#"{}[[parts]]
id = "answer"
kind = "identification"
prompt = "{PROMPT}"
answers = [{labels}]
repetitions = 1
practice = ["l9991"]
feedback = "always"
"#,
        models()
    );
    written_newest(folder.path(), &part);
    // Every lever is taken for the one after it, but the last one is known.
    let next = |attempt: &Json| {
        let places = ["l9991", "l9993", "l9995", "l9997", "l9999"];
        let felt = attempt["model"].as_str().unwrap();
        let place = places.iter().position(|p| *p == felt).unwrap() + 1;
        ((place + 1).min(5).to_string(), place.to_string())
    };
    let rows = eventful(folder.path(), next);
    assert_eq!(rows.len(), 1 + 5);
    let arguments = ["analyze", "results", "--include", "pilot", "--json"];
    let (_, out, _) = study(&arguments, folder.path());
    let document: Json = serde_json::from_str(&out).unwrap();
    let part = &document["parts"][0];
    assert_eq!(
        (&part["task"], &part["trials"]),
        (&"identification".into(), &5.into())
    );
    let values = &part["values"];
    let count = |right: &str, given: &str| {
        let id = format!("identification/confusion/lever {right}/lever {given}");
        values[id].as_f64().unwrap()
    };
    assert_eq!(count("9999", "9999"), 1.0);
    // One of the others was corrected, if it was no practice.
    let right = values["identification/correct"].as_f64().unwrap();
    assert!(right == 0.2 || right == 0.4, "{right}");
    let verdict = &part["findings"][0];
    assert_eq!(verdict["question"], "identified");
    assert_eq!(
        verdict["undefined_because"],
        "there are fewer than two participants"
    );
}
