//! Bootstrap of a correlation over subjects, exact for few subjects.
//!
//! The exact bootstrap enumerates all C(2S−1, S) compositions of S draws from S subjects,
//! each with its multinomial weight (Fisher & Hall 1991), without Monte Carlo error. The
//! bootstrap describes how the correlation varies with the subjects; it does not
//! generalize to other realizations.

use super::correlation::pearson;
use super::describe::is_constant;
use super::distribution::{normal_cdf, normal_quantile};
use super::matrix::{Cholesky, SymmetricMatrix, dot};
use super::random::RandomSource;
use super::{finite, rectangular};

/// Most subjects for which all compositions are enumerated.
pub const MAX_EXACT: usize = 10;

/// Most subjects that are resampled one by one. For larger tables the column sums are
/// drawn from their limiting normal distribution: with 500 subjects and a skewness of 1
/// its quantiles are off by .02 standard errors, less than the .027 of 10,000 draws.
pub const MAX_DRAWN: usize = 500;
/// Most numbers of a table whose subjects are resampled one by one.
const MAX_TABLE: usize = 50_000;

/// Most columns: the work grows with their square.
const MAX_COLUMNS: usize = 300;

/// Number of resamples above [`MAX_EXACT`].
pub const DRAWS: u32 = 10_000;

/// Summary of a bootstrap distribution of the correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bootstrap {
    /// Mean of the resamples.
    pub mean: f64,
    /// Standard error: standard deviation of the resamples.
    pub se: f64,
    /// 95 % percentile interval: the smallest values with cdf ≥ .025 and ≥ .975.
    pub percentile: (f64, f64),
    /// 95 % interval, bias-corrected and accelerated (Efron 1987); `None` if its
    /// constants are not defined.
    pub bca: Option<(f64, f64)>,
    /// Bias correction: the normal quantile of P(r* < r), with ties counted half; `None`
    /// if that is 0 or 1.
    pub z0: Option<f64>,
    /// Acceleration, by the jackknife; `None` if omitting a subject changes nothing.
    pub acceleration: Option<f64>,
    /// P(r* ≤ 0).
    pub p_le_zero: f64,
    /// Probability of the resamples in which all columns have the same mean. They have no
    /// correlation and are left out.
    pub undefined_probability: f64,
    /// Whether all compositions were enumerated.
    pub exact: bool,
    /// Whether column sums were drawn from their limiting normal distribution.
    pub normal_limit: bool,
}

/// Resamples the rows (subjects) of a table and correlates the column sums with `x`, a
/// number for each column. `None` for fewer than two subjects, fewer than three columns
/// or more than 300, or if the correlation is not defined.
pub fn correlation<R: AsRef<[f64]>>(
    rows: &[R],
    x: &[f64],
    random: &mut impl RandomSource,
) -> Option<Bootstrap> {
    let rows = &rectangular(rows).filter(|rows| rows[0].len() == x.len())?;
    let exact = rows.len() <= MAX_EXACT;
    let normal_limit = !exact && (rows.len() > MAX_DRAWN || rows.len() * x.len() > MAX_TABLE);
    resample(rows, x, normal_limit, random)
}

fn resample(
    rows: &[&[f64]],
    x: &[f64],
    normal_limit: bool,
    random: &mut impl RandomSource,
) -> Option<Bootstrap> {
    if rows.len() < 2 || !(3..=MAX_COLUMNS).contains(&x.len()) {
        return None;
    }
    let score = CorrelationWith::new(x)?;
    let ones = vec![1; rows.len()];
    let observed = score.of(&weighted(rows, &ones))?;
    let exact = rows.len() <= MAX_EXACT && !normal_limit;
    let mut resamples = Vec::new();
    let (mut undefined, mut total) = (0u64, 0u64);
    let mut count = |r: Option<f64>, weight: u64| {
        total += weight;
        match r {
            Some(r) => resamples.push((r, weight)),
            None => undefined += weight,
        }
    };
    if exact {
        let turned = Turned::new(rows, &score);
        let mut sums = vec![vec![0.0; x.len() - 1]; rows.len() + 1];
        let mut of_sum = |sum: &[f64], weight: u64| count(turned.correlation(sum), weight);
        compose(&turned.rows, 0, rows.len(), 1, &mut sums, &mut of_sum);
    } else if normal_limit {
        let limit = NormalLimit::new(rows)?;
        for _ in 0..DRAWS {
            count(score.of(&limit.draw(random)), 1);
        }
    } else {
        let mut draws = vec![0u32; rows.len()];
        for _ in 0..DRAWS {
            draws.fill(0);
            for _ in 0..rows.len() {
                // Below the number of rows, which is a usize.
                draws[random.below(rows.len() as u64) as usize] += 1;
            }
            count(score.of(&weighted(rows, &draws)), 1);
        }
    }
    let summed = summary(rows, &score, observed, &resamples, undefined, total)?;
    Some(Bootstrap {
        exact,
        normal_limit,
        ..summed
    })
}

/// The limiting normal distribution of the column sums of resamples.
struct NormalLimit {
    sums: Vec<f64>,
    /// Cholesky's factor of their covariance; a column that the others determine
    /// contributes nothing of its own.
    factor: Cholesky,
}

impl NormalLimit {
    fn new(rows: &[&[f64]]) -> Option<Self> {
        let k = rows.first()?.len();
        let n = rows.len() as f64;
        let sums = weighted(rows, &vec![1; rows.len()]);
        let mut squares = SymmetricMatrix::zero(k);
        let mut d = vec![0.0; k];
        for row in rows {
            for ((d, v), sum) in d.iter_mut().zip(*row).zip(&sums) {
                *d = v - sum / n;
            }
            squares.add_outer(1.0, &d);
        }
        let factor = Cholesky::semidefinite(&squares, |_| 1e-12)?;
        Some(Self { sums, factor })
    }

    fn draw(&self, random: &mut impl RandomSource) -> Vec<f64> {
        let z: Vec<f64> = self.sums.iter().map(|_| random.normal()).collect();
        let deviations = self.factor.times(&z);
        let sums = self.sums.iter().zip(deviations);
        sums.map(|(sum, deviation)| sum + deviation).collect()
    }
}

fn summary(
    rows: &[&[f64]],
    score: &CorrelationWith,
    observed: f64,
    resamples: &[(f64, u64)],
    undefined: u64,
    total: u64,
) -> Option<Bootstrap> {
    const TIE: f64 = 1e-12;
    let defined = (total - undefined) as f64;
    let (mut sum, mut below, mut ties, mut not_above) = (0.0, 0u64, 0u64, 0u64);
    for &(r, weight) in resamples {
        let if_so = |so: bool| if so { weight } else { 0 };
        sum += r * weight as f64;
        below += if_so(r < observed - TIE);
        ties += if_so((r - observed).abs() <= TIE);
        // Rounding can turn a correlation of 0 into 10⁻¹⁷.
        not_above += if_so(r <= TIE);
    }
    let mean = sum / defined;
    let variance = resamples
        .iter()
        .map(|(r, w)| (r - mean) * (r - mean) * *w as f64)
        .sum::<f64>()
        / defined;
    let z0 = normal_quantile((below as f64 + 0.5 * ties as f64) / defined);
    let acceleration = acceleration(rows, score);
    let quantiles = Quantiles::of(resamples);
    let at = |p: f64| quantiles.at(p * defined);
    let bca = z0.zip(acceleration).and_then(|(z0, a)| {
        let level = |p: f64| {
            let z = z0 + normal_quantile(p)?;
            finite(normal_cdf(z0 + z / (1.0 - a * z)))
        };
        Some((at(level(0.025)?)?, at(level(0.975)?)?))
    });
    Some(Bootstrap {
        mean: finite(mean)?,
        se: finite(variance.max(0.0).sqrt())?,
        percentile: (at(0.025)?, at(0.975)?),
        bca,
        z0,
        acceleration,
        p_le_zero: not_above as f64 / defined,
        undefined_probability: undefined as f64 / total as f64,
        exact: false,
        normal_limit: false,
    })
}

/// Quantiles of weighted correlations without sorting all of them: the weights are
/// accumulated in a histogram, and only the class that contains the quantile is sorted.
struct Quantiles<'a> {
    resamples: &'a [(f64, u64)],
    /// The class of each, of equal width over [−1, 1].
    class_of: Vec<u16>,
    /// Weight of each class.
    classes: Vec<u64>,
}

impl<'a> Quantiles<'a> {
    const CLASSES: u16 = 4096;

    /// Non-decreasing in r.
    fn class(r: f64) -> u16 {
        // From 0 to CLASSES: r is a correlation.
        (((r + 1.0) * 0.5 * f64::from(Self::CLASSES)) as u16).min(Self::CLASSES - 1)
    }

    fn of(resamples: &'a [(f64, u64)]) -> Self {
        let mut classes = vec![0; usize::from(Self::CLASSES)];
        let mut class_of = Vec::with_capacity(resamples.len());
        for (r, weight) in resamples {
            let class = Self::class(*r);
            classes[usize::from(class)] += weight;
            class_of.push(class);
        }
        Self {
            resamples,
            class_of,
            classes,
        }
    }

    /// The smallest value whose cumulative weight is at least `weight`; the largest value
    /// if, due to rounding, there is none.
    fn at(&self, weight: f64) -> Option<f64> {
        let mut sum = 0u64;
        for (class, own) in (0u16..).zip(&self.classes) {
            if ((sum + own) as f64) < weight || *own == 0 {
                sum += own;
                continue;
            }
            let all = self.class_of.iter().zip(self.resamples);
            let mut members: Vec<_> = all.filter(|(c, _)| **c == class).map(|(_, r)| r).collect();
            members.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            return members.into_iter().find_map(|(r, w)| {
                sum += w;
                (sum as f64 >= weight).then_some(*r)
            });
        }
        let all = self.resamples.iter().map(|(r, _)| *r);
        all.max_by(f64::total_cmp)
    }
}

/// Σ(m − mᵢ)³/(6(Σ(m − mᵢ)²)^1.5) over the correlations mᵢ without subject i.
fn acceleration(rows: &[&[f64]], score: &CorrelationWith) -> Option<f64> {
    let mut without = Vec::with_capacity(rows.len());
    let all = weighted(rows, &vec![1; rows.len()]);
    for row in rows {
        let rest: Vec<f64> = all.iter().zip(*row).map(|(sum, v)| sum - v).collect();
        without.push(score.of(&rest)?);
    }
    let mean = without.iter().sum::<f64>() / without.len() as f64;
    let (mut cubes, mut squares) = (0.0, 0.0);
    for m in &without {
        let d = mean - m;
        cubes += d * d * d;
        squares += d * d;
    }
    // Correlations that differ by rounding errors only have no skewness.
    if squares <= 1e-24 * without.len() as f64 {
        return None;
    }
    finite(cubes / (6.0 * squares.powf(1.5)))
}

/// Column sums, each row taken as often as it was drawn.
fn weighted(rows: &[&[f64]], draws: &[u32]) -> Vec<f64> {
    let mut sums = vec![0.0; rows.first().map_or(0, |row| row.len())];
    for (row, &n) in rows.iter().zip(draws) {
        if n > 0 {
            for (s, v) in sums.iter_mut().zip(*row) {
                *s += f64::from(n) * v;
            }
        }
    }
    sums
}

/// Enumerates the ways to draw `left` times from the rows from `row` on, two or more.
/// `weight` is the number of sequences for each (S! / Π kᵢ!, at most 10¹⁰, exact).
fn compose<R: AsRef<[f64]>>(
    rows: &[R],
    row: usize,
    left: usize,
    weight: u64,
    sums: &mut [Vec<f64>],
    count: &mut impl FnMut(&[f64], u64),
) {
    if left == 0 {
        count(&sums[row], weight);
        return;
    }
    let own = rows[row].as_ref();
    let last = (row + 2 == rows.len()).then(|| rows[row + 1].as_ref());
    let (done, next) = sums.split_at_mut(row + 1);
    next[0].copy_from_slice(&done[row]);
    if let Some(last) = last {
        let (sum, steps) = next.split_at_mut(1);
        for (((n, step), v), l) in sum[0].iter_mut().zip(&mut steps[0]).zip(own).zip(last) {
            *n += left as f64 * l;
            *step = v - l;
        }
    }
    let mut ways = weight;
    for k in 0..=left {
        // ways = weight · C(left, k)
        if k > 0 {
            ways = ways * (left - k + 1) as u64 / k as u64;
            let (sum, steps) = sums[row + 1..].split_at_mut(1);
            let step = if last.is_some() { &steps[0] } else { own };
            for (n, v) in sum[0].iter_mut().zip(step) {
                *n += v;
            }
        }
        match last {
            // The last row is drawn as often as this one is not.
            Some(_) => count(&sums[row + 1], ways),
            None => compose(rows, row + 1, left - k, ways, sums, count),
        }
    }
}

/// Rows in orthonormal coordinates of the deviations from their means, the first of them
/// along x: a sum of rows correlates with x by its first coordinate over its length.
struct Turned {
    rows: Vec<Vec<f64>>,
    /// Sums that are shorter differ from 0 by rounding errors only.
    shortest: f64,
}

impl Turned {
    fn new(rows: &[&[f64]], score: &CorrelationWith) -> Self {
        let k = score.x.len();
        let mut basis = vec![vec![1.0 / (k as f64).sqrt(); k], score.x.clone()];
        while basis.len() < k {
            // The unit vector of which most is left, twice orthogonalized.
            let left = |j: &usize| 1.0 - basis.iter().map(|b| b[*j] * b[*j]).sum::<f64>();
            let most = (0..k).max_by(|a, b| left(a).total_cmp(&left(b)));
            let mut v = vec![0.0; k];
            v[most.unwrap_or(0)] = 1.0;
            for b in basis.iter().chain(&basis) {
                let along = dot(b, &v);
                v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
            }
            let length = dot(&v, &v).sqrt();
            v.iter_mut().for_each(|v| *v /= length);
            basis.push(v);
        }
        let size = rows.iter().flat_map(|row| *row);
        let size = size.fold(0.0f64, |most, v| most.max(v.abs()));
        let turned = |row: &&[f64]| {
            let mean = row.iter().sum::<f64>() / k as f64;
            let centered: Vec<f64> = row.iter().map(|v| v - mean).collect();
            basis[1..].iter().map(|b| dot(b, &centered)).collect()
        };
        Self {
            rows: rows.iter().map(turned).collect(),
            shortest: 1e-12 * size * rows.len() as f64,
        }
    }

    /// The correlation of a sum of as many rows as there are.
    fn correlation(&self, sum: &[f64]) -> Option<f64> {
        let length = dot(sum, sum).sqrt();
        let defined = length.is_finite() && length > self.shortest;
        defined.then(|| (sum[0] / length).clamp(-1.0, 1.0))
    }
}

/// Correlation of column sums with a fixed x.
struct CorrelationWith {
    /// Centered, of norm 1.
    x: Vec<f64>,
}

impl CorrelationWith {
    fn new(x: &[f64]) -> Option<Self> {
        if is_constant(x) {
            return None;
        }
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let centered: Vec<f64> = x.iter().map(|v| v - mean).collect();
        let norm = centered.iter().map(|v| v * v).sum::<f64>().sqrt();
        pearson(x, x)?;
        Some(Self {
            x: centered.iter().map(|v| v / norm).collect(),
        })
    }

    fn of(&self, y: &[f64]) -> Option<f64> {
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let (mut xy, mut yy, mut size) = (0.0, 0.0, 0.0f64);
        for (x, v) in self.x.iter().zip(y) {
            let d = v - mean;
            xy += x * d;
            yy += d * d;
            size = size.max(v.abs());
        }
        // Sums that differ only by rounding errors are equal.
        if !(yy.is_finite() && yy.sqrt() > 1e-12 * size) {
            return None;
        }
        Some((xy / yy.sqrt()).clamp(-1.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    fn slices(rows: &[Vec<f64>]) -> Vec<&[f64]> {
        rows.iter().map(Vec::as_slice).collect()
    }

    fn seeded() -> SplitMix64 {
        SplitMix64::new(1)
    }

    #[test]
    fn all_compositions_are_enumerated_with_their_weights() {
        let rows: Vec<Vec<f64>> = (0..4).map(|i| vec![f64::from(i), 1.0, 2.0]).collect();
        let (mut compositions, mut weights) = (0, 0);
        let mut sums = vec![vec![0.0; 3]; 5];
        compose(&slices(&rows), 0, 4, 1, &mut sums, &mut |s, w| {
            // Every composition draws four rows, so the constant columns are fixed.
            assert_eq!((s[1], s[2]), (4.0, 8.0));
            compositions += 1;
            weights += w;
        });
        assert_eq!((compositions, weights), (35, 256));
    }

    #[test]
    fn turned_rows_have_the_correlations_of_the_columns() {
        let x = [0.7, 0.75, 0.8, 0.95, 0.9];
        let rows: Vec<Vec<f64>> = (0..4)
            .map(|s| {
                let row = (0..5).map(|m| 1e6 + f64::from((7 * s + 3 * m * m + s * m) % 11));
                row.collect()
            })
            .collect();
        let score = CorrelationWith::new(&x).unwrap();
        let turned = Turned::new(&slices(&rows), &score);
        let mut both = [Vec::new(), Vec::new()];
        let of_columns = &mut |s: &[f64], _: u64| both[0].push(pearson(&x, s).unwrap());
        compose(&rows, 0, 4, 1, &mut vec![vec![0.0; 5]; 5], of_columns);
        let of_turned = &mut |s: &[f64], _: u64| both[1].push(turned.correlation(s).unwrap());
        compose(&turned.rows, 0, 4, 1, &mut vec![vec![0.0; 4]; 5], of_turned);
        assert_eq!(both[0].len(), 35);
        for (a, b) in both[0].iter().zip(&both[1]) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        // Each column the same mean: only rounding is left.
        let alike = vec![vec![0.1 + 0.2, 0.3, 0.3, 0.3, 0.3]; 3];
        let turned = Turned::new(&slices(&alike), &score);
        let sum: Vec<f64> = turned.rows[0].iter().map(|v| 3.0 * v).collect();
        assert_eq!(turned.correlation(&sum), None);
    }

    /// With equally spaced x, the sign of r is that of the whole number Σ (2j − 3)·yⱼ.
    #[test]
    fn a_correlation_of_zero_is_not_above_zero_by_rounding() {
        let rows: [[f64; 4]; 5] = [
            [1.0, 2.0, 2.0, 1.0],
            [3.0, 1.0, 2.0, 4.0],
            [5.0, 4.0, 4.0, 4.0],
            [2.0, 3.0, 1.0, 2.0],
            [1.0, 4.0, 2.0, 3.0],
        ];
        let trend = |y: &[f64]| -3.0 * y[0] - y[1] + y[2] + 3.0 * y[3];
        let (mut not_above, mut zero, mut all) = (0, 0, 0);
        let mut correlations = Vec::new();
        let mut sums = vec![vec![0.0; 4]; 6];
        let rows: Vec<Vec<f64>> = rows.iter().map(|r| r.to_vec()).collect();
        compose(&slices(&rows), 0, 5, 1, &mut sums, &mut |s, w| {
            not_above += if trend(s) <= 0.0 { w } else { 0 };
            zero += if trend(s) == 0.0 { w } else { 0 };
            all += w;
            let r = pearson(&[0.7, 0.75, 0.8, 0.85], s);
            correlations.push((r.unwrap(), w));
        });
        let found = correlation(&rows, &[0.7, 0.75, 0.8, 0.85], &mut seeded()).unwrap();
        // the ends are where the distribution function reaches .025 and .975
        let share = |in_it: &dyn Fn(f64) -> bool| {
            let weights = correlations.iter().filter(|(r, _)| in_it(*r));
            weights.map(|(_, w)| *w).sum::<u64>() as f64 / all as f64
        };
        for (end, level) in [(found.percentile.0, 0.025), (found.percentile.1, 0.975)] {
            assert!(share(&|r| r <= end + 1e-9) >= level);
            assert!(share(&|r| r < end - 1e-9) < level);
        }
        assert!(found.exact && zero > 0 && found.undefined_probability == 0.0);
        let expected = not_above as f64 / all as f64;
        assert!((found.p_le_zero - expected).abs() < 1e-15);
    }

    #[test]
    fn quantiles_are_those_of_the_sorted_resamples() {
        let mut random = SplitMix64::new(5);
        let resamples: Vec<(f64, u64)> = (0..3000)
            // Many ties, and a class with hundreds of values.
            .map(|_| {
                let r = (random.normal().sin() * 300.0).round() / 300.0;
                (r * r * r, 1 + random.below(50))
            })
            .collect();
        let mut sorted = resamples.clone();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: u64 = sorted.iter().map(|(_, w)| w).sum();
        let quantiles = Quantiles::of(&resamples);
        for step in 0..=1000 {
            let weight = total as f64 * f64::from(step) / 1000.0;
            let mut sum = 0;
            let slow = sorted.iter().find(|(_, w)| {
                sum += w;
                sum as f64 >= weight
            });
            assert_eq!(quantiles.at(weight), slow.map(|(r, _)| *r), "{weight}");
        }
        assert_eq!(quantiles.at(2.0 * total as f64), Some(sorted[2999].0));
    }

    #[test]
    fn the_normal_limit_agrees_with_resampling_subjects() {
        let mut noise = SplitMix64::new(3);
        let x = [0.1, 0.2, 0.4, 0.5];
        let rows: Vec<Vec<f64>> = (0..400)
            .map(|_| x.map(|v| (4.0 + v + noise.normal()).round()).to_vec())
            .collect();
        let drawn = resample(&slices(&rows), &x, false, &mut seeded()).unwrap();
        let limit = resample(&slices(&rows), &x, true, &mut seeded()).unwrap();
        assert!(limit.normal_limit && !drawn.normal_limit && !drawn.exact);
        // Each end has a Monte Carlo error of about 1 % of the width.
        let width = drawn.percentile.1 - drawn.percentile.0;
        assert!((limit.percentile.0 - drawn.percentile.0).abs() < 0.05 * width);
        assert!((limit.percentile.1 - drawn.percentile.1).abs() < 0.05 * width);
        assert!((limit.se - drawn.se).abs() < 0.05 * drawn.se);
    }

    #[test]
    fn equal_ratings_have_no_bootstrap() {
        assert_eq!(
            correlation(&vec![vec![4.0; 3]; 3], &[1.0, 2.0, 3.0], &mut seeded()),
            None
        );
    }
}
