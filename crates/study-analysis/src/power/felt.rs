//! Parts of ranking, similarity, adjustment and identification: answers are drawn from what participants feel, and decided by
//! the analysis of such parts.
//!
//! **Ranking.** A realization is worth slope·x + scatter + what a participant adds; each time it is felt with noise, and the
//! realizations of a trial are ranked by what was felt. Only ratios of these standard deviations matter.
//!
//! **Similarity.** Realizations have two coordinates in points of the scale: slope·x, and one that is drawn. A rating is their
//! distance, plus what a participant adds to the pair and noise, as a whole number from 0 to 100.
//!
//! **Adjustment.** A setting is the level that feels equal to a participant plus noise, at the nearest step of the ladder.
//!
//! **Identification.** The logit of a correct answer is that of the mean share plus the ease of the label and what a
//! participant adds; of wrong labels each is given alike.

use super::decide::{Outcome, is_lost, verdict};
use super::{Cell, STREAM, Settings, Test};
use crate::analyze::psychophysics::{
    LabelRow, PartFinding, RankingRow, SettingRow, SimilarityRow, decided,
};
use std::collections::BTreeMap;
use study_base::rng::Stream;
use study_base::sort::SmallSort as _;

/// What is assumed of the realizations of a part, and what participants do with them.
#[derive(Debug, Clone, PartialEq)]
pub enum FeltWorld {
    /// They are ranked.
    Ranking {
        /// Standardized, of each realization.
        x: Vec<f64>,
        /// What x is.
        property: &'static str,
        /// Whether several can have the same rank.
        ties: bool,
    },
    /// How different two are is rated.
    Similarity {
        /// Standardized, of each realization.
        x: Vec<f64>,
        /// What x is.
        property: &'static str,
        /// The pairs that are rated, by place.
        pairs: Vec<[usize; 2]>,
    },
    /// A level is set until it feels equal to a standard.
    Adjustment {
        /// The levels, rising.
        levels: Vec<f64>,
        /// That of the standard.
        standard: f64,
        /// The mean level that feels equal.
        mean: f64,
    },
    /// Labels are given.
    Identification {
        /// Of each realization the place of its label.
        right: Vec<usize>,
        /// Number of labels.
        labels: usize,
        /// The share of correct answers of a typical participant.
        correct: f64,
    },
}

/// Noise within which two that are felt have the same rank, if that is allowed, as a share of its standard deviation.
const TIED: f64 = 0.5;

impl FeltWorld {
    /// The tests of such a part.
    pub(super) fn tests(&self) -> Vec<Test> {
        match self {
            Self::Ranking { .. } => vec![Test::RankedAlike, Test::RankedFirst],
            Self::Similarity { .. } => vec![Test::MapFollows],
            Self::Adjustment { .. } => vec![Test::Adjusted],
            Self::Identification { .. } => vec![Test::Identified],
        }
    }
}

/// Decides simulated studies of such a part.
pub(super) struct FeltJudge<'a> {
    settings: &'a Settings,
    world: &'a FeltWorld,
    cell: Cell,
    text: String,
    /// Of realizations or labels, in their order.
    names: Vec<String>,
}

impl<'a> FeltJudge<'a> {
    pub(super) fn new(settings: &'a Settings, world: &'a FeltWorld, cell: &Cell) -> Self {
        let named = match world {
            FeltWorld::Ranking { x, .. } | FeltWorld::Similarity { x, .. } => x.len(),
            FeltWorld::Adjustment { .. } => 0,
            FeltWorld::Identification { labels, .. } => *labels,
        };
        Self {
            settings,
            world,
            cell: *cell,
            text: cell.canonical(),
            names: (0..named).map(|i| format!("{i:06}")).collect(),
        }
    }

    /// Draws and decides study k.
    pub(super) fn decide(&self, k: u64) -> Outcome {
        let number = k.to_string();
        let stream = |of: &str| Stream::new(self.settings.seed, &[STREAM, &self.text, &number, of]);
        let mut drawn = stream("felt");
        let (draws, alpha) = (&mut drawn, self.settings.alpha);
        let seed = stream("analysis").next_u64();
        let found: Vec<PartFinding> = match self.world {
            FeltWorld::Ranking { x, ties, .. } => {
                decided::ranked(&self.rankings(x, *ties, draws), alpha, seed)
            }
            FeltWorld::Similarity { x, pairs, .. } => {
                let names = self.names.iter().cloned();
                let property: BTreeMap<String, f64> = names.zip(x.iter().copied()).collect();
                let rows = self.differences(x, pairs, draws);
                let found = decided::follows(&rows, &property, (alpha, seed));
                found.into_iter().collect()
            }
            FeltWorld::Adjustment {
                levels,
                standard,
                mean,
            } => decided::adjusted(
                &self.adjustments(levels, *mean, draws),
                *standard,
                (alpha, seed),
            ),
            FeltWorld::Identification { right, correct, .. } => {
                let rows = self.labels(right, *correct, draws);
                vec![decided::identified(&rows, &self.names, alpha)]
            }
        };
        let of = |test: &Test| {
            let mut found = found.iter();
            verdict(found.find(|f| f.question.id().starts_with(test.as_str())))
        };
        Outcome::of_tests(self.settings.tests.iter().map(of))
    }

    /// Calls `trials` for each participant, with the place and whether the participant is lost.
    fn participants(&self, draws: &mut Stream, mut trials: impl FnMut(usize, bool, &mut Stream)) {
        for i in 0..self.cell.participants {
            let lost = is_lost(self.settings, draws);
            trials(i, lost, draws);
        }
    }

    /// Whether a trial has no answer.
    fn is_missing(&self, draws: &mut Stream) -> bool {
        draws.unit() < self.settings.assumptions.missing
    }

    fn rankings(&self, x: &[f64], ties: bool, draws: &mut Stream) -> Vec<RankingRow> {
        let a = &self.settings.assumptions;
        let spread = a.spread;
        let worth = |x: &f64| a.slope * x + spread.realization * draws.normal();
        let worths: Vec<f64> = x.iter().map(worth).collect();
        let apart = if ties { TIED * spread.residual } else { 0.0 };
        let mut rows = Vec::new();
        self.participants(draws, |i, lost, draws| {
            let added = |worth: &f64| worth + spread.interaction * draws.normal();
            let own: Vec<f64> = worths.iter().map(added).collect();
            for trial in 0..self.cell.repetitions {
                let noise = |worth: &f64| worth + spread.residual * draws.normal();
                let felt: Vec<f64> = own.iter().map(noise).collect();
                if self.is_missing(draws) || lost {
                    continue;
                }
                let ranks = ranks(&felt, apart).into_iter().zip(&self.names);
                rows.extend(ranks.map(|(rank, name)| RankingRow {
                    participant: format!("{i:06}"),
                    ranking: trial.to_string(),
                    realization: name.clone(),
                    rank,
                }));
            }
        });
        rows
    }

    fn differences(
        &self,
        x: &[f64],
        pairs: &[[usize; 2]],
        draws: &mut Stream,
    ) -> Vec<SimilarityRow> {
        let a = &self.settings.assumptions;
        let spread = a.spread;
        let place = |x: &f64| [a.slope * x, spread.realization * draws.normal()];
        let places: Vec<[f64; 2]> = x.iter().map(place).collect();
        let mut rows = Vec::new();
        self.participants(draws, |i, lost, draws| {
            for (p, [first, second]) in pairs.iter().enumerate() {
                let along = |k: usize| places[*first][k] - places[*second][k];
                let distance = (along(0) * along(0) + along(1) * along(1)).sqrt();
                let own = distance + spread.interaction * draws.normal();
                for trial in 0..self.cell.repetitions {
                    let rating = own + spread.residual * draws.normal();
                    if self.is_missing(draws) || lost {
                        continue;
                    }
                    let turned = (i + p + trial) % 2 == 1;
                    let [one, other] = [first, second].map(|at| self.names[*at].clone());
                    let (one, other) = if turned { (other, one) } else { (one, other) };
                    rows.push(SimilarityRow {
                        participant: format!("{i:06}"),
                        first: one,
                        second: other,
                        rating: rating.round().clamp(0.0, 100.0),
                    });
                }
            }
        });
        rows
    }

    fn adjustments(&self, levels: &[f64], mean: f64, draws: &mut Stream) -> Vec<SettingRow> {
        let spread = self.settings.assumptions.spread;
        let mut rows = Vec::new();
        self.participants(draws, |i, lost, draws| {
            let own = mean + spread.subject * draws.normal();
            for setting in 0..2 * self.cell.repetitions {
                let level = nearest(levels, own + spread.residual * draws.normal());
                if self.is_missing(draws) || lost {
                    continue;
                }
                rows.push(SettingRow {
                    participant: format!("{i:06}"),
                    level,
                    ascending: setting % 2 == 0,
                    changes: None,
                });
            }
        });
        rows
    }

    fn labels(&self, right: &[usize], correct: f64, draws: &mut Stream) -> Vec<LabelRow> {
        let spread = self.settings.assumptions.spread;
        let mean = libm::log(correct / (1.0 - correct));
        let ease = |_: &String| mean + spread.realization * draws.normal();
        let eases: Vec<f64> = self.names.iter().map(ease).collect();
        let others = self.names.len().saturating_sub(1).max(1) as u64;
        let mut rows = Vec::new();
        self.participants(draws, |i, lost, draws| {
            let own = spread.subject * draws.normal();
            for right in right {
                let share = 1.0 / (1.0 + libm::exp(-(eases[*right] + own)));
                for _ in 0..self.cell.repetitions {
                    let (u, other) = (draws.unit(), draws.below(others) as usize);
                    if self.is_missing(draws) || lost {
                        continue;
                    }
                    rows.push(LabelRow {
                        participant: format!("{i:06}"),
                        realization: None,
                        right: *right,
                        given: match u < share {
                            true => *right,
                            false => other + usize::from(other >= *right),
                        },
                    });
                }
            }
        });
        rows
    }
}

/// The ranks of what was felt, the largest first; it has the rank of the one before if it is less than `apart` away.
fn ranks(felt: &[f64], apart: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..felt.len()).collect();
    order.small_sort_by(|a, b| felt[*b].total_cmp(&felt[*a]));
    let (mut ranks, mut rank) = (vec![0.0; felt.len()], 1.0);
    for (place, item) in order.iter().enumerate() {
        if place > 0 && felt[order[place - 1]] - felt[*item] >= apart {
            rank = place as f64 + 1.0;
        }
        ranks[*item] = rank;
    }
    ranks
}

/// The level that is nearest to a number.
fn nearest(levels: &[f64], to: f64) -> f64 {
    let away = |level: &f64| (level - to).abs();
    let found = levels.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
    found.copied().unwrap_or(to)
}

#[cfg(test)]
mod tests;
