//! Whether the groups change alike from session to session: `groups_sessions/…`.

use super::{Common, interaction};
use crate::analyze::psychophysics::over_participants::{Contrast, FTest};
use crate::analyze::record::{Interval, PairName, Stat, statistics};
use std::collections::{BTreeMap, BTreeSet};
use study_stats::between;
use study_stats::describe::mean;
use study_stats::paired::holm;

statistics! {
    /// The interaction of group and session, of each participant's mean in each session over the conditions that all groups have in all of the sessions, in an analysis of variance between and within participants.
    pub struct Courses {
        /// number of sessions
        n_sessions: Stat,
        /// conditions that all groups have in all of them
        n_conditions: Stat,
        /// number of participants
        n: Stat,
        /// of the interaction
        test: FTest as "",
        /// Greenhouse and Geisser's ε from the covariance within groups
        eps_gg: Stat,
        /// p with their correction, which decides
        p_gg: Stat,
        /// by pair of groups: the change from the first session to the last of the first group less that of the second, by Student's t; of ratios the ratio of the changes
        changes: BTreeMap<PairName, Contrast> as "",
    }
}

/// The conditions that all groups have in a session.
fn conditions<'a>(common: &Common<'a>, session: &str) -> BTreeSet<&'a str> {
    let own = (common.cells.iter()).filter(|(_, of)| *of == Some(session));
    own.map(|(condition, _)| *condition).collect()
}

/// Nothing of one group or one session, or if no condition is in all sessions. `sessions` are in the
/// order of the protocol.
pub(super) fn courses(common: &Common<'_>, sessions: &[&str], ratios: bool) -> Option<Courses> {
    let present: Vec<&str> = (sessions.iter().copied())
        .filter(|session| !conditions(common, session).is_empty())
        .collect();
    let shared = (present.iter())
        .map(|session| conditions(common, session))
        .reduce(|a, b| &a & &b)
        .unwrap_or_default();
    if present.len() < 2 || common.groups.len() < 2 || shared.is_empty() {
        return None;
    }
    let of_sessions = |row: &Vec<f64>| -> Vec<f64> {
        let of = |session: &&str| {
            let own = (common.cells.iter().zip(row))
                .filter(|((condition, of), _)| *of == Some(*session) && shared.contains(condition));
            mean(&own.map(|(_, x)| *x).collect::<Vec<_>>())
        };
        present.iter().filter_map(of).collect()
    };
    let rows: Vec<Vec<Vec<f64>>> = (common.groups.values())
        .map(|group| group.iter().map(of_sessions).collect())
        .collect();
    let why = "too few participants have all that the groups have in common";
    let found = interaction(&rows, why);
    Some(Courses {
        n_sessions: Stat::count(present.len()),
        n_conditions: Stat::count(shared.len()),
        n: found.n,
        test: found.test,
        eps_gg: found.eps_gg,
        p_gg: found.p_gg,
        changes: changes(common, &rows, ratios),
    })
}

/// By how much more each group changes than each other one.
fn changes(
    common: &Common<'_>,
    rows: &[Vec<Vec<f64>>],
    ratios: bool,
) -> BTreeMap<PairName, Contrast> {
    let of_row = |row: &Vec<f64>| Some(row.last()? - row.first()?);
    let of_groups: Vec<(&str, Vec<f64>)> = (common.groups.keys().zip(rows))
        .map(|(name, rows)| (*name, rows.iter().filter_map(of_row).collect()))
        .collect();
    let mut found = Vec::new();
    for (i, (first, own)) in of_groups.iter().enumerate() {
        for (second, other) in &of_groups[i + 1..] {
            let name = PairName::of(first, second);
            found.push((name, between::difference(own, other)));
        }
    }
    let p: Vec<Option<f64>> = found.iter().map(|(_, d)| d.and_then(|d| d.p)).collect();
    let why = "a group has too few participants, or all of them change alike";
    let stat = |x: Option<f64>| Stat::or(x, why);
    let shown = |x: f64| if ratios { libm::exp(x) } else { x };
    let contrast = |((name, d), p_holm): ((PairName, Option<between::Difference>), Option<f64>)| {
        let estimate = d.map(|d| shown(d.difference));
        let of = Contrast {
            ratio: ratios.then(|| stat(estimate)),
            difference: (!ratios).then(|| stat(estimate)),
            ci95: Interval::or(d.map(|d| (shown(d.ci95.0), shown(d.ci95.1))), why),
            t: stat(d.map(|d| d.t)),
            df: stat(d.map(|d| d.df)),
            p: stat(d.and_then(|d| d.p)),
            p_holm: stat(p_holm),
            hedges_g: Some(stat(d.and_then(|d| d.hedges_g))),
        };
        (name, of)
    };
    found.into_iter().zip(holm(&p)).map(contrast).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{again, tests};
    use super::*;
    use crate::analyze::psychophysics::over_participants::Measured;
    use crate::analyze::record::{Field as _, Number as _};

    /// SciPy's t test of two samples, of the changes 1, 0.5, 1 and 0.5, 1.5, 1 of the two groups, whose t² is F; its
    /// interval, and g by the gamma function. R 4.2.2 has the same F and p by
    /// `anova(lm(y ~ group), lm(y ~ 1), X = ~1, test = "Spherical")`.
    const REFERENCE: [(&str, f64); 10] = [
        ("groups_sessions/F", 0.25),
        ("groups_sessions/df1", 1.0),
        ("groups_sessions/df2", 4.0),
        ("groups_sessions/p_gg", 0.643_329_963_181_863_5),
        ("groups_sessions/n", 6.0),
        ("groups_sessions/x|y/difference", -0.166_666_666_666_666_63),
        ("groups_sessions/x|y/ci95_lo", -1.092_148_368_399_264_3),
        ("groups_sessions/x|y/ci95_hi", 0.758_815_035_065_931_2),
        ("groups_sessions/x|y/hedges_g", -0.325_735_007_935_279_93),
        ("groups_sessions/x|y/p_holm", 0.643_329_963_181_863_5),
    ];

    fn is_close(values: &crate::analyze::Values, id: &str, expected: f64) {
        let found = values.number(id).unwrap_or(f64::NAN);
        assert!((found / expected - 1.0).abs() < 1e-9, "{id}: {found}");
    }

    #[test]
    fn groups_by_sessions_are_the_interaction_of_other_programs() {
        let rows = tests::measured(&tests::ROWS);
        let values = again(&rows, &["one", "two"], false).values();
        for (id, expected) in REFERENCE {
            is_close(&values, id, expected);
        }
        // The order of the sessions is that of the protocol, not of their names.
        let turned = again(&rows, &["two", "one"], false).values();
        is_close(&turned, "groups_sessions/x|y/difference", 1.0 / 6.0);
        is_close(&turned, "groups_sessions/F", 0.25);
    }

    /// A condition of one session only, and who missed a session, do not count.
    #[test]
    fn sessions_are_compared_over_what_all_of_them_have() {
        let mut rows = tests::measured(&tests::ROWS);
        let extra = |who: &str, group: &str, session: &str, condition: &str, value: f64| Measured {
            participant: who.to_owned(),
            group: Some(group.to_owned()),
            session: Some(session.to_owned()),
            condition: condition.to_owned(),
            value,
        };
        for (who, group) in ["A", "B", "C", "D", "E", "F"]
            .into_iter()
            .zip(["x", "x", "x", "y", "y", "y"])
        {
            rows.push(extra(who, group, "two", "only-two", 100.0));
        }
        rows.push(extra("G", "x", "one", "c", 900.0));
        let values = again(&rows, &["one", "two"], false).values();
        for (id, expected) in REFERENCE {
            is_close(&values, id, expected);
        }
        assert_eq!(values.number("groups_sessions/n_conditions"), Some(1.0));
    }

    #[test]
    fn without_a_second_group_or_session_nothing_is_tested() {
        let rows = tests::measured(&tests::ROWS);
        assert_eq!(again(&rows, &["one"], false).groups_sessions, None);
        let one_group: Vec<Measured> = rows[..6].to_vec();
        assert_eq!(
            again(&one_group, &["one", "two"], false).groups_sessions,
            None
        );
    }

    /// Of ratios the change of one group is so many times that of the other.
    #[test]
    fn changes_of_ratios_are_ratios() {
        let rows = tests::measured(&tests::ROWS);
        let found = again(&rows, &["one", "two"], true).groups_sessions.unwrap();
        let (name, ratio) = found.changes[&PairName::of("x", "y")].estimate();
        // Geometric means of second/first: x of 3/2, 4.5/4 and 4/3; y of 5.5/5, 7.5/6 and 5/4.
        let x = (1.5f64 * 1.125 * (4.0 / 3.0)).cbrt();
        let y = (1.1f64 * 1.25 * 1.25).cbrt();
        assert_eq!(name, "ratio");
        assert!((ratio.unwrap() / (x / y) - 1.0).abs() < 1e-12, "{ratio:?}");
    }

    /// With one participant in each group nothing tells how much a group varies.
    #[test]
    fn what_cannot_be_tested_has_a_reason() {
        let rows = tests::measured(&[
            tests::ROWS[0],
            tests::ROWS[1],
            tests::ROWS[6],
            tests::ROWS[7],
        ]);
        let found = again(&rows, &["one", "two"], false)
            .groups_sessions
            .unwrap();
        assert!(found.p_gg.reason().is_some() && found.test.f.number().is_none());
        let change = &found.changes[&PairName::of("x", "y")];
        assert!(change.p.reason().unwrap().contains("too few"));
    }
}
