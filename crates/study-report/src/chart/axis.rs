//! Axes, ticks and tick labels.

use crate::plot::step;

/// Largest width of a label, in columns: the same everywhere.
pub(crate) const MAX_LABEL: usize = 36;

/// The ticks of an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Ticks {
    /// At round numbers, as many as fit.
    Round,
    /// At these values with these labels. Untrusted.
    At(Vec<(f64, String)>),
    /// No ticks.
    Bare,
}

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit; empty for none. Untrusted.
    pub label: String,
    /// Value at the left or lower end.
    pub low: f64,
    /// Value at the right or upper end.
    pub high: f64,
    /// Ticks.
    pub ticks: Ticks,
    /// Whether grid lines are drawn at the ticks.
    pub grid: bool,
    /// Largest width of a tick label, in columns.
    pub columns: usize,
}

impl Axis {
    /// From `low` to `high` with round ticks and grid lines. Ends that are equal or
    /// not finite are replaced by a range that can be drawn; with `low` above `high`
    /// the axis is reversed.
    pub fn new(label: &str, low: f64, high: f64) -> Self {
        let (low, high) = if (high - low).is_finite() && high != low {
            (low, high)
        } else if low.is_finite() && low.abs() < 1e300 {
            let room = (low.abs() * 0.1).max(0.5);
            (low - room, low + room)
        } else {
            (0.0, 1.0)
        };
        Self {
            label: label.to_owned(),
            low,
            high,
            ticks: Ticks::Round,
            grid: true,
            columns: MAX_LABEL,
        }
    }

    /// An axis that includes all finite values, with a margin of a tenth of the range.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for v in values.into_iter().filter(|v| v.is_finite()) {
            low = low.min(v);
            high = high.max(v);
        }
        let room = (high - low) * 0.1;
        if room > 0.0 {
            Self::new(label, low - room, high + room)
        } else {
            Self::new(label, low, high)
        }
    }

    /// The same over the natural logarithms of positive values: the axis goes by logarithms, its
    /// labels are values.
    pub fn of_logarithms(quantity: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let axis = Self::around(quantity, values.into_iter().map(f64::ln));
        let (low, high) = (axis.low.exp(), axis.high.exp());
        // 1, 2 and 5 of each power of ten; of many powers 1 only, within few more than these.
        let decades = (axis.high - axis.low) / std::f64::consts::LN_10;
        let powers = (low.log10().floor() as i32)..=(high.log10().ceil() as i32);
        let at = |tenths: &[i32]| -> Vec<(f64, String)> {
            let of_power = |power: i32| {
                let value = move |tenth: &i32| format!("{tenth}e{}", power - 1).parse::<f64>().ok();
                tenths.iter().filter_map(value)
            };
            (powers.clone().flat_map(of_power))
                .filter(|x| (low..=high).contains(x))
                .map(|x| (x.ln(), format!("{x}")))
                .collect()
        };
        let usual: &[i32] = if decades > 2.0 { &[10] } else { &[10, 20, 50] };
        let mut ticks = at(usual);
        if ticks.len() < 3 {
            ticks = at(&[10, 15, 20, 30, 40, 60, 80]);
        }
        match ticks.len() {
            // Within less than a factor of two: both ends.
            0 | 1 => {
                let ends = [axis.low, axis.high].map(|at| (at, label(at.exp(), 0.1 * at.exp())));
                axis.at(ends.to_vec())
            }
            _ => axis.at(ticks),
        }
    }

    /// Categories at 0, 1, 2 …, without grid lines.
    pub fn of_names<S: AsRef<str>>(label: &str, names: &[S]) -> Self {
        let at = names.iter().enumerate();
        Self {
            ticks: Ticks::At(at.map(|(i, n)| (i as f64, n.as_ref().to_owned())).collect()),
            grid: false,
            ..Self::new(label, -0.5, names.len().max(1) as f64 - 0.5)
        }
    }

    /// Exchanges the ends, so that the first category is at the top of a y axis.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        (self.low, self.high) = (self.high, self.low);
        self
    }

    /// Sets the ticks.
    #[must_use]
    pub fn at(mut self, ticks: Vec<(f64, String)>) -> Self {
        self.ticks = Ticks::At(ticks);
        self
    }

    /// As long as `range`, about the same middle.
    pub(super) fn widened(&mut self, range: f64) {
        let (middle, half) = (0.5 * (self.low + self.high), 0.5 * range);
        (self.low, self.high) = (middle - half, middle + half);
    }

    /// Removes the ticks.
    #[must_use]
    pub fn bare(mut self) -> Self {
        self.ticks = Ticks::Bare;
        self
    }

    /// Removes the grid lines.
    #[must_use]
    pub fn without_grid(mut self) -> Self {
        self.grid = false;
        self
    }

    /// Position of a value, 0 at the low end and 1 at the high end, limited to ±50 so
    /// that no coordinate overflows.
    pub(super) fn share(&self, value: f64) -> Option<f64> {
        let share = (value - self.low) / (self.high - self.low);
        let share = if value.is_finite() && share.is_infinite() {
            share.signum() * 50.0
        } else {
            share
        };
        (!share.is_nan()).then(|| share.clamp(-50.0, 50.0))
    }

    /// Values and labels of the ticks, at most about `most`.
    pub(super) fn marks(&self, most: usize) -> Vec<(f64, String)> {
        match &self.ticks {
            Ticks::Bare => Vec::new(),
            Ticks::At(ticks) => ticks.clone(),
            Ticks::Round => self.round(most.max(1)),
        }
    }

    fn round(&self, most: usize) -> Vec<(f64, String)> {
        let (low, high) = (self.low.min(self.high), self.low.max(self.high));
        let step = step(high - low, most);
        let first = (low / step - 1e-9).ceil();
        let mut marks = Vec::new();
        for i in 0..=most {
            let k = first + i as f64;
            let at = k * step;
            // For large values adjacent doubles are further apart than a step.
            if at > high + 1e-9 * step || k + 1.0 <= k || !at.is_finite() {
                break;
            }
            marks.push((at, label(at, step)));
        }
        marks
    }
}

/// The label of a tick, with as many decimals as the step needs.
fn label(at: f64, step: f64) -> String {
    let size = at.abs().max(step);
    let shown = if !(1e-4..1e7).contains(&size) {
        format!("{at:.2e}")
    } else {
        let decimals = (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize;
        // + 0.0: no "-0".
        format!("{:.decimals$}", at + 0.0)
    };
    shown.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, most: usize) -> Vec<String> {
        axis.marks(most).into_iter().map(|m| m.1).collect()
    }

    #[test]
    fn ticks_stand_at_round_numbers() {
        assert_eq!(
            labels(&Axis::new("", 1.0, 7.0), 8),
            ["1", "2", "3", "4", "5", "6", "7"]
        );
        assert_eq!(
            labels(&Axis::new("", -0.05, 0.15), 5),
            ["−0.05", "0.00", "0.05", "0.10", "0.15"]
        );
    }

    #[test]
    fn an_axis_of_logarithms_is_labeled_with_values() {
        let ticks = |values: &[f64]| labels(&Axis::of_logarithms("", values.iter().copied()), 5);
        assert_eq!(ticks(&[0.02, 0.6]), ["0.02", "0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(ticks(&[0.07, 0.17]), ["0.08", "0.1", "0.15"]);
        assert_eq!(ticks(&[0.02, 60.0]), ["0.01", "0.1", "1", "10", "100"]);
        let narrow = Axis::of_logarithms("", [2.4, 3.0]);
        assert_eq!(labels(&narrow, 5), ["2.3", "3.1"]);
        assert!((narrow.marks(5)[1].0.exp() - 3.0676).abs() < 1e-3);
    }

    #[test]
    fn an_axis_of_nothing_can_still_be_drawn_on() {
        for (low, high) in [
            (f64::NAN, 1.0),
            (2.0, 2.0),
            (f64::INFINITY, f64::NEG_INFINITY),
            (-1e308, 1e308),
            (1e300, 1.000_000_1e300),
            (1e308, 1e308),
        ] {
            let axis = Axis::new("", low, high);
            assert!((axis.high - axis.low).is_finite() && axis.high != axis.low);
            assert!(axis.marks(10).len() <= 11);
        }
    }

    #[test]
    fn a_value_far_outside_has_a_small_place() {
        let axis = Axis::new("", 0.0, 1e-300);
        assert_eq!(axis.share(1e308), Some(50.0));
        assert_eq!(axis.share(f64::NAN), None);
    }
}
