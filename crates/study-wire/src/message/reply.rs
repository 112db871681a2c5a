//! Replies of a device: ACK, IDENTITY, OUTCOME, PULSE.

use super::WireError;
use super::bytes::{Field, Reader, Writer, fields};
use super::code::{DeviceState, Fault, Loaded, Refusal};

fields! {
    /// Result of a request.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Ack {
        /// Type of the request.
        request: u8;
        /// [`Refusal::None`] if the request was executed.
        refusal: Refusal;
        /// State of the device after the request.
        state: DeviceState;
        /// Why the device is limp, or why the last playback ended.
        fault: Fault;
        /// Clock of the device, ms, wrapping.
        clock_ms: u32;
        /// Detail of the refusal, see [`Refusal`]; else 0.
        detail: u32;
    }
}

/// Optional features of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags {
    /// Measures the force on the handle.
    pub force_sensor: bool,
    /// Simulated, without motor and hand.
    pub simulated: bool,
    /// Sends TELEMETRY.
    pub telemetry: bool,
    /// Can record along a path.
    pub probe: bool,
}

/// What a device does beyond minor version 0. A host ignores features that it does not
/// know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Features {
    /// The acceleration is the difference of the speeds of two servo periods, and not
    /// that of a sensor, so that a host can compute it from TELEMETRY.
    pub acceleration_from_speed: bool,
    /// It plays mechanisms, from minor version 2 on.
    pub mechanism: bool,
    /// It plays elements, from minor version 2 on.
    pub elements: bool,
    /// It lets the force fall before it ends a playback, from minor version 3 on.
    pub fade: bool,
}

/// Text of a device: UTF-8, padded with zeros. It is untrusted input.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
pub struct Name([u8; Name::LEN]);

fields! {
    /// Identity and limits of a device.
    #[derive(Debug, Clone, Copy, PartialEq)]
    Identity {
        /// The nonce of HELLO.
        nonce: u32;
        /// Oldest and newest supported version.
        versions: [u8; 2];
        /// State of the device.
        state: DeviceState;
        /// Why the device is limp, or why the last playback ended.
        fault: Fault;
        /// Optional features.
        flags: Flags;
        /// Clock of the device, ms, wrapping.
        clock_ms: u32;
        /// Time without a fresh heartbeat after which the device goes limp, ms.
        watchdog_ms: u16;
        /// Largest number of nodes of a table.
        max_nodes: u16;
        /// Largest number of points of a path; 0 without probe mode.
        max_points: u32;
        /// Longest duration of a playback or recording, ms.
        longest_ms: u32;
        /// Servo periods per second.
        servo_hz: f64, if positive;
        /// Highest telemetry rate, samples per second.
        telemetry_hz: f64, if finite;
        /// Largest force, N.
        force_n: f64, if positive;
        /// Largest velocity limit, mm/s.
        velocity_mm_s: f64, if positive;
        /// Largest stiffness that it renders stably, N/mm.
        stiffness_n_per_mm: f64, if positive;
        /// Largest damping that it renders stably, N·s/mm.
        damping_n_s_per_mm: f64, if positive;
        /// Lowest and highest position of the handle, mm.
        stroke_mm: [f64; 2], if finite_range;
        /// Name and version of the firmware.
        firmware: Name;
        /// Serial number, the same on every port.
        serial: Name;
        /// What the device adds to a table; `None` from a device of minor version 0, or
        /// to a host of minor version 0.
        constants: Option<Constants>;
    }
}

fields! {
    /// What a device adds to a table and how long a COMMIT takes, from minor version 1
    /// on. A host predicts the force with these values.
    #[derive(Debug, Clone, Copy, PartialEq)]
    Constants {
        /// Minor version of the connection, the lower one of host and device, not 0.
        minor: u8, if not_zero;
        /// What the device does beyond minor version 0.
        features: Features;
        /// Longest time from COMMIT to its reply, at most 1000 ms.
        commit_ms: u16;
        /// Corner of the acceleration's low-pass, Hz.
        acceleration_hz: f64, if positive;
        /// Smallest mass that is rendered, kg, zero or negative; may be −∞.
        least_mass_kg: f64, if not_positive;
        /// Damping added to the table's, N·s/mm.
        damping_n_s_per_mm: f64, if finite;
        /// Stiffness of the wall beyond the range, N/mm.
        wall_n_per_mm: f64, if finite;
        /// Damping of the wall, N·s/mm.
        wall_n_s_per_mm: f64, if finite;
        /// How far beyond the range the device trips, mm.
        overtravel_mm: f64, if finite;
        /// Larger position changes in one servo period trip, mm.
        jump_mm: f64, if finite;
        /// Fastest change of force, N/s.
        slew_n_s: f64, if positive;
        /// Time from zero to full force, s.
        ramp_s: f64, if finite;
    }
}

fields! {
    /// State of the device and outcome of the last playback or recording.
    #[derive(Debug, Clone, Copy, PartialEq)]
    Outcome {
        /// State of the device.
        state: DeviceState;
        /// Why the device is limp, or why the playback ended; [`Fault::None`] after STOP.
        fault: Fault;
        /// What is loaded.
        loaded: Loaded;
        /// Clock of the device, ms, wrapping.
        clock_ms: u32;
        /// CRC of what is loaded; 0 if nothing is.
        crc: u32;
        /// The host's number of the last playback; 0 before the first.
        playback: u32;
        /// Duration of that playback, servo periods.
        ticks: u32;
        /// Samples taken for the stream.
        samples: u32;
        /// Full strokes.
        strokes: u32;
        /// Sign changes of the direction state.
        switches: u32;
        /// How often the force reached its limit.
        clamps: u32;
        /// Servo periods in which the slew limit was active.
        slewed: u32;
        /// Servo periods in which the mass was raised to the smallest one.
        mass_held: u32;
        /// Energy that the hand has put in, J.
        energy_j: f64, if finite;
        /// Smallest value of that energy, J.
        least_energy_j: f64, if finite;
        /// Largest magnitude of the commanded force, N.
        peak_force_n: f64, if finite;
        /// Mean square of the commanded force above 20 Hz, N².
        rough_n2: f64, if finite;
        /// Force limit of what is loaded, with every cap applied, N; 0 if nothing is.
        limit_n: f64, if finite;
        /// Frames discarded since power-up because of CRC, length, type or fields.
        bad_frames: u32;
        /// Heartbeats since power-up that were old or past their deadline.
        stale_beats: u32;
    }
}

fields! {
    /// Reply to a heartbeat.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    Pulse {
        /// Count of the heartbeat.
        count: u32;
        /// Whether the heartbeat was fresh.
        fresh: bool;
        /// State of the device.
        state: DeviceState;
        /// Why the device is limp, or why the last playback ended.
        fault: Fault;
        /// Clock of the device, ms, wrapping.
        clock_ms: u32;
    }
}

impl Field for Flags {
    const MAX_LEN: usize = 1;

    fn write(&self, out: &mut Writer) {
        let flags = [
            self.force_sensor,
            self.simulated,
            self.telemetry,
            self.probe,
        ];
        let bits = flags
            .iter()
            .rev()
            .fold(0, |bits, flag| bits << 1 | u8::from(*flag));
        bits.write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let bits = u8::read(from)?;
        let flags = Self {
            force_sensor: bits & 1 != 0,
            simulated: bits & 2 != 0,
            telemetry: bits & 4 != 0,
            probe: bits & 8 != 0,
        };
        (bits < 16).then_some(flags).ok_or(WireError::Field)
    }
}

/// Unknown bits are ignored, so that later minor versions can use them.
impl Field for Features {
    const MAX_LEN: usize = u32::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        let bits = u32::from(self.acceleration_from_speed)
            | u32::from(self.mechanism) << 1
            | u32::from(self.elements) << 2
            | u32::from(self.fade) << 3;
        bits.write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let bits = u32::read(from)?;
        Ok(Self {
            acceleration_from_speed: bits & 1 != 0,
            mechanism: bits & 2 != 0,
            elements: bits & 4 != 0,
            fade: bits & 8 != 0,
        })
    }
}

/// The end of a message: absent in minor version 0.
impl Field for Option<Constants> {
    const MAX_LEN: usize = Constants::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        if let Some(constants) = self {
            constants.write(out);
        }
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        match from.left() {
            0 => Ok(None),
            1..Constants::MAX_LEN => Err(WireError::Length),
            _ => Constants::read(from).map(Some),
        }
    }
}

impl Field for Name {
    const MAX_LEN: usize = Self::LEN;

    fn write(&self, out: &mut Writer) {
        out.bytes(&self.0);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self(from.array()?))
    }
}

impl Name {
    /// Its length in bytes.
    pub const LEN: usize = 32;

    /// As much of `text` as fits, cut between characters.
    pub const fn new(text: &str) -> Self {
        let mut end = text.len();
        while end > Self::LEN || !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; Self::LEN];
        let (used, _) = bytes.split_at_mut(end);
        used.copy_from_slice(text.as_bytes().split_at(end).0);
        Self(bytes)
    }

    /// Up to the first zero. Whatever the device sent: it may not be UTF-8.
    pub fn as_bytes(&self) -> &[u8] {
        let end = self.0.iter().position(|b| *b == 0).unwrap_or(Self::LEN);
        &self.0[..end]
    }
}

impl core::fmt::Debug for Name {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Name(\"{}\")", self.as_bytes().escape_ascii())
    }
}

fn finite(value: f64) -> bool {
    value.is_finite()
}

fn not_positive(value: f64) -> bool {
    value <= 0.0
}

fn not_zero(value: u8) -> bool {
    value != 0
}

fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// `[low, high]`, both finite.
fn finite_range([low, high]: [f64; 2]) -> bool {
    low.is_finite() && high.is_finite()
}
