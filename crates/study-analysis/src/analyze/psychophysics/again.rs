//! Groups and repeated sessions: `groups/…`, `groups_conditions/…`, `sessions/…`, `retest/…`.
//!
//! Each participant has one number for each condition and session: a mean rating, a
//! threshold or a sensitivity. Groups are compared over what all of them have, sessions
//! over what all sessions have.

use super::over_participants::{NOT_POSITIVE, Threshold, mixed};
use super::part_data::Measured;
use crate::analyze::identifiers::{group_id, pair_id};
use crate::analyze::values::Values;
use std::collections::{BTreeMap, BTreeSet};
use study_stats::agreement::icc;
use study_stats::between::{self, welch};
use study_stats::describe::{mean, sd};
use study_stats::paired::holm;

/// Condition and session.
type Cell<'a> = (&'a str, Option<&'a str>);

/// The statistics of groups and sessions; of `ratios` over natural logarithms. Sessions are
/// in the order of the protocol.
pub(super) fn again(measured: &[Measured], sessions: &[&str], ratios: bool, values: &mut Values) {
    let logs: Vec<Measured> = (measured.iter())
        .map(|m| Measured {
            value: if ratios { libm::log(m.value) } else { m.value },
            ..m.clone()
        })
        .collect();
    let usable = logs.iter().all(|m| m.value.is_finite());
    if logs.iter().any(|m| m.group.is_some()) {
        between_groups(&logs, ratios, usable, values);
    }
    if sessions.len() > 1 {
        between_sessions(&logs, sessions, ratios, usable, values);
    }
}

/// The numbers of each participant in these cells, in their order; only of those who have all
/// of them.
fn complete<'a>(
    measured: &'a [Measured],
    cells: &BTreeSet<Cell<'_>>,
) -> BTreeMap<&'a str, Vec<f64>> {
    let mut own: BTreeMap<&str, BTreeMap<Cell<'_>, f64>> = BTreeMap::new();
    for m in measured {
        let cell = (m.condition.as_str(), m.session.as_deref());
        if cells.contains(&cell) {
            own.entry(&m.participant).or_default().insert(cell, m.value);
        }
    }
    let complete = own.into_iter().filter(|(_, x)| x.len() == cells.len());
    complete
        .map(|(who, x)| (who, x.into_values().collect()))
        .collect()
}

/// What the groups have in common, and who has all of it.
struct Common<'a> {
    cells: BTreeSet<Cell<'a>>,
    /// Of each group the numbers of its participants in these cells, in their order.
    groups: BTreeMap<&'a str, Vec<Vec<f64>>>,
}

impl<'a> Common<'a> {
    fn of(measured: &'a [Measured]) -> Self {
        let names: BTreeSet<&str> = measured.iter().filter_map(|m| m.group.as_deref()).collect();
        // What somebody of every group has.
        let has = |group: &&'a str| -> BTreeSet<Cell<'a>> {
            let own = measured
                .iter()
                .filter(|m| m.group.as_deref() == Some(group));
            own.map(|m| (m.condition.as_str(), m.session.as_deref()))
                .collect()
        };
        let all = names.iter().map(has).reduce(|a, b| &a & &b);
        let cells = all.unwrap_or_default();
        let group_of: BTreeMap<&str, &str> = (measured.iter())
            .filter_map(|m| Some((m.participant.as_str(), m.group.as_deref()?)))
            .collect();
        let mut groups: BTreeMap<&str, Vec<Vec<f64>>> =
            names.iter().map(|g| (*g, Vec::new())).collect();
        if !cells.is_empty() {
            for (who, row) in complete(measured, &cells) {
                if let Some(own) = group_of.get(who).and_then(|g| groups.get_mut(g)) {
                    own.push(row);
                }
            }
        }
        Self { cells, groups }
    }
}

/// Groups by conditions only, of numbers whose mean over the conditions says nothing of a
/// participant.
pub(super) fn by_condition(measured: &[Measured], values: &mut Values) {
    if measured.iter().any(|m| m.group.is_some()) {
        profiles(&Common::of(measured), values);
    }
}

fn between_groups(measured: &[Measured], ratios: bool, usable: bool, values: &mut Values) {
    let shown = |x: f64| if ratios { libm::exp(x) } else { x };
    let all = Common::of(measured);
    if usable {
        profiles(&all, values);
    }
    let means = |rows: &Vec<Vec<f64>>| -> Vec<f64> {
        let rows = rows.iter().filter(|_| usable);
        rows.filter_map(|row| mean(row)).collect()
    };
    let groups = all.groups.iter().map(|(group, rows)| (*group, means(rows)));
    let groups: BTreeMap<&str, Vec<f64>> = groups.collect();
    let x: Vec<&Vec<f64>> = groups.values().collect();
    let test = welch::one_way(&x);
    let why = if !usable {
        NOT_POSITIVE
    } else if groups.len() < 2 {
        "there is only one group"
    } else if all.cells.is_empty() {
        "the groups have no condition in common"
    } else {
        "a group has fewer than two participants, or they are all alike"
    };
    let mut group = values.group("groups", why);
    group.put("n_cells", all.cells.len() as f64);
    group.maybe("F", test.map(|t| t.f));
    group.maybe("df1", test.map(|t| t.df1));
    group.maybe("df2", test.map(|t| t.df2));
    group.maybe("p", test.and_then(|t| t.p));
    let (center, difference) = match ratios {
        true => ("geometric_mean", "ratio"),
        false => ("mean", "difference"),
    };
    for (name, x) in &groups {
        let mut group = values.group(group_id("groups", &[name]), why);
        group.put("n", x.len() as f64);
        group.maybe(center, mean(x).map(shown));
        group.maybe(if ratios { "geometric_sd" } else { "sd" }, sd(x).map(shown));
    }
    let list: Vec<(&str, &Vec<f64>)> = groups.iter().map(|(name, x)| (*name, x)).collect();
    let pairs: Vec<(usize, usize)> = (0..list.len())
        .flat_map(|a| (a + 1..list.len()).map(move |b| (a, b)))
        .collect();
    let found: Vec<_> = (pairs.iter())
        .map(|(a, b)| welch::difference(list[*a].1, list[*b].1))
        .collect();
    let p: Vec<Option<f64>> = found.iter().map(|d| d.and_then(|d| d.p)).collect();
    for (((a, b), found), (p, p_holm)) in pairs.iter().zip(&found).zip(p.iter().zip(holm(&p))) {
        let mut group = values.group(pair_id("groups", list[*a].0, list[*b].0), why);
        group.maybe(difference, found.map(|d| shown(d.difference)));
        group.interval("ci95", found.map(|d| (shown(d.ci95.0), shown(d.ci95.1))));
        group.maybe("t", found.map(|d| d.t));
        group.maybe("df", found.map(|d| d.df));
        group.maybe("p", *p);
        group.maybe("p_holm", p_holm);
        group.maybe("hedges_g", found.and_then(|d| d.hedges_g));
    }
}

/// Whether what the conditions do depends on the group: the interaction of both, of each
/// participant's means over the sessions. Nothing of one group or one condition.
fn profiles(common: &Common<'_>, values: &mut Values) {
    let conditions: BTreeSet<&str> = common.cells.iter().map(|(c, _)| *c).collect();
    if conditions.len() < 2 || common.groups.len() < 2 {
        return;
    }
    let of_conditions = |row: &Vec<f64>| -> Vec<f64> {
        let of = |condition: &&str| {
            let own = common
                .cells
                .iter()
                .zip(row)
                .filter(|((c, _), _)| c == condition);
            mean(&own.map(|(_, x)| *x).collect::<Vec<_>>())
        };
        conditions.iter().filter_map(of).collect()
    };
    let rows: Vec<Vec<Vec<f64>>> = (common.groups.values())
        .map(|group| group.iter().map(of_conditions).collect())
        .collect();
    // A group without anybody has no profile.
    let found = match rows.iter().any(Vec::is_empty) {
        true => None,
        false => between::profiles(&rows),
    };
    let found = found.as_ref();
    let why = "too few participants have all conditions that the groups have in common";
    let mut group = values.group("groups_conditions", why);
    group.put("n_conditions", conditions.len() as f64);
    group.put("n", rows.iter().map(Vec::len).sum::<usize>() as f64);
    group.maybe("F", found.and_then(|f| f.f));
    group.maybe("df1", found.map(|f| f.df1));
    group.maybe("df2", found.map(|f| f.df2));
    group.maybe("p", found.and_then(|f| f.p));
    group.maybe("eps_gg", found.and_then(|f| f.eps_gg));
    group.maybe("p_gg", found.and_then(|f| f.p_gg));
}

fn between_sessions(
    measured: &[Measured],
    sessions: &[&str],
    ratios: bool,
    usable: bool,
    values: &mut Values,
) {
    // Conditions that every session has; of each participant those of that participant's group.
    let mut own: BTreeMap<&str, BTreeMap<&str, BTreeMap<&str, f64>>> = BTreeMap::new();
    for m in measured {
        if let Some(session) = m.session.as_deref() {
            let by_session = own.entry(&m.participant).or_default();
            by_session
                .entry(session)
                .or_default()
                .insert(&m.condition, m.value);
        }
    }
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut cells: Vec<(&str, &str, f64)> = Vec::new();
    for (who, by_session) in &own {
        let conditions = by_session
            .values()
            .map(|c| c.keys().copied().collect::<BTreeSet<_>>());
        let common = conditions.reduce(|a, b| &a & &b).unwrap_or_default();
        let value = |session: &&str| {
            let found = by_session.get(session)?;
            let all: Vec<f64> = common
                .iter()
                .filter_map(|c| found.get(c).copied())
                .collect();
            mean(&all)
        };
        let by: Vec<Option<f64>> = sessions.iter().map(value).collect();
        let known = sessions.iter().zip(&by);
        cells.extend(known.filter_map(|(session, x)| Some((*who, *session, (*x)?))));
        rows.extend(by.into_iter().collect::<Option<Vec<f64>>>());
    }
    let of_cells: Vec<Threshold<'_>> = (cells.iter())
        .map(|(participant, condition, value)| Threshold {
            participant,
            condition,
            value: if ratios { libm::exp(*value) } else { *value },
        })
        .collect();
    if usable {
        mixed("sessions", &of_cells, ratios, values);
    }
    let found = icc(&rows).filter(|_| usable);
    let why = if usable {
        "fewer than two participants have been to all sessions"
    } else {
        NOT_POSITIVE
    };
    for (name, found) in [
        ("agreement", found.as_ref().and_then(|f| f.icc2)),
        ("consistency", found.as_ref().and_then(|f| f.icc3)),
    ] {
        let mut group = values.group("retest", why);
        group.maybe(&format!("icc_{name}"), found.map(|c| c.value));
        let ci95 = found
            .and_then(|c| c.ci95)
            .and_then(|(low, high)| low.zip(high));
        group.interval(&format!("icc_{name}_ci95"), ci95);
    }
    let mut group = values.group("retest", why);
    group.put("n", rows.len() as f64);
    let sem = found.as_ref().map(|f| f.ms_error.max(0.0).sqrt());
    group.maybe("sem", sem);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(rows: &[(&str, &str, &str, f64)]) -> Vec<Measured> {
        let one = |(participant, group, session, value): &(&str, &str, &str, f64)| Measured {
            participant: (*participant).to_owned(),
            group: Some((*group).to_owned()),
            session: Some((*session).to_owned()),
            condition: "c".to_owned(),
            value: *value,
        };
        rows.iter().map(one).collect()
    }

    const ROWS: [(&str, &str, &str, f64); 12] = [
        ("A", "x", "one", 2.0),
        ("A", "x", "two", 3.0),
        ("B", "x", "one", 4.0),
        ("B", "x", "two", 4.5),
        ("C", "x", "one", 3.0),
        ("C", "x", "two", 4.0),
        ("D", "y", "one", 5.0),
        ("D", "y", "two", 5.5),
        ("E", "y", "one", 6.0),
        ("E", "y", "two", 7.5),
        ("F", "y", "one", 4.0),
        ("F", "y", "two", 5.0),
    ];

    const REFERENCE: [(&str, f64); 16] = [
        ("groups/F", 6.25),
        ("groups/df2", 3.7467216185837),
        ("groups/p", 0.070979117624854),
        ("groups/x/mean", 3.4166666666667),
        ("groups/x/sd", 0.87797114607106),
        ("groups/x|y/t", -2.5),
        ("groups/x|y/ci95_lo", -4.46004597747841),
        ("groups/x|y/p_holm", 0.070979117624854),
        ("sessions/F", 35.58823529),
        ("sessions/df2", 5.0),
        ("sessions/p", 0.0018942471146),
        ("sessions/one|two/difference", -0.91666666666667),
        ("sessions/one|two/ci95_hi", -0.52167344142069),
        ("retest/icc_agreement", 0.81421647819063),
        ("retest/icc_consistency", 0.96737044145873),
        ("retest/sem", 0.26614532371119),
    ];

    /// R 4.2.2: t.test of the participants' means; paired t.test of the sessions and
    /// lmer(v ~ s + (1|p)); ICC(2,1) and ICC(3,1) from anova(lm(v ~ p + s)).
    #[test]
    fn groups_and_sessions_are_those_of_r() {
        let mut values = Values::default();
        again(&measured(&ROWS), &["one", "two"], false, &mut values);
        for (id, expected) in REFERENCE {
            let found = values.number(id).unwrap_or(f64::NAN);
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{id}: {found} {expected}"
            );
        }
    }

    #[test]
    fn groups_are_compared_over_what_all_of_them_have() {
        let mut rows = measured(&ROWS);
        // A condition of one group only would shift its mean.
        rows.extend(measured(&ROWS[..6]).into_iter().map(|m| Measured {
            condition: "only-x".to_owned(),
            value: 100.0,
            ..m
        }));
        let (mut with, mut without) = (Values::default(), Values::default());
        again(&rows, &[], false, &mut with);
        again(&measured(&ROWS), &[], false, &mut without);
        for id in [
            "groups/F",
            "groups/p",
            "groups/x/mean",
            "groups/x|y/difference",
        ] {
            assert!(without.number(id).is_some(), "{id}");
            assert_eq!(with.number(id), without.number(id), "{id}");
        }
    }

    /// Of the ratings below. R 4.2.2: F and p of aov(v ~ g * c + Error(p / c)); ε from the
    /// covariance of orthonormal contrasts, pooled within groups.
    const INTERACTION: [(&str, f64); 6] = [
        ("F", 14.682926829268),
        ("df1", 2.0),
        ("df2", 8.0),
        ("p", 0.00210116575328025),
        ("eps_gg", 0.85200202736949),
        ("p_gg", 0.003965799811631),
    ];

    #[test]
    fn groups_by_conditions_are_the_interaction_of_r() {
        const RATINGS: [(&str, &str, [f64; 3]); 6] = [
            ("A", "x", [2.0, 4.0, 5.5]),
            ("B", "x", [3.0, 4.5, 6.0]),
            ("C", "x", [2.5, 5.0, 7.0]),
            ("D", "y", [4.0, 4.5, 4.0]),
            ("E", "y", [5.0, 4.0, 5.5]),
            ("F", "y", [4.5, 5.5, 5.0]),
        ];
        let rows = RATINGS.iter().flat_map(|(participant, group, ratings)| {
            let one = |(condition, value): (&str, &f64)| Measured {
                participant: (*participant).to_owned(),
                group: Some((*group).to_owned()),
                session: None,
                condition: condition.to_owned(),
                value: *value,
            };
            let all = ["c1", "c2", "c3"].into_iter().zip(ratings).map(one);
            all.collect::<Vec<_>>()
        });
        let rows: Vec<Measured> = rows.collect();
        let mut values = Values::default();
        again(&rows, &[], false, &mut values);
        for (id, expected) in INTERACTION {
            let id = format!("groups_conditions/{id}");
            let found = values.number(&id).unwrap_or(f64::NAN);
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{id}: {found} {expected}"
            );
        }
        // Nothing without a second condition.
        let mut values = Values::default();
        again(&rows[..1], &[], false, &mut values);
        assert_eq!(values.get("groups_conditions/F"), None);
    }

    /// By condition, what the participants differ by in all conditions does not matter.
    #[test]
    fn groups_by_conditions_do_not_depend_on_the_level_of_a_participant() {
        let row = |who: &str, group: &str, condition: &str, value| Measured {
            participant: who.to_owned(),
            group: Some(group.to_owned()),
            session: None,
            condition: condition.to_owned(),
            value,
        };
        let own = [
            ("A", "x", [0.2, 0.8]),
            ("B", "x", [0.3, 0.7]),
            ("C", "y", [0.6, 0.4]),
            ("D", "y", [0.9, 0.1]),
        ];
        let of = |shift: f64| {
            let rows = own.iter().enumerate().flat_map(|(i, (who, group, x))| {
                let up = shift * i as f64;
                [
                    row(who, group, "a", x[0] + up),
                    row(who, group, "b", x[1] + up),
                ]
            });
            let mut values = Values::default();
            by_condition(&rows.collect::<Vec<_>>(), &mut values);
            assert!(
                values
                    .iter()
                    .all(|(id, _)| id.starts_with("groups_conditions/"))
            );
            values.number("groups_conditions/F").unwrap()
        };
        // t² of the differences -.6, -.4 against .2, .8 with 2 degrees of freedom.
        assert!((of(0.0) - 10.0).abs() < 1e-9, "{}", of(0.0));
        assert!((of(5.0) - 10.0).abs() < 1e-9);
    }

    #[test]
    fn thresholds_are_compared_as_ratios() {
        let mut values = Values::default();
        again(&measured(&ROWS), &["one", "two"], true, &mut values);
        let number = |id: &str| values.number(id).unwrap();
        let ratio = number("groups/x/geometric_mean") / number("groups/y/geometric_mean");
        assert!((number("groups/x|y/ratio") - ratio).abs() < 1e-12);
        assert!(number("sessions/one|two/ratio") < 1.0);
        let mut rows = measured(&ROWS);
        rows[0].value = 0.0;
        let mut values = Values::default();
        again(&rows, &["one", "two"], true, &mut values);
        assert_eq!(values.reason("groups/p"), Some(NOT_POSITIVE));
        assert_eq!(values.reason("retest/icc_agreement"), Some(NOT_POSITIVE));
    }
}
