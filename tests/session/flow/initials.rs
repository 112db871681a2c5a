//! Initials that are typed by keys, in lines and on the participant's page: the copy has them, and nothing else.

use super::consent::{copies, decided, signed};
use super::rig::Rig;
use crate::views::{drawn, picture};
use crossterm::event::{Event as Pressed, KeyCode, KeyEvent, KeyModifiers};
use serde_json::{Value, json};
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_session::page::reply::{Exchange, Sent};

const PLEASE: &str = "Please type your initials in place of a signature.";

/// A session at the page of the document.
fn at_the_document() -> Rig {
    let mut rig = Rig::new(signed());
    rig.until("Consent").wait(1.0);
    rig
}

/// The copy has the initials, no event and no page has them, and the session goes on to its end.
fn assert_signed(mut rig: Rig) {
    assert_eq!(decided(&rig), 1);
    let copies = copies(&rig);
    assert_eq!(copies.len(), 1);
    assert!(copies[0].ends_with("\nQXJ\n"), "{}", copies[0]);
    assert!(!format!("{:?}", rig.journal).contains("QXJ"));
    assert!(!format!("{:?}", rig.view()).contains("QXJ"));
    rig.finish();
    rig.assert_whole();
    assert!(!format!("{:?}", rig.journal).contains("QXJ"));
}

#[test]
fn initials_are_typed_by_keys() {
    let mut rig = at_the_document();
    let mut surface = Surface::new(ColorDepth::None);
    let look = |rig: &Rig, surface: &mut Surface| picture(&drawn(surface, &rig.view(), 80, 24));
    let press = |rig: &mut Rig, surface: &mut Surface, code| {
        let view = rig.view();
        drawn(surface, &view, 80, 24);
        let key = Pressed::Key(KeyEvent::new(code, KeyModifiers::NONE));
        for input in surface.event(&key, &view) {
            rig.wait(1.0).send(input);
        }
    };
    press(&mut rig, &mut surface, KeyCode::Char('y'));
    let page = look(&rig, &mut surface);
    assert!(page.contains(PLEASE), "{page}");
    // Without initials there is no consent.
    press(&mut rig, &mut surface, KeyCode::Enter);
    for _ in 0..2 {
        press(&mut rig, &mut surface, KeyCode::Char(' '));
    }
    press(&mut rig, &mut surface, KeyCode::Enter);
    assert_eq!(decided(&rig), 0);
    for c in "QXJ".chars() {
        press(&mut rig, &mut surface, KeyCode::Char(c));
    }
    let page = look(&rig, &mut surface);
    assert!(page.contains("QXJ"), "{page}");
    press(&mut rig, &mut surface, KeyCode::Enter);
    let page = look(&rig, &mut surface);
    assert!(!page.contains("QXJ"), "{page}");
    assert_signed(rig);
}

#[test]
fn initials_are_typed_in_a_line() {
    let mut rig = at_the_document();
    let mut dialogue = Dialogue::new(true, false);
    let types = |rig: &mut Rig, dialogue: &mut Dialogue, line: &str| {
        let view = rig.view();
        let mut said = dialogue.follow(&view).lines;
        let (inputs, more) = dialogue.line(line, &view);
        for input in inputs {
            rig.wait(1.0).send(input);
        }
        said.extend(more);
        said.extend(dialogue.follow(&rig.view()).lines);
        said.join("\n")
    };
    let said = types(&mut rig, &mut dialogue, "y");
    assert!(said.contains(PLEASE), "{said}");
    for nothing in ["", "  ", "/decline private"] {
        types(&mut rig, &mut dialogue, nothing);
        assert_eq!(decided(&rig), 0, "{nothing:?}");
    }
    let said = types(&mut rig, &mut dialogue, "QXJ");
    assert!(!said.contains("QXJ"), "{said}");
    assert_signed(rig);
}

#[test]
fn initials_are_typed_on_the_page() {
    let mut rig = at_the_document();
    let mut exchange = Exchange::new("run".to_owned());
    let reply =
        |rig: &mut Rig, exchange: &mut Exchange, key: &str, (does, answers): (&str, Value)| {
            exchange.show(&rig.view());
            let page = json!(exchange.page().unwrap());
            let reply = json!({
                "page": page["id"], "key": key, "shown_ms": 1000, "does": does, "answers": answers,
            });
            let sent = Sent::read(reply.to_string().as_bytes()).unwrap();
            assert!(exchange.arrive(sent));
            let input = exchange.input(&rig.view());
            if let Some(input) = input {
                rig.wait(1.0).send(input);
            }
            exchange.show(&rig.view());
            json!(exchange.outcome(key).unwrap())["outcome"].clone()
        };
    let agreed = reply(&mut rig, &mut exchange, "1", ("agree", json!({})));
    assert_eq!(agreed, "saved");
    let page = json!(exchange.page().unwrap());
    assert_eq!(page["questions"][0]["prompt"], PLEASE);
    assert_eq!(page["decline"], Value::Null);
    for (key, reply_of) in [
        ("2", ("answer", json!({}))),
        ("3", ("answer", json!({"initials": " "}))),
        ("4", ("decline", json!({}))),
    ] {
        let outcome = reply(&mut rig, &mut exchange, key, reply_of);
        assert_eq!(outcome, "refused", "{key}");
        assert_eq!(decided(&rig), 0);
    }
    let typed = ("answer", json!({"initials": "QXJ"}));
    assert_eq!(reply(&mut rig, &mut exchange, "5", typed), "saved");
    let page = json!(exchange.page().unwrap()).to_string();
    assert!(!page.contains("QXJ"), "{page}");
    assert_signed(rig);
}
