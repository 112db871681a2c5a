//! Upload of a table: TABLE_BEGIN, TABLE_CHUNK.
//!
//! Values are not checked here. The handler checks limits and nodes and refuses an
//! invalid table with its own code.

use super::bytes::{Reader, Writer};
use super::{FixedVec, WireError};
use crate::frame::RunningCrc;
use crate::predict::{Direction, Lookup};

/// Properties and limits of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableBegin {
    /// Number of nodes that follow.
    pub nodes: u16,
    /// Interpolation between nodes.
    pub lookup: Lookup,
    /// How the branches for the two directions are combined.
    pub direction: Direction,
    /// Identified range, mm; the wall begins at its ends.
    pub range_mm: [f64; 2],
    /// Largest speed in the identification, mm/s.
    pub trained_mm_s: f64,
    /// Requested force limit, N.
    pub force_n: f64,
    /// Requested velocity limit, mm/s.
    pub velocity_mm_s: f64,
    /// If `Some`, the table may be played although its certificate fails, then with at
    /// most this force, N.
    pub uncertified_n: Option<f64>,
}

/// The parameters at one position.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Node {
    /// Position, mm.
    pub x_mm: f64,
    /// Mass, kg; damping, N·s/mm; stiffness, N/mm; offset force, N, for v > 0.
    pub positive: [f64; 4],
    /// The same for v < 0.
    pub negative: [f64; 4],
}

/// Consecutive nodes of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableChunk {
    /// Index of the first node, from 0.
    pub first: u16,
    /// One to three.
    pub nodes: FixedVec<Node, 3>,
}

/// Accumulates the CRC of a table.
#[derive(Debug, Clone, Default)]
pub struct TableCrc(RunningCrc);

impl TableBegin {
    pub(super) const LEN: usize = 2 + 1 + 1 + 1 + 8 * 7;

    pub(super) fn write(&self, out: &mut Writer) {
        let (rule, delta_mm) = match self.direction {
            Direction::Sign => (0, 0.0),
            Direction::Play { delta_mm } => (1, delta_mm),
            Direction::Dahl { delta_mm } => (2, delta_mm),
        };
        out.u16(self.nodes);
        out.u8(match self.lookup {
            Lookup::Linear => 0,
            Lookup::Floor => 1,
            Lookup::Nearest => 2,
        });
        out.u8(rule);
        out.u8(u8::from(self.uncertified_n.is_some()));
        out.f64(delta_mm);
        out.f64(self.range_mm[0]);
        out.f64(self.range_mm[1]);
        out.f64(self.trained_mm_s);
        out.f64(self.force_n);
        out.f64(self.velocity_mm_s);
        out.f64(self.uncertified_n.unwrap_or(0.0));
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let nodes = from.u16()?;
        let lookup = match from.u8()? {
            0 => Lookup::Linear,
            1 => Lookup::Floor,
            2 => Lookup::Nearest,
            _ => return Err(WireError::Field),
        };
        let rule = from.u8()?;
        let armed = from.u8()?;
        let delta_mm = from.f64()?;
        let direction = match rule {
            0 => Direction::Sign,
            1 => Direction::Play { delta_mm },
            2 => Direction::Dahl { delta_mm },
            _ => return Err(WireError::Field),
        };
        let range_mm = [from.f64()?, from.f64()?];
        let trained_mm_s = from.f64()?;
        let force_n = from.f64()?;
        let velocity_mm_s = from.f64()?;
        let cap_n = from.f64()?;
        let uncertified_n = match armed {
            0 => None,
            1 => Some(cap_n),
            _ => return Err(WireError::Field),
        };
        Ok(Self {
            nodes,
            lookup,
            direction,
            range_mm,
            trained_mm_s,
            force_n,
            velocity_mm_s,
            uncertified_n,
        })
    }
}

impl Node {
    const LEN: usize = 8 * 9;

    fn write(&self, out: &mut Writer) {
        out.f64(self.x_mm);
        for parameter in self.positive.iter().chain(&self.negative) {
            out.f64(*parameter);
        }
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let x_mm = from.f64()?;
        let mut branches = [[0.0; 4]; 2];
        for parameter in branches.iter_mut().flatten() {
            *parameter = from.f64()?;
        }
        let [positive, negative] = branches;
        Ok(Self {
            x_mm,
            positive,
            negative,
        })
    }
}

impl TableChunk {
    /// Largest number of nodes in one chunk.
    pub const MAX_NODES: usize = 3;
    pub(super) const MAX_LEN: usize = 2 + 1 + Self::MAX_NODES * Node::LEN;

    pub(super) fn write(&self, out: &mut Writer) {
        let nodes = self.nodes.as_slice();
        out.u16(self.first);
        out.u8(nodes.len() as u8);
        for node in nodes {
            node.write(out);
        }
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let first = from.u16()?;
        let count = usize::from(from.u8()?);
        if !(1..=Self::MAX_NODES).contains(&count) {
            return Err(WireError::Field);
        }
        let mut nodes = FixedVec::new();
        for _ in 0..count {
            nodes.push(Node::read(from)?);
        }
        Ok(Self { first, nodes })
    }
}

impl TableCrc {
    /// Starts with the fields of TABLE_BEGIN.
    pub fn of(begin: &TableBegin) -> Self {
        let mut crc = RunningCrc::new();
        let mut out = Writer::new();
        begin.write(&mut out);
        crc.update(out.done().unwrap_or_default());
        Self(crc)
    }

    /// Adds the next node.
    pub fn node(&mut self, node: &Node) {
        let mut out = Writer::new();
        node.write(&mut out);
        self.0.update(out.done().unwrap_or_default());
    }

    /// The CRC of everything so far.
    pub fn value(&self) -> u32 {
        self.0.value()
    }
}
