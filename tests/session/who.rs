//! The first screen: who takes part.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::player::play_until;
use crate::support::{PATIENT, Terminal, changed_protocol};
use crate::views::{drawn, picture, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::sync::Arc;
use study::tui::{ColorDepth, Surface};
use study_session::session::roster::{Newcomer, Roster};
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
