//! A long consent document is shown in full: by keys, in lines and on the participant's page.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{changed_protocol, study};
use crate::views::{drawn, picture, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::fs;
use study::tui::{ColorDepth, Surface};
use study_session::page::participant;
use study_session::session::{Input, Screen};

fn paragraph(n: usize) -> String {
    format!("Paragraph {n} of the text.")
}

fn document() -> Screen {
    let text: Vec<String> = (1..=60).map(paragraph).collect();
    Screen::Consent {
        document: format!("Information, version 2\n\n{}", text.join("\n\n")),
        version: String::new(),
    }
}

#[test]
fn by_keys_it_is_scrolled_and_answered_by_a_letter() {
    for (width, height) in [(80, 24), (100, 40), (200, 50)] {
        let mut surface = Surface::new(ColorDepth::None);
        let view = view(document());
        let mut seen = picture(&drawn(&mut surface, &view, width, height));
        for words in ["Do you agree to take part?", "yes, I agree", "Information"] {
            assert!(seen.contains(words), "{words}\n{seen}");
        }
        let press = |surface: &mut Surface, code| {
            let event = Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
            surface.event(&event, &view)
        };
        // Its end has not been on the screen: this reads on.
        assert_eq!(press(&mut surface, KeyCode::Char('y')), []);
        seen.push_str(&picture(&drawn(&mut surface, &view, width, height)));
        for _ in 0..150 {
            assert_eq!(press(&mut surface, KeyCode::Down), []);
            seen.push_str(&picture(&drawn(&mut surface, &view, width, height)));
        }
        for n in 1..=60 {
            assert!(seen.contains(&paragraph(n)), "{n} at {width} × {height}");
        }
        assert_eq!(
            press(&mut surface, KeyCode::Char('y')),
            [Input::Consent(true)]
        );
    }
}

#[test]
fn in_lines_and_on_the_page_it_is_whole() {
    let view = view(document());
    let lines = study::plain::pages::page(&view, 0, true).lines;
    let page = participant(&view).unwrap();
    for n in 1..=60 {
        assert!(lines.contains(&paragraph(n)), "{n}");
        assert!(page.text.contains(&paragraph(n)), "{n}");
    }
}

/// From the protocol to the copy, and to its erasure.
#[test]
fn a_study_freezes_the_text_and_keeps_a_copy_for_each_participant() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let changes = [
        (
            "format = \"study-protocol/1\"",
            "format = \"study-protocol/3\"",
        ),
        (
            "[session]\n",
            "[consent]\ndocument = \"Information\"\nversion = \"2\"\ntext = \"consent.txt\"\n\
             initials = true\n\n[session]\n",
        ),
    ];
    changed_protocol("turn-signal", &home.join("p"), &changes);
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
    let (code, _, err) = study(&arguments, home);
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("the consent file cannot be read"), "{err}");
    fs::write(home.join("p/consent.txt"), " \n").unwrap();
    let (code, _, err) = study(&arguments, home);
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("the text of the consent document is empty"),
        "{err}"
    );

    let text = "You turn a switch that is not there.\r\n\r\nIt takes an hour.\r\n";
    fs::write(home.join("p/consent.txt"), text).unwrap();
    let (code, out, err) = study(&arguments, home);
    assert_eq!(code, 0, "{out}{err}");
    let results = home.join("r/turn-signal");
    let frozen = fs::read_to_string(results.join("protocol/1/consent.txt")).unwrap();
    assert_eq!(frozen, text);
    let copy = results.join("sessions/SIM001/1/consent.txt");
    let kept = fs::read_to_string(&copy).unwrap();
    assert!(kept.starts_with("Information, version 2\n\nYou turn a switch"));
    assert!(kept.ends_with("\nSIM\n"), "{kept}");
    let journal = results.join("sessions/SIM001/1/journal.jsonl");
    assert!(!fs::read_to_string(journal).unwrap().contains("initials"));
    let (code, out, err) = study(&["verify", "r"], home);
    assert_eq!(code, 0, "{err}");
    assert!(!out.contains("consent.txt"), "{out}");

    // Another text is another wording of the study, and not another study.
    fs::write(home.join("p/consent.txt"), "Something else.").unwrap();
    let amend = ["amend", "r", "p", "--reason", "a clearer text"];
    let (code, out, err) = study(&amend, home);
    assert_eq!(code, 0, "{out}{err}");
    assert!(!out.contains("Something else"), "{out}");

    let erase = [
        "participant",
        "r",
        "SIM001",
        "--state",
        "withdrawn",
        "--reason",
        "asked",
        "--erase",
        "--yes",
    ];
    let (code, out, err) = study(&erase, home);
    assert_eq!(code, 0, "{out}{err}");
    assert!(!copy.exists());
}
