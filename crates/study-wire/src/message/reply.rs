//! Replies of a device: ACK, IDENTITY, OUTCOME, PULSE.

use super::WireError;
use super::bytes::{Reader, Writer};
use super::code::{DeviceState, Fault, Loaded, Refusal};

/// Result of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ack {
    /// Type of the request.
    pub request: u8,
    /// [`Refusal::None`] if the request was executed.
    pub refusal: Refusal,
    /// State of the device after the request.
    pub state: DeviceState,
    /// Why the device is limp, or why the last playback ended.
    pub fault: Fault,
    /// Clock of the device, ms, wrapping.
    pub clock_ms: u32,
    /// Detail of the refusal, see [`Refusal`]; else 0.
    pub detail: u32,
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

/// Text of a device: UTF-8, padded with zeros. It is untrusted input.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
pub struct Name([u8; Name::LEN]);

/// Identity and limits of a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identity {
    /// The nonce of HELLO.
    pub nonce: u32,
    /// Oldest and newest supported version.
    pub versions: [u8; 2],
    /// State of the device.
    pub state: DeviceState,
    /// Why the device is limp, or why the last playback ended.
    pub fault: Fault,
    /// Optional features.
    pub flags: Flags,
    /// Clock of the device, ms, wrapping.
    pub clock_ms: u32,
    /// Time without a fresh heartbeat after which the device goes limp, ms.
    pub watchdog_ms: u16,
    /// Largest number of nodes of a table.
    pub max_nodes: u16,
    /// Largest number of points of a path; 0 without probe mode.
    pub max_points: u32,
    /// Longest duration of a playback or recording, ms.
    pub longest_ms: u32,
    /// Servo periods per second.
    pub servo_hz: f64,
    /// Highest telemetry rate, samples per second.
    pub telemetry_hz: f64,
    /// Largest force, N.
    pub force_n: f64,
    /// Largest velocity limit, mm/s.
    pub velocity_mm_s: f64,
    /// Largest stiffness that it renders stably, N/mm.
    pub stiffness_n_per_mm: f64,
    /// Largest damping that it renders stably, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Lowest and highest position of the handle, mm.
    pub stroke_mm: [f64; 2],
    /// Name and version of the firmware.
    pub firmware: Name,
    /// Serial number, the same on every port.
    pub serial: Name,
}

/// State of the device and outcome of the last playback or recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// State of the device.
    pub state: DeviceState,
    /// Why the device is limp, or why the playback ended; [`Fault::None`] after STOP.
    pub fault: Fault,
    /// What is loaded.
    pub loaded: Loaded,
    /// Clock of the device, ms, wrapping.
    pub clock_ms: u32,
    /// CRC of what is loaded; 0 if nothing is.
    pub crc: u32,
    /// The host's number of the last playback; 0 before the first.
    pub playback: u32,
    /// Duration of that playback, servo periods.
    pub ticks: u32,
    /// Samples taken for the stream.
    pub samples: u32,
    /// Full strokes.
    pub strokes: u32,
    /// Sign changes of the direction state.
    pub switches: u32,
    /// How often the force reached its limit.
    pub clamps: u32,
    /// Servo periods in which the slew limit was active.
    pub slewed: u32,
    /// Servo periods in which the mass was raised to the smallest one.
    pub mass_held: u32,
    /// Energy that the hand has put in, J.
    pub energy_j: f64,
    /// Smallest value of that energy, J.
    pub least_energy_j: f64,
    /// Largest magnitude of the commanded force, N.
    pub peak_force_n: f64,
    /// Mean square of the commanded force above 20 Hz, N².
    pub rough_n2: f64,
    /// Force limit of what is loaded, with every cap applied, N; 0 if nothing is.
    pub limit_n: f64,
    /// Frames discarded since power-up because of CRC, length, type or fields.
    pub bad_frames: u32,
    /// Heartbeats since power-up that were old or past their deadline.
    pub stale_beats: u32,
}

/// Reply to a heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pulse {
    /// Count of the heartbeat.
    pub count: u32,
    /// Whether the heartbeat was fresh.
    pub fresh: bool,
    /// State of the device.
    pub state: DeviceState,
    /// Why the device is limp, or why the last playback ended.
    pub fault: Fault,
    /// Clock of the device, ms, wrapping.
    pub clock_ms: u32,
}

fn state(from: &mut Reader<'_>) -> Result<DeviceState, WireError> {
    DeviceState::from_code(from.u8()?).ok_or(WireError::Field)
}

fn fault(from: &mut Reader<'_>) -> Result<Fault, WireError> {
    Fault::from_code(from.u8()?).ok_or(WireError::Field)
}

impl Ack {
    pub(super) fn write(&self, out: &mut Writer) {
        out.u8(self.request);
        out.u8(self.refusal.code());
        out.u8(self.state.code());
        out.u8(self.fault.code());
        out.u32(self.clock_ms);
        out.u32(self.detail);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            request: from.u8()?,
            refusal: Refusal::from_code(from.u8()?).ok_or(WireError::Field)?,
            state: state(from)?,
            fault: fault(from)?,
            clock_ms: from.u32()?,
            detail: from.u32()?,
        })
    }
}

impl Flags {
    fn bits(self) -> u8 {
        u8::from(self.force_sensor)
            | u8::from(self.simulated) << 1
            | u8::from(self.telemetry) << 2
            | u8::from(self.probe) << 3
    }

    fn from_bits(bits: u8) -> Option<Self> {
        (bits < 16).then_some(Self {
            force_sensor: bits & 1 != 0,
            simulated: bits & 2 != 0,
            telemetry: bits & 4 != 0,
            probe: bits & 8 != 0,
        })
    }
}

impl Name {
    /// Its length in bytes.
    pub const LEN: usize = 32;

    /// As much of `text` as fits, cut between characters.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(Self::LEN);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; Self::LEN];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
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

impl Identity {
    pub(super) const LEN: usize = 4 + 2 + 3 + 4 + 2 + 2 + 4 + 4 + 8 * 8 + 2 * Name::LEN;

    pub(super) fn write(&self, out: &mut Writer) {
        out.u32(self.nonce);
        out.bytes(&self.versions);
        out.u8(self.state.code());
        out.u8(self.fault.code());
        out.u8(self.flags.bits());
        out.u32(self.clock_ms);
        out.u16(self.watchdog_ms);
        out.u16(self.max_nodes);
        out.u32(self.max_points);
        out.u32(self.longest_ms);
        out.f64(self.servo_hz);
        out.f64(self.telemetry_hz);
        out.f64(self.force_n);
        out.f64(self.velocity_mm_s);
        out.f64(self.stiffness_n_per_mm);
        out.f64(self.damping_n_s_per_mm);
        out.f64(self.stroke_mm[0]);
        out.f64(self.stroke_mm[1]);
        out.bytes(&self.firmware.0);
        out.bytes(&self.serial.0);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            nonce: from.u32()?,
            versions: from.array()?,
            state: state(from)?,
            fault: fault(from)?,
            flags: Flags::from_bits(from.u8()?).ok_or(WireError::Field)?,
            clock_ms: from.u32()?,
            watchdog_ms: from.u16()?,
            max_nodes: from.u16()?,
            max_points: from.u32()?,
            longest_ms: from.u32()?,
            servo_hz: positive(from)?,
            telemetry_hz: from.finite()?,
            force_n: positive(from)?,
            velocity_mm_s: positive(from)?,
            stiffness_n_per_mm: positive(from)?,
            damping_n_s_per_mm: positive(from)?,
            stroke_mm: [from.finite()?, from.finite()?],
            firmware: Name(from.array()?),
            serial: Name(from.array()?),
        })
    }
}

fn positive(from: &mut Reader<'_>) -> Result<f64, WireError> {
    let value = from.finite()?;
    if value > 0.0 {
        Ok(value)
    } else {
        Err(WireError::Field)
    }
}

impl Outcome {
    pub(super) const LEN: usize = 3 + 4 * 10 + 8 * 5 + 4 * 2;

    pub(super) fn write(&self, out: &mut Writer) {
        out.u8(self.state.code());
        out.u8(self.fault.code());
        out.u8(self.loaded.code());
        for count in [
            self.clock_ms,
            self.crc,
            self.playback,
            self.ticks,
            self.samples,
            self.strokes,
            self.switches,
            self.clamps,
            self.slewed,
            self.mass_held,
        ] {
            out.u32(count);
        }
        for quantity in [
            self.energy_j,
            self.least_energy_j,
            self.peak_force_n,
            self.rough_n2,
            self.limit_n,
        ] {
            out.f64(quantity);
        }
        out.u32(self.bad_frames);
        out.u32(self.stale_beats);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            state: state(from)?,
            fault: fault(from)?,
            loaded: Loaded::from_code(from.u8()?).ok_or(WireError::Field)?,
            clock_ms: from.u32()?,
            crc: from.u32()?,
            playback: from.u32()?,
            ticks: from.u32()?,
            samples: from.u32()?,
            strokes: from.u32()?,
            switches: from.u32()?,
            clamps: from.u32()?,
            slewed: from.u32()?,
            mass_held: from.u32()?,
            energy_j: from.finite()?,
            least_energy_j: from.finite()?,
            peak_force_n: from.finite()?,
            rough_n2: from.finite()?,
            limit_n: from.finite()?,
            bad_frames: from.u32()?,
            stale_beats: from.u32()?,
        })
    }
}

impl Pulse {
    pub(super) fn write(&self, out: &mut Writer) {
        out.u32(self.count);
        out.u8(u8::from(self.fresh));
        out.u8(self.state.code());
        out.u8(self.fault.code());
        out.u32(self.clock_ms);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            count: from.u32()?,
            fresh: match from.u8()? {
                0 => false,
                1 => true,
                _ => return Err(WireError::Field),
            },
            state: state(from)?,
            fault: fault(from)?,
            clock_ms: from.u32()?,
        })
    }
}
