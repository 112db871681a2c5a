//! Upload of a table: TABLE_BEGIN, TABLE_CHUNK.
//!
//! Values are not checked here. The handler checks limits and nodes and refuses an
//! invalid table with its own code.

use super::bytes::{Field, Reader, Writer, fields};
use super::elements::ElementsBegin;
use super::mechanism::MechanismBegin;
use super::probe::PathBegin;
use super::{FixedVec, WireError};
use crate::elements::MAX_SPRINGS;
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

fields! {
    /// The parameters at one position.
    #[derive(Debug, Clone, Copy, PartialEq, Default)]
    Node {
        /// Position, mm.
        x_mm: f64;
        /// Mass, kg; damping, N·s/mm; stiffness, N/mm; offset force, N, for v > 0.
        positive: [f64; 4];
        /// The same for v < 0.
        negative: [f64; 4];
    }
}

fields! {
    /// Consecutive nodes of a table.
    #[derive(Debug, Clone, Copy, PartialEq)]
    TableChunk {
        /// Index of the first node, from 0.
        first: u16;
        /// One to three.
        nodes: FixedVec<Node, { TableChunk::MAX_NODES }>;
    }
}

impl Node {
    /// A node of elements: C, N, the damping for v > 0 and v < 0, N·s/mm, and the force of each
    /// spring, N, in the places of a table's parameters.
    pub fn of_elements(x_mm: f64, values: [f64; 3 + MAX_SPRINGS]) -> Self {
        let [c, forwards, backwards, first, rest @ ..] = values;
        Self {
            x_mm,
            positive: [c, forwards, backwards, first],
            negative: rest,
        }
    }
}

/// What elements have in common with a table.
impl From<&ElementsBegin> for TableBegin {
    fn from(begin: &ElementsBegin) -> Self {
        Self {
            nodes: begin.nodes,
            lookup: Lookup::Linear,
            direction: Direction::Sign,
            range_mm: begin.range_mm,
            trained_mm_s: begin.trained_mm_s,
            force_n: begin.force_n,
            velocity_mm_s: begin.velocity_mm_s,
            uncertified_n: begin.uncertified_n,
        }
    }
}

/// The order on the wire is not that of the fields.
impl Field for TableBegin {
    const MAX_LEN: usize = 2 + 1 + 1 + 1 + 8 * 7;

    fn write(&self, out: &mut Writer) {
        let rule = match self.direction {
            Direction::Sign => 0,
            Direction::Play { .. } => 1,
            Direction::Dahl { .. } => 2,
        };
        self.nodes.write(out);
        [self.lookup as u8, rule].write(out);
        self.uncertified_n.is_some().write(out);
        self.direction.delta_mm().unwrap_or(0.0).write(out);
        self.range_mm.write(out);
        self.trained_mm_s.write(out);
        self.force_n.write(out);
        self.velocity_mm_s.write(out);
        self.uncertified_n.unwrap_or(0.0).write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let nodes = u16::read(from)?;
        let [lookup, rule] = <[u8; 2]>::read(from)?;
        let uncertified = bool::read(from)?;
        let [
            delta_mm,
            low,
            high,
            trained_mm_s,
            force_n,
            velocity_mm_s,
            cap_n,
        ] = <[f64; 7]>::read(from)?;
        let lookup = Lookup::NAMES.get(usize::from(lookup));
        // What is not used is zero: the CRC of COMMIT includes it.
        let unused = |value: f64| value.to_bits() == 0;
        if (rule == 0 && !unused(delta_mm)) || (!uncertified && !unused(cap_n)) {
            return Err(WireError::Field);
        }
        Ok(Self {
            nodes,
            lookup: lookup.ok_or(WireError::Field)?.1,
            direction: match rule {
                0 => Direction::Sign,
                1 => Direction::Play { delta_mm },
                2 => Direction::Dahl { delta_mm },
                _ => return Err(WireError::Field),
            },
            range_mm: [low, high],
            trained_mm_s,
            force_n,
            velocity_mm_s,
            uncertified_n: uncertified.then_some(cap_n),
        })
    }
}

impl TableChunk {
    /// Largest number of nodes in one chunk.
    pub const MAX_NODES: usize = 3;
}

/// Accumulates the CRC of an upload: the fields of BEGIN, then every node, value or point.
#[derive(Debug, Clone, Default)]
pub struct UploadCrc(RunningCrc);

impl UploadCrc {
    /// Of nothing so far.
    pub const fn new() -> Self {
        Self(RunningCrc::new())
    }

    /// Starts with TABLE_BEGIN.
    pub fn of_table(begin: &TableBegin) -> Self {
        Self::default().with(begin)
    }

    /// Starts with PATH_BEGIN.
    pub fn of_path(begin: &PathBegin) -> Self {
        Self::default().with(begin)
    }

    /// Starts with MECHANISM_BEGIN.
    pub fn of_mechanism(begin: &MechanismBegin) -> Self {
        Self::default().with(begin)
    }

    /// Starts with ELEMENTS_BEGIN.
    pub fn of_elements(begin: &ElementsBegin) -> Self {
        Self::default().with(begin)
    }

    /// Adds the next value of a mechanism, N.
    pub fn value_n(&mut self, value: f64) {
        self.add(&value);
    }

    /// Adds the next node of a table.
    pub fn node(&mut self, node: &Node) {
        self.add(node);
    }

    /// Adds the next point of a path, nm.
    pub fn point(&mut self, x_nm: i32) {
        self.add(&x_nm);
    }

    /// The CRC of everything so far.
    pub fn value(&self) -> u32 {
        self.0.value()
    }

    fn with(mut self, begin: &impl Field) -> Self {
        self.add(begin);
        self
    }

    fn add(&mut self, part: &impl Field) {
        let mut out = Writer::new();
        part.write(&mut out);
        self.0.update(out.done().unwrap_or_default());
    }
}
