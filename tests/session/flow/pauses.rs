//! Pauses.

use super::device::{in_phase, screen};
use super::part_rig::pairs;
use super::rig::{DeviceMood, Rig, StoreMood};
use super::studies::plain;
use study_session::outcome::Event;
use study_session::session::{Effect, Input, Screen};

#[test]
fn a_pause_stops_the_playback_first() {
    for (phase, first) in [
        ("Loading", Effect::Limp),
        ("Ready", Effect::Limp),
        ("Playing", Effect::Stop),
    ] {
        let mut rig = in_phase(phase);
        rig.send(Input::Pause);
        assert_eq!(rig.effects[0], first, "{phase}");
        if phase == "Playing" {
            let playback = rig.playback;
            rig.send(Input::DeviceStopped(playback));
        }
        assert_eq!(screen(&rig), "Paused", "{phase}");
        rig.wait(30.0);
        assert!(matches!(rig.view().screen, Screen::Paused { since_s } if since_s >= 30.0));
        rig.effects.clear();
        rig.send(Input::Answer(Vec::new())).send(Input::PlayAgain);
        assert_eq!(rig.effects, [], "nothing goes on under a pause");
        rig.send(Input::Advance);
        let after = if phase == "Playing" {
            "Stopped"
        } else {
            "Reference"
        };
        assert_eq!(screen(&rig), after, "{phase}");
        assert_eq!(
            rig.count(|e| matches!(e, Event::Unpaused { paused_s } if *paused_s >= 30.0)),
            1
        );
        rig.finish();
        rig.assert_whole();
    }
}

/// Between Enter and the confirmation of the device.
#[test]
fn a_pause_while_the_device_stops_is_kept() {
    let mut rig = in_phase("Stopping");
    rig.send(Input::Pause);
    let playback = rig.playback;
    rig.send(Input::DeviceStopped(playback));
    assert_eq!(screen(&rig), "Paused");
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
}

/// The next interval is loaded already, and must not play under a pause or while saving fails.
#[test]
fn what_comes_between_two_intervals_holds_the_next_one_back() {
    for between in [Input::Pause, Input::SaveFailed("disk full".to_owned())] {
        let mut rig = Rig::new(pairs("gap_s = 1.0"));
        rig.until("Playing");
        rig.device = DeviceMood::Silent;
        let playback = rig.playback;
        rig.send(Input::Advance).send(between.clone());
        rig.effects.clear();
        rig.store = StoreMood::Slow;
        rig.send(Input::DeviceStopped(playback))
            .send(Input::DeviceLoaded)
            .wait(5.0);
        let start = |rig: &Rig| rig.effects.contains(&Effect::Start);
        assert!(!start(&rig), "{between:?}");
        let all = rig.all_on_disk();
        rig.send(all);
        if between == Input::Pause {
            assert_eq!(screen(&rig), "Paused");
            rig.send(Input::Advance);
        }
        rig.wait(0.0);
        assert!(start(&rig), "{between:?}");
    }
}

#[test]
fn a_pause_is_no_part_of_the_response_time() {
    let mut rig = Rig::new(plain());
    rig.until("Form").wait(3.0);
    rig.send(Input::Pause).wait(600.0).send(Input::Advance);
    rig.wait(2.0).answer_page();
    let response = rig.events().find_map(|e| match e {
        Event::TrialDone { response_s, .. } => Some(*response_s),
        _ => None,
    });
    assert!((response.unwrap() - 5.0).abs() < 1e-6, "{response:?}");
}
