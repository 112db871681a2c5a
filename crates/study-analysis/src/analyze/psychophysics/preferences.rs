//! Paired preferences: `pairs/…`.

use crate::analyze::identifiers::{group_id, pair_id};
use crate::analyze::values::Values;
use std::collections::BTreeSet;
use study_stats::distribution::normal_quantile;
use study_stats::paired::holm;
use study_stats::pairs::{
    Comparison, Difference, Link, Model, NoAbilities, abilities, circular_triads,
};

/// The fewest participants whose clustered standard error is used.
pub(super) const ENOUGH_CLUSTERS: usize = 10;

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
pub fn preferences(rows: &[Preference], ties: bool, order: bool) -> Values {
    let mut values = Values::default();
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
    // The clustered error, where there are enough participants for one.
    let enough = people.len() >= ENOUGH_CLUSTERS;
    let quantile = normal_quantile(0.975).unwrap_or(f64::NAN);
    let around = |x: f64, se: f64| (x - quantile * se, x + quantile * se);
    for (i, item) in items.iter().enumerate() {
        let mut group = values.group("pairs", why.as_str());
        let id = |name: &str| group_id(name, &[item]);
        group.maybe(&id("ability"), found.map(|f| f.abilities[i]));
        group.maybe(&id("ability_se"), found.map(|f| f.ses[i]));
        let interval = found.map(|f| {
            let clustered = f.clustered_se(i).filter(|_| enough);
            around(f.abilities[i], clustered.unwrap_or(f.ses[i]))
        });
        group.maybe(&id("ability_ci95_lo"), interval.map(|e| e.0));
        group.maybe(&id("ability_ci95_hi"), interval.map(|e| e.1));
    }
    let mut group = values.group("pairs", why.as_str());
    if order {
        let effect = found.and_then(|f| f.order);
        group.maybe("order", effect.map(|e| e.estimate));
        group.maybe("order_se", effect.map(|e| e.se));
        group.maybe("order_p", effect.map(|e| e.p));
    }
    if ties {
        let why = if why.is_empty() {
            "there are no ties"
        } else {
            &why
        };
        let tie = found.and_then(|f| f.tie);
        group.put_or("tie_log_nu", tie.map(|e| e.estimate), why);
        group.put_or("tie_log_nu_se", tie.map(|e| e.se), why);
    } else {
        let tied = comparisons.iter().map(|c| c.tied).sum();
        group.put("ties_left_out", tied);
    }
    group.maybe("deviance", found.map(|f| f.deviance));
    group.maybe("df", found.map(|f| f.df as f64));
    if let Some(fit) = found {
        let ranks = fit.ranks().into_iter().map(|r| r as f64).collect();
        group.list("rank", ranks);
    }
    let pairs: Vec<(usize, usize)> = (0..items.len())
        .flat_map(|a| (a + 1..items.len()).map(move |b| (a, b)))
        .collect();
    let differences: Vec<_> = (pairs.iter())
        .map(|(a, b)| found.map(|f| f.difference(*a, *b)))
        .collect();
    let deciding = |d: &Difference| d.clustered.filter(|_| enough).unwrap_or(d.effect);
    let p: Vec<Option<f64>> = (differences.iter())
        .map(|d| d.as_ref().map(|d| deciding(d).p))
        .collect();
    for (((a, b), difference), (p, p_holm)) in
        pairs.iter().zip(&differences).zip(p.iter().zip(holm(&p)))
    {
        let mut group = values.group(pair_id("pairs", items[*a], items[*b]), why.as_str());
        group.maybe("difference", difference.map(|d| d.effect.estimate));
        group.maybe("se", difference.map(|d| d.effect.se));
        let effect = difference.as_ref().map(deciding);
        group.interval("ci95", effect.map(|e| around(e.estimate, e.se)));
        group.maybe("preferred", difference.map(|d| d.preferred));
        if people.len() > 1 {
            let clustered = difference.and_then(|d| d.clustered);
            group.maybe("se_clustered", clustered.map(|e| e.se));
        }
        group.maybe("p", *p);
        group.maybe("p_holm", p_holm);
    }
    if items.len() > 2 {
        triads(&items, &people, &comparisons, &mut values);
    }
    values
}

/// How consistent each participant is, by what was preferred more often of each pair.
fn triads(items: &[&str], people: &[&str], comparisons: &[Comparison], values: &mut Values) {
    for (cluster, name) in people
        .iter()
        .enumerate()
        .filter(|(_, name)| !name.is_empty())
    {
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
        let mut group = values.group(group_id("pairs/triads", &[name]), why);
        group.maybe("circular", found.map(|f| f.circular));
        group.maybe("consistency", found.map(|f| f.consistency));
    }
}

/// The reason with the names of the items.
fn reason(error: &NoAbilities, items: &[&str]) -> String {
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
        | NoAbilities::NotFound => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Participants who always prefer the same of two, by turns: their answers are not
    /// independent, and the clustered error is larger.
    #[test]
    fn ten_participants_are_enough_for_a_clustered_error() {
        let decides = |people: usize| {
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
            let values = preferences(&rows, false, false);
            let get = |id: &str| values.number(&format!("pairs/a|b/{id}")).unwrap();
            let half = 0.5 * (get("ci95_hi") - get("ci95_lo"));
            assert!(get("se_clustered") > 1.5 * get("se"));
            [get("se"), get("se_clustered")].map(|se| (half / se - 1.96).abs() < 1e-3)
        };
        assert_eq!(decides(9), [true, false]);
        assert_eq!(decides(10), [false, true]);
    }
}
