//! The steps without a scale: ruler, friction and emergency stop.

use super::rig::{MOVED_BEFORE, Rig, Stop, UNREST, safe};
use super::{Bench, Made, failed, is_late, is_of_motion, judged, left_out};
use std::time::Duration;
use study_device::commission::{
    EmergencyStop, ORIGIN_MM, Ruler, SCALE_ERROR, Stage, VirtualSpring, stages,
};

/// Least distance of the two places on the ruler, mm.
const APART_MM: f64 = 10.0;
/// Largest believed coordinate of a ruler, mm.
const RULER_MM: f64 = 2000.0;
/// A stroke shorter than this is none, mm.
const LEAST_STROKE_MM: f64 = 1.0;
/// How long a device is watched after the switch was released.
const AFTER: Duration = Duration::from_secs(1);
/// How often the handle is asked to be brought to the middle.
const TRIES: u32 = 5;

/// What an emergency stop has to do.
const STOP_REQUIRED: &str = "the switch takes the force away at once, the device notices it, and there is no force after the release";

/// A number within bounds.
fn number(given: &str, bounds: [f64; 2]) -> Result<f64, String> {
    match given.replace(',', ".").parse::<f64>() {
        Ok(x) if (bounds[0]..=bounds[1]).contains(&x) => Ok(x),
        _ => Err(format!(
            "a number from {} to {} is needed",
            bounds[0], bounds[1]
        )),
    }
}

/// Between which stops the handle moves: as the device tells, or as it is moved by hand.
pub(super) fn stroke(rig: &mut Rig<'_>, bench: &mut Bench) -> Result<Made, Stop> {
    let what = "stroke";
    let required = "known";
    if let Some([low, high]) = bench.numbers.stroke_mm {
        return Ok(judged(
            what,
            required,
            true,
            format!("{low} to {high} mm, as the device tells"),
        ));
    }
    rig.say("\nStroke. No force. The device does not tell where its stops are.")?;
    let mut ends = Vec::new();
    for which in ["one stop", "the other stop"] {
        if !rig.may_go(&format!(
            "Bring the handle to {which} by hand and leave it there. The position is read, without force."
        ))? {
            return Ok(left_out(what, required));
        }
        match rig.position_mm(None) {
            Ok(x_mm) => ends.push(x_mm),
            Err(why) => return Ok(failed(what, required, why)),
        }
    }
    ends.sort_by(f64::total_cmp);
    let stroke = [ends[0], ends[1]];
    let ok = stroke[1] - stroke[0] >= LEAST_STROKE_MM;
    bench.numbers.stroke_mm = ok.then_some(stroke);
    Ok(judged(
        what,
        required,
        ok,
        format!("{:.2} to {:.2} mm, by hand", stroke[0], stroke[1]),
    ))
}

/// A ruler: scale and origin of the position.
pub(super) fn ruler(rig: &mut Rig<'_>, bench: &mut Bench) -> Result<Made, Stop> {
    let what = "ruler";
    let required = &format!(
        "scale within {:.0} %, origin within {ORIGIN_MM} mm",
        100.0 * SCALE_ERROR
    );
    rig.say(
        "\nRuler. No force. Lay a ruler along the handle's way, its zero at the origin of the device \
         (x = 0), rising towards +x.",
    )?;
    let mut places: Vec<[f64; 2]> = Vec::new();
    for which in [
        "a first place",
        "a second place, as far from it as possible",
    ] {
        let question = format!("Move the handle to {which}. Where is it on the ruler, in mm?");
        let first = places.first().map(|[first, _]| *first);
        let read = |given: &str| {
            let at = number(given, [-RULER_MM, RULER_MM])?;
            match first {
                Some(first) if (at - first).abs() < APART_MM => Err(format!(
                    "a place at least {APART_MM} mm from the first is needed"
                )),
                _ => Ok(at),
            }
        };
        let Ok(given) = rig.ask_for(&question, true, read)? else {
            return Ok(left_out(what, required));
        };
        match rig.position_mm(bench.numbers.stroke_mm) {
            Ok(x_mm) => places.push([given, x_mm]),
            Err(why) => return Ok(failed(what, required, why)),
        }
    }
    let found = Ruler::of([places[0][0], places[1][0]], [places[0][1], places[1][1]]);
    bench.numbers.ruler = Some(found);
    let [[r1, x1], [r2, x2]] = [places[0], places[1]];
    let seen = format!(
        "{r1} and {r2} mm on the ruler, {x1:.2} and {x2:.2} mm reported: scale {:.3}, off by {:.2} mm",
        found.scale, found.origin_mm
    );
    Ok(judged(what, required, found.is_right(), seen))
}

/// Friction without power.
pub(super) fn friction(rig: &mut Rig<'_>, bench: &mut Bench) -> Result<Made, Stop> {
    let (what, required) = ("unpowered friction", "known");
    rig.limp();
    rig.say(
        "\nFriction. Switch off the power of the motor, with the emergency switch if there is no other. Pull the \
         handle slowly with a spring scale.",
    )?;
    let question = "Which force moves it, in N, the larger one of both directions?";
    let read = |given: &str| number(given, [0.0, 100.0]);
    let Ok(force_n) = rig.ask_for(question, true, read)? else {
        return Ok(left_out(what, required));
    };
    bench.numbers.friction_n = Some(force_n);
    if rig
        .word(
            "Switch the power of the motor on again, then type `on`.",
            &["on"],
        )?
        .is_none()
    {
        return Ok(left_out(what, required));
    }
    rig.watch(AFTER);
    Ok(judged(what, required, true, format!("{force_n} N")))
}

/// Holds the handle where it is by a spring; it is brought to the middle if it has no room, and
/// asked for again if it was moved meanwhile.
pub(super) fn hold_here(
    rig: &mut Rig<'_>,
    bench: &Bench,
    stage: Stage,
) -> Result<Result<VirtualSpring, Made>, Stop> {
    let (what, required) = ("room", "");
    let Some(stroke_mm) = bench.numbers.stroke_mm else {
        return Ok(Err(failed(what, required, "the stops are not known")));
    };
    let mut why = String::new();
    for _ in 0..TRIES {
        let spring = (rig.position_mm(Some(stroke_mm)))
            .map(|at_mm| VirtualSpring::for_stage(stage, at_mm, stroke_mm));
        why = match spring {
            Ok(Ok(spring)) => match rig.hold(&spring) {
                Ok(()) => return Ok(Ok(spring)),
                Err(why) => why,
            },
            Ok(Err(no_room)) => format!("too near to a stop: {no_room}"),
            Err(why) => why,
        };
        rig.ended()?;
        rig.limp();
        if !by_hand(&why) {
            return Ok(Err(failed(what, required, why)));
        }
        let question =
            format!("There is no force: {why}. Leave the handle at rest and type `go`, or `skip`.");
        if rig.word(&question, &["go"])?.is_none() {
            return Ok(Err(left_out(what, required)));
        }
    }
    Ok(Err(failed(what, required, why)))
}

/// Whether the person and not the device is why a motion did not begin.
pub(super) fn by_hand(why: &str) -> bool {
    [MOVED_BEFORE, UNREST, "too near to a stop"]
        .iter()
        .any(|own| why.contains(own))
}

/// The emergency switch, at the lowest force.
pub(super) fn emergency_stop(rig: &mut Rig<'_>, bench: &mut Bench) -> Result<Made, Stop> {
    let what = "emergency stop";
    let required = STOP_REQUIRED;
    if let Some(why) = bench.ban() {
        return Ok(left_out(what, required).seen(why));
    }
    let mut why = String::new();
    for _ in 0..TRIES {
        match pressed(rig, bench)? {
            Pressed::Seen { gone, noticed } => return released(rig, bench, gone, noticed),
            Pressed::Other(made) => return Ok(made.of(what, required)),
            Pressed::Moved(moved) => why = moved,
        }
        rig.say(&format!(
            "The device went limp before the switch was seen: {}. Once more; pull slowly.",
            safe(&why)
        ))?;
    }
    let why = format!("it went limp before the switch was seen: {}", safe(&why));
    Ok(failed(what, required, why))
}

/// What happened while the switch was to be pressed.
enum Pressed {
    /// Whether the force was gone, as the person says, and what the device reported.
    Seen { gone: bool, noticed: Option<String> },
    /// The motion ended the playback.
    Moved(String),
    /// There was no motion.
    Other(Made),
}

fn yes_or_no(given: &str) -> Result<bool, &'static str> {
    match given {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("yes or no is needed"),
    }
}

/// Holds the handle while the switch is pressed; the device is limp at the end.
fn pressed(rig: &mut Rig<'_>, bench: &mut Bench) -> Result<Pressed, Stop> {
    let what = "emergency stop";
    let [stage, ..] = stages(bench.largest_n, rig.limits);
    rig.say(&format!(
        "\nEmergency stop, at no more than {:.1} N. The device will hold the handle like a soft spring.",
        stage.limit_n
    ))?;
    if !rig.may_go("Nothing pushes before you pull. Take the handle.")? {
        return Ok(Pressed::Other(left_out(what, "")));
    }
    let spring = match hold_here(rig, bench, stage)? {
        Ok(spring) => spring,
        Err(made) => return Ok(Pressed::Other(made)),
    };
    let question = "Pull the handle until you feel the force, keep it there, and press the emergency switch. \
                    Was the force gone at once, yes or no?";
    // A trip is what is expected here.
    let answer = rig.ask_for(question, true, yes_or_no)?;
    let noticed = rig.take_trouble();
    bench.numbers.travels.push(rig.travel(what, &spring));
    rig.limp();
    let Ok(gone) = answer else {
        return Ok(Pressed::Other(left_out(what, "")));
    };
    Ok(match noticed {
        Some(why) if is_late(&why) => Pressed::Other(failed(what, "", why)),
        Some(why) if is_of_motion(&why) => Pressed::Moved(why),
        noticed => Pressed::Seen { gone, noticed },
    })
}

/// The release of the switch, and what it came to.
fn released(
    rig: &mut Rig<'_>,
    bench: &mut Bench,
    force_gone: bool,
    noticed: Option<String>,
) -> Result<Made, Stop> {
    let (what, required) = ("emergency stop", STOP_REQUIRED);
    let mut found = EmergencyStop {
        force_gone,
        noticed,
        limp_before_release: true,
        limp_after_release: None,
    };
    let ended = "The playback is over, and the device was told to be limp.";
    let question = format!("{ended} Only now release the switch, then type `released`.");
    if rig.word(&question, &["released"])?.is_some() {
        rig.watch(AFTER);
        let question = "Move the handle a little. Is it still without force, yes or no?";
        found.limp_after_release = rig.ask_for(question, true, yes_or_no)?.ok();
    }
    let seen = format!(
        "the force was {}; the device {}; after the release {}",
        if force_gone { "gone" } else { "NOT gone" },
        match &found.noticed {
            Some(why) => format!("reported: {}", safe(why)),
            None => "did NOT notice it".to_owned(),
        },
        match found.limp_after_release {
            Some(true) => "no force",
            Some(false) => "FORCE AGAIN",
            None => "not looked at",
        },
    );
    let right = found.is_right();
    bench.numbers.emergency_stop = Some(found);
    Ok(match right {
        Some(ok) => judged(what, required, ok, seen),
        None => left_out(what, required).seen(seen),
    })
}
