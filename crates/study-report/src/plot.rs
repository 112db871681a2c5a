//! Small text charts: histograms in a table cell, dots with error bars, curves of braille characters.

pub mod braille;
pub mod strip;

/// Blocks of 0 to 8 eighths.
const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// One bar for each count, relative to `most`; counts above 0 are always visible.
///
/// ```
/// # use study_report::plot::bars;
/// assert_eq!(bars(&[0.0, 1.0, 4.0, 8.0], 8.0, ""), " ▁▄█");
/// ```
pub fn bars(counts: &[f64], most: f64, gap: &str) -> String {
    let bar = |n: &f64| {
        let eighths = if most > 0.0 {
            (n / most * 8.0).round()
        } else {
            0.0
        };
        let least = if *n > 0.0 { 1.0 } else { 0.0 };
        // Between 0 and 8, so the cast is exact.
        BARS[eighths.clamp(least, 8.0) as usize].to_string()
    };
    counts.iter().map(bar).collect::<Vec<_>>().join(gap)
}

/// A horizontal axis of some columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    low: f64,
    high: f64,
    columns: usize,
}

impl Axis {
    /// From `low` to `high` over at least two columns. `None` unless the ends are
    /// finite and different.
    pub fn new(low: f64, high: f64, columns: usize) -> Option<Self> {
        let finite = low.is_finite() && high.is_finite() && (high - low).is_finite();
        (finite && high > low && columns >= 2).then_some(Self { low, high, columns })
    }

    /// The column of a number, if it is on the axis.
    fn column(&self, x: f64) -> Option<usize> {
        let at = (x - self.low) / (self.high - self.low) * (self.columns - 1) as f64;
        let at = at.round();
        // Not negative and below the number of columns, so the cast is exact.
        (at >= 0.0 && at < self.columns as f64).then_some(at as usize)
    }

    /// `├──●──┤`: a dot at `x` with a bar of ± `half`. A bar has no cap where it leaves
    /// the axis; a dot outside the axis is not drawn.
    pub fn dot(&self, x: f64, half: Option<f64>) -> String {
        let mut line = vec![' '; self.columns];
        if let Some(half) = half.filter(|h| h.is_finite()) {
            let (from, to) = (self.column(x - half), self.column(x + half));
            let first = from.unwrap_or(0);
            let last = to.unwrap_or(self.columns - 1);
            if self.column(x).is_some() && first <= last {
                line[first..=last].fill('─');
                if from.is_some() && first < last {
                    line[first] = '├';
                }
                if to.is_some() && first < last {
                    line[last] = '┤';
                }
            }
        }
        if let Some(at) = self.column(x) {
            line[at] = '●';
        }
        line.into_iter().collect::<String>().trim_end().to_owned()
    }

    /// Round numbers centered at their columns: as many as fit, at most ten.
    pub fn ticks(&self) -> String {
        (2..=10)
            .rev()
            .find_map(|most| self.ticks_of(step(self.high - self.low, most)))
            .unwrap_or_default()
    }

    fn ticks_of(&self, step: f64) -> Option<String> {
        let decimals = (-(step * 1.000001).log10().floor()).clamp(0.0, 9.0) as usize;
        let mut line = vec![' '; self.columns];
        let mut free = 0;
        let mut k = (self.low / step - 1e-9).ceil();
        while k * step <= self.high + 1e-9 * step {
            let at = k * step + 0.0;
            let label = if at.abs().max(step) >= 1e12 {
                format!("{at:.2e}")
            } else {
                format!("{at:.decimals$}")
            };
            let label: Vec<char> = label.chars().collect();
            let column = self.column(k * step)?;
            let start = column.saturating_sub(label.len() / 2);
            let start = start.min(self.columns.checked_sub(label.len())?);
            if start < free {
                return None;
            }
            line[start..start + label.len()].copy_from_slice(&label);
            free = start + label.len() + 1;
            // For large values adjacent doubles are further apart than a step.
            if k + 1.0 <= k {
                return None;
            }
            k += 1.0;
        }
        Some(line.into_iter().collect::<String>().trim_end().to_owned())
    }
}

/// 1, 2 or 5 times a power of ten, so that at most `most` steps fit.
pub(super) fn step(span: f64, most: usize) -> f64 {
    let rough = span / most as f64;
    let ten = 10f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .iter()
        .map(|m| m * ten)
        .find(|s| *s >= rough * (1.0 - 1e-9))
        .unwrap_or(10.0 * ten)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rare_rating_still_shows() {
        assert_eq!(bars(&[0.0, 1.0, 50.0, 100.0], 100.0, ""), " ▁▄█");
        assert_eq!(bars(&[0.0, 0.0], 0.0, " "), "   ");
    }

    #[test]
    fn a_dot_lies_within_its_bar() {
        let axis = Axis::new(1.0, 7.0, 25).unwrap();
        assert_eq!(axis.dot(4.0, Some(1.0)), "        ├───●───┤");
        assert_eq!(axis.ticks(), "1   2   3   4   5   6   7");
    }

    #[test]
    fn a_bar_that_leaves_the_axis_has_no_cap() {
        let axis = Axis::new(1.0, 7.0, 7).unwrap();
        assert_eq!(axis.dot(2.0, Some(3.0)), "─●──┤");
        assert_eq!(axis.dot(9.0, Some(1.0)), "");
    }

    #[test]
    fn an_axis_of_nothing_is_none() {
        assert_eq!(Axis::new(1.0, 1.0, 20), None);
        assert_eq!(Axis::new(f64::NAN, 1.0, 20), None);
        assert_eq!(Axis::new(-1e308, 1e308, 20), None);
    }

    #[test]
    fn huge_axes_end() {
        let axis = Axis::new(1e300, 1.0000001e300, 40).unwrap();
        assert!(axis.ticks().chars().count() <= 40);
    }
}
