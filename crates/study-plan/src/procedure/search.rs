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
    /// In indices of the certified points.
    choices: Vec<Choice>,
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
            choices: Vec::new(),
        })
    }

    /// The two points that are compared next, the lower one first; `None` when the search has ended. The rule
    /// `preference-gp` computes for some 0.05 s here: ask once for each trial.
    pub fn next(&self) -> Option<[usize; 2]> {
        let planned = *self.planned.get(self.choices.len())?;
        if self.choices.len() < self.rule.planned() as usize {
            return Some(planned);
        }
        let found = self.posterior().and_then(|p| match self.rule.choose {
            Choose::PreferenceGp {
                acquire: Acquire::Challenger,
                ..
            } => p.challenge(CHALLENGE_SDS),
            _ => p.best_pair(),
        });
        Some(found.map_or(planned, |(a, b)| {
            [a, b].map(|index| self.lattice.certified()[index])
        }))
    }

    /// Takes the answer to a trial. A search that has ended takes none, and no search one about other points than
    /// those of its lattice.
    pub fn answer(&mut self, answer: &Preferred) {
        let index = |point| self.lattice.certified().binary_search(&point).ok();
        if let (Some(preferred), Some(other)) = (index(answer.preferred), index(answer.other))
            && preferred != other
            && self.choices.len() < self.planned.len()
        {
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

    /// The certified point with the largest mean utility.
    pub fn best_point(&self) -> Option<usize> {
        Some(self.lattice.certified()[self.posterior()?.best_point()])
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
pub fn verify_search(mut search: Search, trials: &[RecordedPair]) -> Result<(), SearchMismatch> {
    for (trial, recorded) in (1..).zip(trials) {
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
