//! Consent with its text, and initials in place of a signature.

use super::rig::{Rig, StoreMood};
use super::studies::rich;
use study_plan::protocol::{Answer, Protocol};
use study_session::outcome::{Event, FormId};
use study_session::page::participant;
use study_session::session::{Effect, Input, Screen};

const TEXT: &str = "You turn a knob.\n\nIt takes an hour.";

/// A study whose participants read the text and type initials.
pub(super) fn signed() -> Protocol {
    let mut protocol = rich();
    if let Some(consent) = &mut protocol.consent {
        consent.text = Some(TEXT.to_owned());
        consent.initials = true;
    }
    protocol
}

/// Gives an answer on the page of the initials.
fn types(rig: &mut Rig, answer: Answer) {
    let Screen::Form {
        form, questions, ..
    } = rig.view().screen
    else {
        panic!("{:?}", rig.view().screen)
    };
    assert_eq!(form, FormId::Consent);
    rig.wait(1.0)
        .send(Input::Answer(vec![(questions[0].id.clone(), answer)]));
}

pub(super) fn copies(rig: &Rig) -> Vec<String> {
    let copy = |effect: &Effect| match effect {
        Effect::KeepConsent(copy) => Some(copy.clone()),
        _ => None,
    };
    rig.effects.iter().filter_map(copy).collect()
}

pub(super) fn decided(rig: &Rig) -> usize {
    rig.count(|e| matches!(e, Event::Consented { .. }))
}

#[test]
fn initials_are_in_the_copy_and_in_nothing_else() {
    let mut rig = Rig::new(signed());
    rig.until("Consent");
    let Screen::Consent { document, .. } = rig.view().screen else {
        panic!()
    };
    let whole = format!("Information sheet, version 3\n\n{TEXT}");
    assert_eq!(document, whole);
    assert_eq!(participant(&rig.view()).unwrap().text, whole);
    rig.wait(1.0).send(Input::Consent(true));
    let page = participant(&rig.view()).unwrap();
    assert!(page.decline.is_none(), "initials are no answer");
    let declined = Answer::Declined {
        reason: "private".to_owned(),
    };
    for nothing in [Answer::Text("  ".to_owned()), declined] {
        types(&mut rig, nothing);
        assert_eq!(decided(&rig), 0);
        assert!(rig.view().notice.is_some());
    }
    types(&mut rig, Answer::Text(" QXJ ".to_owned()));
    assert_eq!(decided(&rig), 1);
    let copies = copies(&rig);
    assert_eq!(copies.len(), 1);
    assert!(copies[0].starts_with(&whole), "{}", copies[0]);
    assert!(copies[0].ends_with("\nQXJ\n"), "{}", copies[0]);
    rig.finish();
    rig.assert_whole();
    assert!(!format!("{:?}", rig.journal).contains("QXJ"));
    assert!(!format!("{:?}", rig.view()).contains("QXJ"));
}

/// Nothing that is written or read names the form of the initials.
#[test]
fn no_journal_can_have_initials() {
    assert!(serde_json::to_string(&FormId::Consent).is_err());
    assert!(serde_json::from_str::<FormId>("\"consent\"").is_err());
    assert!(serde_json::from_str::<FormId>("\"outro\"").is_ok());
}

#[test]
fn who_does_not_agree_types_nothing_and_has_no_copy() {
    let mut rig = Rig::new(signed());
    rig.until("Consent").wait(1.0).send(Input::Consent(false));
    assert_eq!(decided(&rig), 1);
    assert!(matches!(rig.view().screen, Screen::End { .. }));
    assert!(copies(&rig).is_empty());
}

/// Who thinks again at the page of the initials can read the document again, and refuse.
#[test]
fn before_the_initials_one_can_go_back_and_refuse() {
    let mut rig = Rig::new(signed());
    rig.until("Consent").wait(1.0).send(Input::Consent(true));
    assert!(rig.view().can_go_back);
    rig.wait(1.0).send(Input::Back);
    assert!(matches!(rig.view().screen, Screen::Consent { .. }));
    rig.wait(1.0).send(Input::Consent(false));
    assert_eq!(decided(&rig), 1);
    assert!(matches!(rig.view().screen, Screen::End { .. }));
    assert!(copies(&rig).is_empty());
}

#[test]
fn a_program_that_ends_before_the_initials_asks_again() {
    let mut rig = Rig::new(signed());
    rig.until("Consent").wait(1.0).send(Input::Consent(true));
    assert_eq!(decided(&rig), 0);
    let mut rig = Rig::back(signed(), rig.journal.clone(), 20.0);
    rig.until("Consent").finish();
    rig.assert_whole();
    assert_eq!((decided(&rig), copies(&rig).len()), (1, 1));
}

#[test]
fn a_text_without_initials_leaves_a_copy_and_no_text_leaves_none() {
    let mut protocol = signed();
    if let Some(consent) = &mut protocol.consent {
        consent.initials = false;
    }
    let mut rig = Rig::new(protocol);
    rig.finish();
    assert_eq!(copies(&rig).len(), 1);
    let mut rig = Rig::new(rich());
    rig.finish();
    assert!(copies(&rig).is_empty());
}

/// A copy that cannot be written is kept until it is, and the page names it; nothing shows what was typed.
#[test]
fn a_copy_that_is_not_on_disk_is_kept_and_named() {
    let mut rig = Rig::new(signed());
    rig.until("Consent").wait(1.0).send(Input::Consent(true));
    assert!(rig.session.unsaved().is_none());
    rig.store = StoreMood::Broken;
    types(&mut rig, Answer::Text("QXJ".to_owned()));
    let view = rig.view();
    assert!(matches!(view.screen, Screen::SaveTrouble { .. }));
    let name = "the participant's copy of the consent".to_owned();
    assert!(view.unsaved.contains(&name), "{:?}", view.unsaved);
    assert!(!format!("{view:?}").contains("QXJ"));
    let unsaved = rig.session.unsaved().unwrap();
    assert!(unsaved.copy.unwrap().ends_with("\nQXJ\n"));
    assert!(unsaved.what.contains(&name));
    assert!(!format!("{:?}", unsaved.events).contains("QXJ"));
    rig.store = StoreMood::Prompt;
    rig.send(Input::RetrySave);
    assert!(rig.session.unsaved().is_none());
    // What is not saved later does not concern it.
    rig.until("Form");
    rig.store = StoreMood::Broken;
    rig.answer_page();
    assert_eq!(rig.session.unsaved().unwrap().copy, None);
    rig.finish();
    rig.assert_whole();
}
