//! Upload of a path for a probe: PATH_BEGIN, PATH_CHUNK.

use super::bytes::{Reader, Writer};
use super::{FixedVec, WireError};
use crate::frame::RunningCrc;

/// Properties of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathBegin {
    /// Number of points that follow.
    pub points: u32,
    /// Points per second, and samples per second of the recording.
    pub rate_hz: f64,
    /// Requested force limit, N.
    pub force_n: f64,
    /// Requested velocity limit, mm/s.
    pub velocity_mm_s: f64,
}

/// Consecutive points of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathChunk {
    /// Index of the first point, from 0.
    pub first: u32,
    /// One to 56 positions, nm.
    pub x_nm: FixedVec<i32, 56>,
}

/// Accumulates the CRC of a path.
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
    /// Largest number of points in one chunk.
    pub const MAX_POINTS: usize = 56;
    pub(super) const MAX_LEN: usize = 4 + 1 + Self::MAX_POINTS * 4;

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
        if !(1..=Self::MAX_POINTS).contains(&count) {
            return Err(WireError::Field);
        }
        let mut x_nm = FixedVec::new();
        for _ in 0..count {
            x_nm.push(from.i32()?);
        }
        Ok(Self { first, x_nm })
    }
}

impl PathCrc {
    /// Starts with the fields of PATH_BEGIN.
    pub fn of(begin: &PathBegin) -> Self {
        let mut crc = RunningCrc::new();
        let mut out = Writer::new();
        begin.write(&mut out);
        crc.update(out.done().unwrap_or_default());
        Self(crc)
    }

    /// Adds the next point.
    pub fn point(&mut self, x_nm: i32) {
        self.0.update(&x_nm.to_le_bytes());
    }

    /// The CRC of everything so far.
    pub fn value(&self) -> u32 {
        self.0.value()
    }
}
