//! Reading and writing trajectory files.
//!
//! TOML with `format = "study-trajectory/1"`. Reading is strict and reports every fault
//! with its line. Writing is reproducible, and `parse(write(t)) == t` for every
//! trajectory that was read.

use super::parts::{PRBS_ORDERS, Part, Prbs, Shape, Sine, Steps, Sweep};
use super::{Envelope, FORMAT, MAX_DURATION_S, MAX_PARTS, MAX_RAMP_S, Trajectory};
use std::fmt::{Display, Write as _};
use std::ops::RangeInclusive;
use study_base::diagnostic::table::{self, Table, Value};
use study_base::diagnostic::{Fault, Findings};
use study_base::limits::Limit;

/// Most levels of steps.
const MAX_LEVELS: usize = 1000;
/// Range of positions and amplitudes, mm.
const LENGTHS_MM: RangeInclusive<f64> = -1000.0..=1000.0;
/// Range of frequencies, Hz.
const FREQUENCIES_HZ: RangeInclusive<f64> = 1e-3..=1000.0;
/// Range of phases, degrees.
const PHASES_DEG: RangeInclusive<f64> = -360.0..=360.0;
/// Range of times, s.
const TIMES_S: RangeInclusive<f64> = 1e-3..=MAX_DURATION_S;

const SHAPES: [(&str, Shape); 2] = [("triangular", Shape::Triangular), ("linear", Shape::Linear)];

/// Reads a trajectory file; `path` is for messages. `None` if and only if the findings
/// contain an error.
///
/// ```
/// # use study_haptics::trajectory::file::parse;
/// let text = "format = \"study-trajectory/1\"\noffset_mm = 10\nduration_s = 4\nramp_s = 0.5\n\
///     parts = [{ kind = \"sine\", amplitude_mm = 3, frequency_hz = 1 }]\n";
/// let (trajectory, _) = parse("sine.toml", text);
/// let trajectory = trajectory.unwrap();
/// // A quarter of a period.
/// assert!((trajectory.at(2.25).x_mm - 13.0).abs() < 1e-9);
/// assert_eq!(trajectory.total_s(), 5.0);
/// ```
pub fn parse(path: &str, text: &str) -> (Option<Trajectory>, Findings) {
    table::parse(path, text, read)
}

fn read(mut root: Table<'_, '_>) -> Option<Trajectory> {
    if !root.has_format(FORMAT, "a trajectory file") {
        return None;
    }
    let title = root.text("title");
    let timing = numbers(&mut root, &TRAJECTORY);
    let limits = root.table("limits").and_then(limits);
    let tables = root.tables("parts");
    if tables.is_empty() || tables.len() > MAX_PARTS {
        root.fault_at(
            "parts",
            Fault::error(format!(
                "there are {} parts: a trajectory has 1 to {MAX_PARTS}",
                tables.len()
            ))
            .hint("a part is [[parts]] with kind = \"sine\", \"sweep\", \"prbs\" or \"steps\""),
        );
    }
    let parts = tables.into_iter().filter_map(part).collect();
    root.finish();
    let [offset_mm, duration_s, ramp_s] = timing?;
    Some(Trajectory {
        title,
        offset_mm,
        duration_s,
        ramp_s,
        parts,
        limits,
    })
}

/// A key with a number: its name, its range, and its default if it is optional.
type Key = (&'static str, RangeInclusive<f64>, Option<f64>);

/// The numbers of a trajectory and of each kind of part, for reading and writing.
const TRAJECTORY: [Key; 3] = [
    ("offset_mm", LENGTHS_MM, None),
    ("duration_s", TIMES_S, None),
    ("ramp_s", 1e-3..=MAX_RAMP_S, None),
];
const SINE: [Key; 3] = [
    ("amplitude_mm", LENGTHS_MM, None),
    ("frequency_hz", FREQUENCIES_HZ, None),
    ("phase_deg", PHASES_DEG, Some(0.0)),
];
const SWEEP: [Key; 5] = [
    ("amplitude_mm", LENGTHS_MM, None),
    ("from_hz", FREQUENCIES_HZ, None),
    ("to_hz", FREQUENCIES_HZ, None),
    ("period_s", TIMES_S, None),
    ("phase_deg", PHASES_DEG, Some(0.0)),
];
const PRBS: [Key; 3] = [
    ("amplitude_mm", LENGTHS_MM, None),
    ("bit_s", TIMES_S, None),
    ("rise_s", TIMES_S, None),
];
const STEPS: [Key; 3] = [
    ("speed_mm_s", 1e-3..=1e5, None),
    ("acceleration_m_s2", 1e-3..=1e4, None),
    ("hold_s", 0.0..=MAX_DURATION_S, Some(0.0)),
];

/// A number in a range; NaN is in no range.
fn number(value: &Value<'_, '_>, range: &RangeInclusive<f64>) -> Option<f64> {
    in_range(value, value.f64()?, range)
}

fn in_range<T: PartialOrd + Display>(
    value: &Value<'_, '_>,
    number: T,
    range: &RangeInclusive<T>,
) -> Option<T> {
    if range.contains(&number) {
        return Some(number);
    }
    let (low, high) = (range.start(), range.end());
    value.refuse(format_args!("has to be from {low} to {high}, not {number}"))
}

/// The numbers of a table, in the order of the keys; reports the faults of all.
fn numbers<const N: usize>(table: &mut Table<'_, '_>, keys: &[Key; N]) -> Option<[f64; N]> {
    let mut all = Some([0.0; N]);
    for (i, (key, range, default)) in keys.iter().enumerate() {
        let value = match default {
            Some(_) => table.value(key),
            None => table.required(key),
        };
        let read = value.map_or(*default, |value| number(&value, range));
        all = all.zip(read).map(|(mut all, number)| {
            all[i] = number;
            all
        });
    }
    all
}

fn limits(mut table: Table<'_, '_>) -> Option<Envelope> {
    let travel = table.required("travel_mm").and_then(|value| {
        let numbers: Vec<f64> = value.array()?.iter().filter_map(Value::f64).collect();
        match numbers[..] {
            [low, high] if low < high && low.is_finite() && high.is_finite() => Some([low, high]),
            _ => value.refuse("has to be two numbers, the lower first"),
        }
    });
    let mut limit = |key: &str| {
        let value = table.value(key)?;
        let limit = Limit::new(value.f64()?);
        if let Err(bad) = limit {
            value.fault(Fault::error(format!("`{}`: {bad}", value.path())));
        }
        limit.ok()
    };
    let velocity_mm_s = limit("velocity_mm_s");
    let acceleration_m_s2 = limit("acceleration_m_s2");
    table.finish();
    Some(Envelope {
        travel_mm: travel?,
        velocity_mm_s,
        acceleration_m_s2,
    })
}

/// Reads a part of one kind.
type Reader = fn(&mut Table<'_, '_>) -> Option<Part>;
const KINDS: [(&str, Reader); 4] = [
    ("sine", sine),
    ("sweep", sweep),
    ("prbs", prbs),
    ("steps", steps),
];

fn part(mut table: Table<'_, '_>) -> Option<Part> {
    let read = table.required("kind").and_then(|v| v.word(&KINDS))?;
    let part = read(&mut table);
    table.finish();
    part
}

fn sine(table: &mut Table<'_, '_>) -> Option<Part> {
    let [amplitude_mm, frequency_hz, phase_deg] = numbers(table, &SINE)?;
    Some(Part::Sine(Sine {
        amplitude_mm,
        frequency_hz,
        phase_deg,
    }))
}

fn sweep(table: &mut Table<'_, '_>) -> Option<Part> {
    let shape = table.required("shape").and_then(|v| v.word(&SHAPES));
    let [amplitude_mm, from_hz, to_hz, period_s, phase_deg] = numbers(table, &SWEEP)?;
    Some(Part::Sweep(Sweep {
        shape: shape?,
        amplitude_mm,
        from_hz,
        to_hz,
        period_s,
        phase_deg,
    }))
}

fn prbs(table: &mut Table<'_, '_>) -> Option<Part> {
    let order = table.required("order");
    let order = order.and_then(|value| in_range(&value, value.u32()?, &PRBS_ORDERS));
    let [amplitude_mm, bit_s, rise_s] = numbers(table, &PRBS)?;
    if rise_s > bit_s {
        table.fault_at(
            "rise_s",
            Fault::error(format!("`{}.rise_s` is longer than a bit", table.path()))
                .hint("a change has to end within its bit: rise_s is at most bit_s"),
        );
        return None;
    }
    Prbs::new(amplitude_mm, order?, bit_s, rise_s).map(Part::Prbs)
}

fn steps(table: &mut Table<'_, '_>) -> Option<Part> {
    let levels = table.required("levels_mm").and_then(|value| {
        let all = value.array()?;
        let levels: Vec<f64> = all.iter().filter_map(|v| number(v, &LENGTHS_MM)).collect();
        if levels.len() < all.len() {
            return None;
        }
        let next = levels.iter().cycle().skip(1);
        let apart = levels.iter().zip(next).all(|(a, b)| a != b);
        if !(2..=MAX_LEVELS).contains(&levels.len()) || !apart {
            return value.refuse(format_args!("has to be 2 to {MAX_LEVELS} levels, each different from the one before (the first follows the last)"));
        }
        Some(levels)
    });
    let [speed_mm_s, acceleration_m_s2, hold_s] = numbers(table, &STEPS)?;
    Some(Part::Steps(Steps {
        levels_mm: levels?,
        speed_mm_s,
        acceleration_m_s2,
        hold_s,
    }))
}

/// The text of a trajectory file.
pub fn write(trajectory: &Trajectory) -> String {
    let t = trajectory;
    let mut out = format!("format = \"{FORMAT}\"\n");
    if let Some(title) = &t.title {
        line(&mut out, "title", toml::Value::String(title.clone()));
    }
    lines(&mut out, &TRAJECTORY, [t.offset_mm, t.duration_s, t.ramp_s]);
    if let Some(limits) = &t.limits {
        out.push_str("\n[limits]\n");
        line(&mut out, "travel_mm", format!("{:?}", limits.travel_mm));
        for (key, limit) in [
            ("velocity_mm_s", limits.velocity_mm_s),
            ("acceleration_m_s2", limits.acceleration_m_s2),
        ] {
            if let Some(limit) = limit {
                line(&mut out, key, format!("{:?}", limit.get()));
            }
        }
    }
    for part in &t.parts {
        let kind = match part {
            Part::Sine(_) => "sine",
            Part::Sweep(_) => "sweep",
            Part::Prbs(_) => "prbs",
            Part::Steps(_) => "steps",
        };
        out.push_str("\n[[parts]]\n");
        line(&mut out, "kind", format!("\"{kind}\""));
        match part {
            Part::Sine(p) => {
                let values = [p.amplitude_mm, p.frequency_hz, p.phase_deg];
                lines(&mut out, &SINE, values);
            }
            Part::Sweep(p) => {
                let values = [p.amplitude_mm, p.from_hz, p.to_hz, p.period_s, p.phase_deg];
                lines(&mut out, &SWEEP, values);
                let shape = match p.shape {
                    Shape::Triangular => "triangular",
                    Shape::Linear => "linear",
                };
                line(&mut out, "shape", format!("\"{shape}\""));
            }
            Part::Prbs(p) => {
                lines(&mut out, &PRBS, [p.amplitude_mm, p.bit_s, p.rise_s]);
                line(&mut out, "order", p.order());
            }
            Part::Steps(p) => {
                let values = [p.speed_mm_s, p.acceleration_m_s2, p.hold_s];
                lines(&mut out, &STEPS, values);
                line(&mut out, "levels_mm", format!("{:?}", p.levels_mm));
            }
        }
    }
    out
}

fn lines<const N: usize>(out: &mut String, keys: &[Key; N], values: [f64; N]) {
    for ((key, ..), value) in keys.iter().zip(values) {
        line(out, key, format!("{value:?}"));
    }
}

fn line(out: &mut String, key: &str, value: impl Display) {
    // writing to a String cannot fail
    let _ = writeln!(out, "{key} = {value}");
}
