//! The method of adjustment: levels that subjects set until they feel equal to a standard, or as they should
//! (Gescheider, Psychophysics, 3rd ed., 1997, chapter 3).
//!
//! Half of the settings start below, half above. A subject's point of subjective equality is the mean of the two means, so
//! that lost trials of one direction do not shift it. How much settings scatter within a subject and a direction is a
//! measure of the just noticeable difference; what separates the two directions is not noise and has a number of its own.

use super::describe::{Sum, mean, quantile, sorted, sum_of_squares};
use super::finite;
use super::random::RandomSource;

/// Resamples of the subjects for the interval of the spread.
pub const RESAMPLES: usize = 2000;
/// Fewest subjects whose spread has an interval: resamples of fewer say little.
pub const FEWEST_RESAMPLED: usize = 5;

/// One setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// The level that was set.
    pub level: f64,
    /// Whether it started below; else above.
    pub ascending: bool,
}

/// The settings of one subject.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Their number.
    pub n: usize,
    /// The point of subjective equality: the mean of the means of both directions, or that of the only one.
    pub pse: f64,
    /// Mean of those that started below.
    pub ascending: Option<f64>,
    /// Mean of those that started above.
    pub descending: Option<f64>,
    /// Sum of their squared deviations from the mean of their direction.
    pub squares: f64,
    /// Degrees of freedom of that sum.
    pub df: usize,
}

impl Settings {
    /// `None` without a setting, or if a number overflows.
    ///
    /// ```
    /// # use study_stats::adjustment::{Setting, Settings};
    /// let set = |level, ascending| Setting { level, ascending };
    /// let own = Settings::of(&[set(1.0, true), set(1.0, true), set(1.5, false)]).unwrap();
    /// assert_eq!((own.pse, own.difference()), (1.25, Some(-0.5)));
    /// ```
    pub fn of(settings: &[Setting]) -> Option<Self> {
        let from = |ascending: bool| -> Vec<f64> {
            let own = settings.iter().filter(|s| s.ascending == ascending);
            own.map(|s| s.level).collect()
        };
        let (up, down) = (from(true), from(false));
        let (ascending, descending) = (mean(&up), mean(&down));
        let pse = match (ascending, descending) {
            (Some(up), Some(down)) => finite(f64::midpoint(up, down)),
            (one, other) => one.or(other),
        };
        let squares = |own: &[f64]| match own.len() {
            0 => Some(0.0),
            _ => sum_of_squares(own).map(|s| s.max(0.0)),
        };
        Some(Self {
            n: settings.len(),
            pse: pse?,
            ascending,
            descending,
            squares: finite(squares(&up)? + squares(&down)?)?,
            df: up.len().saturating_sub(1) + down.len().saturating_sub(1),
        })
    }

    /// Standard deviation within directions; `None` without two settings of one direction.
    pub fn sd(&self) -> Option<f64> {
        (self.df > 0).then(|| (self.squares / self.df as f64).sqrt())
    }

    /// Mean from below less mean from above: below 0 if settings stay near their start, above 0 if they overshoot.
    pub fn difference(&self) -> Option<f64> {
        finite(self.ascending? - self.descending?)
    }
}

/// How much settings scatter within subjects and directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Pooled standard deviation: the root of all squares over all degrees of freedom.
    pub sd: f64,
    /// Degrees of freedom.
    pub df: usize,
    /// Percentile interval over subjects, by the bootstrap; `None` of fewer than [`FEWEST_RESAMPLED`].
    pub ci95: Option<(f64, f64)>,
}

/// The spread of these subjects. `None` if nobody has two settings of one direction.
pub fn spread(subjects: &[Settings], random: &mut impl RandomSource) -> Option<Spread> {
    let known: Vec<Settings> = subjects.iter().filter(|s| s.df > 0).copied().collect();
    let n = known.len();
    let all: Vec<usize> = (0..n).collect();
    let sd = pooled(&known, &all)?;
    let ci95 = if n < FEWEST_RESAMPLED {
        None
    } else {
        let mut found = Vec::with_capacity(RESAMPLES);
        for _ in 0..RESAMPLES {
            let drawn: Vec<usize> = (0..n).map(|_| random.below(n as u64) as usize).collect();
            found.extend(pooled(&known, &drawn));
        }
        let found = sorted(&found);
        quantile(&found, 0.025).zip(quantile(&found, 0.975))
    };
    Some(Spread {
        sd,
        df: known.iter().map(|s| s.df).sum(),
        ci95,
    })
}

/// The pooled standard deviation of some subjects, by their places.
fn pooled(subjects: &[Settings], places: &[usize]) -> Option<f64> {
    let squares: Sum = places.iter().map(|at| subjects[*at].squares).collect();
    let df: usize = places.iter().map(|at| subjects[*at].df).sum();
    if df == 0 {
        return None;
    }
    finite((squares.get() / df as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paired::one_sample;
    use crate::random::SplitMix64;

    /// Six subjects, of each the settings from below and from above; tests/reference/adjustment.R has the same.
    const DATA: [(&[f64], &[f64]); 6] = [
        (&[0.9, 1.0, 1.1], &[1.2, 1.1, 1.3]),
        (&[1.2, 1.1, 1.0], &[1.2, 1.4, 1.3]),
        (&[0.8, 0.9, 0.9], &[1.0, 1.0, 0.9]),
        (&[1.3, 1.1], &[1.3, 1.5, 1.2]),
        (&[1.0, 1.2, 1.1], &[1.1, 1.0, 1.3]),
        (&[1.4], &[1.5]),
    ];

    fn subjects() -> Vec<Settings> {
        let of = |(up, down): &(&[f64], &[f64])| {
            let set = |ascending: bool| {
                move |level: &f64| Setting {
                    level: *level,
                    ascending,
                }
            };
            let all = up.iter().map(set(true)).chain(down.iter().map(set(false)));
            Settings::of(&all.collect::<Vec<_>>()).unwrap()
        };
        DATA.iter().map(of).collect()
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn settings_are_those_of_r() {
        let subjects = subjects();
        let pse: Vec<f64> = subjects.iter().map(|s| s.pse).collect();
        let expected = [1.1, 1.2, 11.0 / 12.0, 19.0 / 15.0, 67.0 / 60.0, 1.45];
        for (found, expected) in pse.iter().zip(expected) {
            near(*found, expected);
        }
        near(subjects[0].sd().unwrap(), 0.1);
        assert_eq!(subjects[5].sd(), None);
        let mean = one_sample(&pse).unwrap();
        near(mean.mean, 1.175);
        near(mean.ci95.0, 0.987_026_966_145_119);
        near(mean.ci95.1, 1.362_973_033_854_881);
        let error: Vec<f64> = pse.iter().map(|p| p - 1.0).collect();
        let error = one_sample(&error).unwrap();
        near(error.t.unwrap(), 2.393_172_105_652_4);
        near(error.p.unwrap(), 0.062_143_319_372_778);
        let difference: Vec<f64> = subjects.iter().filter_map(Settings::difference).collect();
        let difference = one_sample(&difference).unwrap();
        near(difference.mean, -0.127_777_777_777_778);
        near(difference.t.unwrap(), -4.838_086_361_984_216);
        near(difference.p.unwrap(), 0.004_722_863_406_675);
    }

    /// R enumerates all 5⁵ resamples of the five subjects who have a spread.
    #[test]
    fn the_spread_and_its_interval_are_those_of_r() {
        let found = spread(&subjects(), &mut SplitMix64::new(1)).unwrap();
        near(found.sd, 0.109_223_736_254_55);
        assert_eq!(found.df, 19);
        let (low, high) = found.ci95.unwrap();
        // Quantiles .015 and .035, .965 and .985 of all resamples: three standard errors of 2000.
        assert!((0.0774..0.0857).contains(&low), "{low}");
        assert!((0.1305..0.1344).contains(&high), "{high}");
        let few = spread(&subjects()[..4], &mut SplitMix64::new(1)).unwrap();
        assert_eq!(few.ci95, None);
    }

    #[test]
    fn a_direction_without_settings_has_no_difference() {
        let set = |level| Setting {
            level,
            ascending: true,
        };
        let own = Settings::of(&[set(1.0), set(3.0)]).unwrap();
        assert_eq!((own.pse, own.difference(), own.df), (2.0, None, 1));
        assert_eq!(Settings::of(&[]), None);
        assert_eq!(spread(&[], &mut SplitMix64::new(1)), None);
    }

    /// Lost trials of one direction do not shift the point of subjective equality.
    #[test]
    fn directions_weigh_alike() {
        let set = |level, ascending| Setting { level, ascending };
        let own = [set(1.0, true), set(1.0, true), set(2.0, false)];
        assert_eq!(Settings::of(&own).unwrap().pse, 1.5);
    }
}
