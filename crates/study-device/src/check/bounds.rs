//! Bounds of what a device tells in IDENTITY: of its limits, because nothing larger can be sent,
//! and of its constants, because the host predicts its force with them (docs/wire.md, 7.7).

use super::exchange::Exchange;
use super::{ClauseResult, fail};
use study_wire::message::{Constants, Identity, MINOR};
use study_wire::servo::ServoSettings;

/// A number with the least and the largest value that it may have.
pub(crate) type Bound = (&'static str, f64, f64, f64, &'static str);

/// What a force or a position in TELEMETRY can hold, N, mm and mm/s.
const LARGEST: f64 = 2147.0;

/// The first of the limits that is out of its bounds, or whose text is missing.
pub(super) fn limits(device: &Identity) -> Option<String> {
    let [low, high] = device.stroke_mm;
    let bounds: [Bound; 8] = [
        ("servo rate", device.servo_hz, 4000.0, 1e5, "Hz"),
        ("force limit", device.force_n, 0.0, LARGEST, "N"),
        ("velocity limit", device.velocity_mm_s, 0.0, LARGEST, "mm/s"),
        (
            "stiffness limit",
            device.stiffness_n_per_mm,
            0.0,
            1e4,
            "N/mm",
        ),
        (
            "damping limit",
            device.damping_n_s_per_mm,
            0.0,
            100.0,
            "N·s/mm",
        ),
        ("stroke from", low, -LARGEST, LARGEST, "mm"),
        ("stroke to", high, -LARGEST, LARGEST, "mm"),
        (
            "telemetry rate",
            device.telemetry_hz,
            0.0,
            device.servo_hz,
            "Hz",
        ),
    ];
    if device.serial.as_bytes().trim_ascii().is_empty() {
        return Some("its serial number is empty".to_owned());
    }
    outside(&bounds)
}

/// The first of the constants that is out of its bounds.
pub(super) fn constants(told: &Constants) -> Option<String> {
    outside(&servo_bounds(&ServoSettings {
        acceleration_hz: told.acceleration_hz,
        // A device that renders every mass tells −∞.
        least_mass_kg: told.least_mass_kg.max(-10.0),
        damping_n_s_per_mm: told.damping_n_s_per_mm,
        wall_n_per_mm: told.wall_n_per_mm,
        wall_n_s_per_mm: told.wall_n_s_per_mm,
        overtravel_mm: told.overtravel_mm,
        jump_mm: told.jump_mm,
        slew_n_s: told.slew_n_s,
        ramp_s: told.ramp_s,
        ..ServoSettings::default()
    }))
}

/// The bounds of the constants of a servo.
pub(crate) fn servo_bounds(told: &ServoSettings) -> [Bound; 9] {
    [
        (
            "acceleration filter",
            told.acceleration_hz,
            10.0,
            200.0,
            "Hz",
        ),
        ("least mass", told.least_mass_kg, -10.0, 0.0, "kg"),
        (
            "added damping",
            told.damping_n_s_per_mm,
            0.0,
            0.01,
            "N·s/mm",
        ),
        ("wall", told.wall_n_per_mm, 1.0, 1e3, "N/mm"),
        (
            "damping of the wall",
            told.wall_n_s_per_mm,
            0.0,
            1.0,
            "N·s/mm",
        ),
        ("overtravel", told.overtravel_mm, 0.1, 10.0, "mm"),
        ("jump", told.jump_mm, 0.01, 10.0, "mm"),
        ("slew limit", told.slew_n_s, 1e3, 1e6, "N/s"),
        ("ramp", told.ramp_s, 0.1, 1.0, "s"),
    ]
}

/// The first number that is out of its bounds, in words.
pub(crate) fn outside(bounds: &[Bound]) -> Option<String> {
    let (what, value, low, high, unit) = bounds
        .iter()
        .find(|(_, value, low, high, _)| !(low..=high).contains(&value))?;
    let value = match value.abs() >= 1e6 {
        true => format!("{value:e}"),
        false => value.to_string(),
    };
    Some(format!(
        "its {what} is {value} {unit}, and not from {low} to {high} {unit}"
    ))
}

/// 7.7: the constants that a device of minor version 1 or later tells.
pub(super) fn told(exchange: &mut Exchange<'_>) -> ClauseResult {
    match exchange.hello_of(MINOR)?.constants {
        None => Ok("it tells none".to_owned()),
        Some(told) => match constants(&told) {
            Some(why) => fail(why),
            None => Ok(format!(
                "slew limit {} N/s, ramp {} s, damping {} N·s/mm, filter {} Hz",
                told.slew_n_s, told.ramp_s, told.damping_n_s_per_mm, told.acceleration_hz
            )),
        },
    }
}
