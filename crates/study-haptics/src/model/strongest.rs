//! The largest force that a table asks for.

use super::Realization;
use study_wire::predict::{Lookup, Motion, force_n};

/// Beside a jump, mm.
const BESIDE_MM: f64 = 1e-9;

impl Realization {
    /// The largest force, N, over the trained range of positions and up to the trained speed in both directions, at a constant
    /// speed: between nodes as well, where k x + F0 is quadratic. What a mass asks for is not part of it, since no acceleration
    /// is stated, and neither is what the state of a mechanism or of elements adds in fast motion.
    pub fn strongest_n(&self) -> f64 {
        let motions = [(1.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (-1.0, -1.0)];
        let of = |(z, share): (f64, f64)| self.strongest_at(z, share * self.trained.v_mm_s);
        motions.map(of).into_iter().fold(0.0, f64::max)
    }

    /// The same in one direction at one speed.
    fn strongest_at(&self, z: f64, v_mm_s: f64) -> f64 {
        let table = self.table();
        let force = |x_mm: f64| {
            let motion = Motion {
                v_mm_s,
                ..Motion::at_rest(x_mm)
            };
            force_n(&table, z, motion)
        };
        let breaks = self.breaks();
        let of_piece = |piece: &[f64]| {
            let (from, to) = (piece[0], piece[1]);
            let beside = BESIDE_MM.min(0.25 * (to - from));
            // Without the ends, at which parameters may jump.
            let (low, high) = (from + beside, to - beside);
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            let [left, center, right] = [low, middle, high].map(force);
            // The parabola through the three, which is exact.
            let bend = (left - 2.0 * center + right) / (2.0 * half * half);
            let vertex = middle - (right - left) / (4.0 * half * bend);
            let within = vertex > low && vertex < high;
            let vertex = if within { force(vertex) } else { center };
            let all = [force(from), left, center, vertex, right, force(to)];
            all.into_iter().fold(0.0, |most: f64, n| most.max(n.abs()))
        };
        breaks.windows(2).map(of_piece).fold(0.0, f64::max)
    }

    /// Ends of the pieces of the trained range in which the force is smooth, mm, rising.
    fn breaks(&self) -> Vec<f64> {
        let [low, high] = self.trained.x_mm;
        let middles = self.x_mm.windows(2).map(|two| 0.5 * (two[0] + two[1]));
        let middles = middles.filter(|_| self.lookup == Lookup::Nearest);
        let all = self.x_mm.iter().copied().chain(middles);
        let inside = all.filter(|x| low < *x && *x < high);
        let mut breaks: Vec<f64> = inside.chain([low, high]).collect();
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        breaks
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{Branch, Provenance, Realization, Trained, Units};
    use proptest::prelude::*;
    use std::collections::BTreeMap;
    use study_wire::predict::{Direction, Lookup, Motion, force_n};

    fn table(values: &[f64], lookup: Lookup, x_mm: [f64; 2]) -> Realization {
        let mut next = values.iter().cycle().copied();
        let mut branch = || Branch {
            m_kg: vec![0.1; 4],
            b_n_s_per_mm: next.by_ref().take(4).map(|v| 0.02 * v).collect(),
            k_n_per_mm: next.by_ref().take(4).map(|v| 2.0 * v).collect(),
            f0_n: next.by_ref().take(4).map(|v| 5.0 * v).collect(),
        };
        Realization {
            id: "t".to_owned(),
            provenance: Provenance::default(),
            vaf: BTreeMap::new(),
            units: Units::Linear,
            lookup,
            direction: Direction::Play { delta_mm: 0.5 },
            trained: Trained {
                x_mm,
                v_mm_s: 120.0,
            },
            x_mm: vec![0.0, 1.0, 2.5, 4.0],
            positive: branch(),
            negative: branch(),
            mechanism: None,
            elements: None,
        }
    }

    /// By brute force, at 4001 positions and 5 speeds in each direction.
    fn searched(table: &Realization) -> f64 {
        let [low, high] = table.trained.x_mm;
        let mut most = 0.0_f64;
        for i in 0..=4000 {
            let x_mm = low + f64::from(i) / 4000.0 * (high - low);
            for (z, j) in [1.0, -1.0]
                .into_iter()
                .flat_map(|z| (0..5).map(move |j| (z, j)))
            {
                let motion = Motion {
                    x_mm,
                    v_mm_s: z * f64::from(j) / 4.0 * table.trained.v_mm_s,
                    a_m_s2: 0.0,
                };
                most = most.max(force_n(&table.table(), z, motion).abs());
            }
        }
        most
    }

    proptest! {
        #[test]
        fn the_strongest_force_is_that_of_an_exhaustive_search(
            values in prop::collection::vec(-1.0f64..1.0, 24),
            ends in prop::array::uniform2(-0.8f64..0.8),
            lookup in prop::sample::select(vec![Lookup::Linear, Lookup::Floor, Lookup::Nearest]),
        ) {
            // Beyond the nodes and within them.
            let table = table(&values, lookup, [ends[0], 4.0 + ends[1]]);
            let (found, expected) = (table.strongest_n(), searched(&table));
            prop_assert!(found >= expected - 1e-6, "{found} {expected}");
            // A step of the search is 1.4 µm of at most some 20 N/mm.
            prop_assert!(found <= expected + 0.05, "{found} {expected}");
        }
    }

    /// k from 1 to −1 N/mm and F0 from 0 to 4 N over 2 mm: the force is largest between the nodes.
    #[test]
    fn the_force_between_nodes_and_in_motion_counts() {
        let flat = |v: f64| vec![v; 2];
        let branch = Branch {
            m_kg: flat(0.0),
            b_n_s_per_mm: flat(0.0),
            k_n_per_mm: vec![1.0, -1.0],
            f0_n: vec![0.0, 4.0],
        };
        let mut arch = Realization {
            x_mm: vec![0.0, 2.0],
            positive: branch.clone(),
            negative: branch,
            ..table(&[0.0], Lookup::Linear, [0.0, 2.0])
        };
        // (1 − x) x + 2 x: 0 at 0, 2 at 2, 2.25 at 1.5.
        assert!((arch.strongest_n() - 2.25).abs() < 1e-9);
        arch.negative.b_n_s_per_mm = flat(-0.01);
        assert!((arch.strongest_n() - 3.45).abs() < 1e-9);
        // Nothing beyond the trained range.
        arch.trained.x_mm = [0.0, 0.5];
        arch.negative.b_n_s_per_mm = flat(0.0);
        assert!((arch.strongest_n() - 1.25).abs() < 1e-9);
    }
}
