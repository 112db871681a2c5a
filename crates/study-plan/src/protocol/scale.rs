//! The scale on which the answers to a question lie.

use std::collections::BTreeMap;

/// What the answers to a question are to an analysis, an export and a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale<'a> {
    /// Whole numbers, in an order.
    Levels {
        /// Smallest.
        from: i64,
        /// Largest.
        to: i64,
        /// Labels of some of the numbers.
        labels: &'a BTreeMap<i64, String>,
    },
    /// Numbers between two ends.
    Interval {
        /// One end.
        from: f64,
        /// The other end, above `from`.
        to: f64,
        /// Labels of some numbers, by the number as text.
        labels: &'a BTreeMap<String, String>,
    },
    /// Numbers without ends that are part of the scale.
    Open {
        /// Their unit.
        unit: Option<&'a str>,
        /// Smallest that is accepted.
        min: Option<f64>,
        /// Largest that is accepted.
        max: Option<f64>,
        /// Only larger numbers are accepted.
        above: Option<f64>,
    },
    /// Names without an order.
    Names {
        /// The names.
        options: &'a [String],
        /// Whether an answer can have several.
        multiple: bool,
    },
    /// Free text.
    Free,
}

impl Scale<'_> {
    /// Its ends, if it has two.
    pub fn ends(&self) -> Option<(f64, f64)> {
        match *self {
            Self::Levels { from, to, .. } => Some((from as f64, to as f64)),
            Self::Interval { from, to, .. } => Some((from, to)),
            Self::Open { .. } | Self::Names { .. } | Self::Free => None,
        }
    }

    /// Its smallest and largest level, if it has levels.
    pub fn levels(&self) -> Option<(i64, i64)> {
        match *self {
            Self::Levels { from, to, .. } => Some((from, to)),
            _ => None,
        }
    }

    /// Labels of some of its numbers, by the number as text.
    pub fn labels(&self) -> BTreeMap<String, String> {
        match self {
            Self::Levels { labels, .. } => {
                let label = |(at, label): (&i64, &String)| (at.to_string(), label.clone());
                labels.iter().map(label).collect()
            }
            Self::Interval { labels, .. } => (*labels).clone(),
            Self::Open { .. } | Self::Names { .. } | Self::Free => BTreeMap::new(),
        }
    }

    /// Whether answers are numbers.
    pub fn is_number(&self) -> bool {
        !matches!(self, Self::Names { .. } | Self::Free)
    }
}
