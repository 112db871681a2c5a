//! Keys of the help on pages where they do nothing: the page says why, and when they do.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::views::{comment, drawn, form, picture, realism, screens, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_session::session::{Input, Screen, View};

const NOW: &str = "This cannot be presented again now.";
const WHEN: &str = "A trial can be, before its first answer, as often as the study allows.";
const NEVER: &str = "In this study nothing is presented again on request.";
const NOT_BEGUN: &str = "That is possible once the session has begun.";

/// The inputs of function keys, and the page after them with one space between words.
fn pressed(view: &View, keys: &[u8]) -> (Vec<Input>, String) {
    let mut surface = Surface::new(ColorDepth::None);
    drawn(&mut surface, view, 80, 24);
    let mut inputs = Vec::new();
    for key in keys {
        let event = KeyEvent::new(KeyCode::F(*key), KeyModifiers::NONE);
        inputs.extend(surface.event(&Event::Key(event), view));
    }
    let page = picture(&drawn(&mut surface, view, 80, 24));
    let words: Vec<&str> = page.split_whitespace().collect();
    (inputs, words.join(" "))
}

/// What lines say to a line, and the inputs.
fn typed(view: &View, line: &str) -> (Vec<Input>, String) {
    let mut dialogue = Dialogue::new(true, false);
    dialogue.follow(view);
    let (inputs, lines) = dialogue.line(line, view);
    (inputs, lines.join("\n"))
}

fn who() -> View {
    view(Screen::Who {
        participant: String::new(),
        operator: String::new(),
        roster: None,
        claiming: false,
    })
}

fn end() -> View {
    let text = "Thank you.".to_owned();
    view(Screen::End { text })
}

/// On every page F7 does something or says why it does nothing.
#[test]
fn feeling_again_is_explained_where_it_is_not_possible() {
    for (name, mut view) in screens() {
        let stopped = matches!(view.screen, Screen::Stopped { .. });
        for has_replays in [true, false] {
            view.has_replays = has_replays;
            let all = [pressed(&view, &[7]), typed(&view, "/replay")];
            for (inputs, said) in all {
                if stopped {
                    assert_eq!(inputs, [Input::PlayAgain], "{name}");
                    continue;
                }
                assert_eq!(inputs, [], "{name}");
                let (why, when) = match has_replays {
                    true => (NOW, WHEN),
                    false => (NEVER, ""),
                };
                assert!(said.contains(why) && said.contains(when), "{name}\n{said}");
            }
        }
    }
    let mut rated = view(form(vec![realism(), comment()]));
    (rated.can_replay, rated.has_replays) = (true, true);
    for (inputs, said) in [pressed(&rated, &[7]), typed(&rated, "/replay")] {
        assert_eq!(inputs, [Input::PlayAgain]);
        assert!(!said.contains(NOW), "{said}");
    }
}

/// Before a session there is nothing to pause, and nothing to come back to.
#[test]
fn before_a_session_a_pause_is_explained_and_leaving_promises_nothing() {
    for (inputs, said) in [pressed(&who(), &[5]), typed(&who(), "/pause")] {
        assert_eq!(inputs, []);
        assert!(said.contains(NOT_BEGUN), "{said}");
    }
    for (inputs, said) in [pressed(&who(), &[10]), typed(&who(), "/quit")] {
        assert_eq!(inputs, []);
        assert!(said.contains("No session has begun. Leave?"), "{said}");
        assert!(!said.contains("resumed"), "{said}");
    }
}

/// A session that is over cannot be resumed: leaving it is not asked about.
#[test]
fn after_a_session_leaving_is_not_asked_about() {
    for (inputs, said) in [pressed(&end(), &[10]), typed(&end(), "/quit")] {
        assert_eq!(inputs, [Input::Quit]);
        assert!(!said.contains("resumed"), "{said}");
    }
}

/// Whoever reads the name of a key in the help presses it there.
#[test]
fn the_keys_of_the_help_work_in_the_help() {
    let rated = view(form(vec![realism(), comment()]));
    for (key, shown) in [
        (2, "Remark"),
        (3, "Correct an answer"),
        (4, "Mark as bad"),
        (6, "Decline this question"),
        (7, NEVER),
    ] {
        let (inputs, page) = pressed(&rated, &[1, key]);
        assert_eq!(inputs, [], "F{key}");
        assert!(page.contains(shown), "F{key}\n{page}");
        assert!(
            !page.contains("Ctrl-Q"),
            "F{key}: the help is closed\n{page}"
        );
    }
    assert_eq!(pressed(&rated, &[1, 5]).0, [Input::Pause]);
}

/// In another dialog they do not work, and it says so.
#[test]
fn a_dialog_says_that_it_comes_first() {
    let rated = view(form(vec![realism(), comment()]));
    for (dialog, key) in [(2, 7), (2, 6), (3, 7), (4, 2), (6, 7)] {
        let (inputs, page) = pressed(&rated, &[dialog, key]);
        assert_eq!(inputs, [], "F{dialog}, F{key}");
        assert!(
            page.contains("Finish this first, or press Esc."),
            "F{dialog}, F{key}\n{page}"
        );
    }
}
