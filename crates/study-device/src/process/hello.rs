//! The first message of a program: who it is, its limits, and the constants of its servo.

use super::error::{FORMAT, MessageError, short_text};
use crate::Identity;
use crate::check::{Bound, outside, servo_bounds};
use serde::Deserialize;
use std::time::Duration;
use study_base::limits::Limits;
use study_wire::servo::ServoSettings;

/// The version before, which tells no constants and does not confirm `limp`.
const FORMAT_1: &str = "study-process/1";

/// Longest id and version, characters.
const MAX_ID: usize = 64;
/// The time without `alive` after which a program is limp that tells none.
const WATCHDOG: Duration = Duration::from_millis(500);
/// Least and most time that a program may state for it, ms.
const WATCHDOG_MS: [f64; 2] = [50.0, 500.0];
/// Least and most periods of a loop per second.
const LOOP_HZ: [f64; 2] = [100.0, 1e5];
/// Farthest position, mm, and stiffness, N/mm.
const FARTHEST_MM: f64 = 2147.0;
const STIFFEST_N_PER_MM: f64 = 1e4;

/// Identity and limits of a program.
#[derive(Debug, Deserialize)]
pub(super) struct Hello {
    format: String,
    id: String,
    telemetry: bool,
    /// Whether it is simulated, without motor and hand.
    #[serde(default)]
    simulated: bool,
    /// Whether it plays mechanisms, and not only tables.
    #[serde(default)]
    mechanisms: bool,
    limits: Limits,
    version: Option<String>,
    servo: Option<Constants>,
    stiffness_n_per_mm: Option<f64>,
    stroke_mm: Option<[f64; 2]>,
    watchdog_ms: Option<f64>,
}

/// The constants of a program's servo; those that are missing are those of docs/wire.md.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constants {
    loop_hz: f64,
    acceleration_hz: Option<f64>,
    least_mass_kg: Option<f64>,
    damping_n_s_per_mm: Option<f64>,
    wall_n_per_mm: Option<f64>,
    wall_n_s_per_mm: Option<f64>,
    overtravel_mm: Option<f64>,
    jump_mm: Option<f64>,
    slew_n_s: Option<f64>,
    ramp_s: Option<f64>,
}

/// What a program has told.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Name, limits and constants.
    pub identity: Identity,
    /// Whether it speaks version 1: it sends `stopped` for `outcome`, and confirms no `limp`.
    pub is_version_1: bool,
    /// How long after the last `alive` it has no force any more.
    pub watchdog: Duration,
}

impl Told {
    /// The version of the messages.
    pub fn format(&self) -> &'static str {
        match self.is_version_1 {
            true => FORMAT_1,
            false => FORMAT,
        }
    }

    /// The command that switches the force off.
    pub(super) fn free(&self) -> &'static str {
        match self.is_version_1 {
            true => "limp",
            false => "free",
        }
    }
}

impl Hello {
    /// Checks it.
    ///
    /// # Errors
    /// [`MessageError`] for an unknown version, and numbers out of their bounds.
    pub(super) fn told(self) -> Result<Told, MessageError> {
        let is_version_1 = match self.format.as_str() {
            FORMAT => false,
            FORMAT_1 => true,
            other => return Err(MessageError::Format(short_text(other))),
        };
        let named = |text: &str| !text.is_empty() && text.chars().count() <= MAX_ID;
        if !named(&self.id) {
            return Err(MessageError::Text("id"));
        }
        if self.version.as_deref().is_some_and(|text| !named(text)) {
            return Err(MessageError::Text("version"));
        }
        // Version 1 ignored what it did not know.
        let own = (!is_version_1).then_some(());
        let servo = own.and(self.servo.as_ref());
        let servo = servo.map(|told| told.servo(self.limits));
        let watchdog_ms = own.and(self.watchdog_ms);
        let stroke_mm = own.and(self.stroke_mm);
        let stiffness_n_per_mm = own.and(self.stiffness_n_per_mm);
        let mut bounds: Vec<Bound> = Vec::new();
        if let Some(servo) = &servo {
            let [least, most] = LOOP_HZ;
            bounds.push(("loop rate", servo.servo_hz, least, most, "Hz"));
            bounds.extend(servo_bounds(servo));
        }
        if let Some([low, high]) = stroke_mm {
            bounds.push(("stroke from", low, -FARTHEST_MM, FARTHEST_MM, "mm"));
            bounds.push(("stroke to", high, low, FARTHEST_MM, "mm"));
        }
        if let Some(most) = stiffness_n_per_mm {
            bounds.push(("stiffness limit", most, 0.0, STIFFEST_N_PER_MM, "N/mm"));
        }
        if let Some(ms) = watchdog_ms {
            let [least, most] = WATCHDOG_MS;
            bounds.push(("watchdog time", ms, least, most, "ms"));
        }
        if let Some(why) = outside(&bounds) {
            return Err(MessageError::Told(why));
        }
        let watchdog = watchdog_ms.map_or(WATCHDOG, |ms| Duration::from_secs_f64(1e-3 * ms));
        Ok(Told {
            is_version_1,
            watchdog,
            identity: Identity {
                id: self.id,
                simulated: self.simulated,
                telemetry: self.telemetry,
                numbered: false,
                limits: self.limits,
                servo,
                mechanisms: self.mechanisms,
                elements: false,
                stiffness_n_per_mm,
                damping_n_s_per_mm: None,
                stroke_mm,
                firmware: own.and(self.version),
            },
        })
    }
}

impl Constants {
    fn servo(&self, limits: Limits) -> ServoSettings {
        let usual = ServoSettings::default();
        ServoSettings {
            servo_hz: self.loop_hz,
            force_n: limits.force_n.get(),
            velocity_mm_s: limits.velocity_mm_s.get(),
            acceleration_hz: self.acceleration_hz.unwrap_or(usual.acceleration_hz),
            least_mass_kg: self.least_mass_kg.unwrap_or(usual.least_mass_kg),
            damping_n_s_per_mm: self.damping_n_s_per_mm.unwrap_or(usual.damping_n_s_per_mm),
            wall_n_per_mm: self.wall_n_per_mm.unwrap_or(usual.wall_n_per_mm),
            wall_n_s_per_mm: self.wall_n_s_per_mm.unwrap_or(usual.wall_n_s_per_mm),
            overtravel_mm: self.overtravel_mm.unwrap_or(usual.overtravel_mm),
            jump_mm: self.jump_mm.unwrap_or(usual.jump_mm),
            slew_n_s: self.slew_n_s.unwrap_or(usual.slew_n_s),
            ramp_s: self.ramp_s.unwrap_or(usual.ramp_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(more: &str) -> Result<Told, String> {
        let text = format!(
            r#"{{"id":"a","telemetry":true,"limits":{{"force_n":5,"velocity_mm_s":300}},{more}}}"#
        );
        let hello: Hello = serde_json::from_str(&text).map_err(|e| e.to_string())?;
        hello.told().map_err(|e| e.to_string())
    }

    #[test]
    fn what_is_not_told_of_a_servo_is_that_of_the_wire() {
        let told = told(
            r#""format":"study-process/2","servo":{"loop_hz":1000,"ramp_s":0.5},"version":"1.2",
               "stroke_mm":[-40,40],"stiffness_n_per_mm":3,"watchdog_ms":100"#,
        )
        .unwrap();
        let servo = told.identity.servo.unwrap();
        let expected = ServoSettings {
            servo_hz: 1000.0,
            force_n: 5.0,
            velocity_mm_s: 300.0,
            ramp_s: 0.5,
            ..ServoSettings::default()
        };
        assert_eq!(servo, expected);
        assert_eq!(told.watchdog, Duration::from_millis(100));
        assert_eq!(told.identity.stroke_mm, Some([-40.0, 40.0]));
        assert_eq!(told.identity.firmware.as_deref(), Some("1.2"));
        assert!(!told.identity.numbered && !told.is_version_1);
    }

    /// It did not have these keys, and ignored what it did not know.
    #[test]
    fn version_1_tells_no_constants() {
        let told = told(
            r#""format":"study-process/1","servo":{"loop_hz":1},"version":"1","watchdog_ms":1e9"#,
        )
        .unwrap();
        assert!(told.is_version_1);
        let identity = &told.identity;
        assert_eq!((identity.servo, &identity.firmware), (None, &None));
        assert_eq!(told.watchdog, WATCHDOG);
    }

    #[test]
    fn what_is_out_of_bounds_is_named() {
        for (more, why) in [
            (r#""servo":{}"#, "missing field `loop_hz`"),
            (
                r#""servo":{"loop_hz":1000,"rampe_s":1}"#,
                "unknown field `rampe_s`",
            ),
            (
                r#""servo":{"loop_hz":20}"#,
                "its loop rate is 20 Hz, and not from 100",
            ),
            (
                r#""servo":{"loop_hz":1000,"slew_n_s":20}"#,
                "its slew limit is 20 N/s",
            ),
            (
                r#""servo":{"loop_hz":1000,"least_mass_kg":0.1}"#,
                "its least mass is 0.1 kg",
            ),
            (r#""stroke_mm":[5,-5]"#, "its stroke to is -5 mm"),
            (r#""watchdog_ms":2000"#, "its watchdog time is 2000 ms"),
            (
                r#""stiffness_n_per_mm":-1"#,
                "its stiffness limit is -1 N/mm",
            ),
            (r#""version":"""#, "its version needs 1 to 64 characters"),
        ] {
            let more = format!(r#""format":"study-process/2",{more}"#);
            let error = told(&more).unwrap_err();
            assert!(error.contains(why), "{more}: {error}");
        }
    }
}
