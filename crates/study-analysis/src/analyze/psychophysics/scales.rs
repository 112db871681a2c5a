//! Magnitude estimation, `magnitude/…`, and ratings with hidden reference and anchors,
//! `mushra/…`.

use super::over_participants::{Threshold, mixed};
use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use std::collections::{BTreeMap, BTreeSet};
use study_stats::magnitude::{Estimate, Magnitude, magnitude as estimate};
use study_stats::mushra::{Screening, condition};

/// One estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnitudeRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Level presented.
    pub level: f64,
    /// Number given.
    pub estimate: f64,
}

/// The estimates of participants, in the order of `people`, and how many are left out.
fn estimated<'a>(
    people: &[&str],
    rows: impl Iterator<Item = (&'a str, f64, f64)>,
) -> (Magnitude, Values) {
    let of_row = |(participant, level, estimate)| Estimate {
        participant: people.binary_search(&participant).unwrap_or_default(),
        level,
        estimate,
    };
    let found = estimate(&rows.map(of_row).collect::<Vec<_>>());
    let mut values = Values::default();
    values
        .group("magnitude", "")
        .put("n_left_out", found.left_out as f64);
    (found, values)
}

/// Geometric means, exponent and coefficient of the power law.
pub fn magnitude(rows: &[MagnitudeRow]) -> Values {
    let people: BTreeSet<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    let people: Vec<&str> = people.into_iter().collect();
    let rows = (rows.iter()).map(|row| (row.participant.as_str(), row.level, row.estimate));
    let (found, mut values) = estimated(&people, rows);
    for (level, mean) in &found.levels {
        // A level always has a decimal point: 1.0.
        let mut group = values.group(
            format!("magnitude/level/{level:?}"),
            "there is one participant",
        );
        group.maybe("geometric_mean", mean.map(|m| m.mean));
        group.interval("ci95", mean.and_then(|m| m.ci95));
    }
    let mut group = values.group("magnitude", "there are fewer than two levels above 0");
    group.maybe("exponent", found.law.map(|l| l.exponent));
    group.maybe("log10_coefficient", found.law.map(|l| l.log10_coefficient));
    group.maybe("r_squared", found.law.and_then(|l| l.r_squared));
    for (person, exponent) in people.iter().zip(&found.exponents) {
        let mut group = values.group(
            group_id("magnitude", &[person]),
            "there are fewer than two levels above 0",
        );
        group.maybe("exponent", *exponent);
    }
    let mut group = values.group(
        "magnitude/exponent_over_participants",
        "fewer than two participants have an exponent",
    );
    group.maybe("mean", found.exponent.map(|e| e.mean));
    group.interval("ci95", found.exponent.and_then(|e| e.ci95));
    values
}

/// One estimate of a realization.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RealizationRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Realization. Untrusted.
    pub realization: String,
    /// Number given.
    pub estimate: f64,
}

/// Geometric means of realizations, as of levels, and their comparison by a mixed model of the
/// logarithms: one mean of each participant and realization.
pub(super) fn realizations(rows: &[RealizationRow]) -> Values {
    let mut names: Vec<&str> = rows.iter().map(|r| r.realization.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let mut people: Vec<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    people.sort_unstable();
    people.dedup();
    let place = |list: &[&str], name: &str| list.binary_search(&name).unwrap_or_default();
    // A realization has no level: its place stands for it, and no power law is fitted.
    let levels = rows.iter().map(|row| {
        let level = place(&names, &row.realization) as f64;
        (row.participant.as_str(), level, row.estimate)
    });
    let (found, mut values) = estimated(&people, levels);
    for (place, mean) in &found.levels {
        let name = names[*place as usize];
        let prefix = group_id("magnitude/realization", &[name]);
        let mut group = values.group(prefix, "there is one participant");
        group.maybe("geometric_mean", mean.map(|m| m.mean));
        group.interval("ci95", mean.and_then(|m| m.ci95));
    }
    let mut logs: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for row in rows.iter().filter(|r| r.estimate > 0.0) {
        let cell = (row.participant.as_str(), row.realization.as_str());
        logs.entry(cell).or_default().push(libm::log(row.estimate));
    }
    let cells: Vec<Threshold<'_>> = (logs.iter())
        .filter_map(|((participant, condition), logs)| {
            Some(Threshold {
                participant,
                condition,
                value: libm::exp(study_stats::describe::mean(logs)?),
            })
        })
        .collect();
    mixed("magnitude_mixed", &cells, true, &mut values);
    values
}

/// One rating.
#[derive(Debug, Clone, PartialEq)]
pub struct MushraRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// Condition. Untrusted.
    pub condition: String,
    /// From 0 to 100.
    pub rating: f64,
}

/// Which conditions are special.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MushraRoles {
    /// The hidden reference.
    pub reference: String,
    /// The mid anchor, if there is one.
    pub mid_anchor: Option<String>,
}

/// Who is screened, and every condition over those who are not; if somebody is screened, over
/// all as well.
pub fn mushra(rows: &[MushraRow], roles: &MushraRoles, screening: &Screening) -> Values {
    let mut values = Values::default();
    let people: BTreeSet<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    let conditions: BTreeSet<&str> = rows.iter().map(|r| r.condition.as_str()).collect();
    let ratings = |person: &str, condition: &str| -> Vec<f64> {
        let own = rows
            .iter()
            .filter(|r| r.participant == person && r.condition == condition);
        own.map(|r| r.rating).collect()
    };
    let mut kept = Vec::new();
    let mut all = Vec::new();
    for person in people {
        all.push(person);
        let reference = ratings(person, &roles.reference);
        let anchor = (roles.mid_anchor.as_ref()).map_or_else(Vec::new, |a| ratings(person, a));
        let found = screening.judge(&reference, &anchor);
        let mut group = values.group(group_id("mushra", &[person]), "it was not rated");
        group.maybe("reference_below", found.reference_below);
        group.maybe("anchor_above", found.anchor_above);
        group.put("screened", f64::from(u8::from(found.screened)));
        if !found.screened {
            kept.push(person);
        }
    }
    values.group("mushra", "").put("n_kept", kept.len() as f64);
    let over = [("mushra", &kept), ("mushra_unscreened", &all)];
    let one_screened = kept.len() < all.len();
    // The same numbers twice if nobody is screened.
    for (prefix, people) in &over[..if one_screened { 2 } else { 1 }] {
        for name in &conditions {
            let own: Vec<Vec<f64>> = people.iter().map(|person| ratings(person, name)).collect();
            let found = condition(&own);
            let why = "nobody is left who rated it";
            let mut group = values.group(group_id(prefix, &[name]), why);
            group.maybe("median", found.map(|c| c.median));
            group.maybe("q1", found.map(|c| c.quartiles.0));
            group.maybe("q3", found.map(|c| c.quartiles.1));
            group.maybe("mean", found.map(|c| c.mean));
            let half = found.and_then(|c| c.ci95_half);
            group.put_or("ci95_half", half, "there is one participant");
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three participants and realizations; estimates with moduli 1, 10 and 3.
    fn estimates() -> Vec<RealizationRow> {
        let noise = [[1.0, 1.2, 0.9], [1.1, 0.8, 1.0], [0.9, 1.0, 1.3]];
        let mut rows = Vec::new();
        for (p, modulus) in [1.0, 10.0, 3.0].into_iter().enumerate() {
            for (r, (name, size)) in [("a", 2.0), ("b", 4.0), ("c", 5.0)].into_iter().enumerate() {
                for repetition in [1.0, 1.1] {
                    rows.push(RealizationRow {
                        participant: format!("P{p}"),
                        realization: name.to_owned(),
                        estimate: modulus * size * noise[p][r] * repetition,
                    });
                }
            }
        }
        rows
    }

    /// Everybody judged everything, so that equalization leaves the geometric means, and the
    /// contrasts of the mixed model are their ratios.
    #[test]
    fn realizations_have_the_geometric_means_of_their_estimates() {
        let rows = estimates();
        let values = realizations(&rows);
        let of = |name: &str| -> f64 {
            let own = rows.iter().filter(|r| r.realization == name);
            let logs: Vec<f64> = own.map(|r| r.estimate.ln()).collect();
            (logs.iter().sum::<f64>() / logs.len() as f64).exp()
        };
        let found = |id: &str| values.number(id).unwrap_or(f64::NAN);
        for name in ["a", "b", "c"] {
            let mean = found(&format!("magnitude/realization/{name}/geometric_mean"));
            assert!((mean / of(name) - 1.0).abs() < 1e-12, "{name}: {mean}");
        }
        let ratio = found("magnitude_mixed/a|b/ratio");
        assert!((ratio / (of("a") / of("b")) - 1.0).abs() < 1e-9, "{ratio}");
        assert!(found("magnitude_mixed/p") < 0.05);
        assert_eq!(values.get("magnitude/exponent"), None);
    }

    #[test]
    fn whoever_is_screened_is_in_the_second_result_only() {
        let row = |participant: &str, condition: &str, rating| MushraRow {
            participant: participant.to_owned(),
            condition: condition.to_owned(),
            rating,
        };
        let mut rows = vec![
            row("A", "ref", 100.0),
            row("A", "x", 40.0),
            row("B", "ref", 95.0),
            row("B", "x", 60.0),
        ];
        let roles = MushraRoles {
            reference: "ref".to_owned(),
            mid_anchor: None,
        };
        let all = |rows: &[MushraRow]| mushra(rows, &roles, &Screening::default());
        let kept = all(&rows);
        assert!(
            kept.iter()
                .all(|(id, _)| !id.starts_with("mushra_unscreened/"))
        );
        rows.extend([row("C", "ref", 20.0), row("C", "x", 80.0)]);
        let values = all(&rows);
        assert_eq!(values.number("mushra/C/screened"), Some(1.0));
        for (id, value) in kept.iter().filter(|(id, _)| id.starts_with("mushra/x/")) {
            assert_eq!(values.get(id), Some(value), "{id}");
        }
        assert_eq!(values.number("mushra_unscreened/x/mean"), Some(60.0));
        assert_eq!(values.number("mushra_unscreened/x/median"), Some(60.0));
    }
}
