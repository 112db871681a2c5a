//! Groups and repeated sessions: `groups/…`, `groups_conditions/…`, `sessions/…`, `groups_sessions/…`,
//! `retest/…`.
//!
//! Each participant has one number for each condition and session: a mean rating, a
//! threshold or a sensitivity. Groups are compared over what all of them have, sessions
//! over what all sessions have.

mod courses;

pub use courses::Courses;

use super::over_participants::{
    Center, ConditionModel, Contrast, FTest, Measured, NOT_POSITIVE, Threshold, mixed,
};
use crate::analyze::keys::GroupName;
use crate::analyze::record::{Interval, PairName, Stat, statistics};
use courses::courses;
use std::collections::{BTreeMap, BTreeSet};
use study_stats::agreement::icc;
use study_stats::between::{self, welch};
use study_stats::describe::{mean, sd};
use study_stats::paired::holm;

statistics! {
    /// Welch's (1951) analysis of variance of the participants' means over what all groups have.
    pub struct Groups {
        /// conditions and sessions that all groups have
        n_cells: Stat,
        /// whether groups differ
        test: FTest as "",
        /// by group
        groups: BTreeMap<GroupName, Center> as "",
        /// by pair of groups
        pairs: BTreeMap<PairName, Contrast> as "",
    }

    /// The interaction of group and condition over what all groups have, in an analysis of variance between and within participants.
    pub struct Profiles {
        /// number of conditions
        n_conditions: Stat,
        /// number of participants
        n: Stat,
        /// of the interaction
        test: FTest as "",
        /// Greenhouse and Geisser's ε from the covariance within groups
        eps_gg: Stat,
        /// p with their correction, which decides
        p_gg: Stat,
    }

    /// How alike the sessions are (Shrout & Fleiss 1979).
    pub struct Retest {
        /// ICC(A,1)
        icc_agreement: Stat,
        /// of ICC(A,1)
        icc_agreement_ci95: Interval,
        /// ICC(C,1)
        icc_consistency: Stat,
        /// of ICC(C,1)
        icc_consistency_ci95: Interval,
        /// participants who came to all sessions
        n: Stat,
        /// √(residual mean square)
        sem: Stat,
    }

    /// Groups and sessions.
    pub struct Again {
        /// whether groups differ
        groups: Option<Groups>,
        /// whether what the conditions do depends on the group
        groups_conditions: Option<Profiles>,
        /// whether sessions differ, over what a participant has in all of their sessions
        sessions: Option<ConditionModel>,
        /// how alike they are
        retest: Option<Retest>,
        /// whether the groups change differently from session to session
        groups_sessions: Option<Courses>,
    }
}

/// Condition and session.
type Cell<'a> = (&'a str, Option<&'a str>);

/// The statistics of groups and sessions; of `ratios` over natural logarithms. Sessions are
/// in the order of the protocol.
pub(super) fn again(measured: &[Measured], sessions: &[&str], ratios: bool) -> Again {
    let logs: Vec<Measured> = (measured.iter())
        .map(|m| Measured {
            value: if ratios { libm::log(m.value) } else { m.value },
            ..m.clone()
        })
        .collect();
    let usable = logs.iter().all(|m| m.value.is_finite());
    let common = have_groups(&logs).then(|| Common::of(&logs));
    let compared = common.as_ref().filter(|_| usable);
    let (of_sessions, retest) = match sessions.len() > 1 {
        true => between_sessions(&logs, sessions, ratios, usable),
        false => (None, None),
    };
    Again {
        groups: (common.as_ref()).map(|common| between_groups(common, ratios, usable)),
        groups_conditions: compared.and_then(profiles),
        sessions: of_sessions,
        retest,
        groups_sessions: compared.and_then(|common| courses(common, sessions, ratios)),
    }
}

fn have_groups(measured: &[Measured]) -> bool {
    measured.iter().any(|m| m.group.is_some())
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
pub(super) fn by_condition(measured: &[Measured]) -> Again {
    let common = have_groups(measured).then(|| Common::of(measured));
    Again {
        groups_conditions: common.and_then(|common| profiles(&common)),
        ..Again::undefined("")
    }
}

fn between_groups(all: &Common<'_>, ratios: bool, usable: bool) -> Groups {
    let shown = |x: f64| if ratios { libm::exp(x) } else { x };
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
    let stat = |x: Option<f64>| Stat::or(x, why);
    let of_ratios = |x: Option<f64>| ratios.then(|| stat(x));
    let of_differences = |x: Option<f64>| (!ratios).then(|| stat(x));
    let centers = groups.iter().map(|(name, x)| {
        let (mean, sd) = (mean(x).map(shown), sd(x).map(shown));
        let center = Center {
            n: Some(Stat::count(x.len())),
            geometric_mean: of_ratios(mean),
            mean: of_differences(mean),
            geometric_sd: of_ratios(sd),
            sd: of_differences(sd),
            ci95: None,
        };
        ((*name).into(), center)
    });
    let list: Vec<(&str, &Vec<f64>)> = groups.iter().map(|(name, x)| (*name, x)).collect();
    let pairs: Vec<(usize, usize)> = (0..list.len())
        .flat_map(|a| (a + 1..list.len()).map(move |b| (a, b)))
        .collect();
    let found: Vec<_> = (pairs.iter())
        .map(|(a, b)| welch::difference(list[*a].1, list[*b].1))
        .collect();
    let p: Vec<Option<f64>> = found.iter().map(|d| d.and_then(|d| d.p)).collect();
    let p_holm = holm(&p);
    let contrasts = pairs.iter().enumerate().map(|(k, (a, b))| {
        let found = found[k];
        let estimate = found.map(|d| shown(d.difference));
        let ends = found.map(|d| (shown(d.ci95.0), shown(d.ci95.1)));
        let contrast = Contrast {
            ratio: of_ratios(estimate),
            difference: of_differences(estimate),
            ci95: Interval::or(ends, why),
            t: stat(found.map(|d| d.t)),
            df: stat(found.map(|d| d.df)),
            p: stat(p[k]),
            p_holm: stat(p_holm[k]),
            hedges_g: Some(stat(found.and_then(|d| d.hedges_g))),
        };
        (PairName::of(list[*a].0, list[*b].0), contrast)
    });
    Groups {
        n_cells: Stat::count(all.cells.len()),
        test: FTest {
            f: stat(test.map(|t| t.f)),
            df1: stat(test.map(|t| t.df1)),
            df2: stat(test.map(|t| t.df2)),
            p: stat(test.and_then(|t| t.p)),
        },
        groups: centers.collect(),
        pairs: contrasts.collect(),
    }
}

/// Whether what the conditions do depends on the group: the interaction of both, of each
/// participant's means over the sessions. Nothing of one group or one condition.
fn profiles(common: &Common<'_>) -> Option<Profiles> {
    let conditions: BTreeSet<&str> = common.cells.iter().map(|(c, _)| *c).collect();
    if conditions.len() < 2 || common.groups.len() < 2 {
        return None;
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
    let why = "too few participants have all conditions that the groups have in common";
    let found = interaction(&rows, why);
    Some(Profiles {
        n_conditions: Stat::count(conditions.len()),
        n: found.n,
        test: found.test,
        eps_gg: found.eps_gg,
        p_gg: found.p_gg,
    })
}

/// An interaction with the group.
struct Interaction {
    /// Participants.
    n: Stat,
    test: FTest,
    eps_gg: Stat,
    p_gg: Stat,
}

/// The interaction of the group and what the columns are, of the rows of each group.
fn interaction(rows: &[Vec<Vec<f64>>], why: &'static str) -> Interaction {
    // A group without anybody has no profile.
    let found = match rows.iter().any(Vec::is_empty) {
        true => None,
        false => between::profiles(rows),
    };
    let found = found.as_ref();
    let stat = |x: Option<f64>| Stat::or(x, why);
    Interaction {
        n: Stat::count(rows.iter().map(Vec::len).sum()),
        test: FTest {
            f: stat(found.and_then(|f| f.f)),
            df1: stat(found.map(|f| f.df1)),
            df2: stat(found.map(|f| f.df2)),
            p: stat(found.and_then(|f| f.p)),
        },
        eps_gg: stat(found.and_then(|f| f.eps_gg)),
        p_gg: stat(found.and_then(|f| f.p_gg)),
    }
}

fn between_sessions(
    measured: &[Measured],
    sessions: &[&str],
    ratios: bool,
    usable: bool,
) -> (Option<ConditionModel>, Option<Retest>) {
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
    let found = icc(&rows).filter(|_| usable);
    let why = if usable {
        "fewer than two participants have been to all sessions"
    } else {
        NOT_POSITIVE
    };
    let ends =
        |c: study_stats::agreement::Coefficient| c.ci95.and_then(|(low, high)| low.zip(high));
    let [icc2, icc3] = [
        found.as_ref().and_then(|f| f.icc2),
        found.as_ref().and_then(|f| f.icc3),
    ];
    let sem = found.as_ref().map(|f| f.ms_error.max(0.0).sqrt());
    let retest = Retest {
        icc_agreement: Stat::or(icc2.map(|c| c.value), why),
        icc_agreement_ci95: Interval::or(icc2.and_then(ends), why),
        icc_consistency: Stat::or(icc3.map(|c| c.value), why),
        icc_consistency_ci95: Interval::or(icc3.and_then(ends), why),
        n: Stat::count(rows.len()),
        sem: Stat::or(sem, why),
    };
    let model = usable.then(|| mixed(&of_cells, ratios)).flatten();
    (model, Some(retest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::{Field as _, Number as _};

    pub(super) fn measured(rows: &[(&str, &str, &str, f64)]) -> Vec<Measured> {
        let one = |(participant, group, session, value): &(&str, &str, &str, f64)| Measured {
            participant: (*participant).to_owned(),
            group: Some((*group).to_owned()),
            session: Some((*session).to_owned()),
            condition: "c".to_owned(),
            value: *value,
        };
        rows.iter().map(one).collect()
    }

    pub(super) const ROWS: [(&str, &str, &str, f64); 12] = [
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
        let values = again(&measured(&ROWS), &["one", "two"], false).values();
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
        let with = again(&rows, &[], false).values();
        let without = again(&measured(&ROWS), &[], false).values();
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
        let values = again(&rows, &[], false).values();
        for (id, expected) in INTERACTION {
            let id = format!("groups_conditions/{id}");
            let found = values.number(&id).unwrap_or(f64::NAN);
            assert!(
                (found / expected - 1.0).abs() < 1e-6,
                "{id}: {found} {expected}"
            );
        }
        // Nothing without a second condition.
        assert_eq!(again(&rows[..1], &[], false).groups_conditions, None);
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
            let found = by_condition(&rows.collect::<Vec<_>>());
            assert_eq!((found.groups, found.sessions), (None, None));
            found.groups_conditions.unwrap().test.f.number().unwrap()
        };
        // t² of the differences -.6, -.4 against .2, .8 with 2 degrees of freedom.
        assert!((of(0.0) - 10.0).abs() < 1e-9, "{}", of(0.0));
        assert!((of(5.0) - 10.0).abs() < 1e-9);
    }

    #[test]
    fn thresholds_are_compared_as_ratios() {
        let found = again(&measured(&ROWS), &["one", "two"], true);
        let (groups, sessions) = (found.groups.unwrap(), found.sessions.unwrap());
        let ratio = groups.groups["x"].mean().unwrap() / groups.groups["y"].mean().unwrap();
        let (name, of_groups) = groups.pairs[&PairName::of("x", "y")].estimate();
        assert_eq!(name, "ratio");
        assert!((of_groups.unwrap() - ratio).abs() < 1e-12);
        let (_, of_sessions) = sessions.pairs[&PairName::of("one", "two")].estimate();
        assert!(of_sessions.unwrap() < 1.0);
        let mut rows = measured(&ROWS);
        rows[0].value = 0.0;
        let found = again(&rows, &["one", "two"], true);
        assert_eq!(found.groups.unwrap().test.p.reason(), Some(NOT_POSITIVE));
        let retest = found.retest.unwrap();
        assert_eq!(retest.icc_agreement.reason(), Some(NOT_POSITIVE));
    }
}
