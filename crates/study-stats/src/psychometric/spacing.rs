//! The scale of the levels over which a function is fitted.

use super::{Core, Level};

/// The scale of the levels over which a function is fitted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Spacing {
    /// The level itself.
    #[default]
    Lin,
    /// Its natural logarithm: thresholds are positive, and widths are logarithms of ratios.
    Log,
}

impl Spacing {
    /// Where a level is on the scale; `None` of a level of 0 or less, which has no logarithm.
    pub fn place(self, level: f64) -> Option<f64> {
        match self {
            Self::Lin => Some(level),
            Self::Log => (level > 0.0).then(|| level.ln()),
        }
    }

    /// The level at a place of the scale.
    pub fn level(self, place: f64) -> f64 {
        match self {
            Self::Lin => place,
            Self::Log => place.exp(),
        }
    }

    /// The shape of a function where none is named: a cumulative normal, over logarithms a
    /// Weibull function of the level.
    pub fn usual_core(self) -> Core {
        match self {
            Self::Lin => Core::Norm,
            Self::Log => Core::Gumbel,
        }
    }

    /// The same trials at their places. Levels without a place are left out.
    pub fn places(self, levels: &[Level]) -> Vec<Level> {
        let placed = |l: &Level| {
            let level = self.place(l.level)?;
            Some(Level { level, ..*l })
        };
        levels.iter().filter_map(placed).collect()
    }
}
