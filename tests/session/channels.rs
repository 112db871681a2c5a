//! A session that is begun on one channel and ended on another: by keys, in typed lines, on
//! the page. A replay, a break, a correction, a quit and a resume are in it.

use crate::plain::{Lines, events, last_answers};
use crate::screen::Session;
use crate::support::player::{F7, correct_newest, play_to_end, play_until};
use crate::support::{PATIENCE, PATIENT, Terminal, changed_protocol, repository, study};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::OnceLock;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Channel {
    Terminal,
    Plain,
    Page,
}

impl Channel {
    fn word(self) -> &'static str {
        match self {
            Self::Terminal => "terminal",
            Self::Plain => "plain",
            Self::Page => "page",
        }
    }

    /// Feels the first realization twice, steps back from its comment to change the rating
    /// (on the page both are before the eyes), rates two trials, corrects the second after the
    /// break and quits.
    fn begin(self, folder: &Path, protocol: &Path) {
        let path = protocol.to_str().unwrap();
        match self {
            Self::Terminal => {
                let run = ["run", path, "--operator", "lw"];
                let mut terminal = Terminal::start(&run, folder, 24, 80);
                play_until(&mut terminal, "P01", "F7: feel it again");
                terminal.keys(F7);
                // What the player does next is done to the new page.
                terminal.wait_until("the replay", |s| !s.contains("F7: feel it again"));
                play_until(&mut terminal, "P01", "Tab: comment");
                terminal.keys("6\t");
                terminal.wait_until("the comment", |s| !s.contains("Tab: comment"));
                terminal.keys("\u{1b}[Z");
                terminal.wait_for("Tab: comment");
                play_until(&mut terminal, "P01", "trial 3 of 5");
                correct_newest(&mut terminal, "3", "mistyped");
                terminal.keys("\u{11}");
                terminal.wait_for("Leave the session?");
                terminal.keys("y");
                assert_eq!(terminal.exit_code(), 0, "{}", terminal.screen());
            }
            Self::Plain => {
                let mut lines = Lines::start(folder, &["run", path, "--plain"], None);
                lines.play(Some("Type a number from 1 to 7"));
                lines.types("/replay\n");
                lines.play(Some("Type a number from 1 to 7"));
                lines.types("6\n");
                lines.asked(&["Type your answer"]);
                lines.types("/back\n");
                lines.play(Some("Trial 3 of 5"));
                lines.types("/correct\n");
                lines.asked(&["Type the number of the answer to correct"]);
                lines.types("1\n");
                lines.asked(&["Type a number from 1 to 7"]);
                lines.types("3\n");
                lines.asked(&["Type the reason"]);
                lines.types("mistyped\n/quit\n");
                lines.asked(&["Leave the session?"]);
                lines.types("y\n");
                lines.line(&["The session is not finished"]);
                lines.child.wait().unwrap();
            }
            Self::Page => {
                let mut session = Session::opened(folder, protocol, &[]);
                let offers = |page: &Value, does: &str| {
                    let buttons = page["buttons"].as_array().unwrap();
                    buttons.iter().any(|b| b["does"] == does)
                };
                let browser = &mut session.browser;
                let page = browser.play("a rating", |p| offers(p, "replay"));
                let again = browser.reply(&page, "replay", json!({}));
                assert_eq!(browser.post("/reply", &again).status, 200);
                browser.play("the third trial", |p| p["progress"]["at"] == 3);
                // The experimenter corrects.
                for line in ["/correct", "1", "3", "mistyped", "/quit"] {
                    session.types(line);
                }
                session.types("y");
                assert!(session.child.wait().unwrap().success());
            }
        }
    }

    /// Feels the first realization and is closed at its rating, as soon as the journal has that the playback has ended: the
    /// page of the rating can be there before.
    fn leave_a_rating(self, folder: &Path, protocol: &Path) {
        let path = protocol.to_str().unwrap();
        match self {
            Self::Terminal => {
                let run = ["run", path, "--operator", "lw"];
                let mut terminal = Terminal::start(&run, folder, 24, 80);
                play_until(&mut terminal, "P01", "Tab: comment");
                has_felt(folder);
                terminal.signal("KILL");
            }
            Self::Plain => {
                let mut lines = Lines::start(folder, &["run", path, "--plain"], None);
                lines.play(Some("Type a number from 1 to 7"));
                has_felt(folder);
                lines.child.kill().unwrap();
                lines.child.wait().unwrap();
            }
            Self::Page => {
                let mut session = Session::opened(folder, protocol, &[]);
                let asks = |page: &Value| page["questions"][0]["id"] == "realism";
                session.browser.play("a rating", asks);
                has_felt(folder);
                session.child.kill().unwrap();
                session.child.wait().unwrap();
            }
        }
    }

    /// Leaves a session at the first page of a questionnaire between the trials, where the channel tells one page from another.
    fn leave_a_questionnaire(self, folder: &Path, protocol: &Path) {
        match self {
            Self::Terminal => {
                let run = ["run", protocol.to_str().unwrap(), "--operator", "lw"];
                let mut terminal = Terminal::start(&run, folder, 24, 80);
                play_until(&mut terminal, "P01", "Was it heavy?");
                terminal.signal("KILL");
            }
            Self::Plain => {}
            Self::Page => {
                let mut session = Session::opened(folder, protocol, &[]);
                let asks = |page: &Value| page["questions"][0]["id"] == "load_1";
                session.browser.play("a questionnaire", asks);
                session.child.kill().unwrap();
                session.child.wait().unwrap();
            }
        }
    }

    /// Begins or resumes a session and plays to the end.
    fn end(self, folder: &Path, protocol: &Path, more: &[&str]) {
        let run = [&["run", protocol.to_str().unwrap()][..], more].concat();
        match self {
            Self::Terminal => {
                let run = [&run[..], &["--operator", "lw"]].concat();
                play_to_end(&mut Terminal::start(&run, folder, 24, 80), "P01");
            }
            Self::Plain => {
                let run = [&run[..], &["--plain"]].concat();
                let mut lines = Lines::start(folder, &run, None);
                let end = lines.play(None);
                assert!(end.starts_with("The session is finished"), "{end}");
                lines.child.wait().unwrap();
            }
            Self::Page => Session::opened(folder, protocol, more).finish(),
        }
    }
}

/// Waits until the journal has the end of a playback.
fn has_felt(folder: &Path) {
    let begun = std::time::Instant::now();
    while !(events(folder).iter()).any(|e| e["event"] == "playback_ended") {
        assert!(begun.elapsed() < PATIENCE, "no playback has ended");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

/// The journal of a session without times, and the channels of its answers.
fn session(begin: Channel, end: Channel) -> (Vec<Value>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("paper");
    let changes = [
        PATIENT,
        (
            "repetitions = 3",
            "repetitions = 1\nbreaks = { every = 2, at_least_s = 1 }",
        ),
        ("min_s = 2 }", "min_s = 2, replays = 1 }"),
    ];
    changed_protocol("turn-signal", &protocol, &changes);
    begin.begin(folder.path(), &protocol);
    end.end(folder.path(), &protocol, &[]);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
    let mut journals = Vec::new();
    crate::plain::find(&folder.path().join("results/turn-signal"), &mut journals);
    let lines = crate::plain::segments(&journals[0]).into_iter();
    let channels = lines.filter(|e| e["event"] == "answered" && e["question"] == "realism");
    let channels = channels.map(|e| e["channel"].as_str().unwrap_or("none").to_owned());
    let mut events = events(folder.path());
    for event in &mut events {
        event.as_object_mut().unwrap().remove("gap_s");
    }
    (events, channels.collect())
}

/// A session by keys alone, with the same quit and resume.
fn by_keys() -> &'static [Value] {
    static JOURNAL: OnceLock<Vec<Value>> = OnceLock::new();
    JOURNAL.get_or_init(|| session(Channel::Terminal, Channel::Terminal).0)
}

fn same_journal(begin: Channel, end: Channel) {
    let (journal, channels) = session(begin, end);
    let words = [vec![begin.word(); 2], vec![end.word(); 3]].concat();
    assert_eq!(channels, words);
    let replays = journal.iter().filter(|e| e["event"] == "replayed").count();
    assert_eq!(replays, 1);
    let corrections = journal.iter().filter(|e| e["reason"] == "mistyped");
    assert_eq!(corrections.count(), 1);
    assert_eq!(last_answers(&journal), last_answers(by_keys()));
    // A busy machine can lose a playback: its trial is then repeated at another place.
    let lost = |events: &[Value]| events.iter().any(|e| e["event"] == "attempt_failed");
    if !lost(&journal) && !lost(by_keys()) {
        assert_eq!(journal, by_keys());
    }
}

#[test]
fn begun_by_keys_and_ended_in_lines() {
    same_journal(Channel::Terminal, Channel::Plain);
}

#[test]
fn begun_by_keys_and_ended_on_the_page() {
    same_journal(Channel::Terminal, Channel::Page);
}

#[test]
fn begun_in_lines_and_ended_by_keys() {
    same_journal(Channel::Plain, Channel::Terminal);
}

#[test]
fn begun_in_lines_and_ended_on_the_page() {
    same_journal(Channel::Plain, Channel::Page);
}

#[test]
fn begun_on_the_page_and_ended_by_keys() {
    same_journal(Channel::Page, Channel::Terminal);
}

#[test]
fn begun_on_the_page_and_ended_in_lines() {
    same_journal(Channel::Page, Channel::Plain);
}

/// A rating page is closed, and the session resumed later than the protocol allows.
#[test]
fn what_was_felt_too_long_ago_is_felt_again_on_every_channel() {
    for channel in EVERY {
        let folder = tempfile::tempdir().unwrap();
        let protocol = folder.path().join("paper");
        let changes = [
            PATIENT,
            ("repetitions = 3", "repetitions = 1"),
            ("[session]\n", "[session]\nlongest_pause_s = 1\n"),
        ];
        changed_protocol("turn-signal", &protocol, &changes);
        channel.leave_a_rating(folder.path(), &protocol);
        std::thread::sleep(std::time::Duration::from_millis(1500));
        channel.end(folder.path(), &protocol, &[]);
        let (code, out, err) = study(&["verify", "results"], folder.path());
        assert_eq!(code, 0, "{channel:?}: {out}{err}");
        let events = events(folder.path());
        let again = events.iter().find(|e| e["event"] == "attempt_failed");
        let again = again.unwrap_or_else(|| panic!("{channel:?}: rated from memory"));
        assert_eq!(again["failure"], "interrupted", "{channel:?}");
        assert!(
            again["paused_s"].as_f64() > Some(1.0),
            "{channel:?}: {again}"
        );
        let ratings = folder.path().join("results/turn-signal/ratings.csv");
        let ratings = std::fs::read_to_string(ratings).unwrap();
        assert!(ratings.contains("felt_again_after_s"), "{ratings}");
        assert_eq!(crate::screen::rated(&ratings), 5, "{ratings}");
    }
}

const BETWEEN: &str = r#"
[[questionnaires]]
id = "load"
kind = "own"
after = "condition"
items = ["Was it heavy?", "Was it rough?"]
from = 1
to = 7

[analysis]"#;

/// Both items after each of five realizations, none twice, also of a session that was killed at the first of them.
#[test]
fn questionnaires_between_the_trials_are_answered_on_every_channel() {
    for channel in EVERY {
        let folder = tempfile::tempdir().unwrap();
        let protocol = folder.path().join("paper");
        let changes = [
            PATIENT,
            ("repetitions = 3", "repetitions = 1"),
            ("study-protocol/1", "study-protocol/3"),
            ("\n[analysis]", BETWEEN),
        ];
        changed_protocol("turn-signal", &protocol, &changes);
        channel.leave_a_questionnaire(folder.path(), &protocol);
        channel.end(folder.path(), &protocol, &[]);
        let (code, out, err) = study(&["verify", "results"], folder.path());
        assert_eq!(code, 0, "{channel:?}: {out}{err}");
        let events = events(folder.path());
        let between = |e: &&Value| e["event"] == "answered" && e["place"]["after"].is_object();
        assert_eq!(events.iter().filter(between).count(), 10, "{channel:?}");
        let ratings = folder.path().join("results/turn-signal/ratings.csv");
        let ratings = std::fs::read_to_string(ratings).unwrap();
        assert!(ratings.contains("load_1,load_2"), "{ratings}");
    }
}

/// Plays a protocol by keys, in lines and on the page, each in a folder of its own. The
/// answers are the same: their number.
fn on_every_channel(
    name: &str,
    changes: &[(&str, &str)],
    more: &[&str],
    channels: &[Channel],
) -> usize {
    let mut journals = Vec::new();
    for channel in channels {
        let folder = tempfile::tempdir().unwrap();
        let protocol = folder.path().join("protocol");
        changed_protocol(name, &protocol, changes);
        channel.end(folder.path(), &protocol, more);
        let (code, out, err) = study(&["verify", "results"], folder.path());
        assert_eq!(code, 0, "{out}{err}");
        let (code, _, err) = study(&["analyze", "results", "--include", "pilot"], folder.path());
        assert_eq!(code, 0, "{channel:?}: {err}");
        let mut answers = last_answers(&crate::plain::events_of(folder.path(), name));
        // The players type different texts.
        answers.retain(|_, answer| answer.get("text").is_none());
        journals.push(answers);
    }
    for (journal, channel) in journals.iter().zip(channels) {
        assert_eq!(*journal, journals[0], "{name} {channel:?}");
    }
    journals[0].len()
}

const EVERY: [Channel; 3] = [Channel::Terminal, Channel::Plain, Channel::Page];

#[test]
#[ignore = "ten sessions, some minutes: cargo test --test session -- --ignored every_shipped"]
fn every_shipped_protocol_on_every_channel() {
    let short = [
        PATIENT,
        ("max_attempts = 3", "max_attempts = 50"),
        ("repetitions = 3", "repetitions = 1"),
        ("at_least_s = 60", "at_least_s = 1"),
        ("reference_min_s = 3", "reference_min_s = 0"),
        ("minimum_strokes = 2", "minimum_strokes = 1"),
    ];
    // The page leaves set-up to the experimenter.
    for (name, least, channels) in [
        ("turn-signal", 5, &EVERY[..]),
        ("knob", 12, &EVERY[..]),
        ("turn-signal-extended", 30, &EVERY[..2]),
        ("turn-signal-passive", 30, &EVERY[..2]),
    ] {
        let text = repository(&format!("protocols/{name}/protocol.toml"));
        let text = std::fs::read_to_string(text).unwrap();
        let own: Vec<_> = short
            .into_iter()
            .filter(|(old, _)| text.contains(old))
            .filter(|&change| change != PATIENT || !text.contains("max_attempts"))
            .collect();
        assert!(
            on_every_channel(name, &own, &[], channels) >= least,
            "{name}"
        );
    }
}

/// A program that plays tones, with a player that makes no sound.
#[test]
fn tones_are_rated_on_every_channel() {
    if !crate::devices::has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let player = folder.path().join("aplay");
    std::fs::write(&player, "#!/bin/sh\nexec cat > /dev/null\n").unwrap();
    let status = std::process::Command::new("chmod")
        .arg("+x")
        .arg(&player)
        .status();
    assert!(status.unwrap().success());
    let command = format!(
        "env PATH={}:{} python3 {}",
        folder.path().display(),
        std::env::var("PATH").unwrap(),
        repository("protocols/sounds/play.py")
    );
    let changes = [
        ("repetitions = 3", "repetitions = 1\nmax_attempts = 50"),
        ("min_s = 2, max_s = 2", "min_s = 0.5, max_s = 0.5"),
    ];
    let more = ["--pilot", "--command", &command];
    assert_eq!(on_every_channel("sounds", &changes, &more, &EVERY), 6);
}

/// The experimenter lays the samples, asks and enters the answers: there is no page.
#[test]
fn cloths_are_rated_by_keys_and_in_lines() {
    let changes = [
        ("repetitions = 2", "repetitions = 1"),
        ("min_s = 4", "min_s = 0.2"),
    ];
    let channels = [Channel::Terminal, Channel::Plain];
    let answers = on_every_channel("cloth", &changes, &["--pilot"], &channels);
    assert_eq!(answers, 6);
    let folder = tempfile::tempdir().unwrap();
    let cloth = repository("protocols/cloth");
    let (code, _, err) = study(&["run", &cloth, "--screen"], folder.path());
    assert_ne!(code, 0);
    assert!(err.contains("entry"), "{err}");
}

#[test]
fn yes_or_no_is_said_on_every_channel() {
    let changes = [
        ("repetitions = 20", "repetitions = 1"),
        ("[0.05, 0.1, 0.2, 0.4, 0.8]", "[0.2, 0.8]"),
        ("min_s = 1, max_s = 6", "min_s = 0.2, max_s = 0.4"),
    ];
    assert!(on_every_channel("yes-no", &changes, &[], &EVERY) >= 2);
}
