//! A session that is begun on one channel and ended on another: by keys, in typed lines, on
//! the page. A replay, a quit and a resume are in it.

use crate::plain::{Lines, events, last_answers};
use crate::screen::Session;
use crate::support::player::{F7, play_to_end, play_until};
use crate::support::{PATIENT, Terminal, changed_protocol, study};
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

    /// Feels the first realization twice, rates two trials and quits.
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
                play_until(&mut terminal, "P01", "trial 3 of 5");
                terminal.keys("\u{11}");
                terminal.wait_for("Quit the session?");
                terminal.keys("y");
                assert_eq!(terminal.exit_code(), 0, "{}", terminal.screen());
            }
            Self::Plain => {
                let mut lines = Lines::start(folder, &["run", path, "--plain"], None);
                lines.play(Some("Type a number from 1 to 7"));
                lines.types("/replay\n");
                lines.play(Some("Trial 3 of 5"));
                lines.types("/quit\n");
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
                session.types("/quit");
                session.types("y");
                assert!(session.child.wait().unwrap().success());
            }
        }
    }

    /// Resumes and plays to the end.
    fn end(self, folder: &Path, protocol: &Path) {
        let path = protocol.to_str().unwrap();
        match self {
            Self::Terminal => {
                let run = ["run", path, "--operator", "lw"];
                play_to_end(&mut Terminal::start(&run, folder, 24, 80), "P01");
            }
            Self::Plain => {
                let mut lines = Lines::start(folder, &["run", path, "--plain"], None);
                let end = lines.play(None);
                assert!(end.starts_with("The session is finished"), "{end}");
                lines.child.wait().unwrap();
            }
            Self::Page => Session::opened(folder, protocol, &[]).finish(),
        }
    }
}

/// The journal of a session without times, and the channels of its answers.
fn session(begin: Channel, end: Channel) -> (Vec<Value>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("paper");
    let changes = [
        PATIENT,
        ("repetitions = 3", "repetitions = 1"),
        ("[trial]\n", "[trial]\nexposure = { replays = 1 }\n"),
    ];
    changed_protocol("turn-signal", &protocol, &changes);
    begin.begin(folder.path(), &protocol);
    end.end(folder.path(), &protocol);
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
