//! Unsolicited messages of a device: TELEMETRY, EVENT, RECORDED.
//!
//! They are neither acknowledged nor repeated. Samples are numbered from the start
//! of the playback, so that a host can count lost ones.

use super::bytes::{Reader, Writer};
use super::code::{DeviceState, EventKind, Fault};
use super::{FixedVec, WireError};

/// Code on the wire for a force without a sensor.
const NO_SENSOR: i32 = i32::MIN;

/// One servo period of a playback. See [`super::fixed`] for the units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TelemetrySample {
    /// Servo periods since the start.
    pub tick: u32,
    /// Position, nm.
    pub x_nm: i32,
    /// Speed, µm/s.
    pub v_um_s: i32,
    /// Commanded force, µN, after every limit.
    pub command_un: i32,
    /// Measured force, µN; `None` without a force sensor.
    pub measured_un: Option<i32>,
}

/// Consecutive samples of a playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// The host's number of the playback.
    pub playback: u32,
    /// Number of earlier samples of this playback, received or lost.
    pub first: u32,
    /// Clock of the device when the last of the samples was taken, ms, wrapping.
    pub clock_ms: u32,
    /// Full strokes so far.
    pub strokes: u32,
    /// Clamps so far.
    pub clamps: u32,
    /// One to ten.
    pub samples: FixedVec<TelemetrySample, 10>,
}

/// A change of state. If it is lost, the next PULSE or OUTCOME shows the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// Kind of the event.
    pub kind: EventKind,
    /// State of the device after the event.
    pub state: DeviceState,
    /// Cause of the event.
    pub fault: Fault,
    /// The host's number of the playback.
    pub playback: u32,
    /// Servo periods since the start of the playback.
    pub tick: u32,
    /// Clock of the device, ms, wrapping.
    pub clock_ms: u32,
}

/// Measurement of the probe at one point of its path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordedPoint {
    /// Position, nm.
    pub x_nm: i32,
    /// Force that the probe applies, µN; `None` without a force sensor.
    pub force_un: Option<i32>,
    /// Acceleration, µm/s².
    pub a_um_s2: i32,
}

/// Consecutive samples of a recording; sample n belongs to point n of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recorded {
    /// The host's number of the recording.
    pub playback: u32,
    /// Number of the first sample, from 0.
    pub first: u32,
    /// Clock of the device when the last of the samples was taken, ms, wrapping.
    pub clock_ms: u32,
    /// One to 18.
    pub points: FixedVec<RecordedPoint, 18>,
}

impl Telemetry {
    /// Largest number of samples in one message.
    pub const MAX_SAMPLES: usize = 10;
    pub(super) const MAX_LEN: usize = 4 * 5 + 1 + Self::MAX_SAMPLES * 20;

    pub(super) fn write(&self, out: &mut Writer) {
        let samples = self.samples.as_slice();
        for count in [
            self.playback,
            self.first,
            self.clock_ms,
            self.strokes,
            self.clamps,
        ] {
            out.u32(count);
        }
        out.u8(samples.len() as u8);
        for sample in samples {
            out.u32(sample.tick);
            out.i32(sample.x_nm);
            out.i32(sample.v_um_s);
            out.i32(sample.command_un);
            out.i32(sample.measured_un.unwrap_or(NO_SENSOR));
        }
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let mut telemetry = Self {
            playback: from.u32()?,
            first: from.u32()?,
            clock_ms: from.u32()?,
            strokes: from.u32()?,
            clamps: from.u32()?,
            samples: FixedVec::new(),
        };
        for _ in 0..count(from, Self::MAX_SAMPLES)? {
            telemetry.samples.push(TelemetrySample {
                tick: from.u32()?,
                x_nm: from.i32()?,
                v_um_s: from.i32()?,
                command_un: from.i32()?,
                measured_un: force(from)?,
            });
        }
        Ok(telemetry)
    }
}

impl Event {
    pub(super) fn write(&self, out: &mut Writer) {
        out.u8(self.kind.code());
        out.u8(self.state.code());
        out.u8(self.fault.code());
        out.u32(self.playback);
        out.u32(self.tick);
        out.u32(self.clock_ms);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            kind: EventKind::from_code(from.u8()?).ok_or(WireError::Field)?,
            state: DeviceState::from_code(from.u8()?).ok_or(WireError::Field)?,
            fault: Fault::from_code(from.u8()?).ok_or(WireError::Field)?,
            playback: from.u32()?,
            tick: from.u32()?,
            clock_ms: from.u32()?,
        })
    }
}

impl Recorded {
    /// Largest number of samples in one message.
    pub const MAX_POINTS: usize = 18;
    pub(super) const MAX_LEN: usize = 4 * 3 + 1 + Self::MAX_POINTS * 12;

    pub(super) fn write(&self, out: &mut Writer) {
        let points = self.points.as_slice();
        out.u32(self.playback);
        out.u32(self.first);
        out.u32(self.clock_ms);
        out.u8(points.len() as u8);
        for point in points {
            out.i32(point.x_nm);
            out.i32(point.force_un.unwrap_or(NO_SENSOR));
            out.i32(point.a_um_s2);
        }
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let mut recorded = Self {
            playback: from.u32()?,
            first: from.u32()?,
            clock_ms: from.u32()?,
            points: FixedVec::new(),
        };
        for _ in 0..count(from, Self::MAX_POINTS)? {
            recorded.points.push(RecordedPoint {
                x_nm: from.i32()?,
                force_un: force(from)?,
                a_um_s2: from.i32()?,
            });
        }
        Ok(recorded)
    }
}

fn force(from: &mut Reader<'_>) -> Result<Option<i32>, WireError> {
    let force_un = from.i32()?;
    Ok((force_un != NO_SENSOR).then_some(force_un))
}

fn count(from: &mut Reader<'_>, max: usize) -> Result<usize, WireError> {
    let count = usize::from(from.u8()?);
    if (1..=max).contains(&count) {
        Ok(count)
    } else {
        Err(WireError::Field)
    }
}
