//! Upload of a path for a probe: PATH_BEGIN, PATH_CHUNK.

use super::FixedVec;
use super::bytes::{Field as _, Writer, fields};
use crate::frame::RunningCrc;

fields! {
    /// Properties of a path.
    #[derive(Debug, Clone, Copy, PartialEq)]
    PathBegin {
        /// Number of points that follow.
        points: u32;
        /// Points per second, and samples per second of the recording.
        rate_hz: f64;
        /// Requested force limit, N.
        force_n: f64;
        /// Requested velocity limit, mm/s.
        velocity_mm_s: f64;
    }
}

fields! {
    /// Consecutive points of a path.
    #[derive(Debug, Clone, Copy, PartialEq)]
    PathChunk {
        /// Index of the first point, from 0.
        first: u32;
        /// One to 56 positions, nm.
        x_nm: FixedVec<i32, { PathChunk::MAX_POINTS }>;
    }
}

/// Accumulates the CRC of a path.
#[derive(Debug, Clone, Default)]
pub struct PathCrc(RunningCrc);

impl PathChunk {
    /// Largest number of points in one chunk.
    pub const MAX_POINTS: usize = 56;
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
