//! Sums, means, standard deviations, quantiles, counts.
//!
//! Sums are carried in two doubles (Neumaier 1974), and deviations are taken
//! from the carried mean before they are squared, so that ratings of 10⁹ ± 1 keep
//! every digit that their doubles have.

use super::finite;

/// A sum that carries what each addition rounds off (Neumaier's variant of
/// Kahan's).
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

    /// The sum.
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

/// The compensated sum.
pub fn sum(x: &[f64]) -> f64 {
    x.iter().copied().collect::<Sum>().get()
}

/// The arithmetic mean, Σx/n, or Σ(x/n) where the sum overflows. `None` for no
/// numbers.
pub fn mean(x: &[f64]) -> Option<f64> {
    mean_of(x.iter().copied())
}

/// The same of numbers that come one by one.
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

/// Sum of squared deviations from the mean, Σd² − (Σd)²/n with d taken from the
/// rounded mean: the second term takes back what the rounding of the mean put
/// in (Chan, Golub & LeVeque 1983).
pub fn sum_of_squares(x: &[f64]) -> Option<f64> {
    squares_about(x, mean(x)?)
}

/// The same where the rounded mean is known already.
pub fn squares_about(x: &[f64], mean: f64) -> Option<f64> {
    let (mut squares, mut rest) = (Sum::default(), Sum::default());
    for v in x {
        let d = v - mean;
        squares.add(d * d);
        rest.add(d);
    }
    finite(squares.get() - rest.get() * rest.get() / x.len() as f64)
}

/// Σ(x − x̄)(y − ȳ), by the same correction.
pub fn sum_of_products(x: &[f64], y: &[f64]) -> Option<f64> {
    products_about(x, mean(x)?, y, mean(y)?)
}

/// The same where the rounded means are known already.
pub fn products_about(x: &[f64], mx: f64, y: &[f64], my: f64) -> Option<f64> {
    let (mut xy, mut dx, mut dy) = (Sum::default(), Sum::default(), Sum::default());
    for (a, b) in x.iter().zip(y) {
        xy.add((a - mx) * (b - my));
        dx.add(a - mx);
        dy.add(b - my);
    }
    finite(xy.get() - dx.get() * dy.get() / x.len() as f64)
}

/// Variance with n − 1. `None` below two numbers.
pub fn variance(x: &[f64]) -> Option<f64> {
    if x.len() < 2 {
        return None;
    }
    finite(sum_of_squares(x)?.max(0.0) / (x.len() - 1) as f64)
}

/// Standard deviation with n − 1. `None` below two numbers.
pub fn sd(x: &[f64]) -> Option<f64> {
    variance(x).map(f64::sqrt)
}

/// Quantile of type 7 (Hyndman & Fan 1996, R's default): with the numbers sorted
/// and h = (n − 1)p, linear between those at ⌊h⌋ and ⌊h⌋ + 1. `sorted` has to be.
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

/// The numbers in ascending order. They must hold no NaN.
pub fn sorted(x: &[f64]) -> Vec<f64> {
    let mut s = x.to_vec();
    s.sort_by(f64::total_cmp);
    s
}

/// How often each whole number from `from` to `to` occurs.
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

/// Correlation of each number with the next:
/// Σ(xᵢ − x̄)(xᵢ₊₁ − x̄) / Σ(xᵢ − x̄)², as NIST's StRD defines it.
pub fn lag1_autocorrelation(x: &[f64]) -> Option<f64> {
    let m = mean(x)?;
    let below: Sum = x.iter().map(|v| (v - m) * (v - m)).collect();
    let above: Sum = x.windows(2).map(|w| (w[0] - m) * (w[1] - m)).collect();
    if below.get() <= 0.0 {
        return None;
    }
    finite(above.get() / below.get())
}

/// Rounded to 10⁻¹⁰, so that thirds which are equal on paper are equal here.
/// Above 10⁵ a double has no such digits and the number stays.
pub fn rounded(x: f64) -> f64 {
    if x.abs() < 1e5 {
        // The addition turns −0 into 0.
        (x * 1e10).round() / 1e10 + 0.0
    } else {
        x
    }
}

/// Whether all numbers are the same, but for the rounding of thirds: within
/// 10⁻¹² of the largest, or of 1.
pub fn is_constant(x: &[f64]) -> bool {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let high = x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    x.is_empty() || high - low <= 1e-12 * low.abs().max(high.abs()).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let far: Vec<f64> = x.iter().map(|v| v + 1e9).collect();
        assert_eq!(sd(&x), sd(&far));
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
    fn what_is_not_defined_is_none() {
        assert_eq!(mean(&[]), None);
        assert_eq!(sd(&[1.0]), None);
        assert_eq!(sd(&[1e308, -1e308]), None);
        assert_eq!(lag1_autocorrelation(&[2.0, 2.0]), None);
    }
}
