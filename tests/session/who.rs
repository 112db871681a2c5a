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
    roster.interrupted(id, "with trial 12 of 40".to_owned());
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

const UNFINISHED: &str = "P03 has not finished: Enter goes on with trial 12 of 40.";
const ANOTHER: &str = "Type another id to start somebody else.";

#[test]
fn who_has_not_finished_is_proposed_with_the_trial_that_comes() {
    let view = after_an_interruption("");
    let press = |surface: &mut Surface, code| {
        let key = Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
        surface.event(&key, &view)
    };
    let look = |surface: &mut Surface| picture(&drawn(surface, &view, 80, 24));
    let mut surface = Surface::new(ColorDepth::None);
    let first = look(&mut surface);
    for words in [UNFINISHED, ANOTHER, "→ or Enter: P03"] {
        assert!(first.contains(words), "{words}\n{first}");
    }
    assert_eq!(press(&mut surface, KeyCode::Enter), []);
    let taken = look(&mut surface);
    assert!(
        taken.contains("┃ P03") && !taken.contains(ANOTHER),
        "{taken}"
    );
    assert_eq!(press(&mut surface, KeyCode::Enter), [identified("P03")]);

    let mut surface = Surface::new(ColorDepth::None);
    look(&mut surface);
    for c in "P04".chars() {
        press(&mut surface, KeyCode::Char(c));
    }
    let other = look(&mut surface);
    assert!(other.contains("new, row 4"), "{other}");
    assert_eq!(press(&mut surface, KeyCode::Enter), [identified("P04")]);
}

#[test]
fn lines_propose_the_same() {
    for (typed, id) in [("", "P03"), ("P04", "P04")] {
        let view = after_an_interruption("");
        let mut dialogue = Dialogue::new(true, false);
        let said = dialogue.follow(&view).lines.join("\n");
        for words in [UNFINISHED, ANOTHER, "Enter alone: P03."] {
            assert!(said.contains(words), "{words}\n{said}");
        }
        assert_eq!(dialogue.line(typed, &view).0, []);
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
