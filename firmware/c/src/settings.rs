//! Settings and measurements as C sees them.

use core::ffi::{CStr, c_char};
use study_wire::handler::{Bounds, Profile};
use study_wire::message::{Features, Flags, Name};
use study_wire::servo::ServoSettings;

/// What the device is. All numbers have to be stated; the header explains them.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct StudySettings {
    /// Name and version of the firmware, UTF-8, at most 32 bytes.
    pub firmware: *const c_char,
    /// Serial number, the same on every port.
    pub serial: *const c_char,
    /// Servo periods per second.
    pub servo_hz: f64,
    /// Highest telemetry rate, samples per second.
    pub telemetry_hz: f64,
    /// Largest force, N.
    pub force_n: f64,
    /// Largest velocity limit, mm/s.
    pub velocity_mm_s: f64,
    /// Largest stiffness that is rendered stably, N/mm.
    pub stiffness_n_per_mm: f64,
    /// Largest damping that is rendered stably, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Lowest position of the handle, mm.
    pub stroke_from_mm: f64,
    /// Highest position of the handle, mm.
    pub stroke_to_mm: f64,
    /// Mass of the handle, kg: a device cannot compensate more.
    pub handle_kg: f64,
    /// Time without a fresh heartbeat after which the device goes limp, ms.
    pub watchdog_ms: u32,
    /// 1 if there is a force sensor.
    pub force_sensor: i32,
    /// 1 if the device is simulated.
    pub simulated: i32,
    /// 1 if the acceleration is the difference of the speeds.
    pub acceleration_from_speed: i32,
}

/// Sensor values at the beginning of a servo period.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct StudyMotion {
    /// Position, mm.
    pub x_mm: f64,
    /// Speed, mm/s.
    pub v_mm_s: f64,
    /// Acceleration, m/s².
    pub a_m_s2: f64,
    /// Measured force, N, if `has_force`.
    pub force_n: f64,
    /// 1 with a force sensor.
    pub has_force: i32,
}

/// Longest playback, ms.
const LONGEST_MS: u32 = 600_000;

/// The profile of these settings; `None` if one is not valid.
///
/// # Safety
/// Each text is null or ends with a zero.
pub(crate) unsafe fn profile(settings: &StudySettings) -> Option<Profile> {
    let s = settings;
    let positive = [
        s.servo_hz,
        s.telemetry_hz,
        s.force_n,
        s.velocity_mm_s,
        s.stiffness_n_per_mm,
        s.damping_n_s_per_mm,
    ];
    let valid = positive
        .iter()
        .all(|value| value.is_finite() && *value > 0.0)
        && s.stroke_from_mm.is_finite()
        && s.stroke_to_mm.is_finite()
        && s.stroke_from_mm < s.stroke_to_mm
        && s.handle_kg.is_finite()
        && s.handle_kg >= 0.0;
    let watchdog_ms = u16::try_from(s.watchdog_ms).ok().filter(|ms| *ms > 0)?;
    // SAFETY: by the contract of this function.
    let (firmware, serial) = unsafe { (name(s.firmware)?, name(s.serial)?) };
    valid.then_some(Profile {
        firmware,
        serial,
        flags: Flags {
            force_sensor: s.force_sensor != 0,
            simulated: s.simulated != 0,
            telemetry: true,
            probe: false,
        },
        features: Features {
            acceleration_from_speed: s.acceleration_from_speed != 0,
            mechanism: true,
            elements: true,
            fade: true,
        },
        watchdog_ms,
        longest_ms: LONGEST_MS,
        telemetry_hz: s.telemetry_hz,
        bounds: Bounds {
            force_n: s.force_n,
            velocity_mm_s: s.velocity_mm_s,
            stiffness_n_per_mm: s.stiffness_n_per_mm,
            damping_n_s_per_mm: s.damping_n_s_per_mm,
            stroke_mm: [s.stroke_from_mm, s.stroke_to_mm],
        },
        servo: ServoSettings {
            servo_hz: s.servo_hz,
            least_mass_kg: -s.handle_kg,
            ..ServoSettings::new()
        },
        rest_mm_s: 5.0,
        rest_s: 0.05,
    })
}

/// # Safety
/// The text is null or ends with a zero.
unsafe fn name(text: *const c_char) -> Option<Name> {
    if text.is_null() {
        return None;
    }
    // SAFETY: by the contract of this function.
    let text = unsafe { CStr::from_ptr(text) }.to_str().ok()?;
    (!text.is_empty()).then(|| Name::new(text))
}
