//! Whether a permutation test of Pearson's r is significant, for many y with the same x.
//!
//! Only the decision is wanted, so that counting stops as soon as it is known. All orders
//! of at most [`MAX_EXACT`] pairs are counted by halves: the x that meet the lower half of
//! the sorted y are one of C(M, M/2) subsets, and each sum is one of the orders of the
//! subset plus one of the orders of the rest.

use super::super::describe::{is_constant, mean, sorted, sum_of_squares};
use super::{DRAWS, MAX_EXACT, TIE, enumerate_orders};
use crate::level;
use crate::random::RandomSource;

/// Decides at one level for one x.
#[derive(Debug, Clone)]
pub struct Decision {
    /// Centered, with a sum of squares of 1.
    x: Vec<f64>,
    /// How many extreme orders are too many.
    limit: u64,
    /// The x that meet the lower half of y, and the others.
    halves: Vec<(Vec<f64>, Vec<f64>)>,
    /// The orders of either half.
    orders: [Vec<Vec<usize>>; 2],
}

impl Decision {
    /// Prepares decisions of [`super::test`] at the level `alpha`. `None` for fewer than
    /// three x or if they do not vary.
    pub fn new(x: &[f64], alpha: f64) -> Option<Self> {
        let x = standardized(x)?;
        let exact = x.len() <= MAX_EXACT;
        let all = if exact {
            (1..=x.len() as u64).product()
        } else {
            DRAWS + 1
        };
        // The smallest count whose share is too large; the observed order counts too.
        let from = (alpha * all as f64) as u64;
        let too_many = |count: &u64| !level::rejects(*count as f64 / all as f64, alpha);
        let near = from.saturating_sub(1)..=from + 1;
        let limit = near.into_iter().find(too_many).unwrap_or(from + 2);
        let mut found = Self {
            limit,
            halves: Vec::new(),
            orders: [Vec::new(), Vec::new()],
            x,
        };
        if exact {
            let x = sorted(&found.x);
            let low = x.len() / 2;
            // The largest sums come first.
            for bits in 0u32..1 << x.len() {
                if bits.count_ones() as usize == low {
                    let part = |of_low: bool| -> Vec<f64> {
                        let chosen = |i: &usize| ((bits >> i) & 1 == 1) == of_low;
                        (0..x.len()).filter(chosen).map(|i| x[i]).collect()
                    };
                    found.halves.push((part(true), part(false)));
                }
            }
            for (orders, length) in found.orders.iter_mut().zip([low, x.len() - low]) {
                let mut order: Vec<usize> = (0..length).collect();
                enumerate_orders(&mut order, |order| orders.push(order.to_vec()));
            }
        }
        Some(found)
    }

    /// Whether the two-sided p of x and y is small enough. `random` is used only above
    /// [`MAX_EXACT`] pairs, and less of it than [`super::test`] uses. `None` if y does not
    /// vary or is not as long as x.
    pub fn rejects(&self, y: &[f64], random: &mut impl RandomSource) -> Option<bool> {
        if y.len() != self.x.len() {
            return None;
        }
        let observed = standardized(y)?;
        Some(if self.halves.is_empty() {
            self.sampled(&observed, random)
        } else {
            self.counted(observed)
        })
    }

    /// By all orders, as far as they are needed.
    fn counted(&self, mut y: Vec<f64>) -> bool {
        let least = self.observed(&y) - TIE;
        y.sort_by(f64::total_cmp);
        let (low, high) = y.split_at(y.len() / 2);
        // The y of each order of a half, one array for each position.
        let arranged = |orders: &[Vec<usize>], y: &[f64]| -> Vec<Vec<f64>> {
            let of = |i: usize| orders.iter().map(|order| y[order[i]]).collect();
            (0..y.len()).map(of).collect()
        };
        let [by_low, by_high] = [
            arranged(&self.orders[0], low),
            arranged(&self.orders[1], high),
        ];
        let mut sums = [
            vec![0.0; self.orders[0].len()],
            vec![0.0; self.orders[1].len()],
        ];
        let mut count = 0;
        for (of_low, of_high) in &self.halves {
            // Sorted against sorted is the largest sum, against reversed the smallest.
            let most = dot(of_low, low) + dot(of_high, high);
            let fewest = reversed(of_low, low) + reversed(of_high, high);
            if most < least && fewest > -least {
                continue;
            }
            fill(&mut sums[0], of_low, &by_low);
            fill(&mut sums[1], of_high, &by_high);
            let [a, b] = &sums;
            let (most, fewest) = (dot(of_high, high), reversed(of_high, high));
            for a in a {
                if a + most >= least || a + fewest <= -least {
                    count += (b.iter())
                        .map(|b| u64::from((a + b).abs() >= least))
                        .sum::<u64>();
                }
            }
            if count >= self.limit {
                return false;
            }
        }
        true
    }

    /// By [`DRAWS`] random orders, as far as they are needed.
    fn sampled(&self, y: &[f64], random: &mut impl RandomSource) -> bool {
        let sum =
            |order: &[usize]| -> f64 { order.iter().zip(&self.x).map(|(&j, x)| x * y[j]).sum() };
        let mut order: Vec<usize> = (0..y.len()).collect();
        let least = self.observed(y) - TIE;
        let mut count = 1;
        for left in (0..DRAWS).rev() {
            random.shuffle(&mut order);
            count += u64::from(sum(&order).abs() >= least);
            if count >= self.limit {
                return false;
            }
            if count + left < self.limit {
                return true;
            }
        }
        count < self.limit
    }

    /// |r|.
    fn observed(&self, y: &[f64]) -> f64 {
        dot(&self.x, y).abs()
    }
}

/// Less their mean, over the root of their sum of squares.
fn standardized(values: &[f64]) -> Option<Vec<f64>> {
    let (mean, scale) = (mean(values)?, sum_of_squares(values)?.sqrt());
    // As for r: numbers that differ only by rounding do not vary.
    let varies = values.len() > 2 && !is_constant(values) && scale > 0.0;
    varies.then(|| values.iter().map(|v| (v - mean) / scale).collect())
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn reversed(x: &[f64], y: &[f64]) -> f64 {
    x.iter().rev().zip(y).map(|(x, y)| x * y).sum()
}

/// Σᵢ xᵢyᵢ for each order of y.
fn fill(sums: &mut [f64], x: &[f64], y: &[Vec<f64>]) {
    sums.fill(0.0);
    for (x, y) in x.iter().zip(y) {
        for (sum, y) in sums.iter_mut().zip(y) {
            *sum += x * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Statistic, test};
    use super::*;
    use crate::random::SplitMix64;

    /// Every length of the exact test and one of the random one, with and without ties and
    /// even spacing, from no to a strong correlation.
    #[test]
    fn decisions_are_those_of_the_test() {
        let mut noise = SplitMix64::new(5);
        let (mut rejected, mut met) = (0, 0);
        for round in 0..1200 {
            // Of five numbers, p can be .05 exactly: 6 of 120 orders.
            let n = if round < 240 { 3 + round % 9 } else { 5 };
            let x: Vec<f64> = (0..n)
                .map(|i| match round % 3 {
                    0 => i as f64,
                    1 => noise.normal(),
                    _ => (i / 2) as f64,
                })
                .collect();
            let strength = [0.0, 0.5, 1.5][round / 3 % 3];
            let y: Vec<f64> = (x.iter())
                .map(|x| {
                    let y = strength * x + noise.normal();
                    if round % 4 == 0 { y.round() } else { y }
                })
                .collect();
            let alpha = [0.05, 0.01, 0.25][round / 9 % 3];
            let seeded = || SplitMix64::new(round as u64);
            let whole = test(Statistic::Pearson, &x, &y, &mut seeded());
            let decision = Decision::new(&x, alpha).unwrap();
            let decided = decision.rejects(&y, &mut seeded());
            assert_eq!(decided, whole.map(|t| t.two_sided <= alpha), "{x:?} {y:?}");
            rejected += u32::from(decided == Some(true));
            met += u32::from(whole.is_some_and(|t| t.two_sided == alpha));
        }
        assert!((40..1000).contains(&rejected), "{rejected}");
        assert!(met > 0);
        assert!(Decision::new(&[1.0; 4], 0.05).is_none());
    }
}
