//! Upload of elements: ELEMENTS_BEGIN. The nodes follow as those of a table do.

use super::bytes::{Field, Reader, Writer};
use super::{FixedVec, WireError};
use crate::elements::{MAX_SPRINGS, Spring};

/// Properties and limits of a realization of elements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementsBegin {
    /// Number of nodes that follow in TABLE_CHUNKs, see [`Node::of_elements`](super::Node::of_elements).
    pub nodes: u16,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Identified range, mm; the wall begins at its ends.
    pub range_mm: [f64; 2],
    /// Largest speed in the identification, mm/s.
    pub trained_mm_s: f64,
    /// Requested force limit, N.
    pub force_n: f64,
    /// Requested velocity limit, mm/s.
    pub velocity_mm_s: f64,
    /// If `Some`, they may be played although their certificate fails, then with at most this
    /// force, N.
    pub uncertified_n: Option<f64>,
    /// The springs.
    pub springs: FixedVec<Spring, MAX_SPRINGS>,
}

/// A code and two numbers: 0 none, 1 stop, 2 Maxwell branch, 3 latch.
impl Field for Option<Spring> {
    const MAX_LEN: usize = 1 + 8 + 8;

    fn write(&self, out: &mut Writer) {
        let (code, numbers) = match *self {
            None => (0_u8, [0.0; 2]),
            Some(Spring::Stop { slip_mm }) => (1, [slip_mm, 0.0]),
            Some(Spring::Maxwell {
                slip_mm,
                relaxation_s,
            }) => (2, [slip_mm, relaxation_s]),
            Some(Spring::Latch { rearm_mm, break_mm }) => (3, [rearm_mm, break_mm]),
        };
        code.write(out);
        numbers.write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let code = u8::read(from)?;
        let [first, second] = <[f64; 2]>::read(from)?;
        // What is not used is zero: the CRC of COMMIT includes it.
        let unused = |value: f64| value.to_bits() == 0;
        match code {
            0 if unused(first) && unused(second) => Ok(None),
            1 if unused(second) => Ok(Some(Spring::Stop { slip_mm: first })),
            2 => Ok(Some(Spring::Maxwell {
                slip_mm: first,
                relaxation_s: second,
            })),
            3 => Ok(Some(Spring::Latch {
                rearm_mm: first,
                break_mm: second,
            })),
            _ => Err(WireError::Field),
        }
    }
}

/// The order on the wire is that of TABLE_BEGIN, with the springs at the end.
impl Field for ElementsBegin {
    const MAX_LEN: usize = 2 + 1 + 8 * 7 + MAX_SPRINGS * <Option<Spring>>::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        self.nodes.write(out);
        self.uncertified_n.is_some().write(out);
        self.mass_kg.write(out);
        self.range_mm.write(out);
        self.trained_mm_s.write(out);
        self.force_n.write(out);
        self.velocity_mm_s.write(out);
        self.uncertified_n.unwrap_or(0.0).write(out);
        for i in 0..MAX_SPRINGS {
            self.springs.as_slice().get(i).copied().write(out);
        }
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let nodes = u16::read(from)?;
        let uncertified = bool::read(from)?;
        let [
            mass_kg,
            low,
            high,
            trained_mm_s,
            force_n,
            velocity_mm_s,
            cap_n,
        ] = <[f64; 7]>::read(from)?;
        if !uncertified && cap_n.to_bits() != 0 {
            return Err(WireError::Field);
        }
        let mut springs = FixedVec::new();
        let mut ended = false;
        for _ in 0..MAX_SPRINGS {
            match <Option<Spring>>::read(from)? {
                None => ended = true,
                Some(_) if ended => return Err(WireError::Field),
                Some(spring) => {
                    springs.push(spring);
                }
            }
        }
        Ok(Self {
            nodes,
            mass_kg,
            range_mm: [low, high],
            trained_mm_s,
            force_n,
            velocity_mm_s,
            uncertified_n: uncertified.then_some(cap_n),
            springs,
        })
    }
}
