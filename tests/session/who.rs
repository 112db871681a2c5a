//! The first screen: who takes part.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::play_until;
use crate::support::{PATIENT, Terminal, changed_protocol};
use crate::views::{drawn, picture, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::sync::Arc;
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_base::text::ParticipantId;
use study_session::outcome::fold::History;
use study_session::session::roster::{Newcomer, Roster};
use study_session::session::view::View;
use study_session::session::{Input, Screen};

/// The id that is proposed is no id until somebody takes it.
#[test]
fn enter_takes_the_id_that_is_proposed_and_another_one_goes_on() {
    let view = view(Screen::Who {
        participant: String::new(),
        operator: "lw".to_owned(),
        roster: Some(Arc::new(Roster::new(&[], Newcomer::Row(1)))),
        claiming: false,
    });
    let mut surface = Surface::new(ColorDepth::None);
    let look = |surface: &mut Surface| picture(&drawn(surface, &view, 80, 24));
    assert!(
        look(&mut surface).contains("→ or Enter: P01"),
        "{}",
        look(&mut surface)
    );
    let enter = Event::Key(KeyEvent::new(KeyCode::Enter, KeyModifiers::NONE));
    assert_eq!(surface.event(&enter, &view), []);
    assert!(
        look(&mut surface).contains("┃ P01"),
        "{}",
        look(&mut surface)
    );
    let identified = Input::Identify {
        participant: "P01".to_owned(),
        operator: "lw".to_owned(),
    };
    assert_eq!(surface.event(&enter, &view), [identified]);
}

/// The first page of a study whose P03 has left after 11 of 40 trials.
fn after_an_interruption(participant: &str) -> View {
    let id = ParticipantId::new("P03").unwrap();
    let row = History::default().participant_row(&id, 1);
    let mut roster = Roster::new(&[row], Newcomer::Row(4));
    let left = "at 14:05, 20 minutes ago".to_owned();
    roster.interrupted(id, left, "with trial 12 of 40".to_owned());
    view(Screen::Who {
        participant: participant.to_owned(),
        operator: "lw".to_owned(),
        roster: Some(Arc::new(roster)),
        claiming: false,
    })
}

fn identified(participant: &str) -> Input {
    Input::Identify {
        participant: participant.to_owned(),
        operator: "lw".to_owned(),
    }
}

const UNFINISHED: &str = "P03 was interrupted at 14:05, 20 minutes ago.";
const DELIBERATE: &str = "Type P03 to go on with trial 12 of 40, or another id for somebody else.";

/// No number of Enters, and no arrow, goes on with the session of whoever has not finished.
#[test]
fn only_a_typed_id_goes_on_with_an_unfinished_session() {
    let view = after_an_interruption("");
    let press = |surface: &mut Surface, code| {
        let key = Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
        surface.event(&key, &view)
    };
    let look = |surface: &mut Surface| picture(&drawn(surface, &view, 80, 24));
    let mut surface = Surface::new(ColorDepth::None);
    let first = look(&mut surface);
    for words in [UNFINISHED, DELIBERATE] {
        assert!(first.contains(words), "{words}\n{first}");
    }
    assert!(!first.contains("or Enter"), "{first}");
    for code in [KeyCode::Enter, KeyCode::Right, KeyCode::Tab, KeyCode::Tab] {
        for _ in 0..5 {
            assert_eq!(press(&mut surface, code), [], "{code:?}");
            press(&mut surface, KeyCode::Enter);
        }
    }
    let still = look(&mut surface);
    assert!(still.contains(DELIBERATE), "{still}");
    assert!(
        still.contains("Type the participant's id first."),
        "{still}"
    );

    for (id, who) in [("P03", "unfinished"), ("P04", "new, row 4")] {
        let mut surface = Surface::new(ColorDepth::None);
        look(&mut surface);
        for c in id.chars() {
            assert_eq!(press(&mut surface, KeyCode::Char(c)), []);
        }
        let typed = look(&mut surface);
        assert!(
            typed.contains(who) && !typed.contains(DELIBERATE),
            "{typed}"
        );
        assert_eq!(press(&mut surface, KeyCode::Enter), [identified(id)]);
    }
}

#[test]
fn in_lines_empty_lines_go_on_with_nobody_either() {
    for id in ["P03", "P04"] {
        let view = after_an_interruption("");
        let mut dialogue = Dialogue::new(true, false);
        let said = dialogue.follow(&view).lines.join("\n");
        for words in [UNFINISHED, DELIBERATE] {
            assert!(said.contains(words), "{words}\n{said}");
        }
        assert!(!said.contains("Enter alone"), "{said}");
        for _ in 0..5 {
            let (inputs, lines) = dialogue.line("", &view);
            assert_eq!(inputs, []);
            assert_eq!(lines, ["Type the participant's pseudonym first."]);
            dialogue.follow(&view);
        }
        assert_eq!(dialogue.line(id, &view).0, []);
        let said = dialogue.follow(&view).lines.join("\n");
        assert!(!said.contains(UNFINISHED), "said once\n{said}");
        assert_eq!(dialogue.line("", &view).0, [identified(id)]);
    }
}

/// `--participant` says who takes part.
#[test]
fn a_participant_of_the_command_line_is_not_replaced() {
    let view = after_an_interruption("P07");
    let mut surface = Surface::new(ColorDepth::None);
    let page = picture(&drawn(&mut surface, &view, 80, 24));
    assert!(
        page.contains("┃ P07") && !page.contains(UNFINISHED),
        "{page}"
    );
    let enter = Event::Key(KeyEvent::new(KeyCode::Enter, KeyModifiers::NONE));
    assert_eq!(surface.event(&enter, &view), [identified("P07")]);
    let mut dialogue = Dialogue::new(true, false);
    let said = dialogue.follow(&view).lines.join("\n");
    assert!(!said.contains(UNFINISHED), "{said}");
    assert!(said.contains("Enter alone: P07."), "{said}");
}

/// As the help of `--participant` says.
#[test]
fn with_participant_and_operator_there_is_no_first_screen() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("paper");
    changed_protocol("turn-signal", &protocol, &[PATIENT]);
    let path = protocol.to_str().unwrap();
    let run = ["run", path, "--participant", "P07", "--operator", "lw"];
    let mut terminal = Terminal::start(&run, folder.path(), 24, 80);
    let seen = play_until(&mut terminal, "P07", "trial 1 of 15");
    let asked = seen.iter().find(|page| page.contains("Who takes part?"));
    assert_eq!(asked, None);
    assert!(
        folder
            .path()
            .join("results/turn-signal/sessions/P07")
            .exists()
    );
}
