//! Reading and writing of model files.

/// A table has no more nodes than this.
pub const MOST_NODES: usize = 20_000;
