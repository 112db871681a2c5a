//! The pages of a session in every shipped language.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::views::{form, picture, realism, screens, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::collections::BTreeMap;
use std::sync::Arc;
use study::plain::pages;
use study::tui::{Colour, Surface};
use study_core::protocol::phrases::{Phrase, Words, languages};
use study_core::session::Screen;
use study_core::session::view::View;

/// What a participant sees of a session.
fn pages_of_a_session(words: &Arc<Words>) -> Vec<(&'static str, View)> {
    let own = [
        (
            "reference",
            Screen::Reference {
                prompt: words.get(Phrase::ReferenceText).to_owned(),
                wait_s: 12.0,
            },
        ),
        ("loading", Screen::Loading { interval: None }),
        (
            "playing",
            Screen::Playing {
                since_s: 4.0,
                keep_exploring: true,
                exposure: Default::default(),
                interval: None,
            },
        ),
        ("stopped", Screen::Stopped { can_rate: true }),
        ("paused", Screen::Paused { since_s: 3.0 }),
        (
            "break",
            Screen::Break {
                text: words.get(Phrase::BreakText).to_owned(),
                wait_s: 130.0,
                done: 6,
                total: Some(15),
            },
        ),
        (
            "consent",
            Screen::Consent {
                document: "A".to_owned(),
                version: "1".to_owned(),
            },
        ),
        ("rating", form(vec![realism()])),
        (
            "end",
            Screen::End {
                text: words.get(Phrase::Complete).to_owned(),
            },
        ),
    ];
    let shown = |(name, screen)| {
        let mut view = view(screen);
        view.words = words.clone();
        (name, view)
    };
    own.into_iter().map(shown).collect()
}

/// The page after these keys.
fn page(view: &View, keys: &[KeyCode]) -> String {
    let mut surface = Surface::new(Colour::None);
    crate::views::drawn(&mut surface, view, 80, 24);
    for key in keys {
        surface.event(&Event::Key(KeyEvent::new(*key, KeyModifiers::NONE)), view);
    }
    picture(&crate::views::drawn(&mut surface, view, 80, 24))
}

#[test]
fn pages_in_every_language() {
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        let mut pictures = String::new();
        for (name, view) in pages_of_a_session(&words) {
            pictures.push_str(&format!("=== {name}\n{}\n", page(&view, &[])));
            let keys: &[KeyCode] = match name {
                "rating" => &[KeyCode::Enter],
                "consent" => &[KeyCode::Char('n')],
                _ => continue,
            };
            pictures.push_str(&format!("=== {name} after keys\n{}\n", page(&view, keys)));
        }
        insta::assert_snapshot!(format!("pages_{lang}"), pictures);
    }
}

#[test]
fn nothing_of_a_participants_page_stays_english() {
    let german = Arc::new(Words::new(Some("de"), &BTreeMap::new()));
    for (name, view) in pages_of_a_session(&german) {
        let keys: &[KeyCode] = match name {
            "rating" => &[KeyCode::Enter],
            _ => &[],
        };
        let full = page(&view, keys);
        let lines = pages::page(&view, 0, true);
        let plain = [lines.top, lines.lines, vec![lines.prompt]]
            .concat()
            .join("\n");
        for phrase in Phrase::ALL {
            let english = phrase.english();
            let told = english.split('{').next().unwrap().trim();
            if told.split(' ').count() > 1 {
                assert!(!full.contains(told), "{name}: {told}\n{full}");
                assert!(!plain.contains(told), "{name}: {told}\n{plain}");
            }
        }
    }
}

#[test]
fn no_language_makes_a_page_cut_more_than_english() {
    let cuts = |view: &View| page(view, &[]).matches('…').count();
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        for (name, english) in screens() {
            let mut view = english.clone();
            view.words = words.clone();
            assert_eq!(cuts(&view), cuts(&english), "{lang} {name}");
        }
    }
}
