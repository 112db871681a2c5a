//! Perceptual VAF: which components of the error of realizations decide which of two is preferred. Weights count as found only
//! if they predict choices that were left out better than equal weights, which are plain VAF.

use super::counting::{Counting, PartRows};
use super::part_data::{Intervals, StudyData};
use super::preferences::Choice;
use super::search::explorations;
use super::study::preference;
use crate::analyze::Rules;
use crate::analyze::draws::Draws;
use crate::analyze::select::Include;
use std::collections::{BTreeMap, BTreeSet};
use study_base::text::PartId;
use study_plan::protocol::{Part, Task};
use study_session::outcome::RatingRow;
use study_stats::choice_weights::{Chosen, LeftOut, NoWeights, Weighed, spread, weigh};
use study_stats::random::RandomSource;

/// A component varies if the root mean square of its differences is at least this part of the largest one.
const VARIES: f64 = 0.1;
/// Components whose differences have at least this cosine have one weight: nothing tells them apart.
const TOGETHER: f64 = 0.99;
/// A group of components of whose differences less than this is its own is hardly told from the others.
const OWN: f64 = 0.05;
/// With less of its own its weight would be what the penalty makes of it: nothing is told of any weight.
const UNTOLD: f64 = 0.001;

/// The errors of realizations against a reference, in components.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// The names of the components.
    pub components: Vec<&'static str>,
    /// By realization, one number for each component.
    pub of: BTreeMap<String, Vec<f64>>,
}

/// What the choices of a part tell of what is weighed.
#[derive(Debug, Clone)]
pub struct Weighing {
    /// The part.
    pub part: PartId,
    /// Whether pilots are among the participants.
    pub pilot: bool,
    /// Whether simulated participants are among them.
    pub simulated: bool,
    /// Trials without a preference, which do not count.
    pub undecided: usize,
    /// Choices that do not count because a realization has no table.
    pub without_table: usize,
    /// The weights.
    pub found: Result<Perceived, Unknown>,
}

/// Weights of components.
#[derive(Debug, Clone, PartialEq)]
pub struct Perceived {
    /// The components with a weight. Those of a group vary together, and have the same weight.
    pub groups: Vec<Vec<&'static str>>,
    /// Components in which the compared realizations hardly differ.
    pub unvaried: Vec<&'static str>,
    /// Groups that are hardly told from the others, by index.
    pub mixed: Vec<usize>,
    /// The weights of the groups.
    pub weighed: Weighed,
    /// What follows.
    pub verdict: Verdict,
}

impl Perceived {
    /// The weight of a component; `None` if the realizations hardly differ in it.
    pub fn weight(&self, component: &str) -> Option<f64> {
        let mut groups = self.groups.iter();
        let group = groups.position(|group| group.contains(&component))?;
        self.weighed.weights.get(group).copied()
    }
}

/// What weights are good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// They predict what was left out better than equal weights, and than guessing.
    Unequal,
    /// They do not, but the sum of the errors is known to be weighed.
    Equal,
    /// Nothing is known to be weighed.
    Nothing,
}

/// Why there are no weights.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unknown {
    /// The choices do not tell.
    #[error(transparent)]
    Choices(#[from] NoWeights),
    /// There is nothing that could be weighed against something else.
    #[error("the compared realizations differ in one respect only: {}", joined(.0))]
    OneGroup(Vec<&'static str>),
    /// Groups whose differences follow from those of the others.
    #[error(
        "what the compared realizations differ in changes together ({}), so that no weight can be told: compare more of them, some of which differ in one of these alone",
        listed(.0)
    )]
    NotTold(Vec<Vec<&'static str>>),
}

fn joined(names: &[&str]) -> String {
    names.join(" with ")
}

fn listed(groups: &[Vec<&str>]) -> String {
    let names: Vec<String> = groups.iter().map(|group| joined(group)).collect();
    names.join(", ")
}

/// The choices of each part in which realizations are compared: pairs and searches. Which participants and trials count is
/// decided as for all parts.
pub fn weighings(study: &StudyData<'_>, include: Include, errors: &Errors) -> Vec<Weighing> {
    let of_part = |part: &Part| {
        let choices = match &part.task {
            Task::Pairs(_) => of_pairs(study, part, include),
            Task::Search(_) => of_search(study, part, include),
            _ => return None,
        };
        let people: BTreeSet<&str> = (choices.made.iter())
            .map(|choice| choice.participant.as_str())
            .collect();
        let people: Vec<&str> = people.into_iter().collect();
        let names: Vec<&String> = errors.of.keys().collect();
        let place = |name: &String| names.binary_search(&name).ok();
        let chosen: Vec<Chosen> = (choices.made.iter())
            .filter_map(|choice| {
                Some(Chosen {
                    preferred: place(&choice.preferred)?,
                    other: place(&choice.other)?,
                    participant: people.binary_search(&choice.participant.as_str()).ok()?,
                })
            })
            .collect();
        let table: Vec<Vec<f64>> = errors.of.values().cloned().collect();
        let mut draws = Draws::new(study.protocol.study.seed, &format!("weights/{}", part.id));
        Some(Weighing {
            part: part.id.clone(),
            pilot: choices.pilot,
            simulated: choices.simulated,
            undecided: choices.undecided,
            without_table: choices.made.len() - chosen.len(),
            found: perceived(&errors.components, &table, &chosen, &mut draws),
        })
    };
    study.protocol.parts.iter().filter_map(of_part).collect()
}

/// A choice by the names of who chose and what.
struct Named {
    participant: String,
    preferred: String,
    other: String,
}

/// The choices of a part.
#[derive(Default)]
struct Choices {
    made: Vec<Named>,
    undecided: usize,
    pilot: bool,
    simulated: bool,
}

impl Choices {
    fn add(&mut self, participant: &str, preferred: String, other: String) {
        // A realization beside itself tells nothing.
        if preferred != other {
            self.made.push(Named {
                participant: participant.to_owned(),
                preferred,
                other,
            });
        }
    }
}

fn of_pairs(study: &StudyData<'_>, part: &Part, include: Include) -> Choices {
    let counting = Counting::of(study, include);
    let rows = study.rows.iter().filter(|row| counting.row(row));
    let rows: Vec<&RatingRow> = rows.collect();
    let intervals = Intervals::of(study.intervals);
    let rules = Rules::of(study.protocol, "", include);
    let PartRows { kept, .. } = Counting::of_part(study, part, &rows, &intervals, &rules.exclude);
    let mut found = Choices {
        pilot: kept.iter().any(|row| row.pilot),
        simulated: kept.iter().any(|row| row.simulated),
        ..Choices::default()
    };
    for own in kept
        .iter()
        .filter_map(|row| preference(part, row, &intervals))
    {
        match own.choice {
            Choice::First(_) => found.add(&own.participant, own.first, own.second),
            Choice::Second(_) => found.add(&own.participant, own.second, own.first),
            Choice::Tie(_) => found.undecided += 1,
        }
    }
    found
}

fn of_search(study: &StudyData<'_>, part: &Part, include: Include) -> Choices {
    let mut found = Choices::default();
    let all = explorations(study, include);
    for own in all.iter().filter(|own| own.part == part.id) {
        found.pilot |= own.pilot;
        found.simulated |= own.simulated;
        let name = |point: usize| own.space.realization(point).to_string();
        for search in &own.searches {
            for pair in &search.pairs {
                let [a, b] = pair.points;
                let participant = search.participant.as_str();
                match pair.preferred {
                    Some(preferred) if preferred == a => found.add(participant, name(a), name(b)),
                    Some(_) => found.add(participant, name(b), name(a)),
                    None => found.undecided += 1,
                }
            }
        }
    }
    found
}

/// Groups components by what choices can tell apart, and weighs the groups.
fn perceived(
    components: &[&'static str],
    errors: &[Vec<f64>],
    chosen: &[Chosen],
    random: &mut impl RandomSource,
) -> Result<Perceived, Unknown> {
    let all = spread(errors, chosen)?;
    let largest = all.rms.iter().fold(0.0f64, |most, rms| most.max(*rms));
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut unvaried = Vec::new();
    for (i, rms) in all.rms.iter().enumerate() {
        if *rms < VARIES * largest || *rms == 0.0 {
            unvaried.push(components[i]);
            continue;
        }
        let is_near = |group: &Vec<usize>| group.iter().any(|j| all.cosine[i][*j] >= TOGETHER);
        match groups.iter().position(is_near) {
            Some(group) => groups[group].push(i),
            None => groups.push(vec![i]),
        }
    }
    let names = |group: &Vec<usize>| -> Vec<&'static str> {
        group.iter().map(|i| components[*i]).collect()
    };
    match &groups[..] {
        [] => return Err(NoWeights::Alike.into()),
        [only] => return Err(Unknown::OneGroup(names(only))),
        _ => {}
    }
    let sums = |own: &Vec<f64>| -> Vec<f64> {
        let sum = |group: &Vec<usize>| group.iter().map(|i| own[*i]).sum();
        groups.iter().map(sum).collect()
    };
    let sums: Vec<Vec<f64>> = errors.iter().map(sums).collect();
    let own = spread(&sums, chosen)?.own;
    let untold = groups.iter().zip(&own).filter(|(_, own)| **own < UNTOLD);
    let untold: Vec<Vec<&'static str>> = untold.map(|(group, _)| names(group)).collect();
    if !untold.is_empty() {
        return Err(Unknown::NotTold(untold));
    }
    let weighed = weigh(&sums, chosen, random)?;
    let mixed = (0..groups.len()).filter(|i| own[*i] < OWN);
    Ok(Perceived {
        mixed: mixed.collect(),
        groups: groups.iter().map(names).collect(),
        unvaried,
        verdict: verdict(&weighed),
        weighed,
    })
}

fn verdict(weighed: &Weighed) -> Verdict {
    // Better than equal weights, which may be worse than guessing.
    let is_better = |left_out: &LeftOut| {
        left_out.score > 0.5f64.ln() && left_out.gain_ci95.is_some_and(|(low, _)| low > 0.0)
    };
    let of_people = weighed.left_out.as_ref().is_some_and(is_better);
    let of_stimuli = weighed.other_stimuli.as_ref();
    let of_stimuli = of_stimuli.is_some_and(|left_out| left_out.gain > 0.0);
    if weighed.shares.is_some() && of_people && of_stimuli {
        Verdict::Unequal
    } else if weighed.sensitivity_ci95.0 > 0.0 {
        Verdict::Equal
    } else {
        Verdict::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_stats::random::SplitMix64;

    const NAMES: [&str; 5] = ["level", "detent", "direction", "slow", "fast"];

    /// Errors of 20 realizations. The second component is twice the first one, and the last one hardly varies.
    fn errors(random: &mut SplitMix64) -> Vec<Vec<f64>> {
        let mut one = || {
            let [a, b, c] = [0; 3].map(|_| random.normal().powi(2));
            vec![a, 2.0 * a, b, c, 0.1 + 0.001 * b]
        };
        (0..20).map(|_| one()).collect()
    }

    /// Choices of eight people.
    fn choices(random: &mut SplitMix64, errors: &[Vec<f64>], weights: [f64; 5]) -> Vec<Chosen> {
        let one = |i: usize| {
            let a = random.below(20) as usize;
            let b = (a + 1 + random.below(19) as usize) % 20;
            let mut felt = |i: usize| {
                let loss: f64 = errors[i].iter().zip(weights).map(|(e, w)| e * w).sum();
                random.normal() - loss
            };
            let (preferred, other) = if felt(a) > felt(b) { (a, b) } else { (b, a) };
            Chosen {
                preferred,
                other,
                participant: i % 8,
            }
        };
        (0..400).map(one).collect()
    }

    fn of(weights: [f64; 5], seed: u64) -> Perceived {
        let mut random = SplitMix64::new(seed);
        let errors = errors(&mut random);
        let chosen = choices(&mut random, &errors, weights);
        perceived(&NAMES, &errors, &chosen, &mut random).unwrap()
    }

    #[test]
    fn components_that_vary_together_have_one_weight() {
        let found = of([0.0, 0.0, 1.0, 0.0, 0.0], 1);
        assert_eq!(
            found.groups,
            [vec!["level", "detent"], vec!["direction"], vec!["slow"]]
        );
        assert_eq!(found.unvaried, ["fast"]);
        assert!(found.mixed.is_empty());
        assert_eq!(found.verdict, Verdict::Unequal);
        let shares = found.weighed.shares.clone().unwrap();
        assert!(shares[1] >= 0.9, "{shares:?}");
        assert_eq!(found.weight("direction"), Some(found.weighed.weights[1]));
        assert_eq!(found.weight("level"), found.weight("detent"));
        assert_eq!(found.weight("fast"), None);
    }

    #[test]
    fn weights_are_found_only_if_they_predict_better() {
        let equal = of([0.5; 5], 2);
        assert_eq!(equal.verdict, Verdict::Equal, "{equal:?}");
        let nothing = of([0.0; 5], 3);
        assert_eq!(nothing.verdict, Verdict::Nothing, "{nothing:?}");
        for (low, high) in &nothing.weighed.shares_ci95 {
            assert!(*low <= 1.0 / 3.0 && 1.0 / 3.0 <= *high, "{nothing:?}");
        }
    }

    #[test]
    fn one_respect_cannot_be_weighed() {
        let mut random = SplitMix64::new(4);
        let errors: Vec<Vec<f64>> = (0..20)
            .map(|i| vec![f64::from(i), 0.5 * f64::from(i), 3.0])
            .collect();
        let wide: Vec<Vec<f64>> = errors
            .iter()
            .map(|e| [&e[..], &[0.0; 2]].concat())
            .collect();
        let chosen = choices(&mut random, &wide, [0.1, 0.0, 0.0, 0.0, 0.0]);
        let refused = perceived(&NAMES[..3], &errors, &chosen, &mut random).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "the compared realizations differ in one respect only: level with detent"
        );
        // Errors of opposite signs vary together, too: between two realizations only how they differ in all counts.
        let two = [vec![1.0, 0.0, 0.2], vec![0.0, 1.2, 0.2]];
        let choose = |i: usize| Chosen {
            preferred: usize::from(i.is_multiple_of(4)),
            other: usize::from(!i.is_multiple_of(4)),
            participant: i % 8,
        };
        let between: Vec<Chosen> = (0..80).map(choose).collect();
        let refused = perceived(&NAMES[..3], &two, &between, &mut random).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "what the compared realizations differ in changes together (level, detent), so that no weight can be told: compare \
             more of them, some of which differ in one of these alone"
        );
        let same = vec![vec![1.0; 3]; 20];
        let refused = perceived(&NAMES[..3], &same, &chosen, &mut random).unwrap_err();
        assert_eq!(refused, Unknown::Choices(NoWeights::Alike));
        let refused = perceived(&NAMES[..3], &errors, &chosen[..3], &mut random).unwrap_err();
        assert_eq!(refused, Unknown::Choices(NoWeights::TooFew(3)));
    }
}
