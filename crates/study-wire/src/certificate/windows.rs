//! Condition 3 with the direction rule play: not at each position, but over its width.
//!
//! Play with the width δ has a middle w, with x = w + z δ/2, and between the ends of its width the
//! force is a function of x alone. Only where w is dragged along does it depend on the way, and a
//! cycle in which w goes from a to b and back costs the hand
//!
//! ```text
//! E = 1/δ ∫ₐᵇ ∫_{w−δ/2}^{w+δ/2} (S⁺ − S⁻)(ξ) dξ dw
//! ```
//!
//! so that a table is passive in this respect if and only if the mean of S⁺ − S⁻ over every
//! window of half a width to either side is not negative. `docs/identification.md` derives it. The
//! range ends where [`Range`](super::Range) does: beyond it S keeps the value of the edge.

use super::{Margin, spring};
use crate::predict::TableView;

/// The least mean of S⁺ − S⁻ over a window of the width δ, N, and the middle of that window, of a
/// valid table with linear look-up. `range_mm` is the range of positions.
pub fn least_mean_gap(table: &TableView<'_>, delta_mm: f64, range_mm: [f64; 2]) -> Margin {
    let pieces = Pieces::of(table, range_mm);
    let half_mm = 0.5 * delta_mm;
    let [low_mm, high_mm] = pieces.range_mm;
    // the pieces where the window begins and ends, and the integral over it, N·mm
    let (mut begin, mut end) = (0, 0);
    let mut middle_mm = low_mm - half_mm;
    let mut integral = delta_mm * pieces.at(0, low_mm)[0];
    let mut margin = Margin::at(low_mm);
    margin.include(integral / delta_mm, low_mm);
    while begin < pieces.last() {
        let next_mm = (pieces.to_mm(begin) + half_mm).min(pieces.to_mm(end) - half_mm);
        let length_mm = (next_mm - middle_mm).max(0.0);
        // the derivative of the integral is the gap at the end less that at the beginning
        let gains = pieces.at(end, middle_mm + half_mm);
        let loses = pieces.at(begin, middle_mm - half_mm);
        let [c, b, a] = [0, 1, 2].map(|i| gains[i] - loses[i]);
        let after = |u: f64| integral + (c + (0.5 * b + a * u / 3.0) * u) * u;
        let root = libm::sqrt((b * b - 4.0 * a * c).max(0.0));
        // stable for small a; NaN and infinite ones are no turning points
        let q = -0.5 * (b + if b < 0.0 { -root } else { root });
        for u in [q / a, c / q, length_mm] {
            if u > 0.0 && u <= length_mm {
                let at_mm = (middle_mm + u).max(low_mm).min(high_mm);
                margin.include(after(u) / delta_mm, at_mm);
            }
        }
        integral = after(length_mm);
        middle_mm = next_mm;
        if pieces.to_mm(end) - half_mm <= middle_mm {
            end += 1;
        }
        if pieces.to_mm(begin) + half_mm <= middle_mm {
            begin += 1;
        }
    }
    margin
}

/// S⁺ − S⁻ in pieces: constant up to the range, a line up to the first node, a parabola between
/// two nodes, a line after the last one, and constant beyond the range.
struct Pieces<'a> {
    table: &'a TableView<'a>,
    range_mm: [f64; 2],
}

impl<'a> Pieces<'a> {
    fn of(table: &'a TableView<'a>, [low, high]: [f64; 2]) -> Self {
        let (first, last) = (table.x_mm[0], table.x_mm[table.x_mm.len() - 1]);
        Self {
            table,
            range_mm: [low.min(first), high.max(last)],
        }
    }

    /// Index of the last piece.
    fn last(&self) -> usize {
        self.table.x_mm.len() + 2
    }

    /// Where a piece ends, mm.
    fn to_mm(&self, piece: usize) -> f64 {
        let nodes = self.table.x_mm;
        match piece {
            0 => self.range_mm[0],
            _ if piece <= nodes.len() => nodes[piece - 1],
            _ if piece < self.last() => self.range_mm[1],
            _ => f64::INFINITY,
        }
    }

    /// A piece as a polynomial around a position: N, N/mm and N/mm².
    fn at(&self, piece: usize, x_mm: f64) -> [f64; 3] {
        let nodes = self.table.x_mm;
        let line = |node: usize, x_mm: f64| {
            let of = |branch| spring(branch, node, x_mm);
            of(&self.table.positive) - of(&self.table.negative)
        };
        let slope = |node: usize| {
            self.table.positive.k_n_per_mm[node] - self.table.negative.k_n_per_mm[node]
        };
        let [low, high] = self.range_mm;
        let end = nodes.len() - 1;
        match piece {
            0 => [line(0, low), 0.0, 0.0],
            1 => [line(0, x_mm), slope(0), 0.0],
            _ if piece <= nodes.len() => {
                let (left, right) = (piece - 2, piece - 1);
                // k and F0 are lines: (line(left) (x_r − x) + line(right) (x − x_l)) / h
                let h = nodes[right] - nodes[left];
                let t = (x_mm - nodes[left]) / h;
                let (from, to) = (line(left, x_mm), line(right, x_mm));
                let (k_from, k_to) = (slope(left), slope(right));
                [
                    from + t * (to - from),
                    k_from + t * (k_to - k_from) + (to - from) / h,
                    (k_to - k_from) / h,
                ]
            }
            _ if piece < self.last() => [line(end, x_mm), slope(end), 0.0],
            _ => [line(end, high), 0.0, 0.0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::{BranchView, Direction, DirectionState, Lookup, Motion, force_n};

    const NODES: usize = 21;
    const ZERO: [f64; NODES] = [0.0; NODES];
    const RANGE_MM: [f64; 2] = [-0.4, 10.3];

    /// A detent of 2 N over 10 mm with a gap between the branches at nodes every 0.5 mm. The
    /// positive branch has its force as a stiffness in part, so that the gap has parabolas.
    struct Table {
        x_mm: [f64; NODES],
        k: [f64; NODES],
        plus: [f64; NODES],
        minus: [f64; NODES],
    }

    impl Table {
        fn of(gap: impl Fn(usize) -> f64) -> Self {
            let x_mm: [f64; NODES] = core::array::from_fn(|i| 0.5 * i as f64);
            let mean = |i: usize| 2.0 * libm::sin(0.7 * i as f64);
            let k: [f64; NODES] = core::array::from_fn(|i| 0.3 * libm::cos(1.3 * i as f64));
            Self {
                x_mm,
                k,
                plus: core::array::from_fn(|i| mean(i) + 0.5 * gap(i) - k[i] * x_mm[i]),
                minus: core::array::from_fn(|i| mean(i) - 0.5 * gap(i)),
            }
        }

        fn view(&self) -> TableView<'_> {
            let branch = |k_n_per_mm, f0_n| BranchView {
                m_kg: &ZERO,
                b_n_s_per_mm: &ZERO,
                k_n_per_mm,
                f0_n,
            };
            TableView {
                x_mm: &self.x_mm,
                positive: branch(&self.k, &self.plus),
                negative: branch(&ZERO, &self.minus),
                lookup: Lookup::Linear,
            }
        }

        fn gap_n(&self, x_mm: f64) -> f64 {
            let motion = Motion::at_rest(x_mm.clamp(RANGE_MM[0], RANGE_MM[1]));
            force_n(&self.view(), 1.0, motion) - force_n(&self.view(), -1.0, motion)
        }

        /// The mean gap over a window by the middles of 500 parts.
        fn by_sum(&self, middle_mm: f64, delta_mm: f64) -> f64 {
            let part = delta_mm / 500.0;
            let at = |i: i32| middle_mm - 0.5 * delta_mm + part * (f64::from(i) + 0.5);
            (0..500).map(|i| self.gap_n(at(i))).sum::<f64>() / 500.0
        }

        /// The energy of a hand that goes from place to place, mJ. The play is that of the device.
        fn energy_mj(&self, delta_mm: f64, places: &[f64]) -> f64 {
            let rule = Direction::Play { delta_mm };
            let mut state = DirectionState::new();
            let force = |state: &mut DirectionState, x_mm: f64| {
                let z = state.step(rule, Motion::at_rest(x_mm));
                let inside = x_mm.clamp(RANGE_MM[0], RANGE_MM[1]);
                force_n(&self.view(), z, Motion::at_rest(inside))
            };
            let mut before = force(&mut state, places[0]);
            let mut energy = 0.0;
            for pair in places.windows(2) {
                let steps = ((pair[1] - pair[0]).abs() / 2e-3).ceil().max(1.0);
                let step_mm = (pair[1] - pair[0]) / steps;
                for i in 1..=steps as usize {
                    let after = force(&mut state, pair[0] + step_mm * i as f64);
                    energy += 0.5 * (before + after) * step_mm;
                    before = after;
                }
            }
            energy
        }
    }

    /// 1 N, but −0.9 N at 5 mm and 0.2 N at the edge.
    fn dip() -> Table {
        Table::of(|i| match i {
            0 => 0.2,
            10 => -0.9,
            _ => 1.0,
        })
    }

    #[test]
    fn the_least_mean_is_that_of_sums() {
        let odd = Table::of(|i| 0.5 + 1.5 * libm::sin(2.1 * i as f64 + 0.3));
        for table in [dip(), odd] {
            for delta_mm in [0.05, 0.3, 1.0, 3.0, 25.0] {
                let found = least_mean_gap(&table.view(), delta_mm, RANGE_MM);
                let everywhere = (-100..320).map(|i| table.by_sum(0.05 * f64::from(i), delta_mm));
                let least = everywhere.fold(f64::INFINITY, f64::min);
                let (value, at_mm) = (found.value, found.at_mm);
                assert!(value < least + 1e-3, "{delta_mm}: {value} {least}");
                if at_mm > RANGE_MM[0] && at_mm < RANGE_MM[1] {
                    let there = table.by_sum(at_mm, delta_mm);
                    assert!((value - there).abs() < 1e-3, "{delta_mm}: {value} {there}");
                }
            }
        }
    }

    #[test]
    fn a_narrow_width_has_the_least_gap_itself() {
        let found = least_mean_gap(&dip().view(), 1e-6, RANGE_MM);
        assert!((found.value + 0.9).abs() < 1e-4, "{}", found.value);
        assert!((found.at_mm - 5.0).abs() < 1e-3, "{}", found.at_mm);
    }

    /// A dip below 0 that a wide play spans: no closed cycle of a hand draws energy. A narrow play
    /// does not span it, and a small cycle around it draws what the integral says.
    #[test]
    fn what_the_windows_permit_is_passive_and_what_they_refuse_is_not() {
        let table = dip();
        let wide_mm = 3.0;
        assert!(least_mean_gap(&table.view(), wide_mm, RANGE_MM).value > 0.0);
        let mut seed = 7_u64;
        let mut unit = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / (1_u64 << 31) as f64
        };
        for cycle in 0..60 {
            let near = cycle % 2 == 0;
            let place = |share: f64| {
                if near {
                    3.0 + 4.0 * share
                } else {
                    -0.5 + 11.0 * share
                }
            };
            let mut places = vec![-4.0, 1.0];
            places.extend((0..12).map(|_| place(unit())));
            // back to where it began, from below
            places.extend([-4.0, 1.0]);
            let open = table.energy_mj(wide_mm, &places[..2]);
            let energy = table.energy_mj(wide_mm, &places) - open;
            assert!(energy > -1e-4, "{places:?}: {energy} mJ");
        }
        let narrow_mm = 0.6;
        let refused = least_mean_gap(&table.view(), narrow_mm, RANGE_MM);
        assert!(refused.value < -0.1);
        // the middle of the play goes 0.1 mm to either side of the worst window
        let [from, to] = [refused.at_mm - 0.1, refused.at_mm + 0.1];
        let half = 0.5 * narrow_mm;
        let start = [from - half - 1.0, from + half];
        let cycle = [start[0], start[1], to + half, from - half, from + half];
        let begun = table.energy_mj(narrow_mm, &start);
        let drawn = begun - table.energy_mj(narrow_mm, &cycle);
        let windows = (-100..100).map(|i| {
            let middle = refused.at_mm + 1e-3 * (f64::from(i) + 0.5);
            let parts = (0..600).map(|j| table.gap_n(middle - half + 1e-3 * (f64::from(j) + 0.5)));
            1e-3 * parts.sum::<f64>() * 1e-3 / narrow_mm
        });
        let expected = -windows.sum::<f64>();
        assert!(drawn > 0.01, "{drawn}");
        assert!(
            (drawn - expected).abs() < 2e-3 * expected,
            "{drawn} {expected}"
        );
    }
}
