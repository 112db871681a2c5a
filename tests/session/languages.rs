//! The pages of a session in every shipped language.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::views::{form, picture, question, realism, screens, view};
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::collections::BTreeMap;
use std::sync::Arc;
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_plan::protocol::kinds::{self, KINDS};
use study_plan::protocol::phrases::{Phrase, Words, languages};
use study_plan::protocol::{Question, QuestionKind};
use study_session::session::Screen;
use study_session::session::view::{Banner, View};

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
    let mut surface = Surface::new(ColorDepth::None);
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

/// Pages of questions and of a pilot, without a word of a language.
fn questions_of_a_pilot(words: &Arc<Words>) -> Vec<(&'static str, View)> {
    let kinds = KINDS.iter().flat_map(|known| {
        let examples = (known.examples)().into_iter();
        examples.map(|kind| (known.word, kind))
    });
    let shown = |(name, mut kind): (&'static str, QuestionKind)| {
        for (text, symbol) in kind
            .texts_mut()
            .into_iter()
            .zip(["◇", "◆", "○"].into_iter().cycle())
        {
            *text = symbol.to_owned();
        }
        let mut asked = question("asked", "？", kind);
        asked.required = name != "text";
        let text = Question {
            required: false,
            ..question("comment", "？", QuestionKind::Text(kinds::Text))
        };
        let mut view = view(form(vec![asked, text]));
        view.words = words.clone();
        view.banner = Some(Banner::Pilot);
        view.can_go_back = true;
        view.can_replay = true;
        if name == "number" {
            view.line.all_saved = false;
        }
        (name, view)
    };
    kinds.map(shown).collect()
}

/// The words of a text in Latin letters that are not keys or commands.
fn latin(text: &str) -> Vec<String> {
    const KEYS: [&str; 9] = [
        "Enter", "Esc", "Tab", "Shift", "Alt", "Ctrl", "Space", "PgUp", "KiB",
    ];
    let mut command = false;
    let kept = |c: &char| {
        command = *c == '/' || (command && c.is_ascii_lowercase());
        !command
    };
    let text: String = text.chars().filter(kept).collect();
    let words = text.split(|c: char| !c.is_ascii_alphabetic());
    words
        .filter(|word| word.len() > 1 && !KEYS.contains(word))
        .map(str::to_owned)
        .collect()
}

/// The texts of a page, without its ids and words of the format.
fn texts(page: &serde_json::Value, all: &mut Vec<String>) {
    match page {
        serde_json::Value::String(text) => all.push(text.clone()),
        serde_json::Value::Array(items) => items.iter().for_each(|item| texts(item, all)),
        serde_json::Value::Object(fields) => {
            let told = |key: &&String| !["does", "id", "kind", "scales"].contains(&key.as_str());
            for key in fields.keys().filter(told) {
                texts(&fields[key], all);
            }
        }
        _ => {}
    }
}

/// In languages that are not written in Latin letters, every Latin word is English.
#[test]
fn nothing_of_a_participants_page_stays_english() {
    let f = KeyCode::F;
    let dialogs: [&[KeyCode]; 10] = [
        &[],
        &[KeyCode::Enter],
        &[f(1)],
        &[f(2)],
        &[f(6)],
        &[f(6), KeyCode::Enter],
        &[f(6), f(7)],
        &[f(10)],
        &[f(10), KeyCode::Char('x')],
        &[f(1), f(6)],
    ];
    for lang in ["ja", "zh-Hans", "ar"] {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        let mut all = pages_of_a_session(&words);
        all.retain(|(name, _)| *name != "rating");
        all.extend(questions_of_a_pilot(&words));
        for (name, mut view) in all {
            for keys in dialogs {
                let full = page(&view, keys);
                assert_eq!(latin(&full), [""; 0], "{lang} {name} {keys:?}\n{full}");
            }
            view.can_replay = false;
            for has_replays in [false, true] {
                view.has_replays = has_replays;
                let full = page(&view, &[f(7)]);
                assert_eq!(latin(&full), [""; 0], "{lang} {name}\n{full}");
            }
            let mut dialogue = Dialogue::new(true, false);
            let mut plain = dialogue.follow(&view).lines;
            for typed in [
                "", "?", "99", "/help", "/back", "/decline", "/says", "/what", "/replay", "/quit",
                "x",
            ] {
                plain.extend(dialogue.line(typed, &view).1);
            }
            let plain = plain.join("\n");
            assert_eq!(latin(&plain), [""; 0], "{lang} {name}\n{plain}");
            let mut shown = Vec::new();
            let of_page = study_session::page::participant(&view);
            texts(&serde_json::to_value(of_page).unwrap(), &mut shown);
            let shown = shown.join("\n");
            assert_eq!(latin(&shown), [""; 0], "{lang} {name}\n{shown}");
        }
    }
}

/// The help of the keys is not cut in any language.
#[test]
fn the_help_fits_in_every_language() {
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        let (_, view) = pages_of_a_session(&words).swap_remove(0);
        let help = page(&view, &[KeyCode::F(1)]);
        assert_eq!(help.matches('…').count(), 0, "{lang}\n{help}");
        for phrase in [
            Phrase::CommandBack,
            Phrase::CommandBad,
            Phrase::CommandCorrect,
            Phrase::CommandQuit,
            Phrase::CommandRemark,
            Phrase::CommandStop,
        ] {
            assert!(help.contains(words.get(phrase)), "{lang}\n{help}");
        }
    }
}

/// Where the keys do not fit, Enter and F7 stay.
#[test]
fn enter_is_offered_on_every_page_in_every_language() {
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        for (name, view) in questions_of_a_pilot(&words) {
            for columns in [80, 100, 200] {
                let mut surface = Surface::new(ColorDepth::None);
                let shown = picture(&crate::views::drawn(&mut surface, &view, columns, 24));
                for (key, what) in [("Enter", Phrase::Save), ("F7", Phrase::FeelAgain)] {
                    let hint = format!("{key}: {}", words.get(what));
                    assert!(shown.contains(&hint), "{lang} {name} {columns}\n{shown}");
                }
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

/// The banner and the progress stand side by side, also where words are long.
#[test]
fn the_first_line_has_room_for_the_banner_and_the_progress() {
    for lang in languages() {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        for (name, mut view) in questions_of_a_pilot(&words) {
            if let Screen::Form { page, pages, .. } = &mut view.screen {
                (*page, *pages) = (12, 24);
            }
            view.progress = Some(study_session::session::view::Progress {
                practice: false,
                current: 107,
                total: Some(240),
                block: None,
            });
            for columns in [80, 120] {
                let mut surface = Surface::new(ColorDepth::None);
                let shown = picture(&crate::views::drawn(&mut surface, &view, columns, 24));
                let first = shown.lines().next().unwrap();
                let content = study_session::page::page(&view);
                let banner = content.banner.as_ref().unwrap();
                let short = banner.split(" — ").next().unwrap();
                let sheet = &content.sheet.as_ref().unwrap().words;
                let progress = &content.progress.as_ref().unwrap().words;
                let after = format!("{sheet} · {progress}");
                let compact = |text: &str| text.replace(' ', "");
                for part in [short, &after] {
                    assert!(
                        compact(first).contains(&compact(part)),
                        "{lang} {name} {columns}: {first}"
                    );
                }
            }
        }
    }
}

/// What is said of answers is in the language of the study, also when they are corrected, by keys
/// and in lines; a break says nothing of a device, which may be none.
#[test]
fn corrections_and_breaks_are_in_every_language() {
    let english = Words::default();
    for lang in languages().filter(|lang| *lang != "en") {
        let words = Arc::new(Words::new(Some(lang), &BTreeMap::new()));
        let mut view = view(form(vec![realism()]));
        view.words = words.clone();
        let keys = [
            KeyCode::F(3),
            KeyCode::Enter,
            KeyCode::Char('2'),
            KeyCode::Enter,
        ];
        for n in 1..=keys.len() {
            let shown = page(&view, &keys[..n]);
            for phrase in [
                Phrase::CorrectTitle,
                Phrase::NewAnswer,
                Phrase::BothKept,
                Phrase::NothingToCorrect,
            ] {
                assert!(!shown.contains(english.get(phrase)), "{lang} {n}\n{shown}");
            }
            if n == keys.len() {
                // Nothing is cut.
                let slip = format!("{}.", words.get(Phrase::Slip));
                let compact = |text: &str| text.replace(' ', "");
                assert!(compact(&shown).contains(&compact(&slip)), "{lang}\n{shown}");
            }
            if n == 1 {
                assert!(
                    shown.contains(words.get(Phrase::CorrectTitle)),
                    "{lang}\n{shown}"
                );
            }
        }
        // In lines as well.
        let mut dialogue = Dialogue::new(true, false);
        dialogue.follow(&view);
        for typed in ["/correct", "99", "1", "2", ""] {
            let said = dialogue.line(typed, &view).1.join("\n");
            for phrase in [
                Phrase::WhichCorrect,
                Phrase::WhichOfList,
                Phrase::NewAnswer,
                Phrase::PlainWhy,
                Phrase::PlainDeclineIt,
                Phrase::Slip,
            ] {
                assert!(
                    !said.contains(english.get(phrase)),
                    "{lang} {typed}\n{said}"
                );
            }
            if typed == "/correct" {
                assert!(
                    said.contains(words.get(Phrase::WhichCorrect)),
                    "{lang}\n{said}"
                );
            }
        }
        let text = words.get(Phrase::BreakText);
        for device in ["Gerät", "l'appareil", "dispositivo", "装置", "الجهاز"] {
            assert!(!text.contains(device), "{lang}: {text}");
        }
    }
}

/// Yes may be said by the letter of the language as well.
#[test]
fn yes_is_the_letter_that_a_language_has_for_it() {
    use study::tui::keys::{Key, is_yes};
    for (lang, letters) in [
        ("de", "yjYJ"),
        ("fr", "yo"),
        ("es", "ys"),
        ("ar", "y"),
        ("en", "yY"),
    ] {
        let words = Words::new(Some(lang), &BTreeMap::new());
        let yes: String = ('A'..='z')
            .filter(|c| is_yes(Key::Char(*c), &words))
            .collect();
        let mut yes: Vec<char> = yes.chars().filter(|c| c.is_ascii_lowercase()).collect();
        let mut expected: Vec<char> = letters.to_lowercase().chars().collect();
        yes.sort_unstable();
        expected.sort_unstable();
        expected.dedup();
        assert_eq!(yes, expected, "{lang}");
        // A study may have words of its own.
        let own = BTreeMap::from([("yes".to_owned(), "nah".to_owned())]);
        assert!(
            !is_yes(Key::Char('n'), &Words::new(Some(lang), &own)),
            "{lang}"
        );
    }
}
