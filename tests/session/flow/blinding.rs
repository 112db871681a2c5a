//! Nothing that identifies a realization is ever in a view; `rig` looks at every
//! one. Focus are the ways in from outside.

use super::rig::Rig;
use super::studies::{MODELS, plain};
use study_session::session::{Input, Screen};

#[test]
fn the_rig_would_find_a_model_id() {
    let rig = Rig::new(plain());
    assert!(
        rig.protocol_text().contains(MODELS[0]),
        "the words it looks for exist"
    );
}

#[test]
fn a_device_that_names_its_table_is_not_quoted() {
    for words in [
        "bad table XQZ-7.",
        "models/XQZ-7.toml: no",
        "«XQZ-7» refused",
        "id=XQZ-7-a1",
    ] {
        let mut rig = Rig::new(plain());
        rig.until("Playing")
            .send(Input::DeviceFault(words.to_owned()));
        let Screen::DeviceTrouble { what, .. } = rig.view().screen else {
            panic!("{:?}", rig.view().screen);
        };
        assert!(what.contains('…'), "{what}");
        let kept = rig.events().any(
            |e| matches!(e, study_session::outcome::Event::AttemptFailed { detail, .. } if detail == words),
        );
        assert!(kept, "the journal has the words as they were");
    }
    // A force can tell realizations apart, too.
    let mut rig = Rig::new(plain());
    rig.until("Playing")
        .send(Input::DeviceFault("5.25 N is too much".to_owned()));
    let Screen::DeviceTrouble { what, .. } = rig.view().screen else {
        panic!("{:?}", rig.view().screen);
    };
    assert_eq!(what, "… N is too much");
}

#[test]
fn a_device_cannot_steer_the_terminal() {
    let mut rig = Rig::new(plain());
    rig.until("Playing")
        .send(Input::DeviceFault("over\u{1b}[2Jheated".to_owned()));
    let Screen::DeviceTrouble { what, .. } = rig.view().screen else {
        panic!("{:?}", rig.view().screen);
    };
    assert!(!what.contains('\u{1b}'), "{what:?}");
}
