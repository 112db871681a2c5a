//! Levels of a track that are counted from its standard.

use super::keys::words;
use super::{Compared, TrackRules};
use crate::procedure::Ladder;

words! {
    /// How a track counts its levels.
    Relative {
        /// The distance of the level from the standard, ΔI.
        Increment = "increment",
        /// This distance as a fraction of the standard, ΔI/I: thresholds are Weber fractions.
        Fraction = "fraction",
    }
}

impl Relative {
    /// A level as the track counts it, with twelve digits, so that 0.3 is 0.1 above 0.2.
    ///
    /// ```
    /// # use study_plan::protocol::Relative;
    /// assert_eq!(Relative::Increment.counted(0.3, 0.2), 0.1);
    /// assert_eq!(Relative::Fraction.counted(0.3, 0.2), 0.5);
    /// ```
    pub fn counted(self, level: f64, standard: f64) -> f64 {
        let increment = level - standard;
        let exact = match self {
            Self::Increment => increment,
            Self::Fraction => increment / standard,
        };
        format!("{exact:.11e}").parse().unwrap_or(exact)
    }

    /// The distance from the standard, ΔI, of what the track counts.
    pub fn increment(self, counted: f64, standard: f64) -> f64 {
        match self {
            Self::Increment => counted,
            Self::Fraction => counted * standard,
        }
    }
}

impl TrackRules {
    /// The ladder of a track, of that of its family: the levels as the track counts them. Those
    /// that are counted from a standard begin above it; `None` if there are none.
    pub fn ladder_of(&self, family: &Ladder) -> Option<Ladder> {
        let (Some(relative), Compared::Levels { standard, .. }) = (self.relative, &self.compared)
        else {
            return Some(family.clone());
        };
        relative_ladder(relative, *standard, family)
    }

    /// How many steps of its family a track leaves out, from the lowest.
    pub(super) fn steps_left_out(&self, family: &Ladder) -> usize {
        match (self.relative, self.standard_level()) {
            (Some(relative), Some(standard)) => {
                let levels = family.levels();
                levels.partition_point(|level| relative.counted(*level, standard) <= 0.0)
            }
            _ => 0,
        }
    }

    /// What the standard is as the track counts levels; `None` of two realizations.
    pub fn counted_standard(&self) -> Option<f64> {
        let level = self.standard_level()?;
        Some(if self.relative.is_some() { 0.0 } else { level })
    }
}

/// The levels above the standard, as a track counts them; `None` if there are none.
pub(super) fn relative_ladder(
    relative: Relative,
    standard: f64,
    family: &Ladder,
) -> Option<Ladder> {
    let counted = |level: &f64| relative.counted(*level, standard);
    let levels = family.levels().iter().map(counted);
    Ladder::new(levels.filter(|level| *level > 0.0).collect()).ok()
}
