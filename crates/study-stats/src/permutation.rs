//! Permutation tests of a correlation, exact or by Monte Carlo.
//!
//! H₀: all M! pairings of the two columns are equally likely. p is the share of pairings,
//! the observed one included, whose statistic is at least as extreme, where values
//! within 10⁻⁹ count as equal (Pitman 1937). No distribution of either column is assumed.

mod decision;

pub use decision::Decision;

use super::correlation::{kendall, pearson, spearman};
use super::describe::{mean, sum_of_squares};
use super::rank::{doubled_ranks, mid_ranks};
use crate::random::RandomSource;

/// Largest number of pairs for which all M! pairings are enumerated.
pub const MAX_EXACT: usize = 9;

/// Number of random pairings above [`MAX_EXACT`].
pub const DRAWS: u64 = 9_999;

/// Most pairs for Monte Carlo; a tenth of it for Kendall's tau, whose work grows with
/// their square.
const MAX_DRAWN: usize = 1000;

/// Values that differ by less are equal.
const TIE: f64 = 1e-9;

/// The correlation that is tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// Pearson's r.
    Pearson,
    /// Spearman's rho.
    Spearman,
    /// Kendall's tau-b.
    Kendall,
}

/// The p values of a permutation test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PermutationTest {
    /// One-sided: P(statistic ≥ observed).
    pub greater: f64,
    /// P(|statistic| ≥ |observed|).
    pub two_sided: f64,
    /// Smallest two-sided p that any y could have had with these x.
    pub smallest: f64,
    /// Whether all pairings were enumerated. Otherwise p is (b + 1)/(B + 1), with b
    /// extreme pairings among B = [`DRAWS`] random ones (Davison & Hinkley 1997).
    pub exact: bool,
}

/// Permutation test of the correlation of x and y. `random` is used only above
/// [`MAX_EXACT`] pairs. `None` if the correlation is not defined, for unequal lengths,
/// fewer than three pairs or more than 1000 (Kendall: 100).
///
/// ```
/// # use study_stats::permutation::{Statistic, test};
/// # use study_stats::random::SplitMix64;
/// let (x, y) = ([1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 3.0, 5.0, 8.0, 13.0]);
/// let found = test(Statistic::Spearman, &x, &y, &mut SplitMix64::new(1)).unwrap();
/// // Only this order of 5! and its reverse are as extreme.
/// assert_eq!((found.exact, found.two_sided), (true, 2.0 / 120.0));
/// ```
pub fn test(
    statistic: Statistic,
    x: &[f64],
    y: &[f64],
    random: &mut impl RandomSource,
) -> Option<PermutationTest> {
    let most = match statistic {
        Statistic::Pearson | Statistic::Spearman => MAX_DRAWN,
        Statistic::Kendall => MAX_DRAWN / 10,
    };
    if x.len() != y.len() || !(3..=most).contains(&x.len()) {
        return None;
    }
    let observed = match statistic {
        Statistic::Pearson => pearson(x, y)?,
        Statistic::Spearman => spearman(x, y)?,
        Statistic::Kendall => kendall(x, y)?,
    };
    let kernel = Kernel::new(statistic, x, y)?;
    let mut order: Vec<usize> = (0..x.len()).collect();
    let mut tally = Tally::new(observed);
    if x.len() <= MAX_EXACT {
        enumerate_orders(&mut order, |order| tally.count(kernel.value(order)));
        let all = tally.counted as f64;
        return Some(PermutationTest {
            greater: tally.greater as f64 / all,
            two_sided: tally.two_sided as f64 / all,
            smallest: smallest(statistic, x, all),
            exact: true,
        });
    }
    for _ in 0..DRAWS {
        random.shuffle(&mut order);
        tally.count(kernel.value(&order));
    }
    let all = (DRAWS + 1) as f64;
    Some(PermutationTest {
        greater: (tally.greater + 1) as f64 / all,
        two_sided: (tally.two_sided + 1) as f64 / all,
        smallest: 1.0 / all,
        exact: false,
    })
}

/// The smallest two-sided p of the exact permutation test of Pearson's r that any y can
/// have with these x: with few or evenly spaced x no result is significant. `None` for
/// fewer than three x or if they do not vary.
pub fn floor(x: &[f64]) -> Option<f64> {
    let all: f64 = (1..=x.len()).map(|i| i as f64).product();
    (x.len() > 2 && sum_of_squares(x)? > 0.0 && all.is_finite())
        .then(|| smallest(Statistic::Pearson, x, all))
}

/// The smallest attainable two-sided p of `all` pairings: for ranks that of a perfect
/// order; for Pearson 1/M!, or 2/M! if x is symmetric about its mean, because the mirrored
/// pairing is then equally extreme. Ties in x multiply it by the orders within them.
fn smallest(statistic: Statistic, x: &[f64], all: f64) -> f64 {
    let mut ranks = doubled_ranks(x);
    ranks.sort_unstable();
    let within: f64 = ranks
        .chunk_by(|a, b| a == b)
        .map(|g| (1..=g.len()).product::<usize>() as f64)
        .product();
    let sorted = super::describe::sorted(x);
    let span = sorted[sorted.len() - 1] - sorted[0];
    let mirrored = match statistic {
        Statistic::Pearson => sorted
            .iter()
            .zip(sorted.iter().rev())
            .all(|(a, b)| (a + b - sorted[0] - sorted[sorted.len() - 1]).abs() <= 1e-9 * span),
        // A perfect order and its reverse are equally extreme if the ties of x are
        // symmetric.
        Statistic::Spearman | Statistic::Kendall => {
            let ends = ranks[0] + ranks[ranks.len() - 1];
            ranks
                .iter()
                .zip(ranks.iter().rev())
                .all(|(a, b)| a + b == ends)
        }
    };
    (within * if mirrored { 2.0 } else { 1.0 } / all).min(1.0)
}

/// Counts of extreme pairings.
struct Tally {
    observed: f64,
    greater: u64,
    two_sided: u64,
    counted: u64,
}

impl Tally {
    fn new(observed: f64) -> Self {
        Self {
            observed,
            greater: 0,
            two_sided: 0,
            counted: 0,
        }
    }

    fn count(&mut self, value: f64) {
        self.counted += 1;
        self.greater += u64::from(value >= self.observed - TIE);
        self.two_sided += u64::from(value.abs() >= self.observed.abs() - TIE);
    }
}

/// The statistic of a pairing, with everything computed beforehand that is the same for
/// all pairings.
enum Kernel {
    /// r is Σ table\[i\]\[order\[i\]\]: what x\[i\] paired with y\[j\] contributes.
    Products { n: usize, table: Vec<f64> },
    /// Doubled ranks, and one over the root of the numbers of untied pairs.
    Signs {
        x: Vec<i64>,
        y: Vec<i64>,
        scale: f64,
    },
}

impl Kernel {
    fn new(statistic: Statistic, x: &[f64], y: &[f64]) -> Option<Self> {
        let (x, y) = match statistic {
            Statistic::Pearson => (x.to_vec(), y.to_vec()),
            Statistic::Spearman => (mid_ranks(x), mid_ranks(y)),
            Statistic::Kendall => {
                let (x, y) = (doubled_ranks(x), doubled_ranks(y));
                let untied = |r: &[i64]| {
                    (0..r.len())
                        .flat_map(|i| (0..i).map(move |j| (i, j)))
                        .filter(|&(i, j)| r[i] != r[j])
                        .count() as f64
                };
                let scale = 1.0 / (untied(&x).sqrt() * untied(&y).sqrt());
                return Some(Self::Signs { x, y, scale });
            }
        };
        let (mx, my) = (mean(&x)?, mean(&y)?);
        let scale = sum_of_squares(&x)?.sqrt() * sum_of_squares(&y)?.sqrt();
        let table = x
            .iter()
            .flat_map(|a| y.iter().map(move |b| (a - mx) * (b - my) / scale))
            .collect();
        Some(Self::Products { n: x.len(), table })
    }

    fn value(&self, order: &[usize]) -> f64 {
        match self {
            Self::Products { n, table } => order
                .iter()
                .enumerate()
                .map(|(i, &j)| table[i * n + j])
                .sum(),
            Self::Signs { x, y, scale } => {
                let mut score = 0i64;
                for i in 1..order.len() {
                    for j in 0..i {
                        score += (x[i] - x[j]).signum() * (y[order[i]] - y[order[j]]).signum();
                    }
                }
                score as f64 * scale
            }
        }
    }
}

/// Calls `each` once for every order (Heap 1963).
pub(crate) fn enumerate_orders(order: &mut [usize], mut each: impl FnMut(&[usize])) {
    let n = order.len();
    let mut stack = vec![0; n];
    each(order);
    let mut i = 0;
    while i < n {
        if stack[i] < i {
            order.swap(if i % 2 == 0 { 0 } else { stack[i] }, i);
            each(order);
            stack[i] += 1;
            i = 0;
        } else {
            stack[i] = 0;
            i += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;
    use std::collections::BTreeSet;

    fn seeded(seed: u64) -> SplitMix64 {
        SplitMix64::new(seed)
    }

    #[test]
    fn every_order_is_enumerated_once() {
        let mut seen = BTreeSet::new();
        let mut order: Vec<usize> = (0..5).collect();
        enumerate_orders(&mut order, |o| assert!(seen.insert(o.to_vec())));
        assert_eq!(seen.len(), 120);
    }

    #[test]
    fn a_perfect_order_of_five_has_the_smallest_p() {
        let x = [0.70, 0.74, 0.78, 0.785, 0.79];
        let y = [1.0, 2.0, 3.5, 3.6, 5.0];
        let ranks = test(Statistic::Spearman, &x, &y, &mut seeded(1)).unwrap();
        assert_eq!(ranks.two_sided, 2.0 / 120.0);
        assert_eq!(ranks.smallest, 2.0 / 120.0);
        let r = test(Statistic::Pearson, &x, &y, &mut seeded(1)).unwrap();
        assert_eq!((r.greater, r.smallest), (1.0 / 120.0, 1.0 / 120.0));
    }

    #[test]
    fn evenly_spaced_x_doubles_the_smallest_p_of_pearson() {
        let x = [1.0, 2.0, 3.0, 4.0, 5.0];
        let y = [1.0, 2.0, 3.0, 4.0, 7.0];
        let r = test(Statistic::Pearson, &x, &y, &mut seeded(1)).unwrap();
        assert_eq!(r.two_sided, 2.0 / 120.0);
        assert_eq!(r.smallest, 2.0 / 120.0);
    }

    #[test]
    fn monte_carlo_is_reproducible_and_never_zero() {
        let x: Vec<f64> = (0..12).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|v| v * v).collect();
        let one = test(Statistic::Pearson, &x, &y, &mut seeded(7)).unwrap();
        assert_eq!(Some(one), test(Statistic::Pearson, &x, &y, &mut seeded(7)));
        assert!(!one.exact && one.greater > 0.0 && one.greater < 0.001);
    }

    /// Counted over all orders.
    #[test]
    fn the_floor_depends_on_the_spacing() {
        let paper = [0.7672, 0.7851, 0.7904, 0.7798, 0.7425];
        assert_eq!(floor(&paper), Some(1.0 / 120.0));
        assert_eq!(floor(&[0.6, 0.7, 0.8, 0.9]), Some(2.0 / 24.0));
        assert_eq!(floor(&[0.6, 0.69, 0.753, 0.7971]), Some(1.0 / 24.0));
        assert_eq!(floor(&[0.6, 0.75, 0.9]), Some(2.0 / 6.0));
        assert_eq!(floor(&[0.7, 0.7, 0.8, 0.85, 0.9]), Some(2.0 / 120.0));
        assert_eq!(floor(&[0.7; 5]), None);
    }

    #[test]
    fn two_pairs_have_no_test() {
        assert_eq!(
            test(Statistic::Pearson, &[1.0, 2.0], &[1.0, 2.0], &mut seeded(1)),
            None
        );
    }
}
