//! Reading and writing trajectory files.
//!
//! TOML with `format = "study-trajectory/1"`. Reading is strict and reports every fault
//! with its line. Writing is reproducible, and `parse(write(t)) == t` for every
//! trajectory that was read.

use super::parts::{PRBS_ORDERS, Part, Prbs, Shape, Sine, Steps, Sweep};
use super::{Envelope, FORMAT, MAX_DURATION_S, MAX_PARTS, MAX_RAMP_S, Trajectory};
use std::fmt::Write as _;
use std::ops::RangeInclusive;
use study_base::diagnostic::table::{Document, Table, Value};
use study_base::diagnostic::{Fault, Findings};
use study_base::limits::Limit;

/// Most levels of steps.
const MAX_LEVELS: usize = 1000;
/// Range of positions and amplitudes, mm.
const LENGTHS_MM: RangeInclusive<f64> = -1000.0..=1000.0;
/// Range of frequencies, Hz.
const FREQUENCIES_HZ: RangeInclusive<f64> = 1e-3..=1000.0;
/// Range of times, s.
const TIMES_S: RangeInclusive<f64> = 1e-3..=MAX_DURATION_S;

const SHAPES: [(&str, Shape); 2] = [("triangular", Shape::Triangular), ("linear", Shape::Linear)];

/// Reads a trajectory file; `path` is for messages. `None` if and only if the findings
/// contain an error.
pub fn parse(path: &str, text: &str) -> (Option<Trajectory>, Findings) {
    let document = Document::parse(text);
    let trajectory = read(&document);
    let mut findings = Findings::new(path, text);
    findings.faults = document.finish().faults;
    findings.sort();
    let good = !findings.has_errors();
    (trajectory.filter(|_| good), findings)
}

fn read(document: &Document<'_>) -> Option<Trajectory> {
    let mut root = document.root();
    if let Some(format) = root.required("format")
        && let Some(given) = format.text()
        && given != FORMAT
    {
        format.fault(
            Fault::error(format!("this is not a {FORMAT} file")).hint(format!(
                "a trajectory file begins with format = \"{FORMAT}\""
            )),
        );
        return None;
    }
    let title = root.text("title");
    let offset_mm = required(&mut root, "offset_mm", LENGTHS_MM);
    let duration_s = required(&mut root, "duration_s", TIMES_S);
    let ramp_s = required(&mut root, "ramp_s", 1e-3..=MAX_RAMP_S);
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
    Some(Trajectory {
        title,
        offset_mm: offset_mm?,
        duration_s: duration_s?,
        ramp_s: ramp_s?,
        parts,
        limits,
    })
}

/// A number in a range; NaN is in no range.
fn number(value: &Value<'_, '_>, range: RangeInclusive<f64>) -> Option<f64> {
    let number = value.f64()?;
    if range.contains(&number) {
        return Some(number);
    }
    value.fault(Fault::error(format!(
        "`{}` has to be from {} to {}, not {number}",
        value.path(),
        range.start(),
        range.end()
    )));
    None
}

/// The number of a required key.
fn required(table: &mut Table<'_, '_>, key: &str, range: RangeInclusive<f64>) -> Option<f64> {
    number(&table.required(key)?, range)
}

/// The number of an optional key.
fn optional(
    table: &mut Table<'_, '_>,
    key: &str,
    range: RangeInclusive<f64>,
    default: f64,
) -> Option<f64> {
    match table.value(key) {
        Some(value) => number(&value, range),
        None => Some(default),
    }
}

fn limits(mut table: Table<'_, '_>) -> Option<Envelope> {
    let travel = table.required("travel_mm").and_then(|value| {
        let numbers: Vec<f64> = value.array()?.iter().filter_map(Value::f64).collect();
        match numbers[..] {
            [low, high] if low < high && low.is_finite() && high.is_finite() => Some([low, high]),
            _ => {
                value.fault(Fault::error(format!(
                    "`{}` has to be two numbers, the lower first",
                    value.path()
                )));
                None
            }
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

#[derive(Debug, Clone, Copy)]
enum Kind {
    Sine,
    Sweep,
    Prbs,
    Steps,
}

fn part(mut table: Table<'_, '_>) -> Option<Part> {
    let kind = table.required("kind").and_then(|v| {
        v.word(&[
            ("sine", Kind::Sine),
            ("sweep", Kind::Sweep),
            ("prbs", Kind::Prbs),
            ("steps", Kind::Steps),
        ])
    })?;
    let part = match kind {
        Kind::Sine => sine(&mut table).map(Part::Sine),
        Kind::Sweep => sweep(&mut table).map(Part::Sweep),
        Kind::Prbs => prbs(&mut table).map(Part::Prbs),
        Kind::Steps => steps(&mut table).map(Part::Steps),
    };
    table.finish();
    part
}

fn sine(table: &mut Table<'_, '_>) -> Option<Sine> {
    let amplitude_mm = required(table, "amplitude_mm", LENGTHS_MM);
    let frequency_hz = required(table, "frequency_hz", FREQUENCIES_HZ);
    let phase_deg = optional(table, "phase_deg", -360.0..=360.0, 0.0);
    Some(Sine {
        amplitude_mm: amplitude_mm?,
        frequency_hz: frequency_hz?,
        phase_deg: phase_deg?,
    })
}

fn sweep(table: &mut Table<'_, '_>) -> Option<Sweep> {
    let shape = table.required("shape").and_then(|v| v.word(&SHAPES));
    let amplitude_mm = required(table, "amplitude_mm", LENGTHS_MM);
    let from_hz = required(table, "from_hz", FREQUENCIES_HZ);
    let to_hz = required(table, "to_hz", FREQUENCIES_HZ);
    let period_s = required(table, "period_s", TIMES_S);
    let phase_deg = optional(table, "phase_deg", -360.0..=360.0, 0.0);
    Some(Sweep {
        shape: shape?,
        amplitude_mm: amplitude_mm?,
        from_hz: from_hz?,
        to_hz: to_hz?,
        period_s: period_s?,
        phase_deg: phase_deg?,
    })
}

fn prbs(table: &mut Table<'_, '_>) -> Option<Prbs> {
    let amplitude_mm = required(table, "amplitude_mm", LENGTHS_MM);
    let order = table.required("order").and_then(|value| {
        let order = value.u32()?;
        if !PRBS_ORDERS.contains(&order) {
            value.fault(Fault::error(format!(
                "`{}` has to be from {} to {}, not {order}",
                value.path(),
                PRBS_ORDERS.start(),
                PRBS_ORDERS.end()
            )));
            return None;
        }
        Some(order)
    });
    let bit_s = required(table, "bit_s", TIMES_S);
    let rise_s = table.required("rise_s").and_then(|value| {
        let rise_s = number(&value, TIMES_S)?;
        if bit_s.is_some_and(|bit_s| rise_s > bit_s) {
            value.fault(
                Fault::error(format!("`{}` is longer than a bit", value.path()))
                    .hint("a change has to end within its bit: rise_s is at most bit_s"),
            );
            return None;
        }
        Some(rise_s)
    });
    Prbs::new(amplitude_mm?, order?, bit_s?, rise_s?)
}

fn steps(table: &mut Table<'_, '_>) -> Option<Steps> {
    let levels = table.required("levels_mm").and_then(|value| {
        let all = value.array()?;
        let levels: Vec<f64> = all.iter().filter_map(|v| number(v, LENGTHS_MM)).collect();
        if levels.len() < all.len() {
            return None;
        }
        let next = levels.iter().cycle().skip(1);
        let apart = levels.iter().zip(next).all(|(a, b)| a != b);
        if !(2..=MAX_LEVELS).contains(&levels.len()) || !apart {
            value.fault(Fault::error(format!(
                "`{}` has to be 2 to {MAX_LEVELS} levels, each different from the one before (the first follows the last)",
                value.path()
            )));
            return None;
        }
        Some(levels)
    });
    let speed_mm_s = required(table, "speed_mm_s", 1e-3..=1e5);
    let acceleration_m_s2 = required(table, "acceleration_m_s2", 1e-3..=1e4);
    let hold_s = optional(table, "hold_s", 0.0..=MAX_DURATION_S, 0.0);
    Some(Steps {
        levels_mm: levels?,
        speed_mm_s: speed_mm_s?,
        acceleration_m_s2: acceleration_m_s2?,
        hold_s: hold_s?,
    })
}

/// The text of a trajectory file.
pub fn write(trajectory: &Trajectory) -> String {
    let t = trajectory;
    let mut out = format!("format = \"{FORMAT}\"\n");
    if let Some(title) = &t.title {
        line(&mut out, "title", toml::Value::String(title.clone()));
    }
    for (key, number) in [
        ("offset_mm", t.offset_mm),
        ("duration_s", t.duration_s),
        ("ramp_s", t.ramp_s),
    ] {
        line(&mut out, key, format!("{number:?}"));
    }
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
        out.push_str("\n[[parts]]\n");
        let mut numbers = |kind: &str, pairs: &[(&str, f64)]| {
            line(&mut out, "kind", format!("\"{kind}\""));
            for (key, number) in pairs {
                line(&mut out, key, format!("{number:?}"));
            }
        };
        match part {
            Part::Sine(p) => numbers(
                "sine",
                &[
                    ("amplitude_mm", p.amplitude_mm),
                    ("frequency_hz", p.frequency_hz),
                    ("phase_deg", p.phase_deg),
                ],
            ),
            Part::Sweep(p) => {
                numbers(
                    "sweep",
                    &[
                        ("amplitude_mm", p.amplitude_mm),
                        ("from_hz", p.from_hz),
                        ("to_hz", p.to_hz),
                        ("period_s", p.period_s),
                        ("phase_deg", p.phase_deg),
                    ],
                );
                let shape = match p.shape {
                    Shape::Triangular => "triangular",
                    Shape::Linear => "linear",
                };
                line(&mut out, "shape", format!("\"{shape}\""));
            }
            Part::Prbs(p) => {
                numbers(
                    "prbs",
                    &[
                        ("amplitude_mm", p.amplitude_mm),
                        ("bit_s", p.bit_s),
                        ("rise_s", p.rise_s),
                    ],
                );
                line(&mut out, "order", p.order());
            }
            Part::Steps(p) => {
                numbers(
                    "steps",
                    &[
                        ("speed_mm_s", p.speed_mm_s),
                        ("acceleration_m_s2", p.acceleration_m_s2),
                        ("hold_s", p.hold_s),
                    ],
                );
                line(&mut out, "levels_mm", format!("{:?}", p.levels_mm));
            }
        }
    }
    out
}

fn line(out: &mut String, key: &str, value: impl std::fmt::Display) {
    // writing to a String cannot fail
    let _ = writeln!(out, "{key} = {value}");
}
