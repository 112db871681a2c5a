//! How abilities and their differences are judged: over participants.

use crate::analyze::record::{Interval, PairName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::distribution::{normal_quantile, normal_upper, t_quantile, t_two_sided};
use study_stats::paired::holm;
use study_stats::pairs::{Abilities, Difference};
use study_stats::ranking::Beyond;

statistics! {
    /// The difference of two abilities.
    pub struct AbilityDifference {
        /// that of the first less that of the second
        difference: Stat,
        /// standard error
        se: Stat,
        /// by the error over participants, from two participants on; one end only, exact, of what was always above in rankings
        ci95: Interval,
        /// 1/(1 + e^(−difference)): the share of comparisons that the first would win
        preferred: Stat,
        /// standard error by the sandwich over participants, without a factor for small samples
        se_clustered: Option<Stat>,
        /// t over participants: `difference` over √(n/(n−1)) · `se_clustered`, which is at least half of `se`, with n = (Σ h)²/Σ h² participants, h the information of each about the difference; z = `difference`/`se` with one participant
        statistic: Stat as "t",
        /// n less 1, at least 1; none with one participant
        statistic_df: Option<Stat> as "t_df",
        /// of `t`; of the sign test over participants of what was always above in rankings
        p: Stat,
        /// with Holm's correction
        p_holm: Stat,
    }
}

/// The least share of the variance of independent answers that an error over participants may have:
/// so few participants who answer alike by chance do not show that everybody does.
const LEAST_SHARE: f64 = 0.25;

/// How an estimate is judged: by participants, of whom each counts once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judge {
    /// On how many participants it rests; `None` with one.
    participants: Option<f64>,
}

impl Judge {
    /// An estimate that rests on this many of some participants.
    pub(super) fn of(all: usize, participants: f64) -> Self {
        Self {
            participants: (all > 1).then_some(participants),
        }
    }

    /// Degrees of freedom of t, at least 1.
    pub(super) fn df(self) -> Option<f64> {
        self.participants.map(|n| (n - 1.0).max(1.0))
    }

    /// The standard error: with n participants √(n/(n − 1)) times the sandwich, but at most √2 times, and at
    /// least a share of that of independent answers; with one that of independent answers.
    pub(super) fn se(self, independent: f64, clustered: Option<f64>) -> f64 {
        let corrected = self.participants.zip(clustered);
        let corrected = corrected.map(|(n, se)| se * (n / (n - 1.0).max(0.5 * n)).sqrt());
        corrected.map_or(independent, |se| se.max(LEAST_SHARE.sqrt() * independent))
    }

    /// Two-sided p of an estimate: t over participants, z with one.
    pub(super) fn p(self, estimate: f64, se: f64) -> Option<f64> {
        let t = estimate / se;
        match self.df() {
            None => Some(2.0 * normal_upper(t.abs())),
            Some(df) => t_two_sided(t, df),
        }
    }

    /// Its 95 % interval.
    pub(super) fn interval(self, estimate: f64, se: f64) -> Option<(f64, f64)> {
        let quantile = match self.df() {
            None => normal_quantile(0.975),
            Some(df) => t_quantile(0.975, df),
        };
        let half = quantile? * se;
        Some((estimate - half, estimate + half))
    }
}

/// A difference without an end: one item was always above the other.
pub(super) struct Endless {
    /// Whether the first one of the pair was above.
    pub(super) first: bool,
    /// Its bound and its test; `None` if nobody compared the two.
    pub(super) known: Option<Beyond>,
    /// What is said in place of the difference.
    pub(super) why: String,
}

impl Endless {
    fn difference(&self, several: bool) -> AbilityDifference {
        let none = || Stat::missing(self.why.clone());
        let end = self.known.map(|known| known.at_least);
        let bound = |sign: f64| Stat::or(end.map(|x| sign * x), self.why.clone());
        let (lo, hi) = match self.first {
            true => (bound(1.0), none()),
            false => (none(), bound(-1.0)),
        };
        AbilityDifference {
            difference: none(),
            se: none(),
            ci95: Interval { lo, hi },
            preferred: none(),
            se_clustered: several.then(none),
            statistic: none(),
            statistic_df: several.then(none),
            p: Stat::or(self.known.map(|known| known.p), self.why.clone()),
            p_holm: none(),
        }
    }
}

/// The differences of all pairs of items, with Holm's correction; `why` there are none. `endless` says which pairs of
/// items have no finite difference.
pub(super) fn differences(
    items: &[&str],
    found: Option<&Abilities>,
    endless: impl Fn(usize, usize) -> Option<Endless>,
    (people, why): (usize, &str),
) -> BTreeMap<PairName, AbilityDifference> {
    let stat = |x: Option<f64>| Stat::or(x, why.to_owned());
    let pairs: Vec<(usize, usize)> = (0..items.len())
        .flat_map(|a| (a + 1..items.len()).map(move |b| (a, b)))
        .collect();
    let without_end: Vec<Option<Endless>> = pairs.iter().map(|(a, b)| endless(*a, *b)).collect();
    let differences: Vec<_> = (pairs.iter().zip(&without_end))
        .map(|((a, b), endless)| {
            let found = found.filter(|_| endless.is_none());
            found.map(|f| f.difference(*a, *b))
        })
        .collect();
    let se = |d: &Difference| {
        Judge::of(people, d.participants).se(d.effect.se, d.clustered.map(|e| e.se))
    };
    let p: Vec<Option<f64>> = (differences.iter().zip(&without_end))
        .map(|(d, endless)| match (d, endless) {
            (Some(d), _) => Judge::of(people, d.participants).p(d.effect.estimate, se(d)),
            (None, Some(endless)) => endless.known.map(|known| known.p),
            (None, None) => None,
        })
        .collect();
    let p_holm = holm(&p);
    let of_pair = |(k, (a, b)): (usize, &(usize, usize))| {
        if let Some(endless) = &without_end[k] {
            let found = AbilityDifference {
                p_holm: Stat::or(p_holm[k], endless.why.clone()),
                ..endless.difference(people > 1)
            };
            return (PairName::of(items[*a], items[*b]), found);
        }
        let difference = differences[k].as_ref();
        let deciding = difference.map(|d| (d.effect.estimate, se(d)));
        let interval = difference
            .and_then(|d| Judge::of(people, d.participants).interval(d.effect.estimate, se(d)));
        let clustered = difference.and_then(|d| d.clustered);
        let found = AbilityDifference {
            difference: stat(difference.map(|d| d.effect.estimate)),
            se: stat(difference.map(|d| d.effect.se)),
            ci95: Interval::or(interval, why.to_owned()),
            statistic: stat(deciding.map(|(d, se)| d / se)),
            statistic_df: (people > 1)
                .then(|| stat(difference.and_then(|d| Judge::of(people, d.participants).df()))),
            preferred: stat(difference.map(|d| d.preferred)),
            se_clustered: (people > 1).then(|| stat(clustered.map(|e| e.se))),
            p: stat(p[k]),
            p_holm: stat(p_holm[k]),
        };
        (PairName::of(items[*a], items[*b]), found)
    };
    pairs.iter().enumerate().map(of_pair).collect()
}

/// The 95 % interval of an ability, by the error over participants, from two of them on.
pub(super) fn interval_of(found: &Abilities, item: usize, people: usize) -> Option<(f64, f64)> {
    let judge = Judge::of(people, found.participants_of(item));
    let se = judge.se(found.ses[item], found.clustered_se(item));
    judge.interval(found.abilities[item], se)
}
