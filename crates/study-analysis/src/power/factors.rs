//! The effects of a factorial study. A rating is the sum of a mean, the effects at the levels of its realization (and of
//! the participant's group), the level of the participant, the scatter of the realization, an interaction and a residual,
//! cut to the scale of the question. Complete studies are decided by the closed form of the analysis, others by the
//! analysis itself.

use super::decide::Outcome;
use super::draw::{Draws, rating, residual};
use super::{Cell, STREAM, Settings};
use crate::analyze::{Question, Rules, all_findings};
use std::collections::BTreeMap;
use study_base::rng::Stream;
use study_plan::protocol::{Crossing, Role};
use study_session::outcome::ratings::{Ratings, Realization, Row, Subject};
use study_session::outcome::rows::Status;
use study_stats::describe::mean;
use study_stats::factorial::{Term, analysis};
use study_stats::level::rejects;
use study_stats::paired::holm;
use study_stats::random::RandomSource as _;

/// A factorial study, and what is assumed of it.
#[derive(Debug, Clone, PartialEq)]
pub struct FactorsWorld {
    /// The factors, and the effects that are tested.
    pub crossing: Crossing,
    /// The size of each effect that is tested, in rating points: of a factor the mean at the last level less that at the
    /// first, with those between in even steps; of an interaction the change of this difference from the first to the last level of
    /// the other factor, and so on.
    pub sizes: Vec<f64>,
}

impl FactorsWorld {
    /// The names of the effects that are tested.
    pub fn names(&self) -> Vec<String> {
        let name = |effect: &Vec<usize>| self.crossing.effect_name(effect);
        self.crossing.effects.iter().map(name).collect()
    }

    /// What the effects add at some levels, the last of them the group if it is a factor.
    fn at(&self, levels: &[usize]) -> f64 {
        // From −½ at the first level to ½ at the last.
        let along = |place: &usize| {
            let last = self.crossing.levels(*place).len() - 1;
            levels[*place] as f64 / last as f64 - 0.5
        };
        let effects = self.crossing.effects.iter().zip(&self.sizes);
        effects
            .map(|(effect, size)| {
                // Of an interaction the difference of the differences between ends is the size.
                size * effect.iter().map(along).product::<f64>()
            })
            .sum()
    }
}

/// Decides simulated factorial studies.
pub(super) struct FactorsJudge<'a> {
    settings: &'a Settings,
    world: &'a FactorsWorld,
    cell: Cell,
    text: String,
    /// Places of the levels of each realization, in the order of their names.
    levels: Vec<&'a [usize]>,
    /// For each combination of levels its realizations.
    columns: Vec<Vec<usize>>,
}

/// The ratings of a participant.
struct Person {
    /// The place of the group.
    group: usize,
    /// By realization, then repetition; `None` if it is missing.
    ratings: Vec<Option<f64>>,
}

impl<'a> FactorsJudge<'a> {
    pub(super) fn new(settings: &'a Settings, world: &'a FactorsWorld, cell: &Cell) -> Self {
        let levels: Vec<&[usize]> = (world.crossing.levels_of.values())
            .map(Vec::as_slice)
            .collect();
        let mut columns = vec![Vec::new(); world.crossing.sizes().iter().product()];
        for (j, levels) in levels.iter().enumerate() {
            columns[world.crossing.place(levels)].push(j);
        }
        Self {
            settings,
            world,
            cell: *cell,
            text: cell.canonical(),
            levels,
            columns,
        }
    }

    /// Draws and decides study k: whether each effect is shown.
    pub(super) fn decide(&self, k: u64) -> Outcome {
        let path = [STREAM, &self.text, &k.to_string(), "factors"];
        let people = self.draw(&mut Draws(Stream::new(self.settings.seed, &path)));
        let is_complete = people.iter().all(|p| p.ratings.iter().all(Option::is_some));
        let shown = match is_complete {
            true => self.complete(&people),
            false => self.analyzed(&people),
        };
        Outcome::of_tests(shown.into_iter())
    }

    fn draw(&self, draws: &mut Draws) -> Vec<Person> {
        let a = &self.settings.assumptions;
        let groups = self.world.crossing.groups.len().max(1);
        let means: Vec<f64> = (self.levels.iter())
            .map(|_| a.mean + a.spread.realization * draws.normal())
            .collect();
        let mut people = Vec::with_capacity(self.cell.participants);
        for i in 0..self.cell.participants {
            let group = i % groups;
            let level = a.spread.subject * draws.normal();
            let mut ratings = Vec::with_capacity(means.len() * self.cell.repetitions);
            for (mean, levels) in means.iter().zip(&self.levels) {
                let effects = self.world.at(&[levels, &[group][..]].concat());
                let here = mean + effects + level + a.spread.interaction * draws.normal();
                for _ in 0..self.cell.repetitions {
                    let rating = rating(here + residual(a, draws), &a.scale);
                    let missing = a.missing > 0.0 && draws.0.unit() < a.missing;
                    ratings.push(Some(rating).filter(|_| !missing));
                }
            }
            let lost = a.dropout > 0.0 && draws.0.unit() < a.dropout;
            if !lost {
                people.push(Person { group, ratings });
            }
        }
        people
    }

    /// A study in which everybody rated everything.
    fn complete(&self, people: &[Person]) -> Vec<Option<bool>> {
        let crossing = &self.world.crossing;
        let none = || vec![None; crossing.effects.len()];
        let row = |person: &Person| {
            let cells: Vec<f64> = (person.ratings.chunks_exact(self.cell.repetitions))
                .filter_map(|own| mean(&own.iter().copied().flatten().collect::<Vec<_>>()))
                .collect();
            let of =
                |own: &Vec<usize>| own.iter().map(|j| cells[*j]).sum::<f64>() / own.len() as f64;
            self.columns.iter().map(of).collect::<Vec<f64>>()
        };
        let rows: Vec<Vec<f64>> = people.iter().map(row).collect();
        let mut groups: Vec<usize> = Vec::new();
        if !crossing.groups.is_empty() {
            let mut present: Vec<usize> = people.iter().map(|p| p.group).collect();
            present.sort_unstable();
            present.dedup();
            if present.len() < 2 {
                return none();
            }
            let place = |p: &Person| present.binary_search(&p.group).unwrap_or(0);
            groups = people.iter().map(place).collect();
        }
        let Ok(found) = analysis(&rows, &crossing.sizes(), &groups) else {
            return none();
        };
        let p: Vec<Option<f64>> = (crossing.effects.iter())
            .map(|effect| {
                let (group, factors): (Vec<usize>, Vec<usize>) =
                    (effect.iter().copied()).partition(|place| *place == crossing.factors.len());
                let term = Term {
                    factors,
                    group: !group.is_empty(),
                };
                found.effect(&term)?.p_corrected()
            })
            .collect();
        let alpha = self.settings.alpha;
        let shown = |p: Option<f64>| p.map(|p| rejects(p, alpha));
        holm(&p).into_iter().map(shown).collect()
    }

    /// What the analysis says of a study.
    fn analyzed(&self, people: &[Person]) -> Vec<Option<bool>> {
        let crossing = &self.world.crossing;
        let rules = Rules {
            alpha: self.settings.alpha,
            crossing: Some(crossing.clone()),
            ..Rules::default()
        };
        let (findings, _) = all_findings(&self.ratings(people), &rules);
        let shown = |effect: &Vec<usize>| {
            let question = Question::Effect(crossing.effect_name(effect));
            let finding = findings.iter().find(|f| f.question == question)?;
            finding.reason().is_none().then(|| finding.is_yes())
        };
        crossing.effects.iter().map(shown).collect()
    }

    /// The study as the analysis reads one.
    fn ratings(&self, people: &[Person]) -> Ratings {
        let crossing = &self.world.crossing;
        let mut made = Ratings {
            question: "rating".to_owned(),
            ..Ratings::default()
        };
        made.subjects = (people.iter().enumerate())
            .map(|(i, person)| Subject {
                id: format!("{i:06}"),
                state: None,
                reason: String::new(),
                site: None,
                group: crossing.groups.get(person.group).cloned(),
            })
            .collect();
        made.models = (crossing.levels_of.keys())
            .map(|name| Realization {
                id: name.clone(),
                role: Role::Test,
                duplicate_of: None,
                covariates: BTreeMap::new(),
            })
            .collect();
        let mut source_row = 0;
        for (i, person) in people.iter().enumerate() {
            for (at, rating) in person.ratings.iter().enumerate() {
                source_row += 1;
                made.push(Row {
                    subject: i as u32,
                    model: Some((at / self.cell.repetitions) as u32),
                    repetition: (at % self.cell.repetitions) as u32 + 1,
                    rating: *rating,
                    status: match rating {
                        Some(_) => Status::Ok,
                        None => Status::Missing,
                    },
                    source_row,
                    ..Row::default()
                });
            }
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::super::parts::PartWorld;
    use super::super::{Assumptions, Chunk, Scale, Test, Vaf, merge, run_chunk};
    use super::*;
    use crate::study::factor;
    use study_stats::power::covariate::Spread;

    fn world(factors: &[&str], groups: &[&str], effects: &[(&[usize], f64)]) -> FactorsWorld {
        let factors: Vec<_> = factors.iter().map(|f| factor(f).unwrap()).collect();
        let mut combinations: Vec<Vec<usize>> = vec![Vec::new()];
        for factor in &factors {
            combinations = (combinations.iter())
                .flat_map(|start| (0..factor.levels.len()).map(|l| [&start[..], &[l]].concat()))
                .collect();
        }
        let name = |levels: Vec<usize>| (format!("{levels:?}"), levels);
        FactorsWorld {
            crossing: Crossing {
                levels_of: combinations.into_iter().map(name).collect(),
                groups: groups.iter().map(|g| (*g).to_owned()).collect(),
                effects: effects.iter().map(|(effect, _)| effect.to_vec()).collect(),
                factors,
            },
            sizes: effects.iter().map(|(_, size)| *size).collect(),
        }
    }

    fn settings(world: FactorsWorld, scale: Scale) -> Settings {
        Settings {
            assumptions: Assumptions {
                slope: 0.0,
                smallest: None,
                mean: 4.0,
                spread: Spread {
                    subject: 0.6,
                    realization: 0.0,
                    interaction: 0.4,
                    residual: 0.8,
                    slope: 0.0,
                },
                scale,
                vaf: Vaf::Listed,
                dropout: 0.0,
                missing: 0.0,
                reference: 0.0,
            },
            tests: vec![Test::Effect; world.sizes.len()],
            part: Some(PartWorld::Factors(world)),
            pilot: None,
            listed: Vec::new(),
            alpha: 0.05,
            margin: None,
            seed: 2007,
            studies: 4000,
        }
    }

    fn cell(settings: &Settings, participants: usize, repetitions: usize) -> Cell {
        let Some(PartWorld::Factors(world)) = &settings.part else {
            panic!("factors");
        };
        Cell {
            realizations: world.crossing.levels_of.len(),
            repetitions,
            participants,
        }
    }

    /// The closed form of complete studies is the analysis, with groups and without, whoever is lost.
    #[test]
    fn complete_studies_are_decided_as_by_the_analysis() {
        let all: [(&[usize], f64); 3] = [(&[0], 0.7), (&[1], 0.4), (&[0, 1], 0.9)];
        let (mut yes, mut no) = (0, 0);
        for (factors, groups) in [
            (&["a=x,y", "b=p,q,r"][..], &[][..]),
            (&["a=x,y,z"][..], &["g1", "g2"][..]),
        ] {
            let mut settings = settings(world(factors, groups, &all), Scale::Rounded(1, 7));
            settings.assumptions.dropout = 0.1;
            let cell = cell(&settings, 14, 2);
            let Some(PartWorld::Factors(world)) = &settings.part else {
                panic!("factors");
            };
            let judge = FactorsJudge::new(&settings, world, &cell);
            for k in 0..40 {
                let people = judge.draw(&mut Draws(Stream::new(k, &["test"])));
                let closed = judge.complete(&people);
                assert_eq!(closed, judge.analyzed(&people), "{k}");
                yes += closed.iter().filter(|x| **x == Some(true)).count();
                no += closed.iter().filter(|x| **x == Some(false)).count();
            }
        }
        assert!(yes > 20 && no > 20, "{yes} {no}");
    }

    /// Power of t tests by SciPy 1.15 (`nct`): of a factor and of an interaction within 20 participants with single ratings,
    /// whose cells have the variance .16 + .64; of groups of ten, whose means have .36 + .8/2; and of their interaction with a factor of two
    /// levels, whose differences have 1.6.
    #[test]
    fn power_of_single_effects_is_that_of_t_tests() {
        let two = &["a=x,y", "b=p,q"][..];
        let between = &["g1", "g2"][..];
        let cases = [
            (two, &[][..], &[1][..], 0.5, 0.659_949_876_782),
            (two, &[], &[0, 1], 0.5, 0.220_713_229_870),
            (&["a=x,y"][..], between, &[1], 1.0, 0.679_557_511_960),
            (&["a=x,y"], between, &[0, 1], 1.0, 0.387_426_977_124),
        ];
        for (factors, groups, effect, size, expected) in cases {
            let world = world(factors, groups, &[(effect, size)]);
            let settings = settings(world, Scale::Continuous);
            let cell = cell(&settings, 20, 1);
            let chunks: Vec<Chunk> = (0..settings.chunks())
                .map(|i| run_chunk(&settings, &cell, i))
                .collect();
            let found = merge(&settings, cell, &chunks).unwrap().tests[0].power;
            let allowed = 4.0 * (expected * (1.0 - expected) / 4000.0f64).sqrt();
            assert!(
                (found - expected).abs() < allowed,
                "{effect:?} {found} {expected}"
            );
        }
    }

    /// With missing ratings the analysis decides, and more than one in ten incomplete participants are enough for another test.
    #[test]
    fn studies_with_missing_ratings_are_decided() {
        let all: [(&[usize], f64); 3] = [(&[0], 1.2), (&[1], 0.0), (&[0, 1], 0.0)];
        let mut settings = settings(world(&["a=x,y", "b=p,q"], &[], &all), Scale::Rounded(1, 7));
        settings.assumptions.missing = 0.2;
        settings.studies = 60;
        let cell = cell(&settings, 16, 1);
        let found = merge(&settings, cell, &[run_chunk(&settings, &cell, 0)]).unwrap();
        let power: Vec<f64> = found.tests.iter().map(|t| t.power).collect();
        assert!(
            power[0] > 0.5 && power[1] < 0.2 && power[2] < 0.2,
            "{power:?}"
        );
        assert!(found.tests.iter().all(|t| t.undefined.is_empty()));
    }
}
