//! Search: which two points of a space of stimuli are compared next.
//!
//! A search is a pure function, as a track is: the same rule, lattice, stream and answers give the same pair on every
//! machine. `docs/search.md` defines it, so that another program can reproduce it.

mod lattice;
mod sobol;

pub use lattice::{Lattice, MAX_POINTS};

use super::ProcedureError;
use serde::{Deserialize, Serialize};
use sobol::Sobol;
use std::collections::BTreeSet;
use study_base::rng::Stream;
use study_stats::preference_gp::{Candidate, Choice, Posterior, candidates};
use thiserror::Error;

/// The most trials of a search.
pub const MAX_TRIALS: u32 = 500;

/// The most indices of the Sobol sequence that are tried for one pair.
const MAX_INDICES: u32 = 1 << 16;

/// How a search chooses, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SearchRule {
    /// Which pair comes next.
    #[serde(flatten)]
    pub choose: Choose,
    /// Number of trials.
    pub trials: u32,
}

/// Which pair comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "name", rename_all = "kebab-case")]
pub enum Choose {
    /// Pairs that follow from the Gaussian process that is learned from the answers.
    PreferenceGp {
        /// So many first pairs are those of `Sobol`.
        start: u32,
        /// Which pair comes after them.
        acquire: Acquire,
    },
    /// Pairs of a shifted Sobol sequence, which fill the space evenly.
    Sobol,
    /// Pairs of which each is as probable as every other.
    Random,
}

/// Which pair is compared, given what is known of all utilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Acquire {
    /// The best point so far, and the one that may be better by most: [`Posterior::challenge`].
    Challenger,
    /// The pair with the largest expected utility of the better point: [`Posterior::best_pair`].
    Eubo,
}

/// Standard deviations by which a challenger may be better than it is expected to be.
const CHALLENGE_SDS: f64 = 2.0;

impl SearchRule {
    /// How many first pairs do not depend on answers.
    pub fn planned(&self) -> u32 {
        match self.choose {
            Choose::PreferenceGp { start, .. } => start.min(self.trials),
            Choose::Sobol | Choose::Random => self.trials,
        }
    }
}

/// The answer to one trial of a search: a later correction changes the analysis, not the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Preferred {
    /// The point that was preferred.
    pub preferred: usize,
    /// The other one.
    pub other: usize,
}

/// A search in progress.
#[derive(Debug, Clone)]
pub struct Search {
    rule: SearchRule,
    lattice: Lattice,
    /// Of the certified points, from 0 to 1.
    coordinates: Vec<Vec<f64>>,
    candidates: Vec<Candidate>,
    planned: Vec<[usize; 2]>,
    /// Index of the next planned pair.
    at: usize,
    /// In indices of the certified points.
    choices: Vec<Choice>,
    /// Certified points that are not presented any more.
    left_out: BTreeSet<usize>,
}

impl Search {
    /// A search before its first trial. `stream` gives the shift of the Sobol sequence, or the random pairs.
    ///
    /// # Errors
    /// [`ProcedureError`] if the rule has no trials or too many, or starts after its end.
    pub fn new(
        rule: &SearchRule,
        lattice: &Lattice,
        stream: &mut Stream,
    ) -> Result<Self, ProcedureError> {
        let range = |what: &str, value: u32, range| {
            Err(ProcedureError::Range {
                what: what.to_owned(),
                value: f64::from(value),
                range,
            })
        };
        if rule.trials == 0 || rule.trials > MAX_TRIALS {
            return range("trials", rule.trials, "1 to 500");
        }
        if let Choose::PreferenceGp { start, .. } = rule.choose
            && start > rule.trials
        {
            return range("start", start, "at most `trials`");
        }
        let planned = match rule.choose {
            Choose::Random => (0..rule.trials).map(|_| random(lattice, stream)).collect(),
            // All of them, so that there is a pair even if the model had none.
            Choose::Sobol | Choose::PreferenceGp { .. } => even(lattice, rule.trials, stream),
        };
        Ok(Self {
            rule: *rule,
            lattice: lattice.clone(),
            coordinates: (lattice.certified().iter())
                .map(|point| lattice.coordinates(*point))
                .collect(),
            candidates: candidates(lattice.steps().len()),
            planned,
            at: 0,
            choices: Vec::new(),
            left_out: BTreeSet::new(),
        })
    }

    /// The two points that are compared next, the lower one first; `None` when the search has ended. The rule
    /// `preference-gp` computes for some 0.05 s here: ask once for each trial.
    pub fn next(&self) -> Option<[usize; 2]> {
        if self.choices.len() >= self.planned.len() {
            return None;
        }
        let (_, planned) = self.planned_pair();
        if self.choices.len() < self.rule.planned() as usize {
            return Some(planned);
        }
        let may = |index: usize| self.may(self.lattice.certified()[index]);
        let found = self.posterior().and_then(|p| match self.rule.choose {
            Choose::PreferenceGp {
                acquire: Acquire::Challenger,
                ..
            } => p.challenge(CHALLENGE_SDS, may),
            _ => p.best_pair(may),
        });
        Some(found.map_or(planned, |(a, b)| {
            [a, b].map(|index| self.lattice.certified()[index])
        }))
    }

    /// The next planned pair of points that are presented, and its index. After the last pair come the first ones again;
    /// should none be left, it is the first two points that are.
    fn planned_pair(&self) -> (usize, [usize; 2]) {
        let all = self.planned.len();
        let from_here = (self.at..self.at + all).map(|index| index % all);
        let mut pairs = from_here.map(|index| (index, self.planned[index]));
        let found = pairs.find(|(_, [a, b])| self.may(*a) && self.may(*b));
        found.unwrap_or_else(|| {
            let certified = self.lattice.certified().iter().copied();
            let mut left = certified.filter(|point| self.may(*point));
            // There are two: `leave_out` sees to it.
            let pair = [left.next(), left.next()].map(Option::unwrap_or_default);
            (self.at % all, pair)
        })
    }

    fn may(&self, point: usize) -> bool {
        !self.left_out.contains(&point)
    }

    /// Whether a point can be left out: it is certified and still presented, and two others are.
    pub fn can_leave_out(&self, point: usize) -> bool {
        let left = self.lattice.certified().len() - self.left_out.len();
        left > 2 && self.lattice.is_certified(point) && self.may(point)
    }

    /// Presents a point no more, such as one that the device does not play. What was answered about it stays. The last two
    /// points cannot be left out.
    pub fn leave_out(&mut self, point: usize) {
        if self.can_leave_out(point) {
            self.left_out.insert(point);
        }
    }

    /// Takes all that a journal has: each point is left out where it was, and answers are taken in their order.
    pub fn replay(&mut self, trials: &[RecordedPair], left_out: &[LeftOut]) {
        for (before, recorded) in trials.iter().enumerate() {
            self.leave_out_at(before, left_out);
            if let Some(answer) = recorded.answer() {
                self.answer(&answer);
            }
        }
        self.leave_out_at(trials.len(), left_out);
    }

    /// Leaves out what was left out after so many trials.
    fn leave_out_at(&mut self, after: usize, left_out: &[LeftOut]) {
        let here = left_out.iter().filter(|out| out.after == after);
        here.for_each(|out| self.leave_out(out.point));
    }

    /// Takes the answer to a trial. A search that has ended takes none, and no search one about other points than
    /// those of its lattice.
    pub fn answer(&mut self, answer: &Preferred) {
        let index = |point| self.lattice.certified().binary_search(&point).ok();
        if let (Some(preferred), Some(other)) = (index(answer.preferred), index(answer.other))
            && preferred != other
            && self.choices.len() < self.planned.len()
        {
            self.at = self.planned_pair().0 + 1;
            self.choices.push(Choice { preferred, other });
        }
    }

    /// Answered trials.
    pub fn answered(&self) -> usize {
        self.choices.len()
    }

    /// The utilities of the certified points, in their order, with the most probable kernel.
    pub fn posterior(&self) -> Option<Posterior> {
        let found = Posterior::most_probable(&self.coordinates, &self.candidates, &self.choices);
        Some(found.ok()?.1)
    }

    /// The certified point with the largest mean utility, of those that are not left out.
    pub fn best_point(&self) -> Option<usize> {
        let may = |index: usize| self.may(self.lattice.certified()[index]);
        Some(self.lattice.certified()[self.posterior()?.best_point(may)?])
    }
}

/// Two different certified points, each pair as probable as every other; the lower one first.
fn random(lattice: &Lattice, stream: &mut Stream) -> [usize; 2] {
    let points = lattice.certified();
    let n = points.len() as u64;
    let first = stream.below(n);
    // Among the others: those from `first` on are one further.
    let second = stream.below(n - 1);
    let second = second + u64::from(second >= first);
    let (low, high) = (first.min(second), first.max(second));
    [points[low as usize], points[high as usize]]
}

/// Pairs of a Sobol sequence in twice as many dimensions: the first half of the coordinates is one point, the second half the
/// other. Pairs of equal points or with one that is not certified are left out.
fn even(lattice: &Lattice, trials: u32, stream: &mut Stream) -> Vec<[usize; 2]> {
    let dimensions = lattice.steps().len();
    let mut sobol = Sobol::new(2 * dimensions, stream);
    (0..trials)
        .map(|_| {
            let found = (0..MAX_INDICES).find_map(|_| {
                let drawn = sobol.next();
                let (one, two) = drawn.split_at(dimensions);
                let (one, two) = (lattice.point_at(one), lattice.point_at(two));
                let good = one != two && lattice.is_certified(one) && lattice.is_certified(two);
                good.then_some([one.min(two), one.max(two)])
            });
            found.unwrap_or_else(|| random(lattice, stream))
        })
        .collect()
}

/// A trial of a search as a journal has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordedPair {
    /// The pair that was presented, the lower point first.
    pub pair: [usize; 2],
    /// The point that was preferred; `None` without an answer, which the search is not told.
    pub preferred: Option<usize>,
}

impl RecordedPair {
    /// What the search is told; `None` without an answer, or if the preferred point is none of the pair.
    pub fn answer(&self) -> Option<Preferred> {
        let preferred = self.preferred?;
        let [a, b] = self.pair;
        let other = match preferred {
            _ if preferred == a => b,
            _ if preferred == b => a,
            _ => return None,
        };
        Some(Preferred { preferred, other })
    }
}

/// A point that a search presents no more, as a journal has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LeftOut {
    /// The point.
    pub point: usize,
    /// The number of trials that the search had been told.
    pub after: usize,
}

/// A journal that its rule would not have produced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum SearchMismatch {
    /// Another pair was presented.
    #[error("trial {trial} of the search compares the points {} and {}, and its rule {} and {}", .recorded[0], .recorded[1], .computed[0], .computed[1])]
    Presented {
        /// Trial of the search, from 1.
        trial: usize,
        /// The pair of the journal.
        recorded: [usize; 2],
        /// The pair of the rule.
        computed: [usize; 2],
    },
    /// The preferred point is none of the pair.
    #[error("trial {trial} of the search prefers the point {preferred}, which it does not compare")]
    Preferred {
        /// Trial of the search, from 1.
        trial: usize,
        /// The point of the journal.
        preferred: usize,
    },
    /// The search had ended.
    #[error("trial {trial} of the search is after its end")]
    Ended {
        /// Trial of the search, from 1.
        trial: usize,
    },
}

/// Replays a search and compares every pair. The first mismatch is an error. `search` has had no answer yet.
///
/// # Errors
/// [`SearchMismatch`].
pub fn verify_search(
    mut search: Search,
    trials: &[RecordedPair],
    left_out: &[LeftOut],
) -> Result<(), SearchMismatch> {
    for (trial, recorded) in (1..).zip(trials) {
        search.leave_out_at(trial - 1, left_out);
        let computed = search.next().ok_or(SearchMismatch::Ended { trial })?;
        if computed != recorded.pair {
            return Err(SearchMismatch::Presented {
                trial,
                recorded: recorded.pair,
                computed,
            });
        }
        match (recorded.answer(), recorded.preferred) {
            (Some(answer), _) => search.answer(&answer),
            (None, Some(preferred)) => {
                return Err(SearchMismatch::Preferred { trial, preferred });
            }
            (None, None) => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
