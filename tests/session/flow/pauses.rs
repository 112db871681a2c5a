//! Pauses.

use super::device::{in_phase, screen};
use super::part_rig::pairs;
use super::rig::{DeviceMood, Rig, StoreMood};
use super::studies::plain;
use chrono::TimeDelta;
use study_session::outcome::{Event, Failure};
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

#[test]
fn a_session_that_is_over_is_not_paused_and_says_so() {
    let mut rig = Rig::new(plain());
    rig.until("End");
    let before = rig.journal.len();
    rig.send(Input::Pause);
    let why = rig.view().notice.unwrap();
    assert!(why.contains("the session is over"), "{why}");
    assert_eq!(rig.journal.len(), before);
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
    rig.send(Input::Pause).wait(50.0).send(Input::Advance);
    rig.wait(2.0).answer_page();
    let response = rig.events().find_map(|e| match e {
        Event::TrialDone { response_s, .. } => Some(*response_s),
        _ => None,
    });
    assert!((response.unwrap() - 5.0).abs() < 1e-6, "{response:?}");
}

/// What somebody does in a session.
type Does = fn(&mut Rig);

/// The failures because of a pause: trial, attempt, pause.
fn forgotten(rig: &Rig) -> Vec<(u32, u32, Option<f64>)> {
    let failed = rig.events().filter_map(|e| match e {
        Event::AttemptFailed {
            trial,
            attempt,
            failure: Failure::Interrupted,
            detail,
            paused_s,
            ..
        } if detail.starts_with("felt again") => Some((*trial, *attempt, *paused_s)),
        _ => None,
    });
    failed.collect()
}

fn paused_s(rig: &Rig) -> Option<f64> {
    rig.events().find_map(|e| match e {
        Event::TrialDone { paused_s, .. } => Some(*paused_s),
        _ => None,
    })?
}

#[test]
fn after_a_long_pause_a_trial_is_felt_again() {
    let pauses: [(&str, Does); 4] = [
        ("a process that was stopped", |rig| {
            rig.send(Input::StoodStill { seconds: 61.0 });
        }),
        ("a pause", |rig| {
            rig.send(Input::Pause).wait(61.0).send(Input::Advance);
        }),
        ("three short ones", |rig| {
            for _ in 0..3 {
                rig.send(Input::Pause).wait(21.0).send(Input::Advance);
            }
        }),
        ("a suspended computer", |rig| {
            rig.now.wall += TimeDelta::seconds(14_000);
            rig.wait(0.1);
        }),
    ];
    for (what, pause) in pauses {
        let mut rig = Rig::new(plain());
        rig.until("Form").wait(3.0);
        pause(&mut rig);
        assert_eq!(screen(&rig), "Reference", "{what}");
        let found = forgotten(&rig);
        let [(1, 1, Some(s))] = found[..] else {
            panic!("{what}: {found:?}");
        };
        assert!(s > 60.0, "{what}: {s}");
        rig.finish();
        rig.assert_whole();
        assert_eq!(rig.closed()[&1], Some(2), "{what}");
        assert_eq!(rig.positions(), [1, 2, 3, 4, 5, 6], "{what}");
        assert_eq!(paused_s(&rig), None, "{what}: of the second attempt");
    }
}

#[test]
fn a_short_pause_is_recorded() {
    let mut rig = Rig::new(plain());
    rig.until("Form").send(Input::Pause).wait(20.0);
    rig.send(Input::Advance).answer_page();
    assert_eq!(forgotten(&rig), []);
    assert!((paused_s(&rig).unwrap() - 20.0).abs() < 1e-6);
}

/// The pause has measured the standstill already.
#[test]
fn a_standstill_during_a_pause_counts_once() {
    let mut rig = Rig::new(plain());
    rig.until("Form").send(Input::Pause).wait(40.0);
    rig.send(Input::StoodStill { seconds: 40.0 });
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
    rig.answer_page();
    assert!((paused_s(&rig).unwrap() - 40.0).abs() < 1e-6);
}

/// Two intervals are compared with each other, not one of them with a memory.
#[test]
fn after_a_long_pause_between_two_intervals_both_are_felt_again() {
    /// A pause of so many seconds, and its end.
    type Between = (&'static str, Input, fn(&mut Rig, f64), fn(&mut Rig));
    let between: [Between; 3] = [
        (
            "a pause",
            Input::Pause,
            |rig, seconds| {
                rig.wait(seconds);
            },
            |rig| {
                rig.send(Input::Advance);
            },
        ),
        (
            "a disk that does not write",
            Input::SaveFailed("disk full".to_owned()),
            |rig, seconds| {
                rig.wait(seconds);
            },
            |rig| {
                let all = rig.all_on_disk();
                rig.send(all);
            },
        ),
        (
            "a suspended computer",
            Input::Tick,
            |rig, seconds| {
                rig.now.wall += TimeDelta::milliseconds((seconds * 1e3) as i64);
                rig.wait(0.1);
            },
            |_| (),
        ),
    ];
    for (what, begin, pause, end) in between {
        for (seconds, again) in [(40.0, false), (62.0, true)] {
            let mut rig = Rig::new(pairs("gap_s = 1.0"));
            rig.until("Playing");
            rig.device = DeviceMood::Silent;
            let playback = rig.playback;
            rig.send(Input::Advance).send(begin.clone());
            rig.store = StoreMood::Slow;
            rig.send(Input::DeviceStopped(playback))
                .send(Input::DeviceLoaded);
            pause(&mut rig, seconds);
            rig.effects.clear();
            end(&mut rig);
            rig.wait(2.0);
            let shown = format!("{what} of {seconds} s");
            assert_eq!(!rig.effects.contains(&Effect::Start), again, "{shown}");
            let found = forgotten(&rig);
            let failed: Vec<(u32, u32)> = found.iter().map(|(t, a, _)| (*t, *a)).collect();
            let expected: &[(u32, u32)] = if again { &[(1, 1)] } else { &[] };
            assert_eq!(failed, expected, "{shown}");
            if again {
                assert!(rig.effects.contains(&Effect::Limp), "{shown}");
                assert_eq!(screen(&rig), "Reference", "{shown}");
                assert!(found[0].2 > Some(60.0), "{shown}: {found:?}");
            }
            rig.finish();
            assert_eq!(rig.closed().len(), rig.schedule().len(), "{shown}");
        }
    }
}

#[test]
fn the_protocol_says_how_long_a_pause_may_be() {
    let mut protocol = plain();
    protocol.session.longest_pause_s = 600.0;
    let mut rig = Rig::new(protocol);
    rig.until("Form").send(Input::Pause).wait(500.0);
    rig.send(Input::Advance);
    assert_eq!(screen(&rig), "Form");
    rig.send(Input::Pause).wait(101.0).send(Input::Advance);
    assert_eq!(screen(&rig), "Reference");
}

/// Whoever stopped a trial and comes back much later does not rate it from memory.
#[test]
fn what_was_stopped_long_ago_is_not_rated() {
    let mut rig = Rig::new(plain());
    rig.until("Playing").send(Input::Stop).wait(59.0);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: true });
    rig.wait(2.0);
    assert_eq!(rig.view().screen, Screen::Stopped { can_rate: false });
    rig.send(Input::RateStopped);
    assert_eq!(screen(&rig), "Stopped");
    rig.send(Input::PlayAgain).finish();
    rig.assert_whole();
}

#[test]
fn a_playback_during_which_the_clock_jumps_forward_is_felt_again() {
    let mut rig = Rig::new(plain());
    rig.until("Playing");
    rig.effects.clear();
    rig.now.wall += TimeDelta::seconds(20);
    rig.wait(0.1);
    assert!(rig.effects.contains(&Effect::Limp));
    assert_eq!(screen(&rig), "Reference");
    rig.finish();
    rig.assert_whole();
    assert_eq!(rig.closed()[&1], Some(2));
}
