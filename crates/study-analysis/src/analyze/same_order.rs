//! Whether everybody felt the realizations in much the same order.

use super::adjusted::MAX_COMPARED;
use super::cells::Cells;
use study_stats::distribution::chi2_upper;

/// Below this chance the orders were not drawn at random …
const LEAST_CHANCE: f64 = 0.01;
/// … and from this share on, what changes over a session looks like a difference between realizations.
const MOST_SHARE: f64 = 0.5;

/// The orders of the trials, by blocks: the trials of one participant in one repetition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Orders {
    /// The share of the variance of the position within a block that realizations explain: Kendall's W where
    /// all blocks have all of them. 1 if everybody felt them in one order.
    pub(super) share: f64,
    /// The chance of such a share with orders drawn at random.
    pub(super) chance: f64,
}

impl Orders {
    /// `None` if positions are not known, if there is one block only, or above [`MAX_COMPARED`]
    /// realizations.
    pub(super) fn of(cells: &Cells<'_>) -> Option<Self> {
        let r = cells.ratings;
        let tested = cells.tested();
        let (k, columns) = (tested.len(), cells.columns(&tested));
        if !(2..=MAX_COMPARED).contains(&k) {
            return None;
        }
        // Participant, repetition, position, realization.
        let mut trials: Vec<(u32, u32, u32, usize)> = (cells.order.iter())
            .filter_map(|&i| {
                let model = columns[r.model[i]? as usize]?;
                Some((r.subject[i], r.repetition[i], r.trial_index[i]?, model))
            })
            .collect();
        trials.sort_unstable();
        let mut sums = vec![(0.0, 0.0); k];
        let (mut total, mut blocks, mut n) = (0.0, 0.0, 0.0);
        let mut known = Known::new(k);
        let mut chance = Some(1.0);
        for block in trials.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if block.len() < 2 || block.windows(2).any(|pair| pair[0].2 == pair[1].2) {
                continue;
            }
            let middle = (block.len() as f64 - 1.0) / 2.0;
            for (place, trial) in block.iter().enumerate() {
                let (sum, count) = &mut sums[trial.3];
                *sum += place as f64 - middle;
                *count += 1.0;
                total += (place as f64 - middle).powi(2);
            }
            (blocks, n) = (blocks + 1.0, n + block.len() as f64);
            let order: Vec<usize> = block.iter().map(|trial| trial.3).collect();
            chance = chance.and_then(|chance| Some(chance * known.agrees(&order)?));
        }
        if blocks < 2.0 {
            return None;
        }
        let between: f64 = (sums.iter().filter(|(_, count)| *count > 0.0))
            .map(|(sum, count)| sum * sum / count)
            .sum();
        let share = between / total;
        let rated = sums.iter().filter(|(_, count)| *count > 0.0).count() as f64;
        let of_share = chi2_upper(share * (n - blocks), rated - 1.0)?;
        Some(Self {
            share,
            // Of blocks that agree in everything it is known; the other is an approximation.
            chance: chance.filter(|chance| *chance < 1.0).unwrap_or(of_share),
        })
    }

    /// Whether order and realization cannot be told apart.
    pub(super) fn are_one(self) -> bool {
        self.share >= MOST_SHARE && self.chance <= LEAST_CHANCE
    }
}

/// Which realization came before which in all blocks so far.
struct Known {
    k: usize,
    before: Vec<bool>,
}

impl Known {
    fn new(k: usize) -> Self {
        Self {
            k,
            before: vec![false; k * k],
        }
    }

    /// Adds the order of a block: the chance that a random order agrees with the blocks before it, or more;
    /// `None` if this one does not. Realizations of which each came before the next in an earlier block have one order
    /// of n!.
    fn agrees(&mut self, order: &[usize]) -> Option<f64> {
        let k = self.k;
        let (mut run, mut longest) = (1usize, 1usize);
        for pair in order.windows(2) {
            run = if self.before[pair[0] * k + pair[1]] {
                run + 1
            } else {
                1
            };
            longest = longest.max(run);
        }
        for (i, first) in order.iter().enumerate() {
            for second in &order[i + 1..] {
                if first == second || self.before[second * k + first] {
                    return None;
                }
                self.before[first * k + second] = true;
            }
        }
        Some((2..=longest).map(|n| 1.0 / n as f64).product())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_session::outcome::ratings::Ratings;

    /// The orders of some blocks of a table.
    fn of(blocks: &[(&str, &str)]) -> Option<Orders> {
        let mut table = String::from("subject,model,rating,trial_index\n");
        let mut last = "";
        let mut trial = 0;
        for (i, (subject, order)) in blocks.iter().enumerate() {
            trial = if *subject == last { trial } else { 0 };
            last = subject;
            for model in order.chars() {
                trial += 1;
                table += &format!("{subject},{model},{},{trial}\n", 1 + i % 7);
            }
        }
        let ratings = Ratings::read_csv("t.csv", table.as_bytes(), None).unwrap();
        Orders::of(&Cells::of(&ratings))
    }

    /// P1 to P9 with these orders.
    fn by(orders: &[&str]) -> Orders {
        let names = ["P1", "P2", "P3", "P4", "P5", "P6", "P7", "P8", "P9"];
        of(&names
            .into_iter()
            .zip(orders.iter().copied())
            .collect::<Vec<_>>())
        .unwrap()
    }

    #[test]
    fn one_order_of_everybody_has_a_share_of_1_and_a_chance() {
        // two more blocks of three: 1/6²
        let three = by(&["bac", "bac", "bac"]);
        assert_eq!(three.share, 1.0);
        assert!((three.chance - 1.0 / 36.0).abs() < 1e-12, "{three:?}");
        assert!(!three.are_one() && by(&["bac"; 4]).are_one());
        assert_eq!(of(&[("P1", "bac")]), None);
        // the second block of a participant counts as well
        let again = of(&[("P1", "ab"), ("P1", "ab"), ("P1", "ab")]).unwrap();
        assert!((again.chance - 0.25).abs() < 1e-12, "{again:?}");
        // Kendall's W of R's irr::kendall for 1 2 3, 1 2 3, 1 3 2: 7/9
        let w = by(&["abc", "abc", "acb"]).share;
        assert!((w - 7.0 / 9.0).abs() < 1e-12, "{w}");
    }

    /// One who differs, or a half who differ in the last two, changes little.
    #[test]
    fn a_few_other_orders_do_not_help_and_random_orders_do() {
        let mut orders = vec!["abcde"; 8];
        orders.push("ecadb");
        assert!(by(&orders).are_one());
        assert!(by(&["abcde", "abced", "abcde", "abced", "abcde", "abced"]).are_one());
        assert!(!by(&["abcde", "bcdea", "cdeab", "deabc", "eabcd"]).are_one());
        assert!(!by(&["abcde", "edcba", "abcde", "edcba"]).are_one());
        assert!(!by(&["abcde", "cebda", "dacbe", "beadc", "ecdab"]).are_one());
    }

    /// Triples of seven, of which each pair meets once, cannot agree or contradict each other.
    #[test]
    fn orders_that_nobody_can_compare_are_not_one() {
        let triples = ["abc", "ade", "afg", "bdf", "beg", "cdg", "cef"];
        let found = by(&triples);
        assert!(!found.are_one() && found.chance > 0.01, "{found:?}");
    }
}
