//! Regression and correlation of two forces.

/// Sums over pairs of values.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    /// Sum of |y − x|.
    apart: f64,
}

impl Moments {
    /// Sums over pairs (x, y).
    pub(super) fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut sums = Self::default();
        for (x, y) in pairs {
            sums.n += 1.0;
            sums.x += x;
            sums.y += y;
            sums.xx += x * x;
            sums.xy += x * y;
            sums.yy += y * y;
            sums.apart += (y - x).abs();
        }
        sums
    }

    /// Variance of x; `None` without pairs.
    pub(super) fn var_x(&self) -> Option<f64> {
        (self.n > 0.0).then(|| ((self.xx - self.x * self.x / self.n) / self.n).max(0.0))
    }

    fn var_y(&self) -> Option<f64> {
        (self.n > 0.0).then(|| ((self.yy - self.y * self.y / self.n) / self.n).max(0.0))
    }

    fn covariance(&self) -> Option<f64> {
        (self.n > 0.0).then(|| (self.xy - self.x * self.y / self.n) / self.n)
    }

    /// Variance of y − x.
    pub(super) fn residual(&self) -> Option<f64> {
        Some((self.var_x()? + self.var_y()? - 2.0 * self.covariance()?).max(0.0))
    }

    /// 1 − var(y − x)/var(x); `None` if x does not vary.
    pub(super) fn vaf(&self) -> Option<f64> {
        let var_x = self.var_x().filter(|v| *v > 0.0)?;
        Some(1.0 - self.residual()? / var_x)
    }

    /// Least-squares slope of y on x; `None` if x does not vary.
    pub(super) fn slope(&self) -> Option<f64> {
        let var_x = self.var_x().filter(|v| *v > 0.0)?;
        Some(self.covariance()? / var_x)
    }

    /// Where the least-squares line has x = 0, or the bias if x does not vary.
    pub(super) fn intercept(&self) -> Option<f64> {
        match self.slope() {
            Some(slope) => Some((self.y - slope * self.x) / self.n),
            None => self.bias(),
        }
    }

    /// Correlation; `None` if one of them does not vary.
    pub(super) fn correlation(&self) -> Option<f64> {
        let product = self.var_x()? * self.var_y()?;
        (product > 0.0).then(|| self.covariance().map(|c| c / product.sqrt()))?
    }

    /// Mean of y − x.
    pub(super) fn bias(&self) -> Option<f64> {
        (self.n > 0.0).then(|| (self.y - self.x) / self.n)
    }

    /// The same as a share of the rms of x; `None` if x is zero.
    pub(super) fn bias_share(&self) -> Option<f64> {
        let square = (self.n > 0.0).then(|| self.xx / self.n)?;
        (square > 0.0).then(|| self.bias().map(|bias| bias / square.sqrt()))?
    }

    /// Mean of |y − x|.
    pub(super) fn mean_error(&self) -> Option<f64> {
        (self.n > 0.0).then(|| self.apart / self.n)
    }
}

/// The lag at which two series agree best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lag {
    /// How much later y is, in steps; a fraction by a parabola through three lags.
    pub(super) steps: f64,
    /// Correlation at the best whole lag.
    pub(super) correlation: f64,
    /// Slope of y on x at that lag.
    pub(super) slope: f64,
}

/// Compares y with x at lags from −`most` to `most` steps. Missing values are skipped.
/// `None` if the series do not vary.
pub(super) fn best_lag(x: &[Option<f64>], y: &[Option<f64>], most: usize) -> Option<Lag> {
    let at = |lag: i64| {
        let from = lag.max(0) as usize;
        let to = x.len().min(x.len().saturating_add_signed(lag as isize));
        Moments::of((from..to).filter_map(|i| {
            let shifted = i.checked_add_signed(-lag as isize)?;
            Some(((*x.get(shifted)?)?, (*y.get(i)?)?))
        }))
    };
    let most = most as i64;
    let all: Vec<Option<Moments>> = (-most..=most).map(|lag| Some(at(lag))).collect();
    let score = |i: usize| all.get(i).copied().flatten().and_then(|m| m.correlation());
    let best = (0..all.len())
        .filter(|i| score(*i).is_some())
        .max_by(|a, b| f64::total_cmp(&score(*a).unwrap_or(-1.0), &score(*b).unwrap_or(-1.0)))?;
    let moments = all[best]?;
    let middle = moments.correlation()?;
    let sides = [best.checked_sub(1).and_then(score), score(best + 1)];
    let fraction = match sides {
        [Some(left), Some(right)] => {
            let bend = left - 2.0 * middle + right;
            if bend < 0.0 {
                (0.5 * (left - right) / bend).clamp(-0.5, 0.5)
            } else {
                0.0
            }
        }
        _ => 0.0,
    };
    Some(Lag {
        steps: best as f64 - most as f64 + fraction,
        correlation: middle,
        slope: moments.slope()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(n: usize, delay: f64) -> Vec<Option<f64>> {
        let value = |i: usize| ((i as f64 - delay) / 40.0).sin();
        (0..n).map(|i| Some(value(i))).collect()
    }

    #[test]
    fn a_line_has_its_slope_and_its_offset() {
        let pairs = (0..100).map(|i| (f64::from(i), 0.5 * f64::from(i) + 3.0));
        let m = Moments::of(pairs);
        assert!((m.slope().unwrap() - 0.5).abs() < 1e-12);
        assert!((m.correlation().unwrap() - 1.0).abs() < 1e-12);
        // 1 − (1 − 0.5)² = 0.75; the mean of x is 49.5.
        assert!((m.vaf().unwrap() - 0.75).abs() < 1e-12);
        assert!((m.intercept().unwrap() - 3.0).abs() < 1e-10);
        assert!((m.bias().unwrap() - (3.0 - 24.75)).abs() < 1e-12);
        assert_eq!(Moments::of([(1.0, 2.0), (1.0, 3.0)]).vaf(), None);
        assert_eq!(Moments::of([]).bias(), None);
    }

    #[test]
    fn a_lag_is_found_below_one_step_and_across_missing_values() {
        for delay in [-7.5, 0.0, 0.25, 12.0, 20.4] {
            let mut late = sine(2000, delay);
            late[300..340].fill(None);
            let lag = best_lag(&sine(2000, 0.0), &late, 60).unwrap();
            assert!((lag.steps - delay).abs() < 0.02, "{delay}: {lag:?}");
            assert!((lag.slope - 1.0).abs() < 0.02, "{delay}: {lag:?}");
        }
        assert_eq!(best_lag(&[Some(1.0); 50], &sine(50, 0.0), 5), None);
    }
}
