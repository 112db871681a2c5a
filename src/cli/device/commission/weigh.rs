//! Forces that somebody weighs, in both directions.

use super::rig::{Answer, Reading, Rig, Stop, safe};
use super::steps::hold_here;
use super::{Bench, Made, failed, judged, left_out};
use study_device::commission::{
    DirectionFit, GAIN_ERROR, Instrument, Measured, OFFSET_N, Side, Stage, VirtualSpring, Weighing,
    instrument, measured, stages,
};

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// A force counts for the one that was asked for within these shares of it.
const NEAR: [f64; 2] = [0.6, 1.6];
/// How often a force is read again.
const TRIES: u32 = 5;

/// What is weighed with.
pub(super) fn ask_instrument(rig: &mut Rig<'_>) -> Result<Option<Instrument>, Stop> {
    let question = "\nForce. What do you weigh with, and how far may it be off? Such as `weights 1 %`, `scale 0.1 N` \
                    or `gauge 0.05 N`.";
    Ok(rig.ask_for(question, true, instrument)?.ok())
}

/// Three forces in one direction.
pub(super) fn direction(rig: &mut Rig<'_>, bench: &mut Bench, pushes: Side) -> Result<Made, Stop> {
    let what = match pushes {
        Side::Minus => "force towards −x",
        Side::Plus => "force towards +x",
    };
    let required = &format!(
        "gain within {:.0} %, no offset beyond friction, no saturation, at three forces up to {:.1} N",
        100.0 * GAIN_ERROR,
        bench.largest_n
    );
    let Some(instrument) = bench.numbers.instrument.clone() else {
        return Ok(left_out(what, required));
    };
    if let Some(why) = bench.ban() {
        return Ok(left_out(what, required).seen(why));
    }
    let stages = stages(bench.largest_n, rig.limits);
    // a step may be done again
    bench.numbers.weighings.retain(|w| w.pushes != pushes);
    bench.numbers.directions.retain(|fit| fit.pushes != pushes);
    let mut open = None;
    for (i, stage) in stages.iter().enumerate() {
        if let Some(why) = bench.bar().filter(|_| i > 0) {
            open = Some(format!(
                "not weighed above {:.1} N, because {why}",
                stages[0].force_n
            ));
            break;
        }
        let label = format!("Force {} of {}, {what}", i + 1, stages.len());
        match one(rig, bench, &label, pushes, *stage, &instrument)? {
            Weighed::Read(weighing) => {
                let strong = weighing.is_too_strong(bench.numbers.friction_n);
                bench.numbers.weighings.push(weighing);
                if strong {
                    let fit = DirectionFit::of(pushes, &bench.numbers.weighings);
                    bench.numbers.directions.extend(fit);
                    let more = "more force than commanded, and no higher one was played";
                    let seen = so_far(bench, pushes, Some(more.to_owned()));
                    return Ok(failed(what, required, seen));
                }
            }
            Weighed::LeftOut => {
                open = Some(format!("{:.1} N and above were left out", stage.force_n));
                break;
            }
            Weighed::Wrong(why) => {
                let seen = format!("at {:.1} N: {}", stage.force_n, safe(&why));
                let fit = DirectionFit::of(pushes, &bench.numbers.weighings);
                bench.numbers.directions.extend(fit);
                return Ok(failed(what, required, so_far(bench, pushes, Some(seen))));
            }
        }
    }
    let seen = so_far(bench, pushes, open.clone());
    let fit = DirectionFit::of(pushes, &bench.numbers.weighings);
    let right = fit.and_then(|fit| {
        bench.numbers.directions.push(fit);
        fit.is_right(bench.numbers.friction_n)
    });
    Ok(match (right, open) {
        (Some(false), _) => judged(what, required, false, seen),
        (Some(true), None) => judged(what, required, true, seen),
        (None, None) => left_out(what, required).seen(format!(
            "{seen}; the tolerance of the instrument is too large to tell"
        )),
        (_, Some(_)) => left_out(what, required).seen(seen),
    })
}

/// The forces so far in one direction, in words.
fn so_far(bench: &Bench, pushes: Side, more: Option<String>) -> String {
    let own = bench
        .numbers
        .weighings
        .iter()
        .filter(|w| w.pushes == pushes);
    let mut parts: Vec<String> = own
        .map(|w| format!("{:.2} N for {:.2} N", w.measured_n, w.commanded_n))
        .collect();
    if let Some(fit) = DirectionFit::of(pushes, &bench.numbers.weighings) {
        parts.push(format!("gain {:.2}", fit.gain));
        parts.extend(fit.offset_n.map(|n| format!("offset {n:.2} N")));
        parts.extend(fit.saturation_n.map(|n| format!("saturated at {n:.1} N")));
    }
    parts.extend(more);
    match parts.is_empty() {
        true => "nothing was weighed".to_owned(),
        false => parts.join(", "),
    }
}

/// How one force was weighed.
enum Weighed {
    Read(Weighing),
    LeftOut,
    Wrong(String),
}

/// One force in one direction.
fn one(
    rig: &mut Rig<'_>,
    bench: &mut Bench,
    label: &str,
    pushes: Side,
    stage: Stage,
    instrument: &Instrument,
) -> Result<Weighed, Stop> {
    let Stage {
        force_n,
        limit_n,
        velocity_mm_s,
    } = stage;
    let pull = pushes.against().as_str();
    if !rig.may_go(&format!(
        "\n{label}: about {force_n:.1} N. The device holds the handle like a spring, with at most {limit_n:.1} N, and goes \
         limp above {velocity_mm_s:.0} mm/s. Nothing pushes before you pull. Let nothing hang at the handle yet."
    ))? {
        return Ok(Weighed::LeftOut);
    }
    let spring = match hold_here(rig, bench, stage)? {
        Ok(spring) => spring,
        Err(made) if made.is_open() => return Ok(Weighed::LeftOut),
        Err(made) => return Ok(Weighed::Wrong(made.step.seen)),
    };
    let give_mm = force_n / spring.stiffness_n_per_mm;
    let question = format!(
        "Pull slowly towards {pull} with about {force_n:.1} N, or hang about {:.0} g at it, until it rests; it gives by about \
         {give_mm:.0} mm. Then type what pulls, such as `{:.0} g` or `{force_n:.1} N`. Keep a hand under a weight: \
         beyond {:.0} mm the device goes limp.",
        1e3 * force_n / GRAVITY,
        1e3 * force_n / GRAVITY,
        spring.reach_mm,
    );
    let mut result = Weighed::Wrong("the handle never rested at that force".to_owned());
    for _ in 0..TRIES {
        let mut typed = String::new();
        let answer = rig.ask_for(&question, false, |given| {
            typed = given.to_owned();
            measured(given)
        })?;
        let read = match answer {
            Ok(read) => read,
            Err(Answer::Trouble(why)) => {
                result = Weighed::Wrong(format!("it did not hold: {why}"));
                break;
            }
            Err(_) => {
                result = Weighed::LeftOut;
                break;
            }
        };
        let reading = match rig.reading() {
            Ok(reading) => reading,
            Err(why) => {
                result = Weighed::Wrong(format!("it did not hold: {why}"));
                break;
            }
        };
        if let Some(why) = off_the_table(reading, &spring) {
            result = Weighed::Wrong(why);
            break;
        }
        match accepted(reading, read, pushes, force_n, instrument) {
            Ok((commanded_n, tolerance_n)) => {
                result = Weighed::Read(Weighing {
                    pushes,
                    target_n: force_n,
                    commanded_n,
                    measured_n: read.force_n,
                    tolerance_n,
                    typed,
                });
                break;
            }
            Err(why) => rig.say(&why)?,
        }
    }
    bench.numbers.travels.push(rig.travel(label, &spring));
    if matches!(result, Weighed::Read(_)) {
        // A weight falls without the force.
        let question =
            "Read. Hold the handle and take away what pulls; then type `off`, and the force ends.";
        rig.word(question, &["off"])?;
    }
    rig.limp();
    Ok(result)
}

/// What is wrong with the commanded force of a handle at rest: it has to be that of the spring.
fn off_the_table(reading: Reading, spring: &VirtualSpring) -> Option<String> {
    let table_n = spring.force_at(reading.x_mm);
    let most_n = OFFSET_N + GAIN_ERROR * table_n.abs();
    let off = reading.rests && (reading.command_n - table_n).abs() > most_n;
    off.then(|| {
        format!(
            "the device commands {:.2} N where the spring has {table_n:.2} N",
            reading.command_n
        )
    })
}

/// The commanded force and the tolerance of a reading, or why it is no reading of this force.
fn accepted(
    reading: Reading,
    read: Measured,
    pushes: Side,
    force_n: f64,
    instrument: &Instrument,
) -> Result<(f64, f64), String> {
    let commanded_n = pushes.sign() * reading.command_n;
    if !reading.rests {
        return Err("The handle does not rest; hold still and type it again.".to_owned());
    }
    if commanded_n <= 0.0 {
        return Err(format!(
            "The device holds against the other side: pull towards {}. If you do, the position counts the \
             wrong way round; then `skip`.",
            pushes.against().as_str()
        ));
    }
    let [least, most] = NEAR;
    let near = (least * force_n..=most * force_n).contains(&read.force_n);
    if !near {
        return Err(format!(
            "That is not about {force_n:.1} N ({:.2} N); pull with another force.",
            read.force_n
        ));
    }
    let tolerance_n = read
        .tolerance_n
        .unwrap_or_else(|| instrument.tolerance_n(read.force_n));
    Ok((commanded_n, tolerance_n))
}
