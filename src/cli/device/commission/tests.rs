//! The dialog with a scripted person in virtual time: the person pulls at the simulated handle,
//! and the test knows where the handle really is.

mod guards;
mod script;
mod self_weigh;

use super::*;
use script::{Person, Script, Shared, Typed, typed};
use std::cell::RefCell;
use std::rc::Rc;
use study_device::commission::DirectionFit;
use study_device::firmware::{Place, Wrong, WrongLoads};
use study_device::virtual_device::Options;

const STROKE_MM: [f64; 2] = [-20.0, 60.0];

/// The force and the direction that a question asks for.
fn asked_n(question: &str) -> (f64, f64) {
    let (_, rest) = question.split_once("Pull slowly towards ").unwrap();
    let sign = if rest.starts_with("+x") { 1.0 } else { -1.0 };
    let (_, rest) = rest.split_once("with about ").unwrap();
    let force_n: f64 = rest.split(' ').next().unwrap().parse().unwrap();
    (force_n, sign)
}

/// Somebody who does everything that is asked, on a handle that is free otherwise.
fn willing(said: &str, device: &Shared) -> Typed {
    let at = |x_mm: f64| {
        device.lock().firmware().hold_at(x_mm);
        typed(3.0, format!("{x_mm}"))
    };
    if said.contains("Nothing moves before you type") {
        Typed::new()
    } else if said.contains("a first place") {
        at(0.0)
    } else if said.contains("a second place") {
        at(30.0)
    } else if said.contains("Which force moves it") {
        device.lock().firmware().hold_at(17.5);
        typed(1.0, "0,05")
    } else if said.contains("type `on`") {
        typed(1.0, "on")
    } else if said.contains("What do you weigh with") {
        typed(1.0, "gauge 0.02 N")
    } else if said.contains("press the emergency switch") {
        device.lock().trip(Fault::External);
        typed(2.0, "yes")
    } else if said.contains("release the switch") {
        typed(1.0, "released")
    } else if said.contains("still without force") {
        typed(1.0, "yes")
    } else if said.contains("Pull slowly") {
        let (force_n, sign) = asked_n(said);
        device.lock().firmware().pull(sign * force_n);
        typed(6.0, format!("{force_n} N"))
    } else if said.contains("type `off`") {
        device.lock().firmware().pull(0.0);
        typed(3.0, "off")
    } else if said.contains("too near to a stop") || said.contains("bring it between") {
        device.lock().firmware().hold_at(17.5);
        typed(4.0, "go")
    } else if said.contains("`go`") {
        device.lock().firmware().let_go();
        typed(1.0, "go")
    } else {
        Typed::new()
    }
}

/// What a dialog came to.
struct Found {
    steps: Vec<Step>,
    numbers: Numbers,
    ended: Option<String>,
    said: String,
    place: Place,
}

impl Found {
    fn outcome(&self, what: &str) -> Outcome {
        self.step(what).outcome
    }

    fn step(&self, what: &str) -> &Step {
        let found = self.steps.iter().find(|step| step.what == what);
        found.unwrap_or_else(|| panic!("{what}: {:#?}", self.steps))
    }

    fn passed(&self) -> bool {
        self.steps
            .iter()
            .all(|step| step.outcome == Outcome::Passed)
    }
}

fn commissioned(wrong: Option<Wrong>, person: Person<'_>) -> Found {
    let mut options = Options::seeded(3);
    options.device.wrong = wrong.map(|wrong| WrongLoads {
        wrong,
        loads: [1, u32::MAX],
    });
    let device = Shared::new(options);
    let (script, said) = Script::new(&device, person);
    let mut own = device.clone();
    let mut rig = Rig::new(&mut own, Box::new(script));
    let tested = Tested::of(&device);
    let (steps, numbers, ended) = dialog(&mut rig, &tested, Some(STROKE_MM), None);
    drop(rig);
    assert_eq!(device.lock().held_n(), 0.0, "limp at the end");
    Found {
        steps,
        numbers,
        ended: ended.map(|stop| stop.failure().message),
        said: said.borrow().clone(),
        place: device.place(),
    }
}

#[test]
fn the_right_device_passes_with_its_numbers() {
    let found = commissioned(None, Box::new(willing));
    assert!(found.passed(), "{:#?}\n{}", found.steps, found.said);
    let numbers = &found.numbers;
    assert_eq!((numbers.weighings.len(), numbers.directions.len()), (6, 2));
    for DirectionFit {
        gain,
        offset_n,
        saturation_n,
        largest_n,
        ..
    } in &numbers.directions
    {
        assert!((gain - 1.0).abs() < 0.03, "{gain}");
        assert!(offset_n.unwrap().abs() < 0.15 && saturation_n.is_none());
        assert!((largest_n - 12.0).abs() < 1e-9);
    }
    assert!((numbers.ruler.unwrap().scale - 1.0).abs() < 0.01);
    assert_eq!(numbers.friction_n, Some(0.05));
    assert!(numbers.emergency_stop.as_ref().unwrap().noticed.is_some());
    // low limits first
    let limits: Vec<[f64; 2]> = (numbers.travels.iter())
        .map(|t| [t.force_n, t.velocity_mm_s])
        .collect();
    for direction in limits[1..].chunks(3) {
        let rises = direction
            .windows(2)
            .all(|w| w[0][0] < w[1][0] && w[0][1] < w[1][1]);
        assert!(rises, "{limits:?}");
    }
    // each motion is asked for, and each question stands for one motion
    let plays = numbers.travels.len();
    assert_eq!(found.said.matches("Type `go` to begin").count(), plays + 1);
    let swing = numbers.swing.unwrap().found;
    assert!((swing.apparent_kg / 0.6 - 1.0).abs() < 0.02, "{swing:?}");
    assert!(swing.lag_s.abs() < 2e-3, "{swing:?}");
    assert!(found.place.stops == 0, "{:?}", found.place);
    // and the record is read again as it was written
    let text = serde_json::to_string(numbers).unwrap();
    assert_eq!(&serde_json::from_str::<Numbers>(&text).unwrap(), numbers);
}

/// Wrong devices that no telemetry shows.
#[test]
fn wrong_devices_are_found_with_their_numbers() {
    for (wrong, step, seen) in [
        (Wrong::HalfPosition, "ruler", "scale 0.500"),
        (Wrong::ShiftedPosition, "ruler", "off by 3.00 mm"),
        (Wrong::Mirrored, "ruler", "scale -1.000"),
        (
            Wrong::DoubleForce,
            "force towards −x",
            "N where the spring has",
        ),
        (
            Wrong::Reversed,
            "force towards −x",
            "1.5 N: it did not hold",
        ),
        (Wrong::WeakMotor, "force towards −x", "gain 0.5"),
        (Wrong::WeakMotor, "force towards +x", "gain 0.5"),
        (Wrong::WeakMotorBackwards, "force towards +x", "gain 0.5"),
        (Wrong::LateMotor, "self-weighing", "lag "),
        (
            Wrong::SaturatedMotor,
            "force towards −x",
            "12.0 N: it did not hold",
        ),
        (
            Wrong::SaturatedMotor,
            "force towards +x",
            "12.0 N: it did not hold",
        ),
    ] {
        let found = commissioned(Some(wrong), Box::new(skips_what_cannot_be));
        let own = found.step(step);
        assert_eq!(
            own.outcome,
            Outcome::Failed,
            "{wrong:?}: {:#?}\n{}",
            found.steps,
            found.said
        );
        assert!(own.seen.contains(seen), "{wrong:?}: {own:#?}");
    }
    let found = commissioned(Some(Wrong::WeakMotorBackwards), Box::new(willing));
    assert_eq!(found.outcome("force towards −x"), Outcome::Passed);
}

/// As [`willing`], but gives up where the position counts the wrong way round.
fn skips_what_cannot_be(said: &str, device: &Shared) -> Typed {
    if said.contains("the position counts the wrong way round") {
        device.lock().firmware().pull(0.0);
        return typed(3.0, "skip");
    }
    willing(said, device)
}

/// Every question to which something can be typed is refused once; the record then says so, and it
/// is not passed.
#[test]
fn every_question_can_be_refused_once() {
    let asks = |said: &str, device: &Shared| !willing(said, device).is_empty();
    let questions = Rc::new(RefCell::new(0));
    let count = Rc::clone(&questions);
    let all = commissioned(
        None,
        Box::new(move |said, device| {
            *count.borrow_mut() += usize::from(asks(said, device));
            willing(said, device)
        }),
    );
    assert!(all.passed());
    let questions = *questions.borrow();
    assert!(questions > 25, "{questions}");
    let mut refused = Vec::new();
    for nth in 0..questions {
        let mut at = 0;
        let mut what = String::new();
        let found = commissioned(
            None,
            Box::new(|said, device| {
                let answer = willing(said, device);
                at += usize::from(!answer.is_empty());
                if answer.is_empty() || at != nth + 1 {
                    return answer;
                }
                said.clone_into(&mut what);
                typed(1.0, "skip")
            }),
        );
        // the force ends anyway when it is read
        let is_end = what.contains("type `off`");
        assert_eq!(found.passed(), is_end, "{nth}: {what}: {:#?}", found.steps);
        let open = found.steps.iter().filter(|s| s.outcome == Outcome::NotDone);
        refused.extend(open.map(|step| step.what));
        assert!(
            found.steps.iter().all(|s| s.outcome != Outcome::Failed),
            "{nth}: {what}: {:#?}",
            found.steps
        );
        assert!(found.ended.is_none());
    }
    for what in [
        "ruler",
        "unpowered friction",
        "emergency stop",
        "force towards −x",
        "force towards +x",
    ] {
        assert!(refused.contains(&what), "{what}");
    }
}

#[test]
fn what_was_typed_ahead_is_dropped() {
    // `go` for everything, long before
    let found = commissioned(
        None,
        Box::new(|said, device| {
            let mut answer = willing(said, device);
            if said.contains("Nothing moves before") {
                answer = (0..50).flat_map(|_| typed(0.0, "go")).collect();
            } else if said.contains("`go`") {
                // an answer, and three more for what comes
                answer.extend(["go", "yes", "1 N"].map(|line| (1.0, line.to_owned())));
            }
            answer
        }),
    );
    assert!(found.passed(), "{:#?}\n{}", found.steps, found.said);
    assert_eq!(found.said.matches("Type `go` to begin").count(), 8);
    // Enter alone, or another word, begins nothing
    let mut wrong = ["", "yes", "ok"].into_iter();
    let found = commissioned(
        None,
        Box::new(|said, device| match said.contains("`go` to begin") {
            true => typed(1.0, wrong.next().unwrap_or("skip")),
            false => willing(said, device),
        }),
    );
    assert!(found.numbers.travels.is_empty() && found.numbers.weighings.is_empty());
    assert_eq!(found.said.matches("one of go is needed").count(), 3);
}

#[test]
fn an_emergency_stop_that_is_not_right_fails_and_stops_higher_forces() {
    // it cuts the motor's power, but the device does not notice
    let unnoticed = |said: &str, device: &Shared| match said.contains("press the emergency switch")
    {
        true => typed(2.0, "yes"),
        false => willing(said, device),
    };
    let found = commissioned(None, Box::new(unnoticed));
    let stop = found.step("emergency stop");
    assert_eq!(stop.outcome, Outcome::Failed, "{stop:#?}");
    assert!(stop.seen.contains("did NOT notice"), "{stop:#?}");
    for what in ["force towards −x", "force towards +x"] {
        let step = found.step(what);
        assert_eq!(step.outcome, Outcome::NotDone);
        assert!(
            step.seen
                .contains("the emergency stop is not shown to work"),
            "{step:#?}"
        );
    }
    let most_n = found
        .numbers
        .travels
        .iter()
        .map(|t| t.force_n)
        .fold(0.0, f64::max);
    assert!(most_n < 4.0, "{most_n}");
    for (question, answer, seen) in [
        ("press the emergency switch", "no", "the force was NOT gone"),
        ("still without force", "no", "FORCE AGAIN"),
    ] {
        let found = commissioned(
            None,
            Box::new(|said, device| {
                let usual = willing(said, device);
                match said.contains(question) {
                    true => typed(1.0, answer),
                    false => usual,
                }
            }),
        );
        let stop = found.step("emergency stop");
        assert_eq!(stop.outcome, Outcome::Failed);
        assert!(stop.seen.contains(seen), "{stop:#?}");
    }
}

#[test]
fn the_device_is_limp_before_the_switch_is_to_be_released() {
    let held = Rc::new(RefCell::new(Vec::new()));
    let seen = Rc::clone(&held);
    let found = commissioned(
        None,
        Box::new(move |said, device| {
            if said.contains("press the emergency switch") {
                // the switch does not reach the device, and the handle is pulled
                device.lock().firmware().pull(1.0);
                return typed(3.0, "yes");
            }
            if said.contains("release the switch") {
                seen.borrow_mut().push(device.lock().held_n());
                device.lock().firmware().pull(0.0);
            }
            willing(said, device)
        }),
    );
    assert_eq!(*held.borrow(), [0.0]);
    assert_eq!(found.outcome("emergency stop"), Outcome::Failed);
}

/// The end of the input, which is also that of a closed terminal, and a panic: the device is limp, and
/// what was found is kept.
#[test]
fn whatever_ends_the_dialog_the_device_is_limp() {
    // while somebody pulls at the second force
    let mut asked = 0;
    let found = commissioned(
        None,
        Box::new(|said, device| {
            asked += usize::from(said.contains("Pull slowly"));
            match (asked, said.contains("a number with its unit")) {
                (2, true) => {
                    assert!(device.lock().held_n().abs() > 3.0, "it holds");
                    typed(0.0, "<end>")
                }
                (2, false) if said.contains("Pull slowly") => {
                    willing(said, device);
                    typed(4.0, "?")
                }
                _ => willing(said, device),
            }
        }),
    );
    assert_eq!(
        found.ended.as_deref(),
        Some("the input ended before all steps were done")
    );
    assert_eq!(found.outcome("ruler"), Outcome::Passed);
    assert_eq!(found.step("force towards +x").seen, "not reached");
    let device = Shared::new(Options::seeded(3));
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let person = |said: &str, device: &Shared| match said.contains("a number with its unit") {
            true => {
                assert!(device.lock().held_n().abs() > 0.5, "it holds");
                typed(0.0, "<panic>")
            }
            false if said.contains("Pull slowly") => {
                willing(said, device);
                typed(4.0, "?")
            }
            false => willing(said, device),
        };
        let (script, _) = Script::new(&device, Box::new(person));
        let mut own = device.clone();
        let mut rig = Rig::new(&mut own, Box::new(script));
        let tested = Tested::of(&device);
        dialog(&mut rig, &tested, Some(STROKE_MM), None)
    }));
    assert!(result.is_err());
    // the dialog had gone on by one turn since its last poll
    device.poll_after(Duration::from_millis(50));
    assert_eq!(device.lock().held_n(), 0.0);
}

/// A handle that nobody pulls stays where it is, whatever the motor does with the force; one that
/// is let go at the farthest place comes back and runs into no stop.
#[test]
fn a_free_handle_never_hits_a_stop() {
    let wrongs = [
        None,
        Some(Wrong::WeakMotor),
        Some(Wrong::WeakMotorBackwards),
        Some(Wrong::SaturatedMotor),
        Some(Wrong::LateMotor),
        Some(Wrong::DoubleForce),
        Some(Wrong::Mirrored),
        Some(Wrong::Biased),
        Some(Wrong::MoreDamping),
        Some(Wrong::Reversed),
    ];
    for friction_n in [0.0, 0.05, 0.5] {
        for wrong in wrongs {
            for lets_go in [false, true] {
                let mut options = Options::seeded(7);
                options.device.friction_n = friction_n;
                options.device.wrong = wrong.map(|wrong| WrongLoads {
                    wrong,
                    loads: [1, u32::MAX],
                });
                let device = Shared::new(options);
                let (script, _) = Script::new(&device, Box::new(willing));
                let mut own = device.clone();
                let mut rig = Rig::new(&mut own, Box::new(script));
                let mut bench = Bench {
                    numbers: Numbers {
                        stroke_mm: Some(STROKE_MM),
                        instrument: weigh::ask_instrument(&mut rig).unwrap(),
                        ..Numbers::default()
                    },
                    largest_n: 12.0,
                };
                bench.numbers.emergency_stop = Some(study_device::commission::EmergencyStop {
                    force_gone: true,
                    noticed: Some("it did".to_owned()),
                    limp_before_release: true,
                    limp_after_release: Some(true),
                });
                for side in Side::BOTH {
                    for stage in study_device::commission::stages(12.0, rig.limits) {
                        let held = steps::hold_here(&mut rig, &bench, stage).unwrap();
                        // what a wrong motor holds as well
                        let pull_n = side.against().sign() * -0.4 * stage.force_n;
                        if lets_go && held.is_ok() {
                            device.lock().firmware().pull(pull_n);
                            rig.watch(Duration::from_secs(4));
                            device.lock().firmware().pull(0.0);
                        }
                        rig.watch(Duration::from_secs(3));
                        rig.limp();
                        rig.watch(Duration::from_secs(3));
                        let place = device.place();
                        assert_eq!(
                            place.stops, 0,
                            "{wrong:?} {friction_n} {stage:?}: {place:?}"
                        );
                        device.lock().firmware().hold_at(17.5);
                        rig.position_mm(Some(STROKE_MM)).ok();
                        rig.watch(Duration::from_secs(2));
                        device.lock().firmware().let_go();
                    }
                }
            }
        }
    }
}
