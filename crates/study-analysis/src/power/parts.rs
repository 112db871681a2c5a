//! Parts of pairs, of tracks (`tracks`), of factors (`factors`) and of what is ranked, compared, set or labeled (`felt`): answers are
//! drawn one by one, and decided by the analysis of such parts.
//!
//! **Pairs.** The ability of a realization is slope·x + scatter + what a participant adds, in
//! logits; P(first preferred) follows from the difference (Bradley and Terry), with ties by
//! Davidson's model.

use super::decide::{Outcome, is_lost, verdict};
use super::draw::standardized;
use super::factors::{FactorsJudge, FactorsWorld};
use super::felt::{FeltJudge, FeltWorld};
use super::tracks::{TracksJudge, TracksWorld};
use super::{Cell, STREAM, Settings, Test};
use crate::analyze::psychophysics::{Choice, Preference, decided};
use study_base::rng::Stream;
use study_stats::permutation::Decision;

/// A part that is no rating, or ratings of a factorial study, and what is assumed of it.
#[derive(Debug, Clone, PartialEq)]
pub enum PartWorld {
    /// Ratings, for the effects of factors.
    Factors(FactorsWorld),
    /// Comparisons of realizations.
    Pairs(PairsWorld),
    /// Tracks of levels, or of two realizations.
    Tracks(TracksWorld),
    /// Ranking, similarity, adjustment or identification.
    Felt(FeltWorld),
}

/// Comparisons of realizations.
#[derive(Debug, Clone, PartialEq)]
pub struct PairsWorld {
    /// VAF of each realization, where it has one.
    pub vaf: Vec<Option<f64>>,
    /// The pairs, by place.
    pub pairs: Vec<[usize; 2]>,
    /// Share of "no difference" between two that are alike; `None` if it is no answer.
    pub ties: Option<f64>,
    /// Whether the first of a pair is drawn for each trial, not each in turn.
    pub random_order: bool,
}

/// Decides simulated studies of a part.
pub(super) struct PartJudge<'a> {
    settings: &'a Settings,
    cell: Cell,
    text: String,
    task: Prepared<'a>,
}

/// What all studies of a cell share.
enum Prepared<'a> {
    Factors(FactorsJudge<'a>),
    Pairs {
        world: &'a PairsWorld,
        /// Standardized VAF, 0 where there is none.
        x: Vec<f64>,
        /// The permutation test over the realizations with a VAF.
        permutation: Option<Decision>,
        names: Vec<String>,
    },
    Tracks(TracksJudge<'a>),
    Felt(FeltJudge<'a>),
}

impl<'a> PartJudge<'a> {
    pub(super) fn new(settings: &'a Settings, part: &'a PartWorld, cell: &Cell) -> Self {
        let task = match part {
            PartWorld::Factors(world) => {
                Prepared::Factors(FactorsJudge::new(settings, world, cell))
            }
            PartWorld::Pairs(world) => {
                let known: Vec<f64> = world.vaf.iter().copied().flatten().collect();
                let mut standard = standardized(&known).0.into_iter();
                let x = world.vaf.iter().map(|vaf| match vaf {
                    Some(_) => standard.next().unwrap_or(0.0),
                    None => 0.0,
                });
                Prepared::Pairs {
                    world,
                    x: x.collect(),
                    permutation: Decision::new(&known, settings.alpha),
                    names: (0..world.vaf.len()).map(|i| format!("{i:06}")).collect(),
                }
            }
            PartWorld::Tracks(world) => Prepared::Tracks(TracksJudge::new(settings, world, cell)),
            PartWorld::Felt(world) => Prepared::Felt(FeltJudge::new(settings, world, cell)),
        };
        Self {
            settings,
            cell: *cell,
            text: cell.canonical(),
            task,
        }
    }

    /// Draws and decides study k.
    pub(super) fn decide(&self, k: u64) -> Outcome {
        let number = k.to_string();
        let stream = |of: &str| Stream::new(self.settings.seed, &[STREAM, &self.text, &number, of]);
        match &self.task {
            Prepared::Factors(judge) => judge.decide(k),
            Prepared::Pairs {
                world,
                x,
                permutation,
                names,
            } => {
                let chosen = self.choices(world, x, names, &mut stream("pairs"));
                self.of_choices(world, &chosen, permutation.as_ref(), stream("permutations"))
            }
            Prepared::Tracks(judge) => judge.decide(k),
            Prepared::Felt(judge) => judge.decide(k),
        }
    }

    fn choices(
        &self,
        world: &PairsWorld,
        x: &[f64],
        names: &[String],
        draws: &mut Stream,
    ) -> Vec<Preference> {
        let a = &self.settings.assumptions;
        let mut chosen = Vec::new();
        let mean = |x: &f64| a.slope * x;
        let means: Vec<f64> = (x.iter())
            .map(|x| mean(x) + a.spread.realization * draws.normal())
            .collect();
        // ν of Davidson's model: two that are alike are tied with ν/(2 + ν).
        let nu = world.ties.map_or(0.0, |share| 2.0 * share / (1.0 - share));
        for i in 0..self.cell.participants {
            let own: Vec<f64> = (means.iter())
                .map(|m| m + a.spread.interaction * draws.normal())
                .collect();
            let lost = is_lost(self.settings, draws);
            for (p, pair) in world.pairs.iter().enumerate() {
                for r in 0..self.cell.repetitions {
                    let turned = match world.random_order {
                        true => draws.unit() < 0.5,
                        false => (i + p + r) % 2 == 1,
                    };
                    let [first, second] = if turned { [pair[1], pair[0]] } else { *pair };
                    let (u, missing) = (draws.unit(), draws.unit() < a.missing);
                    if lost || missing {
                        continue;
                    }
                    let (up, down) = (libm::exp(own[first] / 2.0), libm::exp(own[second] / 2.0));
                    let [wins, ties, losses] = [up / down, nu, down / up];
                    let all = wins + ties + losses;
                    chosen.push(Preference {
                        participant: format!("{i:06}"),
                        first: names[first].clone(),
                        second: names[second].clone(),
                        choice: match u * all {
                            u if u < wins => Choice::First(1.0),
                            u if u < wins + ties => Choice::Tie(1.0),
                            _ => Choice::Second(1.0),
                        },
                    });
                }
            }
        }
        chosen
    }

    fn of_choices(
        &self,
        world: &PairsWorld,
        chosen: &[Preference],
        permutation: Option<&Decision>,
        permutations: Stream,
    ) -> Outcome {
        let found = decided::compared(chosen, world.ties.is_some(), self.settings.alpha);
        let mut permutations = super::draw::Draws(permutations);
        let mut of_vaf = || {
            let abilities = found.abilities.iter().zip(&world.vaf);
            let known: Vec<f64> = (abilities.filter(|(_, vaf)| vaf.is_some()))
                .map(|(ability, _)| *ability)
                .collect();
            let whole = found.abilities.len() == world.vaf.len();
            permutation
                .filter(|_| whole)?
                .rejects(&known, &mut permutations)
        };
        let one = |test: &Test| match test {
            Test::Preferred => verdict(found.preferred.as_ref()),
            Test::PreferenceVaf => of_vaf(),
            _ => None,
        };
        Outcome::of_tests(self.settings.tests.iter().map(one))
    }
}

#[cfg(test)]
mod tests;
