//! Any size, any text, any keys: nothing panics, no control sequence reaches the
//! terminal.

// A helper that unwraps is an assertion here.
#![allow(clippy::unwrap_used)]

use crate::views::*;
use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use proptest::prelude::*;
use study::tui::{ColorDepth, Surface};
use study_base::text::is_unsafe;
use study_plan::protocol::{Answer, QuestionKind, kinds};
use study_session::session::Screen;
use study_session::session::view::View;

/// Replaces every text of a view by hostile text.
fn poison(view: &mut View, text: &str, n: f64) {
    let t = || text.to_owned();
    view.notice = Some(t());
    view.line.participant = t();
    view.line.operator = t();
    view.line.elapsed_s = n;
    view.can_mark_bad = Some(t());
    view.unsaved = vec![t(); 8];
    for earlier in &mut view.correctable {
        earlier.title = t();
        earlier.question.prompt = t();
        earlier.answer = Answer::Text(t());
    }
    match &mut view.screen {
        Screen::Who { .. } => {
            view.screen = Screen::Who {
                participant: t(),
                operator: t(),
                roster: None,
                claiming: false,
            };
        }
        Screen::ResumeChoice { gap_h, .. } => *gap_h = n,
        Screen::Consent { document, version } => {
            (*document, *version) = (t(), t());
        }
        Screen::Message { text, .. } | Screen::End { text } => *text = t(),
        Screen::Break { text, wait_s, .. } => (*text, *wait_s) = (t(), n),
        Screen::Reference { prompt, wait_s } => (*prompt, *wait_s) = (t(), n),
        Screen::Playing { since_s, .. } | Screen::Paused { since_s } => *since_s = n,
        Screen::DeviceTrouble { what, .. } | Screen::SaveTrouble { what } => *what = t(),
        Screen::Form { questions, .. } => {
            for question in questions {
                question.prompt = t();
                question
                    .kind
                    .texts_mut()
                    .into_iter()
                    .for_each(|text| *text = t());
            }
        }
        _ => {}
    }
}

fn key(n: usize) -> Event {
    let plain = [
        KeyCode::Enter,
        KeyCode::Tab,
        KeyCode::BackTab,
        KeyCode::Up,
        KeyCode::Down,
        KeyCode::Left,
        KeyCode::Right,
        KeyCode::Home,
        KeyCode::End,
        KeyCode::PageUp,
        KeyCode::PageDown,
        KeyCode::Backspace,
        KeyCode::Delete,
        KeyCode::F(1),
        KeyCode::F(2),
        KeyCode::F(3),
        KeyCode::F(4),
        KeyCode::F(6),
        KeyCode::F(10),
        KeyCode::Char('1'),
        KeyCode::Char('x'),
        KeyCode::Char('\u{301}'),
        KeyCode::Char('日'),
        KeyCode::Char('n'),
    ];
    Event::Key(KeyEvent::new(plain[n % plain.len()], KeyModifiers::NONE))
}

fn hostile() -> impl Strategy<Value = String> {
    let words =
        "[a-z\u{1b}\u{9b}\u{202e}\u{301}\u{200d}\u{feff}日👩🏽\u{1f1e9}\0\t\n \u{5d0}]{0,200}";
    prop_oneof!["\\PC{0,80}", words, ".{0,300}", Just("x".repeat(5000))]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]
    #[test]
    fn any_size_any_text_any_keys(
        which in 0usize..1000,
        text in hostile(),
        number in prop_oneof![any::<f64>(), 0.0..1e5],
        (w, h) in (0u16..200, 0u16..60),
        (w2, h2) in (0u16..200, 0u16..60),
        keys in proptest::collection::vec(0usize..24, 0..12),
        (x, y) in (0u16..200, 0u16..60),
    ) {
        let mut all = screens();
        let at = which % all.len();
        let (name, mut view) = all.swap_remove(at);
        poison(&mut view, &text, number);
        let mut surface = Surface::new(ColorDepth::Full);
        drawn(&mut surface, &view, w, h);
        for n in keys {
            surface.event(&key(n), &view);
        }
        surface.event(&Event::Paste(text.clone()), &view);
        let kind = MouseEventKind::Down(MouseButton::Left);
        let modifiers = KeyModifiers::NONE;
        surface.event(&Event::Mouse(MouseEvent { kind, column: x, row: y, modifiers }), &view);
        for (w, h) in [(w, h), (w2, h2), (80, 24)] {
            let buf = drawn(&mut surface, &view, w, h);
            for cell in &buf.content {
                prop_assert!(!cell.symbol().contains(is_unsafe), "{name}: {:?}", cell.symbol());
            }
        }
        let esc = Event::Key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE));
        prop_assert_eq!(surface.event(&esc, &view), vec![study_session::session::Input::Stop]);
    }
}

#[test]
fn extreme_scales_are_drawn() {
    for (from, to) in [(i64::MIN, i64::MAX), (0, i64::MAX), (-1000, -990), (1, 1)] {
        let view = view(form(vec![question(
            "q",
            "?",
            rating(from, to, &[(from, "a")]),
        )]));
        fresh(&view, 80, 24);
    }
    for (from, to) in [
        (f64::MIN, f64::MAX),
        (0.0, 1e-300),
        (f64::NAN, 1.0),
        (1.0, 1.0),
    ] {
        let mut slider = slider();
        slider.kind = QuestionKind::Slider(kinds::Slider {
            from,
            to,
            step: 0.0,
            labels: std::collections::BTreeMap::new(),
        });
        let view = view(form(vec![slider]));
        let mut surface = Surface::new(ColorDepth::None);
        drawn(&mut surface, &view, 80, 24);
        for n in 0..24 {
            surface.event(&key(n), &view);
        }
    }
}
