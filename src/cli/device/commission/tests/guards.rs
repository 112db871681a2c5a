//! What ends a motion, and what forbids one.

use super::*;
use study_device::commission::VirtualSpring;

/// Whenever Ctrl-C is pressed, also while nothing is asked: the device is limp at once and loads
/// nothing more, and what was interrupted is no failure of the device.
#[test]
fn after_a_signal_nothing_moves_and_nothing_is_held_against_the_device() {
    let mut moments = 0;
    for question in [
        "`go` to begin",
        "Pull slowly",
        "a first place",
        "type `off`",
    ] {
        for after_s in [0.5, 1.02, 1.2, 1.5, 1.7, 2.0, 3.05, 3.3] {
            let mut loads = None;
            let mut at = 0;
            let found = commissioned(
                None,
                Box::new(|said, device| {
                    let mut answer = willing(said, device);
                    if said.contains(question) {
                        at += 1;
                        // the second motion, so that something was found before
                        if at == 2 || question == "a first place" {
                            answer.push((after_s, "<ctrl-c>".to_owned()));
                        }
                    }
                    loads = Some(device.loads());
                    answer
                }),
            );
            let Some(ended) = found.ended else {
                panic!("{question} {after_s}: it went on\n{}", found.said)
            };
            assert_eq!(ended, "SIGINT ended it before all steps were done");
            let failed = found.steps.iter().any(|s| s.outcome == Outcome::Failed);
            assert!(!failed, "{question} {after_s}: {:#?}", found.steps);
            moments += 1;
        }
    }
    assert_eq!(moments, 32);
}

/// A handle that was pulled too far is no emergency switch.
#[test]
fn a_device_that_stops_because_of_its_motion_has_not_noticed_the_switch() {
    let mut pressed = 0;
    let found = commissioned(
        None,
        Box::new(|said, device| {
            if said.contains("press the emergency switch") {
                pressed += 1;
                if pressed < 3 {
                    device.lock().trip(Fault::Velocity);
                    return typed(2.0, "yes");
                }
            }
            willing(said, device)
        }),
    );
    assert_eq!(pressed, 3);
    let again = "went limp before the switch was seen: velocity limit exceeded";
    assert_eq!(found.said.matches(again).count(), 2, "{}", found.said);
    assert!(found.passed(), "{:#?}", found.steps);
    let always = |said: &str, device: &Shared| {
        if said.contains("press the emergency switch") {
            device.lock().trip(Fault::Stroke);
            return typed(2.0, "yes");
        }
        willing(said, device)
    };
    let found = commissioned(None, Box::new(always));
    assert_eq!(found.outcome("emergency stop"), Outcome::Failed);
    assert_eq!(found.outcome("force towards −x"), Outcome::NotDone);
}

#[test]
fn a_motor_without_samples_is_switched_off() {
    let found = commissioned(
        None,
        Box::new(|said, device| {
            device.mute(
                said.contains("Force 2 of 3, force towards −x") || said.contains("Pull slowly"),
            );
            willing(said, device)
        }),
    );
    let step = found.step("force towards −x");
    assert_eq!(step.outcome, Outcome::Failed);
    assert!(step.seen.contains("reports no"), "{step:#?}");
    let mut held_n = f64::NAN;
    let found = commissioned(
        None,
        Box::new(|said, device| {
            if said.contains("Pull slowly") {
                device.mute(true);
                device.lock().firmware().pull(1.0);
                return typed(6.0, "1 N");
            }
            if said.contains("reports no samples") {
                held_n = device.lock().held_n();
            }
            device.mute(false);
            willing(said, device)
        }),
    );
    assert_eq!(held_n, 0.0);
    let step = found.step("force towards −x");
    assert!(
        step.seen.contains("no samples while its motor is on"),
        "{step:#?}"
    );
}

/// Between the reading of the position and the force somebody moves the handle: it is asked for
/// again.
#[test]
fn a_handle_that_was_moved_feels_no_force() {
    let device = Shared::new(Options::seeded(3));
    let (script, _) = Script::new(&device, Box::new(|_, _| Typed::new()));
    let mut own = device.clone();
    let mut rig = Rig::new(&mut own, Box::new(script));
    let [low, ..] = study_device::commission::stages(12.0, rig.limits);
    let spring = VirtualSpring::for_stage(low, 10.0, STROKE_MM).unwrap();
    device.lock().firmware().hold_at(25.0);
    rig.watch(Duration::from_secs(3));
    let why = rig.hold(&spring).unwrap_err();
    assert_eq!(why, "the handle was moved before the force began");
    assert!(steps::by_hand(&why));
    // the ramp had just begun
    let held_n = device.lock().held_n();
    assert!(held_n.abs() < 0.1, "{held_n}");
    rig.settle(Duration::from_millis(100));
    let held_n = device.lock().held_n();
    assert_eq!(held_n, 0.0);
}

/// A position that counts the wrong way round or has another scale: a spring would push, or its
/// bounds mean nothing.
#[test]
fn without_a_right_position_there_is_no_or_no_higher_force() {
    let found = commissioned(Some(Wrong::Mirrored), Box::new(willing));
    for what in ["emergency stop", "force towards −x", "force towards +x"] {
        let step = found.step(what);
        assert_eq!(step.outcome, Outcome::NotDone);
        assert!(step.seen.contains("shows the scale -1.000"), "{step:#?}");
    }
    assert!(found.numbers.travels.is_empty());
    let skips = |said: &str, device: &Shared| match said.contains("a first place") {
        true => typed(1.0, "skip"),
        false => willing(said, device),
    };
    for found in [
        commissioned(Some(Wrong::ShiftedPosition), Box::new(willing)),
        commissioned(None, Box::new(skips)),
    ] {
        let step = found.step("force towards +x");
        assert!(
            step.seen.contains("the position is not shown to be right"),
            "{step:#?}"
        );
        let most_n = found.numbers.travels.iter().map(|t| t.force_n);
        assert!(most_n.fold(0.0, f64::max) < 4.0);
    }
}

/// Somebody who weighs more than the device commands sees no higher force.
#[test]
fn a_motor_that_is_too_strong_is_asked_for_no_more() {
    let found = commissioned(
        None,
        Box::new(|said, device| {
            let usual = willing(said, device);
            match said.contains("Pull slowly") {
                true => typed(6.0, format!("{:.2} N", 1.3 * asked_n(said).0)),
                false => usual,
            }
        }),
    );
    for what in ["force towards −x", "force towards +x"] {
        let step = found.step(what);
        assert_eq!(step.outcome, Outcome::Failed);
        assert!(step.seen.contains("more force than commanded"), "{step:#?}");
    }
    assert_eq!(found.numbers.weighings.len(), 2);
}

/// A program that was stopped for a while, such as by Ctrl-Z, switches the motor off when it goes on;
/// the step is done again.
#[test]
fn after_this_program_stood_still_the_motor_is_off() {
    let device = Shared::new(Options::seeded(3));
    let person = |said: &str, _: &Shared| match said.contains("still") {
        true => typed(0.0, "<late>"),
        false => Typed::new(),
    };
    let (script, _) = Script::new(&device, Box::new(person));
    let mut own = device.clone();
    let mut rig = Rig::new(&mut own, Box::new(script));
    let [low, ..] = study_device::commission::stages(12.0, rig.limits);
    let at_mm = device.place().x_mm;
    let spring = VirtualSpring::for_stage(low, at_mm, STROKE_MM).unwrap();
    rig.hold(&spring).unwrap();
    rig.say("it stands still").unwrap();
    rig.watch(Duration::from_millis(100));
    let why = rig.take_trouble().unwrap();
    assert!(is_late(&why), "{why}");
    rig.settle(Duration::from_millis(100));
    let held_n = device.lock().held_n();
    assert_eq!(held_n, 0.0);
}
