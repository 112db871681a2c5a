//! The constraints `max_run` and `min_distance`.
//!
//! `max_run = k`: at most k trials in a row with the same realization.
//! `min_distance = d`: positions of the same realization differ by at least d.
//! Realizations are distinguished by id; a hidden duplicate is another realization.

use std::collections::HashMap;
use std::fmt;
use study_base::text::ModelId;

/// The first violation of a constraint by an order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Position of the trial that violates it, from 1.
    pub position: usize,
    /// Its realization.
    pub model: ModelId,
    /// The constraint.
    pub broken: Broken,
}

/// A violated constraint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Broken {
    /// Too many in a row.
    MaxRun {
        /// `max_run`
        limit: u32,
    },
    /// Too close to the last position.
    MinDistance {
        /// `min_distance`
        limit: u32,
        /// Distance to the last position.
        found: usize,
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "position {}: `{}` ", self.position, self.model)?;
        match self.broken {
            Broken::MaxRun { limit } => {
                write!(f, "occurs {} times in a row (max_run = {limit})", limit + 1)
            }
            Broken::MinDistance { limit, found } => {
                write!(
                    f,
                    "is {found} after its last position (min_distance = {limit})"
                )
            }
        }
    }
}

/// The first violation of a constraint; at the same position, `max_run` is reported.
pub fn first_violation(
    models: &[&ModelId],
    max_run: Option<u32>,
    min_distance: Option<u32>,
) -> Option<Violation> {
    let mut watch = Watch::new(max_run, min_distance);
    models.iter().enumerate().find_map(|(i, &model)| {
        watch.next(model).map(|broken| Violation {
            position: i + 1,
            model: model.clone(),
            broken,
        })
    })
}

/// Follows an order and notices violations.
#[derive(Debug, Clone)]
pub(super) struct Watch<'a> {
    max_run: Option<u32>,
    min_distance: Option<u32>,
    /// Trials so far.
    trials: usize,
    /// The last position of each realization.
    last: HashMap<&'a ModelId, usize>,
    /// Length of the present run.
    run: u32,
}

impl<'a> Watch<'a> {
    pub(super) fn new(max_run: Option<u32>, min_distance: Option<u32>) -> Self {
        Self {
            max_run,
            min_distance,
            trials: 0,
            last: HashMap::new(),
            run: 0,
        }
    }

    /// Adds a trial; returns the constraint that it violates.
    pub(super) fn next(&mut self, model: &'a ModelId) -> Option<Broken> {
        self.trials += 1;
        let back = self.last.insert(model, self.trials);
        let back = back.map(|last| self.trials - last);
        self.run = if back == Some(1) { self.run + 1 } else { 1 };
        if let Some(limit) = self.max_run
            && self.run > limit
        {
            return Some(Broken::MaxRun { limit });
        }
        match (self.min_distance, back) {
            (Some(limit), Some(found)) if found < limit as usize => {
                Some(Broken::MinDistance { limit, found })
            }
            _ => None,
        }
    }

    /// Adds the trials of an order; returns how many of them violate a constraint.
    pub(super) fn violations(&mut self, models: impl Iterator<Item = &'a ModelId>) -> usize {
        models.filter(|model| self.next(model).is_some()).count()
    }
}

/// The rule that the two constraints reduce to.
///
/// A distance of two or more forbids every run, which makes `max_run` redundant, and
/// `max_run = 1` is a distance of two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rule {
    /// Every order is valid.
    None,
    /// At most this many in a row, two or more.
    Run(u32),
    /// At least this distance, two or more.
    Distance(u32),
}

impl Rule {
    /// The rule of a design with `repetitions` trials of each realization.
    pub(super) fn of(max_run: Option<u32>, min_distance: Option<u32>, repetitions: u32) -> Self {
        let apart = min_distance.unwrap_or(1);
        match max_run {
            _ if repetitions <= 1 => Self::None,
            _ if apart >= 2 => Self::Distance(apart),
            Some(1) => Self::Distance(2),
            Some(k) if k < repetitions => Self::Run(k),
            _ => Self::None,
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("no constraint"),
            Self::Run(k) => write!(f, "max_run = {k}"),
            Self::Distance(2) => f.write_str("max_run = 1 (min_distance = 2)"),
            Self::Distance(d) => write!(f, "min_distance = {d}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(letters: &str) -> Vec<ModelId> {
        letters
            .chars()
            .map(|c| ModelId::new(c.to_string()).unwrap())
            .collect()
    }

    fn first(letters: &str, run: Option<u32>, distance: Option<u32>) -> Option<String> {
        let ids = ids(letters);
        let models: Vec<_> = ids.iter().collect();
        first_violation(&models, run, distance).map(|v| v.to_string())
    }

    #[test]
    fn a_run_that_is_too_long_is_found_where_it_becomes_so() {
        assert_eq!(first("AABBA", Some(2), None), None);
        assert_eq!(
            first("ABBBA", Some(2), None).unwrap(),
            "position 4: `B` occurs 3 times in a row (max_run = 2)"
        );
        assert_eq!(first("ABBA", Some(1), None).unwrap()[..10], *"position 3");
    }

    #[test]
    fn a_realization_that_is_back_too_soon_is_found() {
        assert_eq!(first("ABCABC", None, Some(3)), None);
        assert_eq!(
            first("ABCBAC", None, Some(3)).unwrap(),
            "position 4: `B` is 2 after its last position (min_distance = 3)"
        );
    }

    #[test]
    fn a_distance_of_one_and_a_long_run_constrain_nothing() {
        assert_eq!(first("AAAA", Some(4), Some(1)), None);
        assert_eq!(Rule::of(Some(4), Some(1), 4), Rule::None);
        assert_eq!(Rule::of(Some(2), Some(3), 4), Rule::Distance(3));
        assert_eq!(Rule::of(Some(1), Some(1), 4), Rule::Distance(2));
        assert_eq!(Rule::of(Some(3), None, 4), Rule::Run(3));
    }

    #[test]
    fn every_trial_that_violates_a_constraint_counts_once() {
        let ids = ids("AABBBAB");
        let count = |run, distance| Watch::new(run, distance).violations(ids.iter());
        assert_eq!(count(None, None), 0);
        assert_eq!(count(Some(1), None), 3);
        assert_eq!(count(Some(2), None), 1);
        assert_eq!(count(Some(1), Some(3)), 4);
    }
}
