//! Simulates the designs of a plan on all cores.

use super::{Cell, CellResult, Chunk, Plan, enough, merge, run_chunk};
use rayon::prelude::*;

/// A design and the index of one of its chunks: what is simulated at once.
pub type Unit = (Cell, u64);

/// Is called after each unit, from any thread.
pub type Progress<'a> = &'a (dyn Fn() + Sync);

impl Plan {
    /// The units of [`Plan::cells`], in order.
    pub fn units(&self) -> Vec<Unit> {
        self.units_of(&self.cells())
    }

    /// The units of some designs, in order.
    pub fn units_of(&self, cells: &[Cell]) -> Vec<Unit> {
        let chunks = self.settings.chunks();
        (cells.iter().copied())
            .flat_map(|cell| (0..chunks).map(move |chunk| (cell, chunk)))
            .collect()
    }

    /// Simulates units on the threads of the current pool, which decide no number. The chunks
    /// are in the order of the units.
    pub fn simulate(&self, units: &[Unit], progress: Progress<'_>) -> Vec<Chunk> {
        (units.par_iter().with_max_len(1))
            .map(|(cell, chunk)| {
                let found = run_chunk(&self.settings, cell, *chunk);
                progress();
                found
            })
            .collect()
    }

    /// Simulates whole designs, with [`Plan::within`] each only until its interval is narrow
    /// enough: one chunk of each open design at a time, so that threads decide nothing. The
    /// chunk of a unit that was not needed is missing.
    pub fn simulate_designs(&self, units: &[Unit], progress: Progress<'_>) -> Vec<Option<Chunk>> {
        let Some(within) = self.within else {
            return (self.simulate(units, progress).into_iter())
                .map(Some)
                .collect();
        };
        let mut found: Vec<Option<Chunk>> = vec![None; units.len()];
        for index in 0..self.settings.chunks() {
            let mut places = Vec::new();
            let mut start = 0;
            for same in units.chunk_by(|a, b| a.0 == b.0) {
                let done = found[start..start + same.len()].iter().flatten();
                if !enough(done, within).1 {
                    places.push(start + index as usize);
                }
                start += same.len();
            }
            let open: Vec<Unit> = places.iter().map(|at| units[*at]).collect();
            let chunks = self.simulate(&open, progress);
            for (at, chunk) in places.into_iter().zip(chunks) {
                found[at] = Some(chunk);
            }
        }
        found
    }

    /// The results of the designs whose chunks are there.
    pub fn results(&self, units: &[Unit], chunks: &[Option<Chunk>]) -> Vec<CellResult> {
        let mut found = Vec::new();
        let mut start = 0;
        for same in units.chunk_by(|a, b| a.0 == b.0) {
            let own = chunks[start..start + same.len()].iter().flatten();
            let needed = self
                .within
                .map_or(usize::MAX, |within| enough(own.clone(), within).0);
            found.extend(merge(&self.settings, same[0].0, own.take(needed)));
            start += same.len();
        }
        found
    }
}
