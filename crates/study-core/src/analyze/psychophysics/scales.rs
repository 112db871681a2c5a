//! Magnitude estimation, `magnitude/…`, and ratings with hidden reference and anchors,
//! `mushra/…`.

use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use std::collections::BTreeSet;
use study_stats::magnitude::{Estimate, magnitude as estimate};
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

/// Geometric means, exponent and coefficient of the power law.
pub fn magnitude(rows: &[MagnitudeRow]) -> Values {
    let people: BTreeSet<&str> = rows.iter().map(|r| r.participant.as_str()).collect();
    let people: Vec<&str> = people.into_iter().collect();
    let estimates: Vec<Estimate> = (rows.iter())
        .map(|row| Estimate {
            participant: people
                .binary_search(&row.participant.as_str())
                .unwrap_or_default(),
            level: row.level,
            estimate: row.estimate,
        })
        .collect();
    let found = estimate(&estimates);
    let mut values = Values::default();
    values
        .group("magnitude", "")
        .put("n_left_out", found.left_out as f64);
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

/// Who is screened, and every condition over those who are not.
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
    for person in people {
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
    for name in conditions {
        let own: Vec<Vec<f64>> = kept.iter().map(|person| ratings(person, name)).collect();
        let found = condition(&own);
        let mut group = values.group(group_id("mushra", &[name]), "nobody is left who rated it");
        group.maybe("median", found.map(|c| c.median));
        group.maybe("q1", found.map(|c| c.quartiles.0));
        group.maybe("q3", found.map(|c| c.quartiles.1));
        group.maybe("mean", found.map(|c| c.mean));
        let half = found.and_then(|c| c.ci95_half);
        group.put_or("ci95_half", half, "there is one participant");
    }
    values
}
