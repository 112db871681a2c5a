//! What is said beside the findings of groups and sessions.

use super::{PartFinding, PartQuestion};
use crate::analyze::psychophysics::again::Again;
use crate::analyze::record::Number as _;

/// How many times as large as the smallest group the largest one can be until findings say what they rely on.
const MOST_UNEQUAL: f64 = 1.5;

/// Says of the sessions and of the groups that they depend on each other, where that is shown.
pub(super) fn differ_by_group(found: &mut [PartFinding]) {
    let shown = |f: &PartFinding| f.question == PartQuestion::GroupsSessions && f.is_yes();
    if !found.iter().any(shown) {
        return;
    }
    for finding in found.iter_mut().filter(|f| f.reason().is_none()) {
        let over = match finding.question {
            PartQuestion::Groups => "sessions between which the groups change differently",
            PartQuestion::Sessions => "groups that change differently from session to session",
            _ => continue,
        };
        finding.caveat(
            "interaction",
            format!("it is a mean over {over}: the interaction of group and session is shown"),
        );
    }
}

/// Says of the interactions with the group, whose tests take one variance for all groups, that they rely on it, where the
/// groups are of different sizes.
pub(super) fn of_unequal_groups(found: &mut [PartFinding], again: &Again) {
    let groups = again.groups.iter().flat_map(|own| own.groups.values());
    let sizes: Vec<f64> = groups.filter_map(|group| group.n.number()).collect();
    let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let most = sizes.iter().copied().fold(0.0, f64::max);
    if most <= MOST_UNEQUAL * least {
        return;
    }
    for finding in found.iter_mut().filter(|f| f.reason().is_none()) {
        if !matches!(
            finding.question,
            PartQuestion::GroupsConditions | PartQuestion::GroupsSessions
        ) {
            continue;
        }
        finding.caveat(
            "unequal-groups",
            format!(
                "the groups have {least} to {most} participants, and the test relies on their scattering alike: if the smaller ones \
                 scatter more, it says yes too often"
            ),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PartFacts, of_groups_and_sessions};
    use super::*;
    use crate::analyze::psychophysics::again::again;
    use crate::analyze::psychophysics::over_participants::Measured;

    /// The caveats of the interaction of group and session, of two groups of these sizes.
    fn caveats(sizes: [usize; 2]) -> Vec<(&'static str, String)> {
        let mut rows = Vec::new();
        for (group, size) in ["x", "y"].into_iter().zip(sizes) {
            for person in 0..size {
                let level = person as f64;
                let change = (person % 3) as f64 + 0.1 * size as f64;
                for (session, value) in [("one", level), ("two", level + change)] {
                    rows.push(Measured {
                        participant: format!("{group}{person}"),
                        group: Some(group.to_owned()),
                        session: Some(session.to_owned()),
                        condition: "c".to_owned(),
                        value,
                    });
                }
            }
        }
        let facts = PartFacts {
            alpha: 0.05,
            participants: rows.len() / 2,
        };
        let found = of_groups_and_sessions(&facts, &again(&rows, &["one", "two"], false));
        let own = found
            .into_iter()
            .find(|f| f.question == PartQuestion::GroupsSessions)
            .unwrap();
        assert!(own.test.is_some(), "{own:?}");
        let caveats = own.caveats.into_iter();
        caveats.map(|caveat| (caveat.code, caveat.text)).collect()
    }

    #[test]
    fn interactions_with_groups_of_different_sizes_say_what_they_rely_on() {
        assert!(caveats([6, 9]).is_empty());
        let told = caveats([6, 12]);
        assert_eq!((told.len(), told[0].0), (1, "unequal-groups"));
        let begins = "the groups have 6 to 12 participants";
        assert!(told[0].1.starts_with(begins), "{told:?}");
    }
}
