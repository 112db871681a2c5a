//! A level is set by keys, in lines and on the page.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::views::{drawn, picture, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_plan::protocol::{AdjustmentWords, Turn};
use study_session::page::reply::{self, Reply};
use study_session::page::{Does, participant};
use study_session::session::view::{Adjusting, View};
use study_session::session::{Input, Screen};

const PROMPT: &str = "Until both feel equal.";

/// The screen while a level, or the standard, is felt.
fn setting(at_standard: bool) -> View {
    let playing = Screen::Playing {
        since_s: 3.0,
        keep_exploring: false,
        exposure: Default::default(),
        interval: at_standard.then_some((1, 2)),
    };
    View {
        has_reference: true,
        adjusting: Some(Adjusting {
            prompt: PROMPT.to_owned(),
            words: AdjustmentWords {
                lower: "weaker".to_owned(),
                higher: "stronger".to_owned(),
                confirm: "they feel equal".to_owned(),
            },
            can_lower: true,
            can_higher: false,
            has_standard: true,
            at_standard,
        }),
        can_advance: true,
        ..view(playing)
    }
}

fn press(view: &View, code: KeyCode) -> Vec<Input> {
    let mut surface = Surface::new(ColorDepth::Full);
    drawn(&mut surface, view, 80, 24);
    let event = Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
    surface.event(&event, view)
}

#[test]
fn a_level_is_set_by_keys() {
    let level = setting(false);
    for (code, turn) in [
        (KeyCode::Left, Some(Turn::Lower)),
        (KeyCode::Char('-'), Some(Turn::Lower)),
        // At the end of the ladder.
        (KeyCode::Right, None),
        (KeyCode::Char('+'), None),
        (KeyCode::Char('s'), Some(Turn::Standard)),
        // It confirms a level that has stopped, which a late key must not.
        (KeyCode::Char('r'), None),
    ] {
        let expected: Vec<Input> = turn.map(Input::Adjust).into_iter().collect();
        assert_eq!(press(&level, code), expected, "{code:?}");
        assert_eq!(press(&setting(true), code), [], "{code:?}");
    }
    assert_eq!(press(&level, KeyCode::Char(' ')), [Input::Stop]);
    let stopped = View {
        screen: Screen::Stopped { can_rate: true },
        ..setting(false)
    };
    assert_eq!(press(&stopped, KeyCode::Char('s')), []);
    let mut surface = Surface::new(ColorDepth::Full);
    let shown = picture(&drawn(&mut surface, &level, 80, 24));
    for text in [
        PROMPT,
        "←  weaker",
        "→  stronger",
        "they feel equal",
        "s  reference",
    ] {
        assert!(shown.contains(text), "{text} is not in\n{shown}");
    }
}

#[test]
fn a_level_is_set_in_lines() {
    let level = setting(false);
    let mut dialogue = Dialogue::new(true, false);
    let said = dialogue.follow(&level).lines.join("\n");
    for text in [PROMPT, "weaker", "they feel equal", "reference"] {
        assert!(said.contains(text), "{text} is not in\n{said}");
    }
    assert!(!said.contains("stronger"), "{said}");
    for (line, inputs) in [
        ("-", vec![Input::Adjust(Turn::Lower)]),
        ("s", vec![Input::Adjust(Turn::Standard)]),
        ("r", Vec::new()),
        ("", vec![Input::Advance]),
        ("/stop", vec![Input::Stop]),
        ("+", Vec::new()),
    ] {
        assert_eq!(dialogue.line(line, &level).0, inputs, "{line}");
    }
    let mut dialogue = Dialogue::new(true, false);
    dialogue.follow(&setting(true));
    assert_eq!(dialogue.line("-", &setting(true)).0, []);
}

#[test]
fn a_level_is_set_on_the_page() {
    let level = setting(false);
    let page = participant(&level).unwrap();
    assert_eq!(page.title, PROMPT);
    let reply = |does| {
        let reply = Reply {
            page: String::new(),
            key: String::new(),
            shown_ms: 1000,
            does,
            answers: Default::default(),
            reason: String::new(),
        };
        reply::input(&reply, &page, &level)
    };
    assert_eq!(reply(Does::Lower), Ok(Input::Adjust(Turn::Lower)));
    assert_eq!(reply(Does::Compare), Ok(Input::Adjust(Turn::Standard)));
    assert_eq!(reply(Does::Advance), Ok(Input::Advance));
    // At the end of the ladder.
    assert!(reply(Does::Higher).is_err());
    // While the standard is felt nothing is set.
    let page = participant(&setting(true)).unwrap();
    assert!(page.button_of(Does::Lower).is_none());
    assert_eq!(page.title, "Reference");
}
