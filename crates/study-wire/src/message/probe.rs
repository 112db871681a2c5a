//! Upload of a path for a probe: PATH_BEGIN, PATH_CHUNK.

use super::FixedVec;
use super::bytes::fields;

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

impl PathChunk {
    /// Largest number of points in one chunk.
    pub const MAX_POINTS: usize = 56;
}
