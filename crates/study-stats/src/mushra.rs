//! Ratings from 0 to 100 with a hidden reference and anchors: who is screened after
//! ITU-R BS.1534-3, and what the others say.

use super::describe;
use super::distribution::t_quantile;

/// The rule of screening.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screening {
    /// The hidden reference is to be rated at least so.
    pub reference_below: f64,
    /// The mid anchor is to be rated at most so.
    pub anchor_above: f64,
    /// Screened if more than this percentage of a participant's items breaks one of the
    /// two rules.
    pub more_than_percent: f64,
}

impl Default for Screening {
    fn default() -> Self {
        Self {
            reference_below: 90.0,
            anchor_above: 90.0,
            more_than_percent: 15.0,
        }
    }
}

/// What the rule finds in the ratings of one participant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screened {
    /// Share of items whose hidden reference was rated too low; `None` without any.
    pub reference_below: Option<f64>,
    /// Share of items whose mid anchor was rated too high; `None` without any.
    pub anchor_above: Option<f64>,
    /// One of the two is more than the percentage. A flag: nothing is deleted.
    pub screened: bool,
}

impl Screening {
    /// The ratings of the hidden reference and of the mid anchor, one for each item.
    pub fn judge(&self, reference: &[f64], anchor: &[f64]) -> Screened {
        let below = reference
            .iter()
            .filter(|r| **r < self.reference_below)
            .count();
        let above = anchor.iter().filter(|r| **r > self.anchor_above).count();
        // Exact for whole percentages: 3 of 20 is not more than 15 %.
        let more =
            |count: usize, of: usize| count as f64 * 100.0 > of as f64 * self.more_than_percent;
        let share = |count: usize, of: usize| (of > 0).then(|| count as f64 / of as f64);
        Screened {
            reference_below: share(below, reference.len()),
            anchor_above: share(above, anchor.len()),
            screened: more(below, reference.len()) || more(above, anchor.len()),
        }
    }
}

/// The ratings of one condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Median of all ratings.
    pub median: f64,
    /// Quartiles (type 7).
    pub quartiles: (f64, f64),
    /// Mean of the participants' means.
    pub mean: f64,
    /// Half width of its t interval; `None` for one participant.
    pub ci95_half: Option<f64>,
}

/// Quantiles of all ratings, and the mean over participants. One slice of ratings for
/// each participant; those without ratings are left out.
pub fn condition<R: AsRef<[f64]>>(participants: &[R]) -> Option<Condition> {
    let all: Vec<f64> = participants
        .iter()
        .flat_map(|r| r.as_ref())
        .copied()
        .collect();
    let sorted = describe::sorted(&all);
    let means: Vec<f64> = participants
        .iter()
        .filter_map(|r| describe::mean(r.as_ref()))
        .collect();
    let n = means.len() as f64;
    Some(Condition {
        median: describe::quantile(&sorted, 0.5)?,
        quartiles: (
            describe::quantile(&sorted, 0.25)?,
            describe::quantile(&sorted, 0.75)?,
        ),
        mean: describe::mean(&means)?,
        ci95_half: describe::sd(&means)
            .zip(t_quantile(0.975, n - 1.0))
            .map(|(sd, t)| t * sd / n.sqrt()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The signs are strict: 90 passes, 3 of 20 passes, 2 of 13 does not.
    #[test]
    fn the_limits_themselves_pass() {
        let ratings = |low: usize, n: usize| -> Vec<f64> {
            (0..n).map(|i| if i < low { 89.0 } else { 90.0 }).collect()
        };
        let rule = Screening::default();
        let found = rule.judge(&ratings(3, 20), &[90.0; 20]);
        assert_eq!(found.reference_below, Some(0.15));
        assert_eq!(found.anchor_above, Some(0.0));
        assert!(!found.screened);
        assert!(rule.judge(&ratings(2, 13), &[]).screened);
        assert!(rule.judge(&ratings(0, 5), &[91.0, 0.0, 0.0]).screened);
        let nothing = rule.judge(&[], &[]);
        assert_eq!((nothing.reference_below, nothing.screened), (None, false));
    }

    #[test]
    fn a_condition_is_summed_up_over_participants() {
        let found = condition(&[vec![10.0, 20.0], vec![30.0], vec![]]).unwrap();
        assert_eq!((found.median, found.mean), (20.0, 22.5));
        assert_eq!(found.quartiles, (15.0, 25.0));
        // t(.975, 1) · 10.6066/√2 = 12.7062 · 7.5
        assert!((found.ci95_half.unwrap() - 95.2965).abs() < 1e-3);
        assert_eq!(condition::<Vec<f64>>(&[]), None);
    }
}
