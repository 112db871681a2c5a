//! What the study was about: by keys, in lines, on the participant's page, and from the protocol to the journal.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{changed_protocol, study};
use crate::views::{drawn, picture, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_plan::protocol::phrases::{Phrase, Words, languages};
use study_session::page::participant;
use study_session::session::view::{MessageKind, View};
use study_session::session::{Input, Screen};

fn paragraph(n: usize) -> String {
    format!("Paragraph {n} of the text.")
}

fn long() -> View {
    let text: Vec<String> = (1..=40).map(paragraph).collect();
    view(Screen::Message {
        kind: MessageKind::Debriefing,
        text: text.join("\n\n"),
    })
}

/// Nobody goes on from a text whose end was not on the screen.
#[test]
fn by_keys_it_is_read_to_its_end() {
    let view = long();
    let mut surface = Surface::new(ColorDepth::None);
    let mut seen = picture(&drawn(&mut surface, &view, 80, 24));
    assert!(seen.contains("About this study"), "{seen}");
    let enter = Event::Key(KeyEvent::new(KeyCode::Enter, KeyModifiers::NONE));
    let mut presses = 0;
    while surface.event(&enter, &view).is_empty() {
        seen.push_str(&picture(&drawn(&mut surface, &view, 80, 24)));
        presses += 1;
        assert!(presses < 50, "{seen}");
    }
    assert!(presses > 2, "{presses}");
    for n in 1..=40 {
        assert!(seen.contains(&paragraph(n)), "{n}");
    }
}

#[test]
fn in_lines_and_on_the_page_it_is_whole_in_every_language() {
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        let title = words.get(Phrase::Debriefing).to_owned();
        let view = View { words, ..long() };
        let page = participant(&view).unwrap();
        assert_eq!(page.title, title, "{lang}");
        let mut dialogue = Dialogue::new(true, false);
        let lines = dialogue.follow(&view).lines;
        assert!(lines.contains(&title), "{lang}: {lines:?}");
        for n in 1..=40 {
            assert!(lines.contains(&paragraph(n)), "{lang}: {n}");
            assert!(page.text.contains(&paragraph(n)), "{lang}: {n}");
        }
        assert_eq!(dialogue.line("", &view).0, [Input::Advance]);
    }
}

/// From the protocol to the journal.
#[test]
fn a_study_freezes_the_text_and_records_that_it_was_shown() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let section = |text: &str| {
        let whole = format!("[debriefing]\n{text}\n[session]\n");
        let format_3 = "format = \"study-protocol/3\"";
        let changes = [
            ("format = \"study-protocol/1\"", format_3),
            ("[session]\n", whole.as_str()),
        ];
        let _ = fs::remove_dir_all(home.join("p"));
        changed_protocol("turn-signal", &home.join("p"), &changes);
    };
    let refused = |words: &str| {
        let (code, out, err) = study(&["check", "p"], home);
        assert_eq!(code, 1, "{out}{err}");
        assert!(format!("{out}{err}").contains(words), "{words}: {out}{err}");
    };
    section("");
    refused("[debriefing] is empty");
    section("text = \" \"");
    refused("`debriefing.text` is empty");
    section("file = \"debriefing.txt\"");
    refused("the debriefing file cannot be read");
    fs::write(home.join("p/debriefing.txt"), " \n").unwrap();
    refused("the text of the debriefing is empty");

    section("text = \"You felt models.\"\nfile = \"debriefing.txt\"");
    let text = "We ask which details\r\nmake them feel real.\r\n";
    fs::write(home.join("p/debriefing.txt"), text).unwrap();
    let arguments = [
        "rehearse",
        "p",
        "--participants",
        "1",
        "--out",
        "r",
        "--telemetry",
        "20",
    ];
    let (code, out, err) = study(&arguments, home);
    assert_eq!(code, 0, "{out}{err}");
    let results = home.join("r/turn-signal");
    let frozen = fs::read_to_string(results.join("protocol/1/debriefing.txt")).unwrap();
    assert_eq!(frozen, text);
    let journal = fs::read_to_string(results.join("sessions/SIM001/1/journal.jsonl")).unwrap();
    assert_eq!(journal.matches("\"event\":\"debriefed\"").count(), 1);
    let replay = ["replay", "r", "SIM001", "--reveal", "a test"];
    let (code, out, err) = study(&replay, home);
    assert_eq!(code, 0, "{out}{err}");
    for words in ["You felt models.", "make them feel real."] {
        assert!(out.contains(words), "{words}: {out}");
    }
    let (code, out, err) = study(&["verify", "r"], home);
    assert_eq!(code, 0, "{out}{err}");

    // Another text is another wording of the study, and not another study.
    fs::write(home.join("p/debriefing.txt"), "Something else.").unwrap();
    let amend = ["amend", "r", "p", "--reason", "a clearer text"];
    let (code, out, err) = study(&amend, home);
    assert_eq!(code, 0, "{out}{err}");
}
