//! Simulated devices whose motors weigh themselves: the truth is that of the simulation.

use super::super::self_weigh::weigh;
use super::super::swing::{Swung, swing};
use super::*;
use study_base::rng::Stream;
use study_device::commission::{NoSelfWeighing, SelfWeighing, SwingNumbers, SwingPlan};
use study_device::firmware::Motor;
use study_plan::protocol::RenderingRules;
use study_session::outcome::SelfWeighed;

/// A handle and its motor.
#[derive(Debug, Clone, Copy)]
struct Built {
    mass_kg: f64,
    bearing_n_s_per_mm: f64,
    friction_n: f64,
    encoder_mm: f64,
    motor: Motor,
}

impl Built {
    fn draw(stream: &mut Stream) -> Self {
        let mut within = |low: f64, high: f64| low + (high - low) * stream.unit();
        Self {
            mass_kg: within(0.2, 1.0),
            bearing_n_s_per_mm: within(0.001, 0.004),
            friction_n: within(0.0, 0.3),
            encoder_mm: 10f64.powf(within(-3.0, 0.05f64.log10())),
            motor: Motor::default(),
        }
    }

    /// The same on another day: friction, damping, and what is at the handle differ.
    fn later(self, stream: &mut Stream, motor: Motor) -> Self {
        let mut within = |low: f64, high: f64| low + (high - low) * stream.unit();
        Self {
            mass_kg: self.mass_kg * within(0.99, 1.01),
            bearing_n_s_per_mm: self.bearing_n_s_per_mm * within(0.6, 1.5),
            friction_n: self.friction_n * within(0.6, 1.5),
            encoder_mm: self.encoder_mm,
            motor,
        }
    }

    fn device(self, seed: u64) -> Shared {
        let mut options = Options::seeded(seed);
        options.device.hand.slider_kg = self.mass_kg;
        options.device.hand.bearing_n_s_per_mm = self.bearing_n_s_per_mm;
        options.device.friction_n = self.friction_n;
        options.device.encoder_mm = self.encoder_mm;
        options.device.motor = self.motor;
        Shared::new(options)
    }
}

fn says_go(said: &str, _: &Shared) -> Typed {
    match said.contains("`go` to begin") {
        true => typed(0.5, "go"),
        false => Typed::new(),
    }
}

/// The swing of a commissioning, with the mass found as the command does.
fn commissioned_swing(built: Built, seed: u64) -> Result<SwingNumbers, String> {
    let mut device = built.device(seed);
    let (script, _) = Script::new(&device.clone(), Box::new(says_go));
    let mut rig = Rig::new(&mut device, Box::new(script));
    let mut plan = SwingPlan::first(0.3, built.friction_n, STROKE_MM);
    for _ in 0..4 {
        let found = match swing(&mut rig, plan, STROKE_MM) {
            Swung::Weighed(found) => found,
            Swung::Not(why) => return Err(why.to_string()),
            Swung::Trouble(why) => return Err(why),
        };
        if (found.apparent_kg / plan.mass_kg).ln().abs() < 1.25f64.ln() {
            return Ok(SwingNumbers { plan, found });
        }
        plan.mass_kg = found.apparent_kg;
    }
    Err("no plan".to_owned())
}

/// What a session finds; also where the handle has been.
fn before_session(built: Built, seed: u64, swing: SwingNumbers) -> (SelfWeighed, Place) {
    let device = built.device(seed);
    let (script, said) = Script::new(&device, Box::new(says_go));
    let mut own = device.clone();
    let mut rig = Rig::new(&mut own, Box::new(script));
    let numbers = Numbers {
        stroke_mm: Some(STROKE_MM),
        swing: Some(swing),
        ..Numbers::default()
    };
    let rules = RenderingRules::default();
    let found = weigh(&mut rig, "c1", &numbers, &rules);
    drop(rig);
    let found = found.unwrap_or_else(|_| panic!("{}", said.borrow()));
    (found, device.place())
}

/// The sorted sizes, and what is the median, the 95th percentile and the largest.
fn spread(mut all: Vec<f64>) -> [f64; 3] {
    all.iter_mut().for_each(|x| *x = x.abs());
    all.sort_by(f64::total_cmp);
    let at = |share: f64| all.get((share * (all.len() - 1) as f64) as usize).copied();
    [0.5, 0.95, 1.0].map(|share| at(share).unwrap_or(f64::NAN))
}

/// Devices with gains of 0.5 to 1.1 and lags of 0 to 20 ms, and as many right ones.
/// `STUDY_DEVICES` is their number.
#[test]
fn weak_and_late_motors_are_found_and_no_right_one_is_accused() {
    let number = std::env::var("STUDY_DEVICES").ok();
    let number: usize = number.map_or(12, |n| n.parse().unwrap());
    let (mut gains, mut lags, mut accused) = (Vec::new(), Vec::new(), Vec::new());
    let (mut not_possible, mut unseen) = (Vec::new(), Vec::new());
    for n in 0..number {
        let mut stream = Stream::new(2007, &["self-weighing", &n.to_string()]);
        let built = Built::draw(&mut stream);
        let swing = match commissioned_swing(built, n as u64) {
            Ok(swing) => swing,
            Err(why) => {
                not_possible.push(format!("{n} {built:?}: {why}"));
                continue;
            }
        };
        let right = built.later(&mut stream, Motor::default());
        let (found, place) = before_session(right, n as u64 + 1000, swing);
        assert_eq!(place.stops, 0, "{n} {right:?}");
        if found.why.is_some() {
            accused.push(format!("{n} {right:?}: {found:?} {swing:?}"));
        }
        let motor = Motor {
            gain: 0.5 + 0.6 * stream.unit(),
            lag_s: 0.02 * stream.unit(),
        };
        let wrong = built.later(&mut stream, motor);
        let (found, place) = before_session(wrong, n as u64 + 2000, swing);
        assert_eq!(place.stops, 0, "{n} {wrong:?}");
        match (found.gain, found.lag_ms) {
            (Some(gain), Some(lag_ms)) => {
                // what is at the handle counts as a gain
                let apparent = motor.gain * built.mass_kg / wrong.mass_kg;
                gains.push(gain / apparent - 1.0);
                lags.push(lag_ms - 1e3 * motor.lag_s);
                if gains.last().unwrap().abs() > 0.03 || lags.last().unwrap().abs() > 3.0 {
                    println!("{n} {wrong:?}: {found:?} {swing:?}");
                }
            }
            _ => unseen.push(format!("{n} {wrong:?}: {found:?}")),
        }
        if (n + 1) % 20 == 0 {
            println!(
                "{} of {number}: gain off by {:.4?}, lag by {:.2?} ms; {} accused",
                n + 1,
                spread(gains.clone()),
                spread(lags.clone()),
                accused.len()
            );
        }
        let is_wrong = !(0.9..=1.1).contains(&motor.gain) || motor.lag_s > 0.008;
        if is_wrong && found.why.is_none() {
            unseen.push(format!("{n} {wrong:?}: {found:?}"));
        }
    }
    println!(
        "{number} devices: gain off by {:.4?}, lag by {:.2?} ms (median, 95 %, most); {} accused, {} without a swing, {} unseen",
        spread(gains.clone()),
        spread(lags.clone()),
        accused.len(),
        not_possible.len(),
        unseen.len()
    );
    println!("{not_possible:#?}\n{unseen:#?}");
    assert!(accused.is_empty(), "{accused:#?}");
    assert!(unseen.is_empty(), "{unseen:#?}");
    assert!(not_possible.len() * 50 <= number * 2, "{not_possible:#?}");
    assert!(spread(gains)[2] < 0.03);
    assert!(spread(lags)[2] < 3.0);
}

/// What is found before a session with somebody; also what was said.
fn asked(device: &Shared, numbers: &Numbers, person: Person<'_>) -> (SelfWeighed, String) {
    let (script, said) = Script::new(device, person);
    let mut own = device.clone();
    let mut rig = Rig::new(&mut own, Box::new(script));
    let found = weigh(&mut rig, "c1", numbers, &RenderingRules::default()).unwrap();
    drop(rig);
    let said = said.borrow().clone();
    (found, said)
}

/// A device and the numbers of its commissioning.
fn commissioned_before() -> (Shared, Numbers) {
    let built = Built::draw(&mut Stream::new(5, &["one"]));
    let numbers = Numbers {
        stroke_mm: Some(STROKE_MM),
        swing: Some(commissioned_swing(built, 5).unwrap()),
        ..Numbers::default()
    };
    (built.device(6), numbers)
}

#[test]
fn a_hand_on_the_handle_is_said_and_nothing_is_compared() {
    let (device, numbers) = commissioned_before();
    let person = |said: &str, device: &Shared| {
        device.lock().firmware().hold_at(17.5);
        says_go(said, device)
    };
    let (found, said) = asked(&device, &numbers, Box::new(person));
    assert!(!found.ok && found.gain.is_none());
    assert!(found.why.unwrap().contains("a hand was at it"));
    assert_eq!(said.matches("Type `go` to begin").count(), 3);
    // Left out, or without a commissioning, nothing is known.
    let person = |said: &str, _: &Shared| match said.contains("`go` to begin") {
        true => typed(0.5, "skip"),
        false => Typed::new(),
    };
    let (found, _) = asked(&device, &numbers, Box::new(person));
    assert!(found.why.unwrap().contains("left out"));
    let loads = device.loads();
    let (found, said) = asked(&device, &Numbers::default(), Box::new(says_go));
    assert!(!found.ok && found.why.unwrap().contains("has no swing"));
    assert_eq!((said.as_str(), device.loads()), ("", loads));
}

/// A computer that was late says nothing about the motor; another fault is told.
#[test]
fn the_swings_are_repeated_if_this_computer_was_late() {
    let (device, numbers) = commissioned_before();
    // each swing is the second of two playbacks
    device.trips_at(4, Fault::Watchdog);
    let (found, said) = asked(&device, &numbers, Box::new(says_go));
    assert!(found.ok, "{found:?}");
    assert_eq!(said.matches("This computer was late").count(), 1, "{said}");
    assert!(said.ends_with("The motor is as it was.\n"), "{said}");
    let (device, numbers) = commissioned_before();
    device.trips_at(4, Fault::Encoder);
    let (found, _) = asked(&device, &numbers, Box::new(says_go));
    let why = found.why.unwrap();
    assert!(why.starts_with("the device gave up: "), "{why}");
    assert!(why.contains(Fault::Encoder.as_str()), "{why}");
    assert_eq!(device.lock().held_n(), 0.0);
}

#[test]
fn a_handle_with_much_friction_has_no_swing() {
    let built = Built {
        mass_kg: 0.2,
        friction_n: 3.0,
        ..Built::draw(&mut Stream::new(5, &["one"]))
    };
    let why = commissioned_swing(built, 5).unwrap_err();
    let said = NoSelfWeighing::Friction {
        friction_n: 3.0,
        mass_kg: 0.3,
    };
    assert_eq!(why, said.to_string());
    // and what is found is read again as it was written
    let built = Built::draw(&mut Stream::new(6, &["one"]));
    let swing = commissioned_swing(built, 5).unwrap();
    let text = serde_json::to_string(&swing).unwrap();
    assert_eq!(serde_json::from_str::<SwingNumbers>(&text).unwrap(), swing);
    let SelfWeighing { alone_kg, .. } = swing.found;
    assert!((alone_kg[0] / alone_kg[1] - 1.0).abs() < 0.06);
}

/// The page with the wrong devices, and where its table of physical checks begins.
const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/wrong-devices.md");
const HEAD: &str = "| device | commission | self-weighing |\n|---|---|---|\n";

/// What commissioning and self-weighing say of each device that no telemetry shows; the page has it.
/// `UPDATE_DOCS=1` writes it.
#[test]
fn the_page_says_what_finds_each_device_that_no_telemetry_shows() {
    let right = Built {
        mass_kg: 0.6,
        bearing_n_s_per_mm: 0.002,
        friction_n: 0.05,
        encoder_mm: 0.005,
        motor: Motor::default(),
    };
    let swing = commissioned_swing(right, 5).unwrap();
    let mut table = HEAD.to_owned();
    for (wrong, name, _) in Wrong::ALL.iter().filter(|(wrong, ..)| wrong.is_physical()) {
        let found = commissioned(Some(*wrong), Box::new(skips_what_cannot_be));
        let failed = found.steps.iter().filter(|s| s.outcome == Outcome::Failed);
        let failed: Vec<String> = failed.map(|s| format!("{}: {}", s.what, s.seen)).collect();
        assert!(!failed.is_empty(), "{name}: {:#?}", found.steps);
        let mut options = Options::seeded(9);
        options.device.wrong = Some(WrongLoads {
            wrong: *wrong,
            loads: [1, u32::MAX],
        });
        let device = Shared::new(options);
        let (script, _) = Script::new(&device, Box::new(says_go));
        let mut own = device.clone();
        let mut rig = Rig::new(&mut own, Box::new(script));
        let numbers = Numbers {
            stroke_mm: Some(STROKE_MM),
            swing: Some(swing),
            ..Numbers::default()
        };
        let weighed = weigh(&mut rig, "c1", &numbers, &RenderingRules::default()).unwrap();
        let said = weighed.why.unwrap_or_else(|| "as it was".to_owned());
        table.push_str(&format!("| `{name}` | {} | {said} |\n", failed.join("; ")));
        assert_eq!(device.place().stops, 0, "{name}");
    }
    let page = std::fs::read_to_string(PAGE).unwrap();
    let (before, _) = page.split_once(HEAD).unwrap();
    let wanted = format!("{before}{table}");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(PAGE, &wanted).unwrap();
    } else {
        assert_eq!(page, wanted, "UPDATE_DOCS=1 writes it");
    }
}
