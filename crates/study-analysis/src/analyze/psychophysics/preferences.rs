//! Paired preferences: `pairs/…`.

use super::abilities::{AbilityDifference, Judge, differences, interval_of};
use crate::analyze::record::{
    Declared, Field, Interval, Key, List, PairName, ParticipantName, RealizationName, Stat, Why,
    join, statistics,
};
use crate::analyze::results::Correlation;
use crate::analyze::values::Values;
use std::collections::{BTreeMap, BTreeSet};
use study_stats::pairs::{
    Abilities, Comparison, Link, Model, NoAbilities, abilities, circular_triads,
};

statistics! {
    /// A realization.
    pub struct Ability {
        /// its ability, the logarithm of its odds; abilities sum to 0
        ability: Stat,
        /// standard error
        ability_se: Stat,
        /// by the error over participants, from two participants on
        ability_ci95: Interval,
    }

    /// The effect of being presented first.
    pub struct OrderEffect {
        /// what it adds to the difference of abilities
        order: Stat,
        /// standard error
        order_se: Stat,
        /// standard error by the sandwich over participants, without a factor for small samples
        order_se_clustered: Option<Stat>,
        /// t over participants, as that of a pair: participants have biases of their own towards a position; z with one participant
        order_t: Stat,
        /// its degrees of freedom, as those of a pair; none with one participant
        order_t_df: Option<Stat>,
        /// of `order_t`
        order_p: Stat,
    }

    /// Ties by Davidson's (1970) model.
    pub struct Ties {
        /// logarithm of ν
        tie_log_nu: Stat,
        /// its standard error
        tie_log_nu_se: Stat,
    }

    /// How consistent a participant is, by what was preferred more often of each pair.
    pub struct Triads {
        /// number of circular triads
        circular: Stat,
        /// Kendall and Babington Smith's (1940) coefficient, 1 without any
        consistency: Stat,
    }

    /// Paired preferences by the model of Bradley and Terry (1952).
    pub struct Preferences {
        /// by realization
        items: Columns<RealizationName, Ability> as "",
        /// where a pair was presented in both orders
        order: Option<OrderEffect> as "",
        /// where they are answers
        ties: Option<Ties> as "",
        /// ties that do not count
        ties_left_out: Option<Stat>,
        /// deviance over the pairs in each order
        deviance: Stat,
        /// its degrees of freedom
        df: Stat,
        /// the rank of each realization, sorted by name
        rank: Option<List>,
        /// by pair
        pairs: BTreeMap<PairName, AbilityDifference> as "",
        /// by participant, of three realizations or more
        triads: BTreeMap<ParticipantName, Triads>,
        /// of abilities with VAF over realizations
        vaf: Option<Correlation>,
    }
}

/// Records whose names follow their statistics in identifiers: `ability/M`, `ability_se/M`.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns<K, R>(pub BTreeMap<K, R>);

impl<K: Key, R: Field> Field for Columns<K, R> {
    fn undefined(why: &Why) -> Self {
        Self(BTreeMap::undefined(why))
    }

    fn put(&self, id: &str, values: &mut Values) {
        for (key, record) in &self.0 {
            for (name, value) in record.values().iter() {
                let column = join(id, name);
                values.insert(format!("{column}/{}", key.part()), value.clone());
            }
        }
    }

    fn explain(&mut self, why: &Why) {
        self.0.explain(why);
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        let mut own = Vec::new();
        R::declare(id, doc, &mut own);
        for declared in &mut own {
            if let Declared::Statistic { id, .. } = declared {
                *id = format!("{id}/{}", K::PLACEHOLDER);
            }
        }
        all.append(&mut own);
    }
}

/// What was answered to a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// The first was preferred, so often.
    First(f64),
    /// The second was preferred, so often.
    Second(f64),
    /// Neither was, so often.
    Tie(f64),
}

/// One answer, or several like it, to a pair in the order in which it was presented.
#[derive(Debug, Clone, PartialEq)]
pub struct Preference {
    /// Participant; empty if nobody knows. Untrusted.
    pub participant: String,
    /// The item presented first. Untrusted.
    pub first: String,
    /// The item presented second. Untrusted.
    pub second: String,
    /// The answer.
    pub choice: Choice,
}

/// Whether a pair was presented in both orders, so that the effect of the order can be
/// estimated.
pub(super) fn in_both_orders(rows: &[Preference]) -> bool {
    let orders: BTreeSet<(&str, &str)> = (rows.iter())
        .map(|row| (row.first.as_str(), row.second.as_str()))
        .collect();
    orders.iter().any(|(a, b)| orders.contains(&(*b, *a)))
}

/// Abilities, their differences, order effect and ties. Items sort by name.
pub fn preferences(rows: &[Preference], ties: bool, order: bool) -> Preferences {
    let items: BTreeSet<&str> = rows
        .iter()
        .flat_map(|r| [r.first.as_str(), &r.second])
        .collect();
    let items: Vec<&str> = items.into_iter().collect();
    let people: BTreeSet<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    let people: Vec<&str> = people.into_iter().collect();
    let place = |name: &str| items.binary_search(&name).unwrap_or_default();
    let comparisons: Vec<Comparison> = (rows.iter())
        .map(|row| {
            let mut comparison = Comparison {
                first: place(&row.first),
                second: place(&row.second),
                first_preferred: 0.0,
                second_preferred: 0.0,
                tied: 0.0,
                cluster: people
                    .binary_search(&row.participant.as_str())
                    .unwrap_or_default(),
            };
            match row.choice {
                Choice::First(n) => comparison.first_preferred = n,
                Choice::Second(n) => comparison.second_preferred = n,
                Choice::Tie(n) => comparison.tied = n,
            }
            comparison
        })
        .collect();
    let link = match ties {
        true => Link::Davidson,
        false => Link::BradleyTerry,
    };
    let fit = abilities(items.len(), &comparisons, Model { link, order });
    let why = fit
        .as_ref()
        .err()
        .map_or_else(String::new, |e| reason(e, &items));
    let found = fit.as_ref().ok();
    let judge = |participants: f64| Judge::of(people.len(), participants);
    let stat = |x: Option<f64>| Stat::or(x, why.clone());
    let ability = |(i, item): (usize, &&str)| {
        let interval = found.and_then(|f| interval_of(f, i, people.len()));
        let ability = Ability {
            ability: stat(found.map(|f| f.abilities[i])),
            ability_se: stat(found.map(|f| f.ses[i])),
            ability_ci95: Interval::or(interval, why.clone()),
        };
        (RealizationName::from(*item), ability)
    };
    let order = order.then(|| {
        let effect = found.and_then(|f| f.order);
        let clustered = found.and_then(Abilities::order_clustered_se);
        let judge = judge(
            found
                .and_then(Abilities::participants_of_order)
                .unwrap_or(0.0),
        );
        let deciding = effect.map(|e| (e.estimate, judge.se(e.se, clustered)));
        let several = people.len() > 1;
        OrderEffect {
            order: stat(effect.map(|e| e.estimate)),
            order_se: stat(effect.map(|e| e.se)),
            order_se_clustered: several.then(|| stat(clustered)),
            order_t: stat(deciding.map(|(order, se)| order / se)),
            order_t_df: several.then(|| stat(effect.and_then(|_| judge.df()))),
            order_p: stat(deciding.and_then(|(order, se)| judge.p(order, se))),
        }
    });
    let davidson = ties.then(|| {
        let why = match why.as_str() {
            "" => "there are no ties",
            why => why,
        };
        let tie = found.and_then(|f| f.tie);
        Ties {
            tie_log_nu: Stat::or(tie.map(|e| e.estimate), why.to_owned()),
            tie_log_nu_se: Stat::or(tie.map(|e| e.se), why.to_owned()),
        }
    });
    let tied = || Stat::of(comparisons.iter().map(|c| c.tied).sum());
    let ranks = |f: &Abilities| List::of(f.ranks().into_iter().map(|r| r as f64).collect());
    Preferences {
        items: Columns(items.iter().enumerate().map(ability).collect()),
        order,
        ties: davidson,
        ties_left_out: (!ties).then(tied),
        deviance: stat(found.map(|f| f.deviance)),
        df: stat(found.map(|f| f.df as f64)),
        rank: found.map(ranks),
        pairs: differences(&items, found, |_, _| None, (people.len(), &why)),
        triads: match items.len() {
            0..=2 => BTreeMap::new(),
            _ => triads(&items, &people, &comparisons),
        },
        vaf: None,
    }
}

/// How consistent each participant is, by what was preferred more often of each pair.
fn triads(
    items: &[&str],
    people: &[&str],
    comparisons: &[Comparison],
) -> BTreeMap<ParticipantName, Triads> {
    let of_participant = |(cluster, name): (usize, &&str)| {
        let mut wins = vec![0.0; items.len() * items.len()];
        for c in comparisons.iter().filter(|c| c.cluster == cluster) {
            wins[c.first * items.len() + c.second] += c.first_preferred;
            wins[c.second * items.len() + c.first] += c.second_preferred;
        }
        let more = |a: &usize, b: &usize| wins[a * items.len() + b] > wins[b * items.len() + a];
        let preferred: Vec<(usize, usize)> = (0..items.len())
            .flat_map(|a| (0..items.len()).map(move |b| (a, b)))
            .filter(|(a, b)| more(a, b))
            .collect();
        let found = circular_triads(items.len(), &preferred);
        let why = "a pair was not compared, or neither was preferred more often";
        let triads = Triads {
            circular: Stat::or(found.map(|f| f.circular), why),
            consistency: Stat::or(found.map(|f| f.consistency), why),
        };
        (ParticipantName::from(*name), triads)
    };
    let known = people.iter().enumerate();
    (known.filter(|(_, name)| !name.is_empty()))
        .map(of_participant)
        .collect()
}

/// The reason with the names of the items.
pub(super) fn reason(error: &NoAbilities, items: &[&str]) -> String {
    let names = |group: &Vec<usize>| {
        let names: Vec<&str> = group.iter().map(|i| items[*i]).collect();
        format!("{{{}}}", names.join(", "))
    };
    match error {
        NoAbilities::Disconnected(groups) => {
            let groups: Vec<String> = groups.iter().map(names).collect();
            format!("no comparison joins {}", groups.join(" with "))
        }
        NoAbilities::Unbounded(top) => {
            let names: Vec<&str> = top.iter().map(|i| items[*i]).collect();
            let ability = match top.len() {
                1 => "its ability is",
                _ => "their abilities are",
            };
            format!(
                "none of the others was ever preferred to {}: {ability} unbounded",
                names.join(" or ")
            )
        }
        NoAbilities::NoPairs
        | NoAbilities::OneOrder
        | NoAbilities::AllTied
        | NoAbilities::AlwaysTied
        | NoAbilities::TooManySets
        | NoAbilities::NotFound => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::Number as _;

    #[test]
    fn names_follow_the_statistics_of_columns() {
        let name = |name: &str| RealizationName::from(name);
        let columns = Columns(BTreeMap::from([(name("a/b"), Stat::of(2.0))]));
        let mut values = Values::default();
        columns.put("pairs/ability", &mut values);
        assert_eq!(values.number("pairs/ability/a%2Fb"), Some(2.0));
        let mut all = Vec::new();
        Columns::<RealizationName, Stat>::declare("pairs/ability", "", &mut all);
        assert!(matches!(&all[..], [Declared::Statistic { id, .. }] if id == "pairs/ability/M"));
    }

    /// Participants who always prefer the same of two, by turns: their answers are not
    /// independent, and each participant counts once.
    #[test]
    fn participants_are_the_units_however_few_they_are() {
        let decides = |people: usize, quantile: f64| {
            let row = |i: usize| Preference {
                participant: format!("P{:02}", i % people),
                first: "a".to_owned(),
                second: "b".to_owned(),
                choice: match (i % people) % 3 {
                    0 => Choice::Second(1.0),
                    _ => Choice::First(1.0),
                },
            };
            let rows: Vec<Preference> = (0..8 * people).map(row).collect();
            let found = preferences(&rows, false, false);
            let pair = &found.pairs[&PairName::of("a", "b")];
            let (low, high) = pair.ci95.ends().unwrap();
            let half = 0.5 * (high - low);
            let (se, clustered) = (
                pair.se.number().unwrap(),
                pair.se_clustered.number().unwrap(),
            );
            assert!(clustered > 1.5 * se);
            let n = people as f64;
            assert!((half / (clustered * (n / (n - 1.0)).sqrt()) - quantile).abs() < 1e-3);
        };
        // tables of t: 2.776 with 4 and 2.093 with 19 degrees of freedom
        decides(5, 2.776);
        decides(20, 2.093);
    }

    /// Five participants who answer alike leave no variance between them: half of the standard error of
    /// independent answers takes its place.
    #[test]
    fn participants_who_answer_alike_are_not_certain() {
        let row = |i: usize| Preference {
            participant: format!("P{}", i / 8),
            first: "a".to_owned(),
            second: "b".to_owned(),
            choice: match i % 4 {
                0 => Choice::Second(1.0),
                _ => Choice::First(1.0),
            },
        };
        let rows: Vec<Preference> = (0..40).map(row).collect();
        let found = preferences(&rows, false, false);
        let pair = &found.pairs[&PairName::of("a", "b")];
        assert!(pair.se_clustered.number().unwrap() < 1e-9);
        // difference ln 3, se √(1/30 + 1/10)
        let t = 3f64.ln() / (0.5 * (1.0 / 30.0 + 1.0 / 10.0_f64).sqrt());
        assert!((pair.statistic.number().unwrap() - t).abs() < 1e-6);
        // R: 2 * pt(-6.0174, 4)
        assert!(
            (pair.p.number().unwrap() - 0.003_841_660_537).abs() < 1e-9,
            "{:?}",
            pair.p
        );
    }

    /// One of eight participants answered ten times as often as the others: the difference rests on
    /// (10 + 7)²/(100 + 7) of them.
    #[test]
    fn who_answers_most_counts_as_one() {
        let mut rows = Vec::new();
        for s in 0..8 {
            for i in 0..if s == 0 { 100 } else { 10 } {
                rows.push(Preference {
                    participant: format!("P{s}"),
                    first: "a".to_owned(),
                    second: "b".to_owned(),
                    choice: match (i + s) % 5 {
                        0 | 1 => Choice::Second(1.0),
                        _ => Choice::First(1.0),
                    },
                });
            }
        }
        let found = preferences(&rows, false, false);
        let pair = &found.pairs[&PairName::of("a", "b")];
        let df = pair.statistic_df.as_ref().unwrap().number().unwrap();
        assert!((df - (289.0 / 107.0 - 1.0)).abs() < 1e-6, "{df}");
    }

    /// Nine participants with a bias of their own towards a position and none in common: the order "mattered" in nearly half of
    /// such studies while answers counted as independent.
    #[test]
    fn biases_towards_a_position_without_a_common_one_keep_the_level() {
        let study = |seed: u64| {
            let mut stream = study_base::rng::Stream::new(seed, &["preferences", "positions"]);
            let mut rows = Vec::new();
            for s in 0..9 {
                let p = 1.0 / (1.0 + (-stream.normal()).exp());
                for (a, b) in [(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)] {
                    for _ in 0..5 {
                        let first = (stream.below(1_000_000) as f64) < 1e6 * p;
                        rows.push(Preference {
                            participant: format!("P{s}"),
                            first: format!("m{a}"),
                            second: format!("m{b}"),
                            choice: if first {
                                Choice::First(1.0)
                            } else {
                                Choice::Second(1.0)
                            },
                        });
                    }
                }
            }
            let order = preferences(&rows, false, true).order.unwrap();
            let independent = order.order.number().unwrap() / order.order_se.number().unwrap();
            (
                order.order_p.number().unwrap() <= 0.05,
                independent.abs() >= 1.96,
            )
        };
        let found: Vec<(bool, bool)> = (0..300).map(study).collect();
        // Binomial: 15 ± 3 · 3.8 of 300 at the level .05.
        let yes = found.iter().filter(|f| f.0).count();
        assert!((4..=26).contains(&yes), "{yes} of 300");
        let independent = found.iter().filter(|f| f.1).count();
        assert!(independent > 75, "{independent} of 300");
    }

    /// Nine participants with tastes of their own and no common preference: any pair was "told apart" in
    /// half of such studies while answers counted as independent.
    #[test]
    fn tastes_without_a_common_preference_keep_the_level() {
        let study = |seed: u64| {
            let mut stream = study_base::rng::Stream::new(seed, &["preferences", "tastes"]);
            let mut rows = Vec::new();
            for s in 0..9 {
                let tastes: Vec<f64> = (0..3).map(|_| stream.normal()).collect();
                for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                    let p = 1.0 / (1.0 + (tastes[b] - tastes[a]).exp());
                    for _ in 0..10 {
                        let first = (stream.below(1_000_000) as f64) < 1e6 * p;
                        rows.push(Preference {
                            participant: format!("P{s}"),
                            first: format!("m{a}"),
                            second: format!("m{b}"),
                            choice: if first {
                                Choice::First(1.0)
                            } else {
                                Choice::Second(1.0)
                            },
                        });
                    }
                }
            }
            let found = preferences(&rows, false, false);
            let p = found.pairs.values().filter_map(|pair| pair.p_holm.number());
            p.fold(1.0, f64::min) <= 0.05
        };
        let yes = (0..300).filter(|seed| study(*seed)).count();
        // Binomial: 15 + 3 · 3.8 of 300 at the level .05; Holm's correction stays below.
        assert!(yes <= 26, "{yes} of 300");
    }
}
