//! Tests a controller program against the clauses of `docs/devices.md`, section 3, above all
//! those by which it is limp: `free`, missing `alive`, end of its input.
//!
//! A program shares this computer, which may be busy: what comes late is repeated, and passes if
//! it once comes in time.

mod talk;
mod trips;

use super::hello::Told;
use crate::DeviceError;
use crate::check::Verdict;
use crate::table::both_ways;
use std::time::Duration;
use study_haptics::model::{Realization, Trained};
use study_session::outcome::Sample;
use talk::{Failed, Talk};
pub use trips::{ProgramTrips, round_trips};

/// Largest force of the test, N.
pub const FORCE_N: f64 = 2.0;
/// How often what came late is repeated.
const TRIES: u32 = 4;
/// What a computer that does other things adds to a promised time.
const SLACK: Duration = Duration::from_millis(100);
/// Time for the outcome after `stop`.
const STOP: Duration = Duration::from_secs(2);
/// Time to the end of the program after the end of its input.
const EXIT: Duration = Duration::from_millis(500);
/// For how long nothing may come that must not come.
const QUIET: Duration = Duration::from_millis(300);
/// Until the force has risen.
const RISEN: Duration = Duration::from_millis(1300);
/// A force of zero, N.
const ZERO_N: f64 = 0.01;
/// Force of the tables, and its limit in one of them, N.
const PUSH_N: f64 = 1.0;
const LOW_N: f64 = 0.5;
/// Half of the range of the tables, mm.
const REACH_MM: f64 = 14.0;
/// Middle of the tables of a program that tells no stroke, mm.
const MIDDLE_MM: f64 = 17.5;

/// The result of the tests.
#[derive(Debug, Clone)]
pub struct Checked {
    /// What the program told.
    pub told: Told,
    /// A verdict about each clause.
    pub verdicts: Vec<Verdict>,
}

/// Middle of the tables that a program is tested with, mm.
pub fn middle_mm(told: &Told) -> f64 {
    (told.identity.stroke_mm).map_or(MIDDLE_MM, |[low, high]| 0.5 * (low + high))
}

type ClauseResult = Result<String, Failed>;

struct Clause {
    clause: &'static str,
    what: &'static str,
    test: fn(&mut Talk) -> ClauseResult,
}

const CLAUSES: [Clause; 11] = [
    Clause {
        clause: "hello",
        what: "it says who it is, its limits and its constants",
        test: hello,
    },
    Clause {
        clause: "load",
        what: "a table that is loaded twice is the second one",
        test: second_load,
    },
    Clause {
        clause: "start",
        what: "the force rises from zero, and samples tell it",
        test: rises,
    },
    Clause {
        clause: "limits",
        what: "the force limit of a load holds",
        test: limited,
    },
    Clause {
        clause: "stroke",
        what: "a table beyond the stroke is refused",
        test: beyond_the_stroke,
    },
    Clause {
        clause: "unknown",
        what: "a command that it does not know is ignored",
        test: unknown,
    },
    Clause {
        clause: "stop",
        what: "stop ends the force, and the outcome follows",
        test: stops,
    },
    Clause {
        clause: "free",
        what: "free switches the force off",
        test: freed,
    },
    Clause {
        clause: "latch",
        what: "after free nothing plays before the next load",
        test: latched,
    },
    Clause {
        clause: "alive",
        what: "without alive it is limp within the time that it promises",
        test: without_alive,
    },
    Clause {
        clause: "end",
        what: "at the end of its input it is limp and ends",
        test: end_of_input,
    },
];

/// Tests a program. `report` receives each verdict at once.
///
/// # Errors
/// [`DeviceError::Lost`] if it cannot be started or sends no valid `hello`.
pub fn clauses(
    command: &[String],
    report: &mut dyn FnMut(&Verdict),
) -> Result<Checked, DeviceError> {
    let mut talk = Talk::open(command)?;
    let mut verdicts = Vec::new();
    for Clause { clause, what, test } in CLAUSES {
        let mut tries = 1;
        let result = loop {
            let result = talk.reset().and_then(|()| test(&mut talk));
            if !matches!(result, Err(Failed::Late(_))) || tries == TRIES {
                break result;
            }
            tries += 1;
        };
        let verdict = Verdict {
            clause,
            what,
            pass: result.is_ok(),
            judged: !matches!(result, Err(Failed::NotJudged(_))),
            seen: result.unwrap_or_else(|failed| failed.to_string()),
        };
        report(&verdict);
        verdicts.push(verdict);
        if talk.is_gone() {
            break;
        }
    }
    Ok(Checked {
        told: talk.told.clone(),
        verdicts,
    })
}

/// A constant force over the middle of the stroke.
fn push(talk: &Talk, force_n: f64) -> Realization {
    let middle_mm = middle_mm(&talk.told);
    let ends_mm = [middle_mm - REACH_MM, middle_mm + REACH_MM];
    let trained = Trained {
        x_mm: ends_mm,
        v_mm_s: 300.0,
    };
    both_ways(
        "check",
        ends_mm.to_vec(),
        (vec![force_n; 2], vec![0.0; 2]),
        trained,
    )
}

fn greatest_n(samples: &[Sample]) -> f64 {
    samples
        .iter()
        .fold(0.0, |most: f64, s| most.max(s.force_command_n.abs()))
}

fn wrong<T>(seen: impl Into<String>) -> Result<T, Failed> {
    Err(Failed::Wrong(seen.into()))
}

fn hello(talk: &mut Talk) -> ClauseResult {
    let told = &talk.told;
    let mut seen = format!("{}, {}", told.format(), told.identity.id);
    match (&told.identity.servo, told.is_version_1) {
        (Some(servo), _) => seen += &format!(", {} periods per second", servo.servo_hz),
        (None, true) => seen += ": it tells no constants, and a wrong force is `unverified`",
        (None, false) => seen += ": without `servo` a wrong force is `unverified`",
    }
    Ok(seen)
}

fn second_load(talk: &mut Talk) -> ClauseResult {
    let first = push(talk, PUSH_N);
    talk.load(&first, FORCE_N)?;
    talk.play(&push(talk, -PUSH_N), FORCE_N)?;
    if !talk.told.identity.telemetry {
        return Ok("it plays; it reports no samples".to_owned());
    }
    let samples = talk.samples_for(RISEN)?;
    match samples.last().map(|s| s.force_command_n) {
        Some(force_n) if force_n > 0.5 * PUSH_N => {
            wrong(format!("the force of the first one plays: {force_n:.2} N"))
        }
        Some(force_n) => Ok(format!("{force_n:.2} N of -{PUSH_N:.2} N")),
        None => wrong(format!("no samples in {:.1} s", RISEN.as_secs_f64())),
    }
}

fn rises(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    if !talk.told.identity.telemetry {
        return Ok("it plays; it reports no samples".to_owned());
    }
    let samples = talk.samples_for(RISEN)?;
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return wrong(format!("no samples in {:.1} s", RISEN.as_secs_f64()));
    };
    if !samples.windows(2).all(|w| w[1].t_s > w[0].t_s) {
        return wrong("their times do not ascend");
    }
    if first.force_command_n.abs() > 0.25 * PUSH_N {
        let (force_n, t_s) = (first.force_command_n, first.t_s);
        return wrong(format!(
            "the first sample, at {t_s:.3} s, has {force_n:.2} N"
        ));
    }
    let hz = (samples.len() - 1) as f64 / (last.t_s - first.t_s);
    Ok(format!(
        "{hz:.0} samples per second, {:.2} N at last",
        last.force_command_n
    ))
}

fn limited(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), LOW_N)?;
    if !talk.told.identity.telemetry {
        return Err(Failed::NotJudged("it reports no samples".to_owned()));
    }
    let most_n = greatest_n(&talk.samples_for(RISEN)?);
    match most_n > LOW_N + ZERO_N {
        true => wrong(format!("{most_n:.2} N of at most {LOW_N:.2} N")),
        false => Ok(format!("{most_n:.2} N of at most {LOW_N:.2} N")),
    }
}

fn beyond_the_stroke(talk: &mut Talk) -> ClauseResult {
    let Some([low, high]) = talk.told.identity.stroke_mm else {
        return Ok("it tells no stroke".to_owned());
    };
    let mut table = push(talk, PUSH_N);
    table.trained.x_mm = [low - 1.0, high + 1.0];
    table.x_mm = vec![low - 1.0, high + 1.0];
    match talk.refusal(&table, FORCE_N)? {
        Some(why) => Ok(why),
        None => wrong(format!(
            "it loads one from {} to {} mm",
            low - 1.0,
            high + 1.0
        )),
    }
}

fn unknown(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    talk.say("future-command")?;
    // Whatever it says now it says because of that.
    let because = |failed| match failed {
        Failed::NotJudged(why) => Failed::Wrong(why),
        other => other,
    };
    talk.samples_for(QUIET).map_err(because)?;
    let (_, took) = talk.stop(STOP).map_err(because)?;
    Ok(format!(
        "it plays on, and stops after {:.0} ms",
        1e3 * took.as_secs_f64()
    ))
}

fn stops(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    talk.samples_for(RISEN)?;
    let (lasted_s, took) = talk.stop(STOP)?;
    let most_n = greatest_n(&talk.samples_for(QUIET)?);
    if most_n > ZERO_N {
        return wrong(format!("{most_n:.2} N after the outcome"));
    }
    let due_s = RISEN.as_secs_f64();
    if !(due_s * 0.5..=due_s * 2.0 + 1.0).contains(&lasted_s) {
        return wrong(format!("it says that {due_s:.1} s lasted {lasted_s:.1} s"));
    }
    Ok(format!("after {:.0} ms", 1e3 * took.as_secs_f64()))
}

fn freed(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    talk.samples_for(RISEN)?;
    let allowed = talk.told.watchdog + SLACK;
    let seen = talk.free(allowed)?;
    let most_n = greatest_n(&talk.samples_for(QUIET)?);
    match most_n > ZERO_N {
        true => wrong(format!("{most_n:.2} N after it")),
        false => Ok(seen),
    }
}

fn latched(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    talk.samples_for(QUIET)?;
    talk.free(STOP)?;
    talk.say("start")?;
    let most_n = greatest_n(&talk.samples_for(RISEN)?);
    if most_n > ZERO_N {
        return wrong(format!("{most_n:.2} N after a start without a load"));
    }
    match talk.started() {
        true => wrong("it says that it has started"),
        false => Ok("nothing".to_owned()),
    }
}

fn without_alive(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    talk.samples_for(RISEN)?;
    let promised = talk.told.watchdog;
    let took = talk.silence(promised + SLACK)?;
    let most_n = greatest_n(&talk.samples_for(QUIET)?);
    if most_n > ZERO_N {
        return wrong(format!("{most_n:.2} N after it, when alive comes again"));
    }
    let [took_ms, promised_ms] = [took, promised].map(|t| 1e3 * t.as_secs_f64());
    Ok(format!("{took_ms:.0} ms of {promised_ms:.0} ms"))
}

fn end_of_input(talk: &mut Talk) -> ClauseResult {
    talk.play(&push(talk, PUSH_N), FORCE_N)?;
    talk.samples_for(RISEN)?;
    talk.end_of_input(EXIT + SLACK)
}
