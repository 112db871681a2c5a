//! The exact distribution of Friedman's statistic.
//!
//! Under H₀ every order of a subject's ranks, ties included, is equally likely. The
//! columns are then exchangeable, and the sorted rank sums are a sufficient state.
//! Rows are added one by one. The last row, which has the most orders, is not added:
//! its orders are compared with the difference to the observed statistic.

/// Most columns: a row of eight has 40,320 orders.
const MAX_COLUMNS: usize = 8;

/// Most additions of an order to a state, about twenty milliseconds. There are fewer
/// states, of 16 bytes each.
const MAX_ADDED: f64 = 2e6;

/// After this many additions, and at each doubling, the remaining number is estimated.
const FIRST_ESTIMATE: f64 = 1e4;

/// Most comparisons of a state with an order of the last row, about ten milliseconds.
const MAX_COMPARED: usize = 4_000_000;

/// P(Σ(Rⱼ − center)² ≥ observed) over all orders within rows, of doubled ranks;
/// `None` above these limits, which depend on the size and ties of the table, not on the
/// observed statistic.
pub(super) fn upper_tail(ranks: &[Vec<i64>], observed: i64) -> Option<f64> {
    let bits = bits(ranks)?;
    match ranks.first()?.len() {
        2 => tail::<2>(ranks, observed, bits),
        3 => tail::<3>(ranks, observed, bits),
        4 => tail::<4>(ranks, observed, bits),
        5 => tail::<5>(ranks, observed, bits),
        6 => tail::<6>(ranks, observed, bits),
        7 => tail::<7>(ranks, observed, bits),
        MAX_COLUMNS => tail::<MAX_COLUMNS>(ranks, observed, bits),
        _ => None,
    }
}

/// Bits of a rank sum, if those of all columns fit into one number.
fn bits(ranks: &[Vec<i64>]) -> Option<u32> {
    let k = ranks.first()?.len();
    let largest = 2 * k.checked_mul(ranks.len())?;
    let bits = usize::BITS - largest.leading_zeros();
    (k <= MAX_COLUMNS && bits * k as u32 <= u64::BITS).then_some(bits)
}

fn tail<const K: usize>(ranks: &[Vec<i64>], observed: i64, bits: u32) -> Option<f64> {
    let mut rows: Vec<[i64; K]> = Vec::with_capacity(ranks.len());
    for row in ranks {
        let mut row: [i64; K] = row.as_slice().try_into().ok()?;
        row.sort_unstable();
        rows.push(row);
    }
    // Rows with few orders first, so that the number of states grows late.
    rows.sort_by_cached_key(|row| (number_of_orders(row), *row));
    let (last, rows) = rows.split_last()?;
    let (first, rows) = rows.split_first()?;
    let mut states = States::with(bits, first);
    let (mut added, mut next_estimate) = (0.0, FIRST_ESTIMATE);
    for (i, row) in rows.iter().enumerate() {
        if added > next_estimate {
            if added + remaining::<K>(states.len, i + 1, &rows[i..]) > MAX_ADDED {
                return None;
            }
            next_estimate = 2.0 * added;
        }
        let orders = orders(row);
        added += (states.len * orders.len()) as f64;
        if added > MAX_ADDED {
            return None;
        }
        let share = 1.0 / orders.len() as f64;
        let mut next = States::new(bits, 2 * states.len);
        for (state, p) in states.iter::<K>() {
            let p = p * share;
            for order in &orders {
                next.add(std::array::from_fn::<i64, K, _>(|j| state[j] + order[j]), p);
            }
        }
        states = next;
    }
    if states.len.saturating_mul(number_of_orders(last)) > MAX_COMPARED {
        return None;
    }
    Some(states.upper_tail(last, observed, ranks.len()).min(1.0))
}

/// Estimated number of additions still needed. The states lie on a lattice of k − 1
/// dimensions, so after j rows there are about ((j + ¼)/(i + ¼))^(k−1) times as many as
/// after i (the ¼ corrects for the boundary).
fn remaining<const K: usize>(states: usize, added: usize, rows: &[[i64; K]]) -> f64 {
    (rows.iter().zip(added..))
        .map(|(row, j)| {
            let growth = ((j as f64 + 0.25) / (added as f64 + 0.25)).powi(K as i32 - 1);
            states as f64 * growth * number_of_orders(row) as f64
        })
        .sum()
}

/// Distinct orders of a sorted row: k!/Π t!.
fn number_of_orders(row: &[i64]) -> usize {
    let factorial = |n: usize| (1..=n).product::<usize>();
    let ties = row.chunk_by(|a, b| a == b).map(|t| factorial(t.len()));
    factorial(row.len()) / ties.product::<usize>()
}

/// The distinct orders of a sorted row; each represents equally many permutations.
fn orders<const K: usize>(row: &[i64; K]) -> Vec<[i64; K]> {
    let mut current = *row;
    let mut all = vec![current];
    // Next permutation in lexicographic order (Narayana).
    while let Some(i) = (1..K).rev().find(|&i| current[i - 1] < current[i]) {
        let j = (i..K)
            .rev()
            .find(|&j| current[j] > current[i - 1])
            .unwrap_or(i);
        current.swap(i - 1, j);
        current[i..].reverse();
        all.push(current);
    }
    all
}

/// Sorted rank sums with their probabilities: an open-addressing hash table. Its order
/// depends only on the insertions, so that sums over it are reproducible.
struct States {
    bits: u32,
    /// Packed rank sums (0 in a free slot) and their probability.
    slots: Vec<(u64, f64)>,
    len: usize,
}

impl States {
    fn new(bits: u32, expected: usize) -> Self {
        let slots = (2 * expected).next_power_of_two().max(64);
        Self {
            bits,
            slots: vec![(0, 0.0); slots],
            len: 0,
        }
    }

    fn with<const K: usize>(bits: u32, first: &[i64; K]) -> Self {
        let mut states = Self::new(bits, 1);
        states.add(*first, 1.0);
        states
    }

    fn add<const K: usize>(&mut self, mut sums: [i64; K], p: f64) {
        for i in 1..K {
            let mut j = i;
            while j > 0 && sums[j - 1] > sums[j] {
                sums.swap(j - 1, j);
                j -= 1;
            }
        }
        // Doubled ranks are positive, so no state is 0.
        let packed = (sums.iter()).fold(0, |all, s| all << self.bits | s.unsigned_abs());
        self.insert(packed, p);
        if 2 * self.len > self.slots.len() {
            let larger = vec![(0, 0.0); 2 * self.slots.len()];
            let old = std::mem::replace(&mut self.slots, larger);
            self.len = 0;
            for (packed, p) in old.into_iter().filter(|s| s.0 != 0) {
                self.insert(packed, p);
            }
        }
    }

    fn insert(&mut self, packed: u64, p: f64) {
        let mask = self.slots.len() - 1;
        // Fibonacci hashing (Knuth, vol. 3, §6.4) mixes the high bits best.
        let mut at = (packed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & mask;
        loop {
            match &mut self.slots[at] {
                (0, _) => break,
                (other, sum) if *other == packed => {
                    *sum += p;
                    return;
                }
                _ => at = (at + 1) & mask,
            }
        }
        self.slots[at] = (packed, p);
        self.len += 1;
    }

    fn iter<const K: usize>(&self) -> impl Iterator<Item = ([i64; K], f64)> {
        let (bits, mask) = (self.bits, (1 << self.bits) - 1);
        let used = self.slots.iter().filter(|s| s.0 != 0);
        used.map(move |&(packed, p)| {
            let sum = |j: usize| (packed >> (bits * (K - 1 - j) as u32) & mask) as i64;
            (std::array::from_fn(sum), p)
        })
    }

    /// P(statistic ≥ observed) after one more row. With s and r relative to their
    /// centers, |s + r|² = |s|² + |r|² + 2s·r, and s·r is largest if both have the same
    /// order and smallest if the orders are reversed.
    fn upper_tail<const K: usize>(&self, last: &[i64; K], observed: i64, n: usize) -> f64 {
        let middle = K as i64 + 1;
        let dot = |a: &[i64; K], b: &[i64; K]| (0..K).map(|j| a[j] * b[j]).sum::<i64>();
        let row: [i64; K] = std::array::from_fn(|j| last[j] - middle);
        let reversed: [i64; K] = std::array::from_fn(|j| row[K - 1 - j]);
        let orders = orders(&row);
        let share = 1.0 / orders.len() as f64;
        let before = middle * (n as i64 - 1);
        (self.iter::<K>())
            .map(|(sums, p)| {
                let s: [i64; K] = std::array::from_fn(|j| sums[j] - before);
                let needed = observed - dot(&s, &s) - dot(&row, &row);
                if 2 * dot(&s, &row) < needed {
                    return 0.0;
                }
                if 2 * dot(&s, &reversed) >= needed {
                    return p;
                }
                let enough = orders.iter().filter(|o| 2 * dot(&s, o) >= needed);
                p * share * enough.count() as f64
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rank::doubled_ranks;

    /// The p and the observed statistic by enumerating every arrangement.
    fn by_enumeration(ranks: &[Vec<i64>]) -> (f64, i64) {
        let k = ranks[0].len();
        let center = (ranks.len() * (k + 1)) as i64;
        let size = |sums: &[i64]| sums.iter().map(|s| (s - center).pow(2)).sum::<i64>();
        let column = |j: usize| ranks.iter().map(|r| r[j]).sum::<i64>();
        let observed = size(&(0..k).map(column).collect::<Vec<_>>());
        // All permutations of positions, with equal ranks distinguished.
        let mut permutations = vec![vec![]];
        for _ in 0..k {
            permutations = (permutations.iter())
                .flat_map(|p: &Vec<usize>| {
                    (0..k)
                        .filter(|j| !p.contains(j))
                        .map(|j| [&p[..], &[j]].concat())
                })
                .collect();
        }
        let mut sums = vec![vec![0; k]];
        for row in ranks {
            sums = (sums.iter())
                .flat_map(|s: &Vec<i64>| {
                    (permutations.iter())
                        .map(|p| (0..k).map(|j| s[j] + row[p[j]]).collect::<Vec<i64>>())
                })
                .collect();
        }
        let extreme = sums.iter().filter(|s| size(s) >= observed).count();
        (extreme as f64 / sums.len() as f64, observed)
    }

    #[test]
    fn the_tail_agrees_with_enumeration() {
        let tables: [&[&[f64]]; 5] = [
            &[
                &[1.0, 2.0],
                &[1.0, 2.0],
                &[2.0, 1.0],
                &[3.0, 3.0],
                &[1.0, 5.0],
            ],
            &[
                &[1.0, 2.0, 3.0],
                &[1.0, 1.0, 3.0],
                &[2.0, 1.0, 3.0],
                &[1.0, 3.0, 3.0],
            ],
            &[
                &[1.0, 2.0, 3.0, 4.0],
                &[1.0, 1.0, 4.0, 2.0],
                &[2.0, 1.0, 3.0, 3.0],
            ],
            &[&[1.0, 2.0, 3.0, 4.0, 9.0], &[1.0, 2.0, 3.0, 3.0, 1.0]],
            &[
                &[6.0, 2.0, 3.0, 4.0, 9.0, 1.0],
                &[5.0, 2.0, 3.0, 3.0, 8.0, 2.0],
            ],
        ];
        for table in tables {
            let ranks: Vec<Vec<i64>> = table.iter().map(|r| doubled_ranks(r)).collect();
            let (p, observed) = by_enumeration(&ranks);
            let found = upper_tail(&ranks, observed).unwrap();
            assert!((found - p).abs() < 1e-14, "{found} {p} {table:?}");
        }
    }

    /// Whether there is a p depends on the ties and the size of the table alone.
    #[test]
    fn the_limit_does_not_depend_on_the_statistic() {
        let untied: Vec<i64> = (1..=5).map(|r| 2 * r).collect();
        let rows = |n: usize| vec![untied.clone(); n];
        for observed in [0, 100, 100_000] {
            assert!(upper_tail(&rows(10), observed).is_some());
            assert!(upper_tail(&rows(200), observed).is_none());
        }
        assert!((upper_tail(&rows(10), 0).unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(upper_tail(&[vec![2; 9], vec![2; 9]], 0), None);
    }
}
