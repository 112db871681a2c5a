//! `study device check`: tables in which each term, look-up and direction rule
//! counts are played, and each playback is judged as in a session.
//!
//! Somebody moves the handle; a simulated device has a hand. A playback with too little
//! motion, or on a computer that was late, is not judged, and repeated.

use super::single_playback::{self, Pace, PlaybackError};
use crate::cli::Failure;
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Duration;
use study_base::limits::Limits;
use study_base::text::{ModelId, Untrusted};
use study_device::{Device, DeviceError, Report, Stimulus, rendering_of};
use study_haptics::model::{Branch, Provenance, Realization, Trained, Units};
use study_plan::protocol::RenderingRules;
use study_session::outcome::{Defect, Fidelity, Playback, Sample, Verdict};
use study_session::rendering::{Played, judge};
use study_wire::message::Fault;
use study_wire::predict::{Direction, Lookup};
use study_wire::servo::ServoSettings;

/// Duration of each playback.
const PLAYBACK: Duration = Duration::from_secs(6);
/// How often a playback that cannot be judged is repeated.
const TRIES: usize = 3;
/// Time for a lost device to return.
const RETURN: Duration = Duration::from_secs(5);
/// Positions of the tables, relative to the middle of the stroke, mm.
const REACH_MM: f64 = 14.0;
/// Distance of the nodes, mm.
const STEP_MM: f64 = 1.0;
/// Largest force, N.
const FORCE_N: f64 = 9.0;
/// A velocity limit that every hand passes, mm/s.
const SLOW_MM_S: f64 = 3.0;
/// Half of a range that every hand leaves, mm, and how far beyond it every device has to have
/// tripped: the largest overtravel of docs/wire.md, 7.7.
const NARROW_MM: f64 = 0.5;
const BEYOND_MM: f64 = 10.0;

/// The result of one playback.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Rendered {
    /// What was tested.
    what: String,
    /// `pass`, `fail` or `not judged`.
    pub(super) result: &'static str,
    seen: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    fidelity: Option<Fidelity>,
    /// Whether the device did not answer: no further table is tried.
    #[serde(skip)]
    pub(super) is_silent: bool,
}

impl Rendered {
    fn new(what: &str, result: &'static str, seen: impl Into<String>) -> Self {
        Self {
            what: what.to_owned(),
            result,
            seen: seen.into(),
            fidelity: None,
            is_silent: false,
        }
    }

    /// For the terminal.
    pub(super) fn line(&self) -> String {
        let mark = match self.result {
            "fail" => "FAIL",
            other => other,
        };
        let seen = Untrusted(&self.seen);
        format!("{mark:<10}  {}\n            {seen}\n", self.what)
    }
}

/// Number of results: passed, failed, not judged.
pub(super) fn tally(all: &[Rendered]) -> [usize; 3] {
    ["pass", "fail", "not judged"].map(|word| all.iter().filter(|r| r.result == word).count())
}

/// What the person at the device has to do.
pub(super) fn prompt() -> String {
    format!(
        "move the handle to and fro over its whole range, {} s for each line",
        PLAYBACK.as_secs()
    )
}

/// Tests a device. `report` receives each result at once. Ends at the first table to which
/// the device does not answer.
pub(super) fn check(
    device: &mut dyn Device,
    middle_mm: f64,
    mut pace: Pace,
    report: &mut dyn FnMut(&Rendered) -> Result<(), Failure>,
) -> Result<Vec<Rendered>, Failure> {
    let mut all = Vec::new();
    if !device.identity().telemetry {
        return Err(Failure::device(
            "the device reports no samples: its rendering cannot be judged",
        ));
    }
    for (what, table) in tables(middle_mm) {
        let result = one(device, &what, &table, &mut pace);
        report(&result)?;
        let silent = result.is_silent;
        all.push(result);
        if silent {
            return Ok(all);
        }
    }
    // How far beyond its range a device goes is one of its constants.
    let told = device.identity().servo.is_some();
    for at in TRIPS
        .iter()
        .filter(|at| told || at.fault == Fault::Velocity)
    {
        let result = trip(device, middle_mm, at, &mut pace);
        report(&result)?;
        all.push(result);
    }
    Ok(all)
}

/// Every term by itself and together, with each look-up and direction rule.
fn tables(middle_mm: f64) -> Vec<(String, Realization)> {
    let all = [0.3, 0.02, 0.15, 1.0];
    let mut tables = Vec::new();
    for (i, term) in ["mass", "damping", "stiffness", "offset"]
        .iter()
        .enumerate()
    {
        let mut only = [0.0; 4];
        only[i] = all[i];
        let what = format!("{term} alone");
        tables.push((
            what,
            table(middle_mm, only, Lookup::Linear, Direction::Sign),
        ));
    }
    let lookups = [
        ("linear", Lookup::Linear),
        ("floor", Lookup::Floor),
        ("nearest", Lookup::Nearest),
    ];
    let rules = [
        ("sign", Direction::Sign),
        ("play", Direction::Play { delta_mm: 3.0 }),
        ("Dahl", Direction::Dahl { delta_mm: 3.0 }),
    ];
    for (lookup, how) in lookups {
        for (rule, direction) in rules {
            let what = format!("all terms, look-up {lookup}, direction {rule}");
            tables.push((what, table(middle_mm, all, how, direction)));
        }
    }
    tables
}

/// A table with these terms: mass kg, damping N·s/mm, stiffness N/mm, and the share of an
/// offset that differs between the directions.
fn table(
    middle_mm: f64,
    [m, b, k, offset]: [f64; 4],
    lookup: Lookup,
    direction: Direction,
) -> Realization {
    let count = (2.0 * REACH_MM / STEP_MM) as i32;
    let x_mm: Vec<f64> = (0..=count)
        .map(|i| middle_mm - REACH_MM + STEP_MM * f64::from(i))
        .collect();
    let branch = |friction: f64| Branch {
        m_kg: vec![m; x_mm.len()],
        b_n_s_per_mm: vec![b; x_mm.len()],
        k_n_per_mm: vec![k; x_mm.len()],
        f0_n: (x_mm.iter())
            .map(|x| {
                let turn = (x - middle_mm) / REACH_MM * std::f64::consts::TAU;
                offset * (2.0 * turn.sin() + friction) - k * middle_mm
            })
            .collect(),
    };
    let (positive, negative) = (branch(0.8), branch(-0.8));
    Realization {
        units: Units::Linear,
        id: "check".to_owned(),
        provenance: Provenance::default(),
        vaf: BTreeMap::new(),
        lookup,
        direction,
        trained: Trained {
            x_mm: [x_mm[0] - 0.5, middle_mm + REACH_MM + 0.5],
            v_mm_s: 300.0,
        },
        x_mm,
        positive,
        negative,
        mechanism: None,
        elements: None,
    }
}

struct Heard {
    samples: Vec<Sample>,
    ended: Result<Playback, PlaybackError>,
}

fn play(device: &mut dyn Device, table: &Realization, limits: Limits, pace: &mut Pace) -> Heard {
    let mut samples = Vec::new();
    let mut collect = |reports: &[Report]| {
        for report in reports {
            if let Report::Telemetry(more) = report {
                samples.extend_from_slice(more);
            }
        }
    };
    let what = Stimulus::of_table(table);
    let ended = single_playback::play(device, &what, limits, PLAYBACK, pace, &mut collect);
    Heard { samples, ended }
}

/// Judges a playback as a session does, by the default rules.
pub(super) fn fidelity(
    device: &dyn Device,
    table: &Realization,
    limits: Limits,
    samples: &[Sample],
    playback: &Playback,
) -> Result<Fidelity, Failure> {
    let model = ModelId::new("check").map_err(|e| Failure::new(crate::cli::Kind::Bug, e))?;
    let told = device.identity().servo;
    let played = Played {
        model: &model,
        what: rendering_of(table),
        servo: ServoSettings {
            force_n: limits.capped_at(device.identity().limits).force_n.get(),
            ..told.unwrap_or_default()
        },
        servo_told: told.is_some(),
        samples,
        numbered: device.identity().numbered,
        lost: playback.samples_lost,
        faded_from_s: None,
        time_ratio: playback.time_ratio,
        host_late_s: playback.host_late_ms.map(|[_, most]| 1e-3 * most),
        others: &[],
    };
    Ok(judge(&played, &RenderingRules::default()))
}

fn one(device: &mut dyn Device, what: &str, table: &Realization, pace: &mut Pace) -> Rendered {
    let Ok(limits) = Limits::new(FORCE_N, 1000.0) else {
        return Rendered::new(what, "not judged", "the limits are invalid");
    };
    let mut last = Rendered::new(what, "not judged", "");
    for _ in 0..TRIES {
        let heard = play(device, table, limits, pace);
        let playback = match heard.ended {
            Ok(playback) => playback,
            Err(why @ PlaybackError::Timeout) => {
                let seen = format!("{why}: the other tables are not tried");
                return Rendered {
                    is_silent: true,
                    ..Rendered::new(what, "fail", seen)
                };
            }
            // A trip is usually caused by the hand; a program that has ended starts again.
            Err(why) => {
                last = Rendered::new(what, "not judged", why.to_string());
                if matches!(why, PlaybackError::Device(DeviceError::Lost(_))) {
                    wait_for_return(device, pace);
                }
                continue;
            }
        };
        let found = match fidelity(device, table, limits, &heard.samples, &playback) {
            Ok(found) => found,
            Err(why) => return Rendered::new(what, "not judged", why.message),
        };
        last = judged(what, &found);
        let [counted, seen] = [
            playback.strokes,
            strokes(&heard.samples, table.trained.x_mm),
        ];
        if last.result == "pass" && counted > seen + 1 {
            let seen = format!("it counts {counted} full strokes, and its samples show {seen}");
            last = Rendered::new(what, "fail", seen);
        }
        last.fidelity = Some(found);
        if last.result != "not judged" {
            break;
        }
    }
    last
}

/// Full strokes in samples: from the outer fifth of the range at one side to that at the other.
fn strokes(samples: &[Sample], [low, high]: [f64; 2]) -> u32 {
    let fifth_mm = 0.2 * (high - low);
    let mut from = None;
    let mut count = 0;
    for sample in samples {
        let side = match sample.x_mm {
            x if x <= low + fifth_mm => false,
            x if x >= high - fifth_mm => true,
            _ => continue,
        };
        count += u32::from(from.is_some_and(|from| from != side));
        from = Some(side);
    }
    count
}

/// Waits some seconds until a lost device is there again.
fn wait_for_return(device: &mut dyn Device, pace: &mut Pace) {
    let until = pace.at() + RETURN;
    while pace.at() < until && !device.poll(pace.at()).contains(&Report::Ready) {
        pace.wait();
    }
}

fn judged(what: &str, found: &Fidelity) -> Rendered {
    let number = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.3}"));
    let seen = format!(
        "VAF {}, gain {}, offset {} N, delay {} ms",
        number(found.rendered_vaf),
        number(found.rendered_gain),
        number(found.rendered_bias_n),
        number(found.rendered_delay_ms)
    );
    match found.verdict {
        Verdict::Ok => Rendered::new(what, "pass", seen),
        Verdict::TooLittle | Verdict::Unverified => {
            let why = found.because.clone().unwrap_or_default();
            let seen = match found.verdict {
                Verdict::Unverified => format!("{why}; {seen}"),
                _ => why,
            };
            Rendered::new(what, "not judged", seen)
        }
        Verdict::Flag | Verdict::Fault => {
            let wrong: Vec<&str> = found.defects.iter().map(|d| in_words(*d)).collect();
            Rendered::new(what, "fail", format!("{}; {seen}", wrong.join(", ")))
        }
    }
}

/// What is wrong, for the person at the device.
fn in_words(defect: Defect) -> &'static str {
    match defect {
        Defect::OverLimit => "the force passes its limit",
        Defect::OtherTable => "it is the force of another table",
        Defect::Sign => "the force has the wrong sign",
        Defect::Shape => "the force varies otherwise than the table",
        Defect::Gain => "the force is too large or too small",
        Defect::Bias => "a constant force is added",
        Defect::Delay => "the force comes late",
        Defect::Error => "for a moment the force is another one",
        Defect::Vibration => "a vibration or ticks are added",
        Defect::Constants => "the constants that it tells make it another force than the table's",
        Defect::Measured => "the measured force is not the commanded one",
        Defect::Speed => "the reported speed is not the change of the position",
        Defect::Clock => "the time of the samples is not that of this computer",
        Defect::Samples => "samples are repeated, missing or out of order",
    }
}

/// A playback in which a moving hand makes the device trip.
struct Trip {
    what: &'static str,
    fault: Fault,
    /// Half of the range of the table, mm.
    reach_mm: f64,
    velocity_mm_s: f64,
    /// Whether the motion of these samples has to trip, and what it was.
    due: fn(&[Sample], middle_mm: f64) -> (bool, String),
}

const TRIPS: [Trip; 2] = [
    Trip {
        what: "trip at the velocity limit",
        fault: Fault::Velocity,
        reach_mm: REACH_MM,
        velocity_mm_s: SLOW_MM_S,
        due: |samples, _| {
            let fastest = samples
                .iter()
                .fold(0.0, |most: f64, s| most.max(s.v_mm_s.abs()));
            let seen = format!("at {fastest:.0} mm/s of {SLOW_MM_S} mm/s");
            (fastest > 2.0 * SLOW_MM_S, seen)
        },
    },
    Trip {
        what: "trip beyond the range of the table",
        fault: Fault::Stroke,
        reach_mm: NARROW_MM,
        velocity_mm_s: 1000.0,
        due: |samples, middle_mm| {
            let way = |s: &Sample| (s.x_mm - middle_mm).abs() - NARROW_MM;
            let beyond_mm = samples.iter().map(way).fold(0.0, f64::max);
            let seen = format!("{beyond_mm:.1} mm beyond the range");
            (beyond_mm > BEYOND_MM, seen)
        },
    },
];

/// A table at whose limits a moving hand makes the device trip.
fn trip(device: &mut dyn Device, middle_mm: f64, trip: &Trip, pace: &mut Pace) -> Rendered {
    let table = Realization {
        trained: Trained {
            x_mm: [middle_mm - trip.reach_mm, middle_mm + trip.reach_mm],
            v_mm_s: 300.0,
        },
        ..table(
            middle_mm,
            [0.0, 0.0, 0.0, 0.2],
            Lookup::Linear,
            Direction::Sign,
        )
    };
    let mut last = Rendered::new(trip.what, "not judged", "the limits are invalid");
    let Ok(limits) = Limits::new(FORCE_N, trip.velocity_mm_s) else {
        return last;
    };
    // A program, which does not number its samples, has its own words for a fault.
    let wire = device.identity().numbered;
    for _ in 0..TRIES {
        let heard = play(device, &table, limits, pace);
        let (due, seen) = (trip.due)(&heard.samples, middle_mm);
        last = match heard.ended {
            Err(PlaybackError::Reported(why)) if why.starts_with(Fault::Watchdog.as_str()) => {
                Rendered::new(trip.what, "not judged", why)
            }
            Err(PlaybackError::Reported(why)) if !wire || why == trip.fault.as_str() => {
                return Rendered::new(trip.what, "pass", why);
            }
            Err(PlaybackError::Reported(why)) => Rendered::new(trip.what, "not judged", why),
            Ok(_) if due => {
                return Rendered::new(trip.what, "fail", format!("it goes on {seen}"));
            }
            Ok(_) => Rendered::new(
                trip.what,
                "not judged",
                format!("too little motion: {seen}"),
            ),
            Err(why) => Rendered::new(trip.what, "not judged", why.to_string()),
        };
    }
    last
}

#[cfg(test)]
mod tests;
