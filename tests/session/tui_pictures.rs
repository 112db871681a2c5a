//! Snapshots of all screens.

// A helper that unwraps is an assertion here.
#![allow(clippy::unwrap_used)]

use crate::views::*;
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use study::tui::{ColorDepth, Surface};
use study_session::session::Screen;
use study_session::session::view::{DeviceState, Telemetry, View};

/// The screen after some keys: function keys as `F2`, characters as they are,
/// `\n` Enter, `\t` Tab.
fn after(view: &View, keys: &[&str], w: u16, h: u16) -> String {
    let mut surface = Surface::new(ColorDepth::None);
    drawn(&mut surface, view, w, h);
    for key in keys {
        let function = key.strip_prefix('F').and_then(|n| n.parse().ok());
        let codes: Vec<KeyCode> = match function {
            Some(n) => vec![KeyCode::F(n)],
            None => key
                .chars()
                .map(|c| match c {
                    '\n' => KeyCode::Enter,
                    '\t' => KeyCode::Tab,
                    '→' => KeyCode::Right,
                    '↓' => KeyCode::Down,
                    c => KeyCode::Char(c),
                })
                .collect(),
        };
        for code in codes {
            surface.event(&Event::Key(KeyEvent::new(code, KeyModifiers::NONE)), view);
        }
    }
    picture(&drawn(&mut surface, view, w, h))
}

#[test]
fn every_screen_at_eighty_by_twenty_four() {
    for (name, view) in screens() {
        insta::assert_snapshot!(format!("{name}_80x24"), fresh(&view, 80, 24));
    }
}

#[test]
fn a_larger_terminal_is_used() {
    for (name, view) in screens() {
        if ["rating", "rating_asked", "playing", "instructions"].contains(&name) {
            insta::assert_snapshot!(format!("{name}_120x40"), fresh(&view, 120, 40));
        }
    }
}

#[test]
fn a_smaller_terminal_says_what_is_needed() {
    let playing = view(Screen::Playing {
        since_s: 1.0,
        keep_exploring: false,
        exposure: Default::default(),
        interval: None,
    });
    insta::assert_snapshot!("small_40x10", fresh(&playing, 40, 10));
    assert!(
        fresh(&view(Screen::Saving), 60, 20)
            .contains("This window has 60 × 20 cells; 80 × 24 are needed.")
    );
}

#[test]
fn answers_as_they_are_entered() {
    let rated = view(form(vec![realism(), comment()]));
    insta::assert_snapshot!(
        "rated_80x24",
        after(
            &rated,
            &["5\tcrisp, but the middle detent comes late — よかった 👍🏽 جيد"],
            80,
            24
        )
    );
    insta::assert_snapshot!("rated_120x40", after(&rated, &["5"], 120, 40));
    insta::assert_snapshot!("nothing_chosen", after(&rated, &["\n"], 80, 24));
    let moved = view(form(vec![slider(), comment()]));
    insta::assert_snapshot!("slider_moved", after(&moved, &["→→"], 80, 24));
    let several = view(form(vec![choice(true)]));
    insta::assert_snapshot!("choice_marked", after(&several, &["1↓↓ "], 80, 24));
    let age = view(form(vec![number()]));
    insta::assert_snapshot!("number_typed", after(&age, &["27"], 80, 24));
}

#[test]
fn every_dialog() {
    let rated = view(form(vec![realism(), comment()]));
    for (name, keys) in [
        ("help", vec!["F1"]),
        ("remark", vec!["F2", "the handle squeaks"]),
        ("correct_list", vec!["F3", "↓"]),
        ("correct_answer", vec!["F3", "\n", "6"]),
        (
            "correct_reason",
            vec!["F3", "\n", "6", "\n", "said 6, typed 3"],
        ),
        ("mark_bad", vec!["F4", "phone rang"]),
        ("decline", vec!["F6", "felt nothing"]),
        ("quit", vec!["F10"]),
    ] {
        insta::assert_snapshot!(format!("dialog_{name}"), after(&rated, &keys, 80, 24));
    }
}

#[test]
fn the_arrival_of_telemetry_is_shown_on_request() {
    let mut playing = view(Screen::Playing {
        since_s: 14.0,
        keep_exploring: false,
        exposure: Default::default(),
        interval: None,
    });
    for (telemetry, words) in [
        (Telemetry::Arrives, "running · telemetry arrives"),
        (Telemetry::Silent, "running · NO TELEMETRY"),
        (Telemetry::None, "running · 12:41"),
    ] {
        playing.line.device = DeviceState::Running(telemetry);
        let mut surface = Surface::new(ColorDepth::None).with_live(true);
        let shown = picture(&drawn(&mut surface, &playing, 80, 24));
        assert!(shown.contains(words), "{shown}");
        let unasked = fresh(&playing, 80, 24).to_lowercase();
        assert!(
            unasked.contains("saved ✓") && !unasked.contains("telemetry"),
            "{unasked}"
        );
    }
}

#[test]
fn no_information_depends_on_color() {
    for (name, view) in screens() {
        let of = |color| drawn(&mut Surface::new(color), &view, 80, 24);
        let none = of(ColorDepth::None);
        for color in [ColorDepth::Full, ColorDepth::Sixteen] {
            assert_eq!(picture(&of(color)), picture(&none), "{name}");
        }
        for cell in &none.content {
            let plain = ratatui::style::Color::Reset;
            assert_eq!((cell.fg, cell.bg), (plain, plain), "{name}");
        }
    }
}
