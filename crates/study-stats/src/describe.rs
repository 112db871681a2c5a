//! Sums, means, standard deviations, quantiles, counts.
//!
//! Sums are compensated (Neumaier 1974), and deviations from the mean are taken before
//! they are squared, so that ratings of 10⁹ ± 1 keep every digit of their doubles.

use super::finite;

/// A compensated sum: it accumulates the rounding error of each addition and adds it
/// at the end (Neumaier 1974).
#[derive(Debug, Clone, Copy, Default)]
pub struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    /// Adds a number.
    pub fn add(&mut self, x: f64) {
        let t = self.high + x;
        self.low += if self.high.abs() >= x.abs() {
            (self.high - t) + x
        } else {
            (x - t) + self.high
        };
        self.high = t;
    }

    /// The sum of the numbers added so far; 0 for none.
    pub fn get(self) -> f64 {
        self.high + self.low
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<I: IntoIterator<Item = f64>>(numbers: I) -> Self {
        let mut sum = Self::default();
        for x in numbers {
            sum.add(x);
        }
        sum
    }
}

/// The compensated sum Σx; 0 for no numbers.
pub fn sum(x: &[f64]) -> f64 {
    x.iter().copied().collect::<Sum>().get()
}

/// The shape of a distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// m₃/m₂^1.5 of the central moments, 0 if symmetric.
    pub skewness: f64,
    /// m₄/m₂² − 3, 0 for a normal distribution.
    pub excess_kurtosis: f64,
    /// Largest distance from the mean in standard deviations √m₂.
    pub largest: f64,
}

/// The shape of a sample, from its central moments mᵣ = Σ(x − x̄)ʳ/n. `None` for no
/// numbers, or if all are equal.
pub fn shape(x: &[f64]) -> Option<Shape> {
    let center = mean(x)?;
    let moment = |r: i32| mean_of(x.iter().map(|x| (x - center).powi(r)));
    let (m2, m3, m4) = (moment(2)?, moment(3)?, moment(4)?);
    let largest = x
        .iter()
        .fold(0.0f64, |most, x| most.max((x - center).abs()));
    (m2 > 0.0).then_some(())?;
    Some(Shape {
        skewness: finite(m3 / m2.powf(1.5))?,
        excess_kurtosis: finite(m4 / (m2 * m2) - 3.0)?,
        largest: finite(largest / m2.sqrt())?,
    })
}

/// The arithmetic mean, Σx/n, or Σ(x/n) if the sum overflows. `None` for no numbers.
pub fn mean(x: &[f64]) -> Option<f64> {
    mean_of(x.iter().copied())
}

/// [`mean`] of the numbers of an iterator.
pub fn mean_of(x: impl Iterator<Item = f64> + Clone) -> Option<f64> {
    let (mut sum, mut n) = (Sum::default(), 0.0);
    for v in x.clone() {
        sum.add(v);
        n += 1.0;
    }
    if n < 1.0 {
        return None;
    }
    finite(sum.get() / n).or_else(|| finite(x.map(|v| v / n).collect::<Sum>().get()))
}

/// Sum of squared deviations from the mean: Σd² − (Σd)²/n with the deviations d from the
/// rounded mean. The second term corrects for that rounding (Chan, Golub & LeVeque
/// 1983). `None` for no numbers, or if it overflows.
pub fn sum_of_squares(x: &[f64]) -> Option<f64> {
    squares_about(x, mean(x)?)
}

/// [`sum_of_squares`] with the mean already computed.
pub fn squares_about(x: &[f64], mean: f64) -> Option<f64> {
    let (mut squares, mut deviations) = (Sum::default(), Sum::default());
    for v in x {
        let d = v - mean;
        squares.add(d * d);
        deviations.add(d);
    }
    finite(squares.get() - deviations.get() * deviations.get() / x.len() as f64)
}

/// Σ(x − x̄)(y − ȳ), with the same correction. `None` for no numbers or unequal
/// lengths, or if it overflows.
pub fn sum_of_products(x: &[f64], y: &[f64]) -> Option<f64> {
    products_about(x, mean(x)?, y, mean(y)?)
}

/// [`sum_of_products`] with the means already computed.
pub fn products_about(x: &[f64], mx: f64, y: &[f64], my: f64) -> Option<f64> {
    if x.len() != y.len() {
        return None;
    }
    let (mut xy, mut dx, mut dy) = (Sum::default(), Sum::default(), Sum::default());
    for (a, b) in x.iter().zip(y) {
        xy.add((a - mx) * (b - my));
        dx.add(a - mx);
        dy.add(b - my);
    }
    finite(xy.get() - dx.get() * dy.get() / x.len() as f64)
}

/// The variance Σ(x − x̄)²/(n − 1), in squared units of x. `None` for fewer than two
/// numbers.
pub fn variance(x: &[f64]) -> Option<f64> {
    if x.len() < 2 {
        return None;
    }
    finite(sum_of_squares(x)?.max(0.0) / (x.len() - 1) as f64)
}

/// The standard deviation √(Σ(x − x̄)²/(n − 1)). `None` for fewer than two numbers.
///
/// ```
/// # use study_stats::describe::{mean, sd};
/// let x = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
/// assert_eq!(mean(&x), Some(5.0));
/// assert_eq!(sd(&x), Some((32.0f64 / 7.0).sqrt()));
/// ```
pub fn sd(x: &[f64]) -> Option<f64> {
    variance(x).map(f64::sqrt)
}

/// The p-quantile of ascending numbers, 0 ≤ p ≤ 1, of type 7 (Hyndman & Fan 1996, R's
/// default): with h = (n − 1)p, linear interpolation between the numbers at ⌊h⌋ and
/// ⌊h⌋ + 1, counted from 0. `None` for no numbers.
///
/// ```
/// # use study_stats::describe::quantile;
/// // As R: quantile(c(1, 2, 3, 4)).
/// assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0], 0.25), Some(1.75));
/// ```
pub fn quantile(sorted: &[f64], p: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let h = last as f64 * p.clamp(0.0, 1.0);
    let below = h.floor();
    // h is between 0 and last, so the cast is exact.
    let i = below as usize;
    let low = *sorted.get(i)?;
    let high = sorted[(i + 1).min(last)];
    finite(low + (h - below) * (high - low))
}

/// The numbers in ascending order.
pub fn sorted(x: &[f64]) -> Vec<f64> {
    let mut s = x.to_vec();
    s.sort_by(f64::total_cmp);
    s
}

/// How often each of the whole numbers `from`, `from` + 1, … `to` occurs. Other numbers
/// are not counted.
pub fn counts(x: &[f64], from: f64, to: f64) -> Vec<f64> {
    let bins = (to - from).max(0.0) as usize + 1;
    let mut counts = vec![0.0; bins];
    for v in x {
        let bin = v - from;
        if bin >= 0.0 && bin.fract() == 0.0 && (bin as usize) < bins {
            counts[bin as usize] += 1.0;
        }
    }
    counts
}

/// Lag-1 autocorrelation Σ(xᵢ − x̄)(xᵢ₊₁ − x̄) / Σ(xᵢ − x̄)², as defined by NIST's StRD.
/// `None` if all numbers are equal.
pub fn lag1_autocorrelation(x: &[f64]) -> Option<f64> {
    let m = mean(x)?;
    let denominator: Sum = x.iter().map(|v| (v - m) * (v - m)).collect();
    let numerator: Sum = x.windows(2).map(|w| (w[0] - m) * (w[1] - m)).collect();
    if denominator.get() <= 0.0 {
        return None;
    }
    finite(numerator.get() / denominator.get())
}

/// The power of two that brings the largest absolute value to at least 1 and below 2, as far
/// as numbers of ordinary size can; 1 if all are 0. Multiplying by it rounds nothing.
pub(crate) fn power_of_two<'a>(x: impl Iterator<Item = &'a f64>) -> f64 {
    let largest = x.fold(0.0f64, |largest, x| largest.max(x.abs()));
    if largest > 0.0 {
        (-largest.log2().floor()).clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}

/// The number rounded to 10⁻¹⁰, so that means that differ only by rounding errors are
/// equal. Numbers of 10⁵ or more are returned unchanged: a double does not have enough
/// digits.
pub fn rounded(x: f64) -> f64 {
    if x.abs() < 1e5 {
        // The addition turns −0 into 0.
        (x * 1e10).round() / 1e10 + 0.0
    } else {
        x
    }
}

/// Whether all numbers are equal except for rounding errors: their range is at most
/// 10⁻¹² times the largest absolute value, or 10⁻¹² if that is below 1.
pub fn is_constant(x: &[f64]) -> bool {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let high = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    x.is_empty() || high - low <= 1e-12 * low.abs().max(high.abs()).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R 4.2: x <- c(1, 2, 2, 3, 4, 9); m <- function(r) mean((x - mean(x))^r);
    /// c(m(3)/m(2)^1.5, m(4)/m(2)^2 - 3, max(abs(x - mean(x)))/sqrt(m(2)))
    #[test]
    fn the_shape_is_that_of_the_central_moments() {
        let found = shape(&[1.0, 2.0, 2.0, 3.0, 4.0, 9.0]).unwrap();
        let expected = [
            1.319_368_078_200_359,
            0.359_703_875_743_939_2,
            2.091_290_026_730_777,
        ];
        for (x, y) in [found.skewness, found.excess_kurtosis, found.largest]
            .into_iter()
            .zip(expected)
        {
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
        assert_eq!(shape(&[2.0, 2.0]), None);
        assert_eq!(shape(&[]), None);
    }

    /// 30 ratings, sum 144, sum of squares 720.
    #[test]
    fn the_papers_row_has_mean_4_800_and_sd_0_997() {
        let x: Vec<f64> = [(3.0, 3), (4.0, 9), (5.0, 9), (6.0, 9)]
            .iter()
            .flat_map(|&(v, n)| std::iter::repeat_n(v, n))
            .collect();
        let squares: f64 = x.iter().map(|v| v * v).sum();
        assert_eq!((x.len(), sum(&x), squares), (30, 144.0, 720.0));
        assert_eq!(format!("{:.3}", mean(&x).unwrap()), "4.800");
        assert_eq!(format!("{:.3}", sd(&x).unwrap()), "0.997");
    }

    #[test]
    fn an_offset_of_a_billion_changes_no_digit_of_the_sd() {
        let x = [1.0, 2.0, 4.0, 4.0, 7.0];
        let shifted: Vec<f64> = x.iter().map(|v| v + 1e9).collect();
        assert_eq!(sd(&x), sd(&shifted));
    }

    #[test]
    fn quantiles_are_of_type_7() {
        // R: quantile(c(1,2,3,4), c(.25,.5,.75)) is 1.75 2.50 3.25
        let x = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(quantile(&x, 0.25), Some(1.75));
        assert_eq!(quantile(&x, 0.5), Some(2.5));
        assert_eq!(quantile(&x, 0.75), Some(3.25));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn undefined_results_are_none() {
        assert_eq!(mean(&[]), None);
        assert_eq!(sd(&[1.0]), None);
        assert_eq!(sd(&[1e308, -1e308]), None);
        assert_eq!(lag1_autocorrelation(&[2.0, 2.0]), None);
        assert_eq!(sum_of_products(&[1.0, 2.0], &[1.0]), None);
    }
}
