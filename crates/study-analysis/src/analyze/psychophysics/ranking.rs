//! Rankings: `ranking/…`.

use super::abilities::{AbilityDifference, differences, interval_of};
use super::preferences::reason;
use crate::analyze::draws::Draws;
use crate::analyze::keys::TiedName;
use crate::analyze::record::{
    Interval, Number as _, PairName, ParticipantName, RealizationName, Stat, statistics,
};
use std::collections::{BTreeMap, BTreeSet};
use study_base::sort::SmallSort as _;
use study_stats::correlation::spearman;
use study_stats::describe::{mean, mean_of, sd};
use study_stats::pairs::NoAbilities;
use study_stats::rank::mid_ranks;
use study_stats::ranking::{Ranking, Worths, concordance, shares, worths};

statistics! {
    /// Whether participants rank alike, by the mean ranks of each. Those without a ranking of all realizations do not count.
    pub struct RankAgreement {
        /// participants
        n: Stat,
        /// Kendall's W (1939), corrected for ties: 1 if all agree, 0 if their ranks cancel out
        w: Stat,
        /// χ² of W
        chi2: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p
        p_chi2: Stat,
        /// p of W over the orders of each participant's ranks
        p: Stat,
        /// whether all orders were counted; otherwise some are drawn
        exact: Stat,
        /// the smallest p that so many participants could have without ties
        smallest_p: Stat,
    }

    /// The realization with the highest worth beside each other one.
    pub struct BestRank {
        /// its logarithm of the worth less that of the next one
        difference: Stat,
        /// by the error over participants, from two participants on
        ci95: Interval,
        /// the largest p, with Holm's correction over all pairs, of its differences from the others
        p: Stat,
    }

    /// A realization.
    pub struct RankedItem {
        /// number of rankings that have it
        n: Stat,
        /// mean over participants of their mean ranks, ties in the middle; 1 is the first
        mean_rank: Stat,
        /// standard deviation of their mean ranks
        sd: Stat,
        /// share of its rankings in which nothing is above it
        first: Stat,
        /// probability that it has the first rank among all, if it is not tied there
        worth: Stat,
        /// logarithm of the worth; they sum to 0
        log_worth: Stat,
        /// its standard error
        log_worth_se: Stat,
        /// by the error over participants, from two participants on
        log_worth_ci95: Interval,
    }

    /// So many realizations with the same rank.
    pub struct RankTie {
        /// logarithm of δ, by which such sets are weighted
        log_delta: Stat,
        /// its standard error
        log_delta_se: Stat,
    }

    /// Two realizations.
    pub struct RankedPair {
        /// rankings that have both
        n: Stat,
        /// share in which the first is above the second
        above: Stat,
        /// share in which both have the same rank
        tied: Stat,
        /// the logarithm of the worth of the first less that of the second
        worths: AbilityDifference as "",
    }

    /// A participant.
    pub struct OwnRanking {
        /// number of rankings
        n: Stat,
        /// Spearman's correlation of the mean ranks with those of all others
        with_others: Stat,
        /// Kendall's W of the own rankings of all realizations, from two on
        own_w: Option<Stat>,
    }

    /// Rankings, by the model of Plackett (1975) and Luce (1959) with ties (Turner et al. 2020).
    pub struct Rankings {
        /// number of rankings
        n: Stat,
        /// participants with a ranking
        n_participants: Stat,
        /// rankings in which a realization has no rank
        n_incomplete: Stat,
        /// agreement of the participants
        agreement: RankAgreement,
        /// the best one
        best: BestRank,
        /// by realization
        items: BTreeMap<RealizationName, RankedItem> as "realization",
        /// by number of realizations that somebody gave the same rank
        ties: BTreeMap<TiedName, RankTie>,
        /// by pair
        pairs: BTreeMap<PairName, RankedPair> as "pair",
        /// by participant
        participants: BTreeMap<ParticipantName, OwnRanking> as "participant",
    }
}

impl Rankings {
    /// Leaves out every p for this reason; what is described stays.
    pub(super) fn cannot_be_told(&mut self, why: &str) {
        let both = [&mut self.agreement.p, &mut self.best.p];
        let of_pairs = (self.pairs.values_mut())
            .flat_map(|pair| [&mut pair.worths.p, &mut pair.worths.p_holm]);
        for p in both.into_iter().chain(of_pairs) {
            if p.number().is_some() {
                *p = Stat::missing(why.to_owned());
            }
        }
    }
}

/// One rank.
#[derive(Debug, Clone, PartialEq)]
pub struct RankingRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Which of the participant's rankings. Untrusted.
    pub ranking: String,
    /// What is ranked. Untrusted.
    pub realization: String,
    /// Its rank: the smallest is the first.
    pub rank: f64,
}

const NO_RANKINGS: &str = "there are no rankings";
const ONE_PARTICIPANT: &str = "there is one participant";
const ONE_REALIZATION: &str = "there are not two realizations";
const ALL_TIED: &str = "each participant gave all realizations the same rank";

/// The ranks of all realizations in one ranking.
type Ranks = Vec<Option<f64>>;

/// The statistics of rankings. `seed` and `name` are those of the random stream.
pub fn ranking(rows: &[RankingRow], (seed, name): (u64, &str)) -> Rankings {
    let items: BTreeSet<&str> = rows.iter().map(|row| row.realization.as_str()).collect();
    let items: Vec<&str> = items.into_iter().collect();
    let people = people(rows, &items);
    let rankings: Vec<Ranking> = (people.values().enumerate())
        .flat_map(|(cluster, own)| {
            own.iter().map(move |ranks| Ranking {
                ranks: ranks.clone(),
                cluster,
            })
        })
        .collect();
    let means: BTreeMap<&str, Vec<f64>> = (people.iter())
        .filter_map(|(who, own)| Some((*who, mean_ranks(own)?)))
        .collect();
    let fit = worths(items.len(), &rankings);
    let why = match &fit {
        _ if rankings.is_empty() => NO_RANKINGS.to_owned(),
        Ok(_) => String::new(),
        Err(error) => no_worths(error, &items),
    };
    let fit = fit.ok();
    let abilities = fit.as_ref().map(|fit| &fit.abilities);
    let differences = differences(&items, abilities, people.len(), &why);
    let pair = |(name, worths): (&PairName, &AbilityDifference)| {
        let [a, b] = name.names();
        let place = |name: &str| items.iter().position(|item| *item == name).unwrap_or(0);
        let found = shares(&rankings, place(a), place(b));
        let n = found.above + found.below + found.tied;
        let share = |of: f64| Stat::or((n > 0.0).then(|| of / n), "no ranking has both");
        let pair = RankedPair {
            n: Stat::of(n),
            above: share(found.above),
            tied: share(found.tied),
            worths: worths.clone(),
        };
        (name.clone(), pair)
    };
    let incomplete = |ranking: &&Ranking| ranking.ranks.iter().any(Option::is_none);
    Rankings {
        n: Stat::count(rankings.len()),
        n_participants: Stat::count(people.len()),
        n_incomplete: Stat::count(rankings.iter().filter(incomplete).count()),
        agreement: agreement(
            &means,
            items.len(),
            &mut Draws::new(seed, &format!("ranking/{name}")),
        ),
        best: best(&items, fit.as_ref(), &differences, &why),
        items: (items.iter().enumerate())
            .map(|(at, name)| {
                let found = of_item(at, &rankings, &means, (fit.as_ref(), people.len(), &why));
                (RealizationName::from(*name), found)
            })
            .collect(),
        ties: fit.iter().flat_map(|fit| &fit.ties).map(tie).collect(),
        pairs: differences.iter().map(pair).collect(),
        participants: (people.iter())
            .map(|(who, own)| {
                (
                    ParticipantName::from(*who),
                    of_participant(who, own, &means),
                )
            })
            .collect(),
    }
}

/// Why there are no worths, in the words of rankings.
fn no_worths(error: &NoAbilities, items: &[&str]) -> String {
    let NoAbilities::Unbounded(top) = error else {
        return reason(error, items);
    };
    let names: Vec<&str> = top.iter().map(|i| items[*i]).collect();
    format!(
        "none of the others was ever ranked above {}, or with the same rank: worths are unbounded",
        names.join(" or ")
    )
}

/// Rankings by participant; those of fewer than two realizations say nothing. Several ranks of a realization in one
/// ranking are averaged.
fn people<'r>(rows: &'r [RankingRow], items: &[&str]) -> BTreeMap<&'r str, Vec<Ranks>> {
    let mut given: BTreeMap<(&str, &str), Vec<Vec<f64>>> = BTreeMap::new();
    for row in rows {
        let own = given
            .entry((&row.participant, &row.ranking))
            .or_insert_with(|| vec![Vec::new(); items.len()]);
        if let Ok(at) = items.binary_search(&row.realization.as_str()) {
            own[at].push(row.rank);
        }
    }
    let mut people: BTreeMap<&str, Vec<Ranks>> = BTreeMap::new();
    for ((who, _), ranks) in given {
        let ranks: Ranks = ranks.iter().map(|own| mean(own)).collect();
        if ranks.iter().flatten().count() > 1 {
            people.entry(who).or_default().push(ranks);
        }
    }
    people
}

/// Ranks of all realizations from 1, ties in the middle; `None` if one has no rank.
fn complete(ranks: &[Option<f64>]) -> Option<Vec<f64>> {
    let ranks: Option<Vec<f64>> = ranks.iter().copied().collect();
    ranks.map(|ranks| mid_ranks(&ranks))
}

/// The mean ranks of a participant over the rankings of all realizations; `None` without one.
fn mean_ranks(own: &[Ranks]) -> Option<Vec<f64>> {
    let all: Vec<Vec<f64>> = own.iter().filter_map(|ranks| complete(ranks)).collect();
    let items = all.first()?.len();
    (0..items)
        .map(|item| mean_of(all.iter().map(|ranks| ranks[item])))
        .collect()
}

fn agreement(means: &BTreeMap<&str, Vec<f64>>, items: usize, draws: &mut Draws) -> RankAgreement {
    let rows: Vec<&Vec<f64>> = means.values().collect();
    let why = match (rows.len(), items) {
        (0, _) => "there are no rankings of all realizations",
        (1, _) => ONE_PARTICIPANT,
        (_, 0 | 1) => ONE_REALIZATION,
        _ => ALL_TIED,
    };
    let found = concordance(&rows, draws);
    let stat = |x: Option<f64>| Stat::or(x, why);
    let of = found.as_ref().map(|found| &found.friedman);
    RankAgreement {
        n: Stat::count(rows.len()),
        w: stat(of.and_then(|f| f.kendall_w)),
        chi2: stat(of.and_then(|f| f.chi2)),
        df: stat(of.map(|f| f.df)),
        p_chi2: stat(of.and_then(|f| f.p)),
        p: stat(found.as_ref().and_then(|f| f.p)),
        exact: stat(found.as_ref().map(|f| f64::from(u8::from(f.exact)))),
        smallest_p: stat(found.as_ref().map(|f| f.smallest_p)),
    }
}

/// The realizations by their worth, the highest first. Untrusted.
pub(super) fn by_worth(found: &Rankings) -> Vec<&str> {
    let mut all: Vec<(&str, f64)> = (found.items.iter())
        .map(|(name, item)| (name.as_str(), item.log_worth.number().unwrap_or(0.0)))
        .collect();
    all.small_sort_by(|a, b| b.1.total_cmp(&a.1));
    all.into_iter().map(|(name, _)| name).collect()
}

fn best(
    items: &[&str],
    fit: Option<&Worths>,
    differences: &BTreeMap<PairName, AbilityDifference>,
    why: &str,
) -> BestRank {
    let Some(fit) = fit else {
        return BestRank::undefined(why.to_owned());
    };
    let worths = &fit.abilities.abilities;
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.small_sort_by(|a, b| worths[*b].total_cmp(&worths[*a]));
    let [first, next, ..] = order[..] else {
        return BestRank::undefined(ONE_REALIZATION);
    };
    let of_first = |(name, _): &(&PairName, &AbilityDifference)| {
        let [a, b] = name.names();
        a == items[first] || b == items[first]
    };
    let own = differences.iter().filter(of_first);
    let p: Option<Vec<f64>> = own.map(|(_, d)| d.p_holm.number()).collect();
    let largest = p.and_then(|p| p.into_iter().reduce(f64::max));
    let ends = differences
        .get(&PairName::of(items[first], items[next]))
        .and_then(|pair| pair.ci95.ends());
    // The difference of the pair is that of the name that sorts first.
    let ends = match items[first] < items[next] {
        true => ends,
        false => ends.map(|(low, high)| (-high, -low)),
    };
    BestRank {
        difference: Stat::of(worths[first] - worths[next]),
        ci95: Interval::or(ends, "it overflows"),
        p: Stat::or(largest, "a difference has no test"),
    }
}

fn of_item(
    at: usize,
    rankings: &[Ranking],
    means: &BTreeMap<&str, Vec<f64>>,
    (fit, people, why): (Option<&Worths>, usize, &str),
) -> RankedItem {
    let own: Vec<&Ranking> = (rankings.iter())
        .filter(|ranking| ranking.ranks[at].is_some())
        .collect();
    let is_first = |ranking: &&&Ranking| {
        let rank = ranking.ranks[at];
        ranking
            .ranks
            .iter()
            .flatten()
            .all(|other| Some(*other) >= rank)
    };
    let first = own.iter().filter(is_first).count() as f64 / own.len() as f64;
    let ranks: Vec<f64> = means.values().map(|ranks| ranks[at]).collect();
    let stat = |x: Option<f64>| Stat::or(x, why.to_owned());
    let interval = fit.and_then(|fit| interval_of(&fit.abilities, at, people));
    RankedItem {
        n: Stat::count(own.len()),
        mean_rank: Stat::or(mean(&ranks), "there are no rankings of all realizations"),
        sd: Stat::or(
            sd(&ranks),
            "fewer than two participants ranked all realizations",
        ),
        first: Stat::or((!own.is_empty()).then_some(first), NO_RANKINGS),
        worth: stat(fit.map(|fit| fit.first()[at])),
        log_worth: stat(fit.map(|fit| fit.abilities.abilities[at])),
        log_worth_se: stat(fit.map(|fit| fit.abilities.ses[at])),
        log_worth_ci95: Interval::or(interval, why.to_owned()),
    }
}

fn tie((size, effect): &(usize, study_stats::pairs::Effect)) -> (TiedName, RankTie) {
    let found = RankTie {
        log_delta: Stat::of(effect.estimate),
        log_delta_se: Stat::of(effect.se),
    };
    (TiedName::from(size.to_string().as_str()), found)
}

fn of_participant(who: &str, own: &[Ranks], means: &BTreeMap<&str, Vec<f64>>) -> OwnRanking {
    let others: Vec<&Vec<f64>> = (means.iter())
        .filter(|(other, _)| **other != who)
        .map(|(_, ranks)| ranks)
        .collect();
    let mine = means.get(who);
    let of_others = |item: usize| mean_of(others.iter().map(|ranks| ranks[item]));
    let correlation = mine.and_then(|mine| {
        let others: Option<Vec<f64>> = (0..mine.len()).map(of_others).collect();
        spearman(mine, &others?)
    });
    let why = match (mine, others.len()) {
        (None, _) => "there is no ranking of all realizations",
        (_, 0) => "there are no other participants",
        _ => "all mean ranks are equal",
    };
    let whole: Vec<Vec<f64>> = own.iter().filter_map(|ranks| complete(ranks)).collect();
    let own_w = (whole.len() > 1).then(|| {
        let found = study_stats::friedman::friedman(&whole);
        Stat::or(
            found.and_then(|found| found.kendall_w),
            "each ranking is one tie",
        )
    });
    OwnRanking {
        n: Stat::count(own.len()),
        with_others: Stat::or(correlation, why),
        own_w,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `rankings`: by participant, each the realizations in their order, `=` between those of one rank.
    fn rows(rankings: &[&[&str]]) -> Vec<RankingRow> {
        let mut all = Vec::new();
        for (who, own) in rankings.iter().enumerate() {
            for (n, ranking) in own.iter().enumerate() {
                for (place, tied) in (1..).zip(ranking.split(' ')) {
                    for realization in tied.split('=') {
                        all.push(RankingRow {
                            participant: format!("P{who}"),
                            ranking: n.to_string(),
                            realization: realization.to_owned(),
                            rank: f64::from(place),
                        });
                    }
                }
            }
        }
        all
    }

    fn found(rankings: &[&[&str]]) -> Rankings {
        ranking(&rows(rankings), (1, "order"))
    }

    const SIX: &[&[&str]] = &[
        &["a b c", "a b c"],
        &["a b c", "b a c"],
        &["a c b", "a b c"],
        &["a b=c", "a c b"],
        &["b a c", "a b c"],
        &["a b c", "c a b"],
    ];

    #[test]
    fn the_best_one_is_above_each_other_one() {
        let found = found(SIX);
        assert_eq!(
            (found.n.number(), found.n_participants.number()),
            (Some(12.0), Some(6.0))
        );
        assert_eq!(by_worth(&found), ["a", "b", "c"]);
        let a = &found.items["a"];
        // Two rankings begin with b, and one with c.
        assert_eq!(a.first.number(), Some(9.0 / 12.0));
        let worths: f64 = found.items.values().filter_map(|i| i.worth.number()).sum();
        assert!((worths - 1.0).abs() < 1e-12);
        let pair = &found.pairs[&PairName::of("a", "b")];
        assert_eq!(
            (pair.above.number(), pair.tied.number()),
            (Some(10.0 / 12.0), Some(0.0))
        );
        let of_b = &found.pairs[&PairName::of("b", "c")];
        assert_eq!(of_b.tied.number(), Some(1.0 / 12.0));
        assert_eq!(found.ties.len(), 1);
        // The largest of the two p of the best one.
        let p = |pair: &str, other: &str| {
            let own = &found.pairs[&PairName::of(pair, other)].worths;
            own.p_holm.number().unwrap()
        };
        assert_eq!(found.best.p.number(), Some(p("a", "b").max(p("a", "c"))));
        let difference = pair.worths.difference.number();
        assert_eq!(found.best.difference.number(), difference);
        assert_eq!(found.best.ci95.ends(), pair.worths.ci95.ends());
    }

    /// The pair of the best and the next has its difference the other way round.
    #[test]
    fn the_names_do_not_matter() {
        let renamed = |text: &str| text.replace('a', "z");
        let all: Vec<Vec<String>> = (SIX.iter())
            .map(|own| own.iter().map(|text| renamed(text)).collect())
            .collect();
        let all: Vec<Vec<&str>> = (all.iter())
            .map(|own| own.iter().map(String::as_str).collect())
            .collect();
        let all: Vec<&[&str]> = all.iter().map(Vec::as_slice).collect();
        let (one, other) = (found(SIX), found(&all));
        assert_eq!(by_worth(&other), ["z", "b", "c"]);
        let ends = |found: &Rankings| {
            let (low, high) = found.best.ci95.ends().unwrap();
            [low, high, found.best.difference.number().unwrap()]
        };
        for (a, b) in ends(&one).into_iter().zip(ends(&other)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    /// Rankings of one participant count once: W is that of the mean ranks.
    #[test]
    fn agreement_is_that_of_participants() {
        let own = found(SIX).agreement;
        assert_eq!((own.n.number(), own.df.number()), (Some(6.0), Some(2.0)));
        let rows = [
            [1.0, 2.0, 3.0],
            [1.5, 1.5, 3.0],
            [1.0, 2.5, 2.5],
            [1.0, 2.75, 2.25],
            [1.5, 1.5, 3.0],
            [1.5, 2.5, 2.0],
        ];
        let expected = study_stats::friedman::friedman(&rows).unwrap();
        assert_eq!(own.w.number(), expected.kendall_w);
        assert_eq!(own.p.number(), expected.exact_p);
        assert!(own.exact.is_set() && own.smallest_p.number().unwrap() < 1e-3);
    }

    #[test]
    fn what_is_undefined_has_a_reason() {
        let none = ranking(&[], (1, "order"));
        assert_eq!(
            none.agreement.w.reason(),
            Some("there are no rankings of all realizations")
        );
        assert_eq!(none.best.p.reason(), Some(NO_RANKINGS));
        let alone = found(&[&["a b c", "b a c", "c a b"]]);
        assert_eq!(alone.agreement.w.reason(), Some(ONE_PARTICIPANT));
        assert!(alone.participants["P0"].own_w.number().is_some());
        let others = alone.participants["P0"].with_others.reason();
        assert_eq!(others, Some("there are no other participants"));
        let tied = found(&[&["a=b=c"], &["a=b=c"]]);
        assert_eq!(tied.agreement.w.reason(), Some(ALL_TIED));
        assert_eq!(tied.best.p.reason(), Some("every comparison is a tie"));
        let always = found(&[&["a b c"], &["a c b"]]);
        let reason = always.best.p.reason().unwrap();
        assert!(reason.contains("ever ranked above a,"), "{reason}");
        // One realization is no ranking.
        let one = found(&[&["a"], &["a"]]);
        assert_eq!(one.n.number(), Some(0.0));
    }

    /// What is described stays, and no test decides.
    #[test]
    fn what_cannot_be_told_has_no_p() {
        let mut found = found(SIX);
        found.cannot_be_told("one order");
        assert!(found.agreement.w.number().is_some() && found.best.difference.number().is_some());
        let pair = &found.pairs[&PairName::of("a", "b")].worths;
        for p in [&found.agreement.p, &found.best.p, &pair.p, &pair.p_holm] {
            assert_eq!(p.reason(), Some("one order"));
        }
        // A reason that there is already stays.
        let mut none = ranking(&[], (1, "order"));
        none.cannot_be_told("one order");
        assert_eq!(none.best.p.reason(), Some(NO_RANKINGS));
    }

    /// A declined rank leaves a realization out of one ranking; W does without such rankings.
    #[test]
    fn a_ranking_can_lack_a_realization() {
        let mut rows = rows(SIX);
        let at = rows.iter().position(|row| row.realization == "c").unwrap();
        rows.remove(at);
        let found = ranking(&rows, (1, "order"));
        assert_eq!(found.n_incomplete.number(), Some(1.0));
        assert_eq!(found.items["c"].n.number(), Some(11.0));
        assert_eq!(found.agreement.n.number(), Some(6.0));
        assert_eq!(found.pairs[&PairName::of("a", "c")].n.number(), Some(11.0));
    }
}
