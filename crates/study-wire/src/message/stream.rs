//! What a device sends by itself: TELEMETRY, EVENT, RECORDED.
//!
//! Nothing of it is acknowledged or repeated. Samples are counted from the start
//! of the playback, so that a host sees how many it has missed.

use super::bytes::{Reader, Writer};
use super::code::{Fault, Happening, State};
use super::{Few, WireError};

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
    /// Measured force, µN, or [`super::fixed::NONE`].
    pub measured_un: i32,
}

/// Some samples of a playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// Which playback.
    pub playback: u32,
    /// How many samples of it came before, whether they arrived or not.
    pub first: u32,
    /// The device's clock when the last of the samples was taken, ms, wrapping.
    pub clock_ms: u32,
    /// Full strokes so far.
    pub strokes: u32,
    /// Clamps so far.
    pub clamps: u32,
    /// One to ten.
    pub samples: Few<TelemetrySample, 10>,
}

/// Something has happened. If it gets lost, the next PULSE or OUTCOME says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// What.
    pub what: Happening,
    /// The device's state from then on.
    pub state: State,
    /// Why.
    pub fault: Fault,
    /// The playback's number.
    pub playback: u32,
    /// Servo periods since the start.
    pub tick: u32,
    /// The device's clock, ms, wrapping.
    pub clock_ms: u32,
}

/// What the probe measured at one point of its path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordedPoint {
    /// Position, nm.
    pub x_nm: i32,
    /// Force that the probe applies, µN.
    pub force_un: i32,
    /// Acceleration, µm/s².
    pub a_um_s2: i32,
}

/// Some samples of a recording: the n-th belongs to the n-th point of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recorded {
    /// Which recording.
    pub playback: u32,
    /// Number of the first, from 0.
    pub first: u32,
    /// The device's clock when the last of them was taken, ms, wrapping.
    pub clock_ms: u32,
    /// One to 18.
    pub points: Few<RecordedPoint, 18>,
}

impl Telemetry {
    /// Most samples in one message.
    pub const MOST: usize = 10;
    pub(super) const MOST_LEN: usize = 4 * 5 + 1 + Self::MOST * 20;

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
            out.i32(sample.measured_un);
        }
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let mut telemetry = Self {
            playback: from.u32()?,
            first: from.u32()?,
            clock_ms: from.u32()?,
            strokes: from.u32()?,
            clamps: from.u32()?,
            samples: Few::new(),
        };
        for _ in 0..count(from, Self::MOST)? {
            telemetry.samples.push(TelemetrySample {
                tick: from.u32()?,
                x_nm: from.i32()?,
                v_um_s: from.i32()?,
                command_un: from.i32()?,
                measured_un: from.i32()?,
            });
        }
        Ok(telemetry)
    }
}

impl Event {
    pub(super) fn write(&self, out: &mut Writer) {
        out.u8(self.what.code());
        out.u8(self.state.code());
        out.u8(self.fault.code());
        out.u32(self.playback);
        out.u32(self.tick);
        out.u32(self.clock_ms);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            what: Happening::from_code(from.u8()?).ok_or(WireError::Field)?,
            state: State::from_code(from.u8()?).ok_or(WireError::Field)?,
            fault: Fault::from_code(from.u8()?).ok_or(WireError::Field)?,
            playback: from.u32()?,
            tick: from.u32()?,
            clock_ms: from.u32()?,
        })
    }
}

impl Recorded {
    /// Most samples in one message.
    pub const MOST: usize = 18;
    pub(super) const MOST_LEN: usize = 4 * 3 + 1 + Self::MOST * 12;

    pub(super) fn write(&self, out: &mut Writer) {
        let points = self.points.as_slice();
        out.u32(self.playback);
        out.u32(self.first);
        out.u32(self.clock_ms);
        out.u8(points.len() as u8);
        for point in points {
            out.i32(point.x_nm);
            out.i32(point.force_un);
            out.i32(point.a_um_s2);
        }
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let mut recorded = Self {
            playback: from.u32()?,
            first: from.u32()?,
            clock_ms: from.u32()?,
            points: Few::new(),
        };
        for _ in 0..count(from, Self::MOST)? {
            recorded.points.push(RecordedPoint {
                x_nm: from.i32()?,
                force_un: from.i32()?,
                a_um_s2: from.i32()?,
            });
        }
        Ok(recorded)
    }
}

fn count(from: &mut Reader<'_>, most: usize) -> Result<usize, WireError> {
    let count = usize::from(from.u8()?);
    if (1..=most).contains(&count) {
        Ok(count)
    } else {
        Err(WireError::Field)
    }
}
