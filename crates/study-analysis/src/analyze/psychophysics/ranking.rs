//! Rankings: `ranking/…`.

use super::abilities::{AbilityDifference, Endless, differences, interval_of};
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
use study_stats::ranking::{Ranking, Worths, always_above, concordance, shares, worths};

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
        /// its logarithm of the worth less that of the next one; none if it is above all others in every ranking
        difference: Stat,
        /// by the error over participants, from two participants on; the lower end only, exact, if it is above all others in every ranking
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
        /// where there are several: its level from 1, the highest; in every ranking those of a level are above all of lower ones
        level: Option<Stat>,
        /// probability that it has the first rank among all, if it is not tied there; 0 below the highest level
        worth: Stat,
        /// logarithm of the worth; they sum to 0 within each level
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
const ALONE: &str = "it is the only one of its level, above or below all others in every ranking";
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
    let endless = |a: usize, b: usize| {
        let fit = fit.as_ref()?;
        (fit.level(a) != fit.level(b)).then(|| without_end(&items, fit, &people, [a, b]))
    };
    let differences = differences(&items, abilities, endless, (people.len(), &why));
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
        "none of the others was ever ranked above {}, or with the same rank, and not all realizations were ranked \
         together",
        names.join(" or ")
    )
}

/// What is known of two realizations of different levels. Each participant with a ranking of both counts once; of one
/// participant each ranking does.
fn without_end(
    items: &[&str],
    fit: &Worths,
    people: &BTreeMap<&str, Vec<Ranks>>,
    [a, b]: [usize; 2],
) -> Endless {
    let has_both = |ranks: &&Ranks| ranks[a].is_some() && ranks[b].is_some();
    let of_person = |own: &Vec<Ranks>| own.iter().filter(has_both).count();
    let times: usize = match people.len() {
        1 => people.values().map(of_person).sum(),
        _ => people.values().filter(|own| of_person(own) > 0).count(),
    };
    let most_tied = fit.ties.last().map_or(1, |(size, _)| *size);
    let first = fit.level(a) < fit.level(b);
    let (above, below) = if first { (a, b) } else { (b, a) };
    Endless {
        first,
        known: always_above(times, most_tied),
        why: format!(
            "{} was above {} in every ranking: how much is unbounded",
            items[above], items[below]
        ),
    }
}

/// The realizations of each level, the highest first; nothing if there is one. Untrusted.
pub(super) fn levels(found: &Rankings) -> Vec<Vec<&str>> {
    let mut levels: Vec<(u64, Vec<&str>)> = Vec::new();
    for (name, item) in &found.items {
        let Some(own) = item.level.number() else {
            continue;
        };
        match levels.iter_mut().find(|(level, _)| *level == own as u64) {
            Some((_, names)) => names.push(name.as_str()),
            None => levels.push((own as u64, vec![name.as_str()])),
        }
    }
    levels.sort();
    levels.into_iter().map(|(_, names)| names).collect()
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

/// The realizations by their level and worth, the highest first. Untrusted.
pub(super) fn by_worth(found: &Rankings) -> Vec<&str> {
    let mut all: Vec<(&str, [f64; 2])> = (found.items.iter())
        .map(|(name, item)| {
            let level = item.level.number().unwrap_or(1.0);
            (
                name.as_str(),
                [level, -item.log_worth.number().unwrap_or(0.0)],
            )
        })
        .collect();
    all.small_sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
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
    let by_worth = |a: usize, b: usize| worths[b].total_cmp(&worths[a]);
    order.small_sort_by(|a, b| fit.level(*a).cmp(&fit.level(*b)).then(by_worth(*a, *b)));
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
    let Some(pair) = differences.get(&PairName::of(items[first], items[next])) else {
        return BestRank::undefined(ONE_REALIZATION);
    };
    // The difference of the pair is that of the name that sorts first.
    let turned = |x: &Stat| match x.number() {
        Some(x) => Stat::of(-x),
        None => x.clone(),
    };
    let ci95 = match items[first] < items[next] {
        true => pair.ci95.clone(),
        false => Interval {
            lo: turned(&pair.ci95.hi),
            hi: turned(&pair.ci95.lo),
        },
    };
    BestRank {
        difference: match fit.level(first) == fit.level(next) {
            true => Stat::of(worths[first] - worths[next]),
            false => pair.difference.clone(),
        },
        ci95,
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
    let level = fit.map(|fit| fit.level(at));
    let alone = fit
        .zip(level)
        .is_some_and(|(fit, level)| fit.levels[level].len() < 2);
    // What has nothing to be compared with.
    let compared = |x: Option<f64>| match alone {
        true => Stat::missing(ALONE),
        false => stat(x),
    };
    let interval = fit.and_then(|fit| interval_of(&fit.abilities, at, people));
    RankedItem {
        n: Stat::count(own.len()),
        mean_rank: Stat::or(mean(&ranks), "there are no rankings of all realizations"),
        sd: Stat::or(
            sd(&ranks),
            "fewer than two participants ranked all realizations",
        ),
        first: Stat::or((!own.is_empty()).then_some(first), NO_RANKINGS),
        level: (level.filter(|_| fit.is_some_and(|fit| fit.levels.len() > 1)))
            .map(|level| Stat::count(level + 1)),
        worth: stat(fit.map(|fit| fit.first()[at])),
        log_worth: compared(fit.map(|fit| fit.abilities.abilities[at])),
        log_worth_se: compared(fit.map(|fit| fit.abilities.ses[at])),
        log_worth_ci95: match alone {
            true => Interval::or(None, ALONE),
            false => Interval::or(interval, why.to_owned()),
        },
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
mod tests;
