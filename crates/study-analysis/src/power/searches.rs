//! How many answers a search needs until what it recommends is less than a just noticeable difference worse than the best point:
//! perceivers are simulated on the lattice of the protocol, and search by its own rule.

use super::part_plan::meant;
use super::perceivers::{Likes, Perceiver};
use super::{Overrides, PlanError, Progress};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;
use study_base::rng::Stream;
use study_base::text::PartId;
use study_plan::procedure::search::MAX_TRIALS;
use study_plan::procedure::{Lattice, Search, SearchRule};
use study_plan::protocol::Protocol;
use study_plan::protocol::parts::{Part, Task};
use study_plan::protocol::power::PowerPlan;
use study_stats::describe::{mean, sd};
use study_stats::distribution::normal_quantile;
use study_stats::proportion::clopper_pearson;

/// Perceivers of each kind, where nobody says otherwise.
const PERCEIVERS: u64 = 200;
/// The best utility, where nobody says otherwise, in units of the noise of one impression.
const BEST: f64 = 4.0;
/// Share of the perceivers whose regret has to be below the just noticeable difference.
const TARGET: f64 = 0.8;
/// Steps of the numbers of answers that are compared.
const EVERY: u32 = 10;

/// A difference of utilities that is just noticed: the better of two is preferred in three quarters of the comparisons.
pub fn utility_jnd() -> f64 {
    SQRT_2 * normal_quantile(0.75).unwrap_or_default()
}

/// What is asked of a search besides [`Overrides`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SearchAsked {
    /// The just noticeable difference, in units of the noise of one impression; [`utility_jnd`] if nobody says otherwise.
    pub jnd: Option<f64>,
    /// The utility of the best point, where the worst has about 0.
    pub best: Option<f64>,
    /// Numbers of answers; without any, tens up to the number of trials.
    pub after: Vec<u32>,
}

/// What is simulated of a part that searches.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchPlan {
    /// The part.
    pub part: PartId,
    /// The space.
    pub space: PartId,
    /// Its points.
    pub lattice: Lattice,
    /// How the search chooses, up to the last of the numbers of answers.
    pub rule: SearchRule,
    /// Numbers of answers, rising.
    pub after: Vec<u32>,
    /// Perceivers of each kind.
    pub perceivers: u64,
    /// About the utility of the best point.
    pub best: f64,
    /// The just noticeable difference.
    pub jnd: f64,
    /// Share of the perceivers whose regret has to be below it.
    pub target: f64,
    /// Seed of all numbers.
    pub seed: u64,
}

/// What the perceivers of a kind have found after so many answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Regret {
    /// Answers.
    pub answers: u32,
    /// Mean regret: the utility of the best point minus that of the one that is recommended.
    pub mean: f64,
    /// Its Monte Carlo error.
    pub mcse: f64,
    /// Perceivers whose regret is below the just noticeable difference.
    pub below: u64,
    /// The same as a share.
    pub share: f64,
    /// Exact 95 % interval of the share (Clopper and Pearson).
    pub interval: (f64, f64),
}

/// The perceivers of a kind.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// What they like.
    pub likes: Likes,
    /// By numbers of answers.
    pub regrets: Vec<Regret>,
}

impl SearchResult {
    /// The first number of answers with which so large a share of the perceivers is below the just noticeable difference, and stays
    /// there with more.
    pub fn enough(&self, target: f64) -> Option<u32> {
        let short = self.regrets.iter().rposition(|r| r.share < target);
        let first = short.map_or(0, |at| at + 1);
        self.regrets.get(first).map(|r| r.answers)
    }
}

impl SearchPlan {
    /// The part that is meant, if it searches: the one of the flag, or the one with the primary question.
    pub fn meant<'p>(protocol: &'p Protocol, flag: Option<&PartId>) -> Option<&'p Part> {
        let part = meant(protocol, flag).ok().flatten();
        part.filter(|part| matches!(part.task, Task::Search(_)))
    }

    /// The plan of a part that searches.
    ///
    /// # Errors
    /// [`PlanError`] if the part is no search, or something is stated that does not apply to searches.
    pub fn of(
        protocol: &Protocol,
        part: &Part,
        flags: &Overrides,
        asked: &SearchAsked,
    ) -> Result<Self, PlanError> {
        let Some((space, rule)) = protocol.searched(part) else {
            return Err(PlanError::NoPower(part.id.clone()));
        };
        // Nothing else than the number of perceivers and the target means something here.
        let other = PowerPlan {
            studies: None,
            targets: Vec::new(),
            ..flags.plan.clone()
        };
        if other != PowerPlan::default() || flags.pilot.is_some() {
            return Err(PlanError::NotOfSearches(part.id.clone()));
        }
        let stated = flags.plan.clone().or(&protocol.power);
        let mut after = asked.after.clone();
        if after.is_empty() {
            after.extend((1..=rule.trials / EVERY).map(|tens| tens * EVERY));
            after.push(rule.trials);
        }
        after.sort_unstable();
        after.dedup();
        let most = after.last().copied().unwrap_or(rule.trials);
        if most > MAX_TRIALS {
            return Err(PlanError::TooManyAnswers(most));
        }
        Ok(Self {
            part: part.id.clone(),
            space: space.id.clone(),
            lattice: space.lattice.clone(),
            rule: SearchRule {
                trials: most.max(rule.planned()),
                ..rule
            },
            after,
            perceivers: stated.studies.unwrap_or(PERCEIVERS),
            best: asked.best.unwrap_or(BEST),
            jnd: asked.jnd.unwrap_or_else(utility_jnd),
            target: stated.targets.first().copied().unwrap_or(TARGET),
            seed: flags.seed.unwrap_or(protocol.study.seed),
        })
    }

    /// Simulated searches.
    pub fn searches(&self) -> usize {
        Likes::ALL.len() * self.perceivers as usize
    }

    /// Simulates all perceivers on the threads of the current pool, which decide no number. `progress` is called after each.
    pub fn simulate(&self, progress: Progress<'_>) -> Vec<SearchResult> {
        let all: Vec<(Likes, u64)> = (Likes::ALL.iter())
            .flat_map(|likes| (0..self.perceivers).map(|number| (*likes, number)))
            .collect();
        let found: Vec<Vec<f64>> = (all.par_iter().with_max_len(1))
            .map(|(likes, number)| {
                let regrets = self.regrets(*likes, *number);
                progress();
                regrets
            })
            .collect();
        let of_kind = found.chunks(self.perceivers.max(1) as usize);
        (Likes::ALL.into_iter().zip(of_kind))
            .map(|(likes, own)| SearchResult {
                likes,
                regrets: (self.after.iter().enumerate())
                    .map(|(at, answers)| self.regret(*answers, own, at))
                    .collect(),
            })
            .collect()
    }

    /// The regret of a perceiver after each number of answers.
    fn regrets(&self, likes: Likes, number: u64) -> Vec<f64> {
        let stream = |of: &str| {
            let number = number.to_string();
            Stream::new(self.seed, &[STREAM, likes.as_str(), &number, of])
        };
        let dimensions = self.lattice.steps().len();
        let who = (number, self.best);
        let person = Perceiver::drawn(likes, dimensions, who, &mut stream("person"));
        let mut noise = stream("noise");
        let Ok(mut search) = Search::new(&self.rule, &self.lattice, &mut stream("pairs")) else {
            return Vec::new();
        };
        (self.after.iter())
            .filter_map(|after| {
                while search.answered() < *after as usize {
                    let pair = search.next()?;
                    search.answer(&person.answer(&self.lattice, pair, &mut noise));
                }
                Some(person.regret(&self.lattice, search.best_point()?))
            })
            .collect()
    }

    /// What all perceivers of a kind have found.
    fn regret(&self, answers: u32, found: &[Vec<f64>], at: usize) -> Regret {
        let own: Vec<f64> = (found.iter())
            .filter_map(|regrets| regrets.get(at).copied())
            .collect();
        let n = own.len() as u64;
        let below = own.iter().filter(|regret| **regret < self.jnd).count() as u64;
        Regret {
            answers,
            mean: mean(&own).unwrap_or_default(),
            mcse: sd(&own).unwrap_or_default() / (n.max(1) as f64).sqrt(),
            below,
            share: below as f64 / n.max(1) as f64,
            interval: clopper_pearson(below, n, 0.95).unwrap_or((0.0, 1.0)),
        }
    }
}

/// Version of the numbers.
const STREAM: &str = "power-search/1";

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::file;

    const SEARCH: &str = r#"
format = "study-protocol/3"
study = { id = "s", title = "t", seed = 1 }
design = { participants = 4 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "best" }
models = [{ id = "a", file = "a.toml" }, { id = "b", file = "b.toml" }]

[[spaces]]
id = "switch"
from = "a.toml"
axes = { friction = [0.0, 1.5], detent = [0.5, 1.5] }
grid = 5

[[parts]]
id = "best"
kind = "search"
prompt = "Which?"
space = "switch"
rule = { name = "preference-gp", trials = 24, start = 6 }

[[parts]]
id = "pairs"
kind = "pairs"
prompt = "Which?"
pairs = [["a", "b"]]
repetitions = 2
"#;

    fn protocol() -> Protocol {
        let parsed = file::parse("p", SEARCH);
        let shown = parsed.findings.render(false);
        parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
    }

    fn plan(flags: &Overrides, asked: &SearchAsked) -> Result<SearchPlan, PlanError> {
        let protocol = protocol();
        let part = SearchPlan::meant(&protocol, None).unwrap();
        SearchPlan::of(&protocol, part, flags, asked)
    }

    /// √2 · 0.6744897501960817, the upper quartile of the standard normal distribution.
    #[test]
    fn a_jnd_of_utility_is_that_of_three_quarters() {
        assert!((utility_jnd() - 0.953_872_552_408_94).abs() < 1e-9);
    }

    #[test]
    fn regret_falls_and_does_not_depend_on_threads_or_other_numbers() {
        let mut flags = Overrides::default();
        flags.plan.studies = Some(40);
        let own = plan(&flags, &SearchAsked::default()).unwrap();
        assert_eq!(own.after, [10, 20, 24]);
        assert_eq!((own.perceivers, own.target, own.searches()), (40, 0.8, 120));
        let all = own.simulate(&|| ());
        for result in &all {
            let [first, .., last] = &result.regrets[..] else {
                panic!("{result:?}");
            };
            assert!(last.mean < first.mean, "{result:?}");
            assert!(last.mcse > 0.0 && last.share >= first.share);
            assert!(last.interval.0 < last.share && last.share <= last.interval.1);
        }
        // The same perceivers have the same regrets when other numbers of answers are asked for.
        let asked = SearchAsked {
            after: vec![20],
            ..SearchAsked::default()
        };
        let alone = plan(&flags, &asked).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let alone = pool.unwrap().install(|| alone.simulate(&|| ()));
        for (one, other) in alone.iter().zip(&all) {
            assert_eq!(one.regrets[0], other.regrets[1]);
        }
        // A very coarse difference is reached by everybody at once, and one of nearly 0 not by all.
        let within = |jnd: f64| {
            let asked = SearchAsked {
                jnd: Some(jnd),
                ..SearchAsked::default()
            };
            let found = plan(&flags, &asked).unwrap().simulate(&|| ());
            found[0].enough(1.0)
        };
        assert_eq!((within(100.0), within(1e-300)), (Some(10), None));
    }

    #[test]
    fn enough_is_what_stays_enough() {
        let regret = |answers: u32, share: f64| Regret {
            answers,
            mean: 0.0,
            mcse: 0.0,
            below: 0,
            share,
            interval: (0.0, 1.0),
        };
        let result = SearchResult {
            likes: Likes::Peaked,
            regrets: vec![
                regret(10, 0.81),
                regret(20, 0.79),
                regret(30, 0.8),
                regret(40, 0.9),
            ],
        };
        assert_eq!(result.enough(0.8), Some(30));
        assert_eq!(result.enough(0.7), Some(10));
        assert_eq!(result.enough(0.95), None);
    }

    #[test]
    fn what_does_not_apply_to_searches_is_refused() {
        let protocol = protocol();
        let none = crate::power::Plan::of(&protocol, &Overrides::default()).unwrap_err();
        assert_eq!(
            none,
            PlanError::NoTest(PartId::new("best").unwrap()),
            "{none}"
        );
        let pairs = PartId::new("pairs").unwrap();
        assert_eq!(SearchPlan::meant(&protocol, Some(&pairs)), None);
        let mut flags = Overrides::default();
        flags.plan.slope = Some(1.0);
        let refused = plan(&flags, &SearchAsked::default()).unwrap_err();
        assert!(matches!(refused, PlanError::NotOfSearches(_)), "{refused}");
        let asked = SearchAsked {
            after: vec![20, 501],
            ..SearchAsked::default()
        };
        let refused = plan(&Overrides::default(), &asked).unwrap_err();
        assert_eq!(refused, PlanError::TooManyAnswers(501));
        assert_eq!(
            refused.to_string(),
            "a search has at most 500 trials, not 501"
        );
    }
}
