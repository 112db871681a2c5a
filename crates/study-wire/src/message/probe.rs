//! The upload of a path for a probe: PATH_BEGIN, PATH_CHUNK.

use super::bytes::{Reader, Writer};
use super::{Few, WireError};
use crate::frame::RunningCrc;

/// What a path is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathBegin {
    /// How many points follow.
    pub points: u32,
    /// Points per second; the recording has as many samples.
    pub rate_hz: f64,
    /// The largest force asked for, N.
    pub force_n: f64,
    /// The speed above which it trips asked for, mm/s.
    pub velocity_mm_s: f64,
}

/// Some points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathChunk {
    /// Number of the first, from 0.
    pub first: u32,
    /// One to 56 positions, nm.
    pub x_nm: Few<i32, 56>,
}

/// The CRC over a whole path.
#[derive(Debug, Clone, Default)]
pub struct PathCrc(RunningCrc);

impl PathBegin {
    pub(super) const LEN: usize = 4 + 8 * 3;

    pub(super) fn write(&self, out: &mut Writer) {
        out.u32(self.points);
        out.f64(self.rate_hz);
        out.f64(self.force_n);
        out.f64(self.velocity_mm_s);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            points: from.u32()?,
            rate_hz: from.f64()?,
            force_n: from.f64()?,
            velocity_mm_s: from.f64()?,
        })
    }
}

impl PathChunk {
    /// Most points in one chunk.
    pub const MOST: usize = 56;
    pub(super) const MOST_LEN: usize = 4 + 1 + Self::MOST * 4;

    pub(super) fn write(&self, out: &mut Writer) {
        let points = self.x_nm.as_slice();
        out.u32(self.first);
        out.u8(points.len() as u8);
        for x_nm in points {
            out.i32(*x_nm);
        }
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let first = from.u32()?;
        let count = usize::from(from.u8()?);
        if !(1..=Self::MOST).contains(&count) {
            return Err(WireError::Field);
        }
        let mut x_nm = Few::new();
        for _ in 0..count {
            x_nm.push(from.i32()?);
        }
        Ok(Self { first, x_nm })
    }
}

impl PathCrc {
    /// Of a path that begins so.
    pub fn of(begin: &PathBegin) -> Self {
        let mut crc = RunningCrc::new();
        let mut out = Writer::new();
        begin.write(&mut out);
        crc.update(out.done().unwrap_or_default());
        Self(crc)
    }

    /// Takes in the next point.
    pub fn point(&mut self, x_nm: i32) {
        self.0.update(&x_nm.to_le_bytes());
    }

    /// Of everything so far.
    pub fn value(&self) -> u32 {
        self.0.value()
    }
}
