//! Why a trial is not presented, as the experimenter reads it.

use super::rig::{DeviceMood, Rig};
use super::studies::plain;
use study_plan::protocol::DeviceKind;
use study_session::outcome::Event;
use study_session::session::{Input, Screen};

/// What is on the page after the device has refused the first trial, and the detail in the
/// journal.
fn refused(of_force: bool) -> (String, String) {
    let mut protocol = plain();
    if !of_force {
        protocol.device.kind = DeviceKind::Process;
        for model in &mut protocol.models {
            model.file = None;
        }
    }
    let mut rig = Rig::new(protocol);
    rig.until("Reference");
    rig.device = DeviceMood::Silent;
    rig.send(Input::Advance)
        .send(Input::DeviceFault("aplay is not installed".to_owned()));
    let Screen::DeviceTrouble { what, .. } = rig.view().screen else {
        panic!("{:?}", rig.view().screen);
    };
    let detail = rig.events().find_map(|e| match e {
        Event::AttemptFailed { detail, .. } => Some(detail.clone()),
        _ => None,
    });
    (what, detail.unwrap())
}

#[test]
fn a_program_that_presents_no_force_says_what_it_lacks() {
    let (shown, detail) = refused(false);
    assert_eq!(shown, "aplay is not installed");
    assert_eq!(detail, shown);
    // Why a force is refused could tell which one it is.
    let (shown, detail) = refused(true);
    assert!(
        shown.contains("attempts.csv will have its reason"),
        "{shown}"
    );
    assert_eq!(detail, "aplay is not installed");
}
