//! Rankings: each participant gives every item of a set a rank, of which several can be the same. Whether participants
//! agree ([`concordance`]), worths of the items ([`worths`]), and how often one is ranked above another ([`shares`]).
//!
//! The model is that of Plackett (1975) and Luce (1959) with the ties of Davidson (1970) for sets of any size (Turner,
//! van Etten, Firth & Kosmidis 2020, Computational Statistics 35, §2.1). A ranking is a sequence of choices: from the items
//! A that are left the set S of those with the smallest rank is taken, with a probability in proportion to δ(|S|) times
//! the geometric mean of the worths in S, over all sets of A whose size is 1 or was tied by somebody; δ(1) = 1. The logarithms of these
//! weights are linear in those of worths and δ. Of two items this is the model of [`super::pairs`].
//!
//! The likelihood has no maximum where an item, or a group of them, is above all others in every ranking: it rises with the
//! difference of their worths without an end. Its limit is the likelihood of the rankings within each such level, because the
//! probability that a higher level is chosen first tends to 1. [`worths`] maximizes that; what is known of the difference of two
//! levels is a lower bound ([`always_above`]).

use super::friedman::{Friedman, friedman};
use super::pairs::{
    Abilities, Comparison, Effect, Fitted, Link, Model, NoAbilities, Row, Space, existence, fitted,
};
use super::random::RandomSource;
use super::rank::doubled_ranks;

/// One ranking.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranking {
    /// By item: a smaller rank is above a larger one, equal ones are tied; only their order counts. `None`: not ranked.
    pub ranks: Vec<Option<f64>>,
    /// The participant.
    pub cluster: usize,
}

/// Most sets of tied items that can be taken in one choice.
const MOST_SETS: f64 = 5_000.0;

/// Estimated worths.
#[derive(Debug, Clone)]
pub struct Worths {
    /// Logarithms of the worths, which sum to zero within each level, with their differences and errors. Only those of items of one
    /// level can be compared: the difference of two levels is infinite.
    pub abilities: Abilities,
    /// The items in levels, the highest first: in every ranking every item is above those of lower levels. One level, if
    /// the likelihood of all items has a maximum.
    pub levels: Vec<Vec<usize>>,
    /// Of each number of items that somebody tied, ascending: ln δ.
    pub ties: Vec<(usize, Effect)>,
    /// The logarithm of the likelihood; of several levels that of its limit.
    pub log_likelihood: f64,
}

impl Worths {
    /// The worths, which sum to one: the probability that an item has the first rank among all, if it is not tied there; 0
    /// below the highest level.
    pub fn first(&self) -> Vec<f64> {
        let worth = |(item, log_worth): (usize, &f64)| match self.level(item) {
            0 => log_worth.exp(),
            _ => 0.0,
        };
        let powers: Vec<f64> = self
            .abilities
            .abilities
            .iter()
            .enumerate()
            .map(worth)
            .collect();
        let sum: f64 = powers.iter().sum();
        powers.iter().map(|power| power / sum).collect()
    }

    /// The level of an item; 0 is the highest.
    pub fn level(&self, item: usize) -> usize {
        let level = self.levels.iter().position(|level| level.contains(&item));
        level.unwrap_or(0)
    }
}

/// What is known of the difference of two logarithms of worths without an end: one item was always above the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beyond {
    /// The lower end of the 95 % interval; the upper one is infinite.
    pub at_least: f64,
    /// Two-sided p of equal worths, by the sign test.
    pub p: f64,
}

/// An item was above another in each of `times` independent rankings. By the model the probability of that is at most
/// 1/(1 + e^(−d)) with the difference d of the logarithms of their worths, so that the lower end of its exact interval (Clopper &
/// Pearson 1934) bounds d. If the worths are equal, it is at most a half, so that p = 2^(1 − `times`), and at most 1.
///
/// `most_tied` is the largest number of items that somebody tied, 1 without ties: among sets of k items those with only one of the two
/// are chosen in proportion to e^(d/k) and 1, so that a bound below zero is `most_tied` times as low. `None` without rankings.
///
/// ```
/// # use study_stats::ranking::always_above;
/// let found = always_above(10, 1).unwrap();
/// assert!((found.p - 1.0 / 512.0).abs() < 1e-15);
/// // 0.025^(1/10) = .692, ln(.692/.308)
/// assert!((found.at_least - 0.807_2).abs() < 1e-4);
/// ```
pub fn always_above(times: usize, most_tied: usize) -> Option<Beyond> {
    if times == 0 {
        return None;
    }
    let n = times as f64;
    let low = 0.025f64.powf(1.0 / n);
    let bound = (low / (1.0 - low)).ln();
    Some(Beyond {
        at_least: match bound < 0.0 {
            true => bound * most_tied.max(1) as f64,
            false => bound,
        },
        p: (2.0 * 0.5f64.powf(n)).min(1.0),
    })
}

/// A set that is taken from those that are left.
struct Choice {
    taken: Vec<usize>,
    left: Vec<usize>,
}

/// The choices of a ranking among the items of a level, but for that from a single item.
fn choices(ranking: &Ranking, level: &[usize]) -> Vec<Choice> {
    let ranked = level
        .iter()
        .filter_map(|item| Some((*item, ranking.ranks.get(*item).copied().flatten()?)));
    let mut left: Vec<(usize, f64)> = ranked.collect();
    left.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut all = Vec::new();
    while left.len() > 1 {
        let best = left[0].1;
        let tied = left.iter().take_while(|(_, rank)| *rank == best).count();
        let items: Vec<usize> = left.iter().map(|(item, _)| *item).collect();
        all.push(Choice {
            taken: items[..tied].to_vec(),
            left: items,
        });
        left.drain(..tied);
    }
    all
}

/// All sets of `size` of some items.
fn sets(items: &[usize], size: usize) -> Vec<Vec<usize>> {
    if size == 0 {
        return vec![Vec::new()];
    }
    let Some((first, rest)) = items.split_first().filter(|_| size <= items.len()) else {
        return Vec::new();
    };
    let with_first = sets(rest, size - 1).into_iter().map(|mut set| {
        set.push(*first);
        set
    });
    with_first.chain(sets(rest, size)).collect()
}

/// Number of sets of `size` of `n` items, at most `n`.
fn number_of_sets(n: usize, size: usize) -> f64 {
    (0..size).map(|i| (n - i) as f64 / (i + 1) as f64).product()
}

/// Every pair of a ranking, as a comparison.
fn comparisons(ranking: &Ranking) -> Vec<Comparison> {
    let ranked = ranking.ranks.iter().enumerate();
    let ranked: Vec<(usize, f64)> = ranked.filter_map(|(i, r)| Some((i, (*r)?))).collect();
    let mut all = Vec::new();
    for (at, (first, own)) in ranked.iter().enumerate() {
        for (second, other) in &ranked[at + 1..] {
            let one = |holds: bool| if holds { 1.0 } else { 0.0 };
            all.push(Comparison {
                first: *first,
                second: *second,
                first_preferred: one(own < other),
                second_preferred: one(own > other),
                tied: one(own == other),
                cluster: ranking.cluster,
            });
        }
    }
    all
}

/// The logarithm of the worth of each item as a linear function of `size` parameters: within a level the last one is minus the sum
/// of the others.
fn vectors(levels: &[Vec<usize>], items: usize, size: usize) -> Vec<Vec<f64>> {
    let mut all = vec![vec![0.0; size]; items];
    let mut first = 0;
    for level in levels {
        let Some((last, others)) = level.split_last() else {
            continue;
        };
        for (place, item) in (first..).zip(others) {
            all[*item][place] = 1.0;
        }
        all[*last][first..first + others.len()].fill(-1.0);
        first += others.len();
    }
    all
}

/// Maximum-likelihood worths of items 0 … `items` − 1, with standard errors from the observed information. Differences
/// have those of the sandwich over participants, too ([`Abilities::difference`]). Where some items are above all
/// others in every ranking, they are those of each level ([`Worths::levels`]).
///
/// ```
/// # use study_stats::ranking::{Ranking, worths};
/// // One of three participants prefers the second item, two the first.
/// let ranks = [[1.0, 2.0], [1.0, 2.0], [2.0, 1.0]];
/// let rankings: Vec<Ranking> = ranks.iter().enumerate()
///     .map(|(cluster, own)| Ranking { ranks: own.iter().copied().map(Some).collect(), cluster })
///     .collect();
/// let found = worths(2, &rankings).unwrap();
/// assert!((found.first()[0] - 2.0 / 3.0).abs() < 1e-9);
/// ```
///
/// # Errors
/// [`NoAbilities`] if there is no maximum within the levels, if the rankings do not say which of two levels is the higher
/// one, or if more than 5,000 sets of tied items could be taken in one choice.
pub fn worths(items: usize, rankings: &[Ranking]) -> Result<Worths, NoAbilities> {
    let pairs: Vec<Comparison> = rankings.iter().flat_map(comparisons).collect();
    let with_ties = pairs.iter().any(|pair| pair.tied > 0.0);
    let levels = existence::levels(items, &pairs, with_ties)?;
    if pairs.iter().all(|pair| pair.tied > 0.0) {
        return Err(NoAbilities::AllTied);
    }
    let made: Vec<(usize, Choice)> = (rankings.iter())
        .flat_map(|ranking| levels.iter().map(move |level| (ranking, level)))
        .flat_map(|(ranking, level)| {
            let cluster = ranking.cluster;
            (choices(ranking, level).into_iter()).map(move |c| (cluster, c))
        })
        .collect();
    let mut tied: Vec<usize> = made.iter().map(|(_, choice)| choice.taken.len()).collect();
    tied.retain(|size| *size > 1);
    tied.sort_unstable();
    tied.dedup();
    let of = |left: usize| -> f64 {
        let sizes = tied.iter().filter(|size| **size <= left);
        sizes.map(|size| number_of_sets(left, *size)).sum()
    };
    if made.iter().any(|(_, c)| of(c.left.len()) > MOST_SETS) {
        return Err(NoAbilities::TooManySets);
    }
    // Of one size wherever there were enough items, or of any size and never a single item.
    let always = |size: &usize| {
        let mut could = made.iter().filter(|(_, c)| c.left.len() >= *size);
        could.all(|(_, c)| c.taken.len() == *size)
    };
    let any_single = made.iter().any(|(_, c)| c.taken.len() == 1);
    if !tied.is_empty() && (!any_single || tied.iter().any(always)) {
        return Err(NoAbilities::AlwaysTied);
    }
    let free = items - levels.len();
    let space = Space {
        vectors: vectors(&levels, items, free + tied.len()),
        abilities: free,
        size: free + tied.len(),
    };
    let weight = |set: &[usize]| -> Vec<f64> {
        let mut sum = vec![0.0; space.size];
        for item in set {
            let own = &space.vectors[*item];
            sum.iter_mut().zip(own).for_each(|(s, own)| *s += own);
        }
        sum.iter_mut().for_each(|s| *s /= set.len() as f64);
        if let Ok(place) = tied.binary_search(&set.len()) {
            sum[free + place] = 1.0;
        }
        sum
    };
    let row = |(cluster, choice): &(usize, Choice)| {
        let mut outcomes = vec![(1.0, weight(&choice.taken))];
        let mut taken = choice.taken.clone();
        taken.sort_unstable();
        for size in std::iter::once(1).chain(tied.iter().copied()) {
            for mut set in sets(&choice.left, size) {
                set.sort_unstable();
                if set != taken {
                    outcomes.push((0.0, weight(&set)));
                }
            }
        }
        Row {
            cluster: *cluster,
            outcomes,
        }
    };
    let rows: Vec<Row> = made.iter().map(row).collect();
    let model = Model {
        link: Link::Davidson,
        order: false,
    };
    // A saturated model has the probability 1 of each choice.
    let of_choices = |at: &[f64]| {
        let taken = rows
            .iter()
            .map(|row| row.probabilities(model.link, at)[0].ln());
        let free: usize = rows.iter().map(|row| row.outcomes.len() - 1).sum();
        (-2.0 * taken.sum::<f64>(), free)
    };
    let found: Fitted = fitted(space, &rows, model, of_choices)?;
    Ok(Worths {
        abilities: found.abilities,
        levels,
        ties: tied.iter().copied().zip(found.ties).collect(),
        log_likelihood: found.log_likelihood,
    })
}

/// How often one item was ranked above another.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shares {
    /// Rankings in which it has the smaller rank.
    pub above: f64,
    /// Rankings in which it has the larger rank.
    pub below: f64,
    /// Rankings in which both have the same.
    pub tied: f64,
}

/// How often item `a` was ranked above item `b`, over the rankings that have both.
pub fn shares(rankings: &[Ranking], a: usize, b: usize) -> Shares {
    let mut found = Shares::default();
    for ranking in rankings {
        let rank = |item: usize| ranking.ranks.get(item).copied().flatten();
        let (Some(own), Some(other)) = (rank(a), rank(b)) else {
            continue;
        };
        if own < other {
            found.above += 1.0;
        } else if own > other {
            found.below += 1.0;
        } else {
            found.tied += 1.0;
        }
    }
    found
}

/// Number of random orders in [`concordance`].
pub const DRAWS: u32 = 9_999;

/// Whether participants rank items alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Concordance {
    /// Kendall's W (1939), corrected for ties, with χ² and its p.
    pub friedman: Friedman,
    /// p of W over the orders of the ranks within participants.
    pub p: Option<f64>,
    /// Whether all orders were counted. Otherwise p is (b + 1)/(B + 1), with b of B = [`DRAWS`] random orders whose W is at least
    /// as large.
    pub exact: bool,
    /// The smallest p that so many participants could have without ties.
    pub smallest_p: f64,
}

/// The smallest p of W that participants can have who rank so many items without ties: that of equal orders.
///
/// ```
/// # use study_stats::ranking::smallest_p;
/// assert!((smallest_p(3, 2) - 1.0 / 6.0).abs() < 1e-15);
/// ```
pub fn smallest_p(items: usize, participants: usize) -> f64 {
    let orders: f64 = (1..=items).map(|i| i as f64).product();
    let others = participants.saturating_sub(1);
    orders.powi(-i32::try_from(others).unwrap_or(i32::MAX))
}

/// Kendall's W of rows with the ranks of a participant each, of which only the order counts. If items do not differ,
/// all orders of the ranks of a participant are equally likely. `None` with fewer than two participants or items.
///
/// ```
/// # use study_stats::{random::SplitMix64, ranking::concordance};
/// let rows = [[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 2.5, 2.5]];
/// let found = concordance(&rows, &mut SplitMix64::new(1)).unwrap();
/// assert!(found.exact && found.friedman.kendall_w.unwrap() > 0.9);
/// ```
pub fn concordance<R: AsRef<[f64]>>(
    rows: &[R],
    random: &mut impl RandomSource,
) -> Option<Concordance> {
    let friedman = friedman(rows)?;
    let items = friedman.mean_ranks.len();
    let smallest = smallest_p(items, rows.len());
    let exact = friedman.exact_p.is_some();
    let mut drawn = || {
        let mut ranks: Vec<Vec<usize>> = (rows.iter())
            .map(|row| doubled_ranks(row.as_ref()))
            .map(|row| {
                row.iter()
                    .map(|r| usize::try_from(*r).unwrap_or(0))
                    .collect()
            })
            .collect();
        let center = rows.len() * (items + 1);
        let spread = |ranks: &[Vec<usize>]| -> usize {
            let sums = (0..items).map(|item| ranks.iter().map(|row| row[item]).sum::<usize>());
            sums.map(|sum| sum.abs_diff(center).pow(2)).sum()
        };
        let observed = spread(&ranks);
        let mut as_large = 1u32;
        for _ in 0..DRAWS {
            ranks.iter_mut().for_each(|row| random.shuffle(row));
            as_large += u32::from(spread(&ranks) >= observed);
        }
        f64::from(as_large) / f64::from(DRAWS + 1)
    };
    let p = match (friedman.exact_p, friedman.chi2) {
        (Some(p), _) => Some(p),
        (None, Some(_)) => Some(drawn()),
        (None, None) => None,
    };
    Some(Concordance {
        friedman,
        p,
        exact,
        smallest_p: match exact {
            true => smallest,
            false => smallest.max(1.0 / f64::from(DRAWS + 1)),
        },
    })
}

#[cfg(test)]
mod tests;
