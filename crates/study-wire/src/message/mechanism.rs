//! Upload of a mechanism: MECHANISM_BEGIN, MECHANISM_CHUNK.
//!
//! As for a table, values are checked by the handler.

use super::bytes::{Field, Reader, Writer, fields};
use super::{FixedVec, WireError};
use crate::mechanism::{SCALARS, Scalars};

/// Parameters and limits of a mechanism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MechanismBegin {
    /// Number of values of the detent force; they follow first.
    pub detents: u16,
    /// Number of values of the follower's friction, which follow then.
    pub frictions: u16,
    /// Position of the first detent value and distance of two, mm.
    pub detent_mm: [f64; 2],
    /// The same of the friction.
    pub friction_mm: [f64; 2],
    /// Identified range, mm; the wall begins at its ends.
    pub range_mm: [f64; 2],
    /// Largest speed in the identification, mm/s.
    pub trained_mm_s: f64,
    /// Requested force limit, N.
    pub force_n: f64,
    /// Requested velocity limit, mm/s.
    pub velocity_mm_s: f64,
    /// If `Some`, the mechanism may be played although its certificate fails, then with at
    /// most this force, N.
    pub uncertified_n: Option<f64>,
    /// The parameters that do not depend on the position.
    pub scalars: Scalars,
}

fields! {
    /// Consecutive values, N: those of the detent force, then those of the friction.
    #[derive(Debug, Clone, Copy, PartialEq)]
    MechanismChunk {
        /// Index of the first value, from 0.
        first: u16;
        /// One to twelve.
        values: FixedVec<f64, { MechanismChunk::MAX_VALUES }>;
    }
}

impl MechanismChunk {
    /// Largest number of values in one chunk.
    pub const MAX_VALUES: usize = 12;
}

/// The order on the wire is that of TABLE_BEGIN, with the scalars at the end.
impl Field for MechanismBegin {
    const MAX_LEN: usize = 2 + 2 + 1 + 8 * (10 + SCALARS);

    fn write(&self, out: &mut Writer) {
        self.detents.write(out);
        self.frictions.write(out);
        self.uncertified_n.is_some().write(out);
        self.detent_mm.write(out);
        self.friction_mm.write(out);
        self.range_mm.write(out);
        self.trained_mm_s.write(out);
        self.force_n.write(out);
        self.velocity_mm_s.write(out);
        self.uncertified_n.unwrap_or(0.0).write(out);
        self.scalars.to_array().write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let [detents, frictions] = [u16::read(from)?, u16::read(from)?];
        let uncertified = bool::read(from)?;
        let detent_mm = <[f64; 2]>::read(from)?;
        let friction_mm = <[f64; 2]>::read(from)?;
        let range_mm = <[f64; 2]>::read(from)?;
        let [trained_mm_s, force_n, velocity_mm_s, cap_n] = <[f64; 4]>::read(from)?;
        // What is not used is zero: the CRC of COMMIT includes it.
        if !uncertified && cap_n.to_bits() != 0 {
            return Err(WireError::Field);
        }
        Ok(Self {
            detents,
            frictions,
            detent_mm,
            friction_mm,
            range_mm,
            trained_mm_s,
            force_n,
            velocity_mm_s,
            uncertified_n: uncertified.then_some(cap_n),
            scalars: Scalars::from_array(<[f64; SCALARS]>::read(from)?),
        })
    }
}
