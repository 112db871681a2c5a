//! Magnitude estimation and MUSHRA of a study.

use super::again::by_condition;
use super::over_participants::Measured;
use super::part_data::{Found, PartData, groups};
use super::results::PartResults;
use super::scales::{
    MagnitudeRow, MushraRoles, MushraRow, RealizationRow, magnitude, mushra, realizations,
};
use crate::analyze::Rules;
use crate::analyze::record::Number as _;
use crate::analyze::results::Correlation;
use std::collections::BTreeMap;
use study_base::text::ModelId;
use study_plan::protocol::parts::{FamilyRules, Part};
use study_plan::protocol::presentations::Presentations;
use study_plan::protocol::{Protocol, Role};
use study_session::outcome::RatingRow;
use study_stats::describe::mean;
use study_stats::mushra::Screening;

/// The estimates of a part: of levels, or of realizations.
pub(super) fn of_magnitudes(
    protocol: &Protocol,
    part: &Part,
    own: &Presentations,
    (rows, rules): (&[&RatingRow], &Rules),
) -> Found {
    if own.models.iter().all(|m| protocol.level_of(m).is_none()) {
        return of_realizations(protocol, part, rows, rules);
    }
    let estimate = |row: &&RatingRow| {
        Some(MagnitudeRow {
            participant: row.participant.as_str().to_owned(),
            level: row.level?,
            estimate: number(part, row)?,
        })
    };
    let estimates: Vec<MagnitudeRow> = rows.iter().filter_map(estimate).collect();
    let presented = |family: &&FamilyRules| own.models.iter().any(|m| family.level_of(m).is_some());
    let family = protocol.families.iter().find(presented);
    let mut results = PartResults::undefined("");
    results.over.magnitude = Some(magnitude(&estimates));
    Found {
        task: "magnitude",
        trials: estimates.len(),
        results,
        warnings: Vec::new(),
        names: Vec::new(),
        data: PartData {
            dimension: family.map(FamilyRules::dimension),
            ..PartData::default()
        },
    }
}

/// The estimates of realizations: geometric means, their comparison, and their correlation with
/// VAF. A hidden duplicate counts as its original.
fn of_realizations(protocol: &Protocol, part: &Part, rows: &[&RatingRow], rules: &Rules) -> Found {
    let names = |id: &ModelId| {
        let model = protocol.model(id);
        let original = model.and_then(|m| m.duplicate_of.as_ref());
        original.unwrap_or(id).as_str().to_owned()
    };
    let estimate = |row: &&RatingRow| {
        Some(RealizationRow {
            participant: row.participant.as_str().to_owned(),
            realization: names(row.model.as_ref()?),
            estimate: number(part, row)?,
        })
    };
    let estimates: Vec<RealizationRow> = rows.iter().filter_map(estimate).collect();
    let (mut magnitudes, model) = realizations(&estimates);
    let groups = groups(rows);
    let mut logs: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for e in estimates.iter().filter(|e| e.estimate > 0.0) {
        let cell = (e.participant.as_str(), e.realization.as_str());
        logs.entry(cell).or_default().push(libm::log(e.estimate));
    }
    let measured = logs.iter().filter_map(|((who, realization), logs)| {
        Some(Measured {
            participant: (*who).to_owned(),
            group: groups.get(*who).cloned(),
            session: None,
            condition: (*realization).to_owned(),
            value: mean(logs)?,
        })
    });
    let again = by_condition(&measured.collect::<Vec<_>>());
    let with_vaf = protocol.models.iter().filter_map(|m| {
        let id = m.id.as_str();
        let mean = magnitudes.realizations.get(id)?.geometric_mean.number();
        let mean = mean.filter(|_| m.role == Role::Test)?;
        Some((id, m.vaf?, libm::log10(mean)))
    });
    let known: Vec<(&str, f64, f64)> = with_vaf.collect();
    if !known.is_empty() {
        let of = |pick: fn(&(&str, f64, f64)) -> f64| known.iter().map(pick).collect::<Vec<_>>();
        let names: Vec<&str> = known.iter().map(|k| k.0).collect();
        let (x, y) = (of(|k| k.1), of(|k| k.2));
        magnitudes.vaf = Some(Correlation::of(&x, &y, &names, rules));
    }
    let mut results = PartResults::undefined("");
    results.magnitude_mixed = model;
    (results.over.magnitude, results.over.again) = (Some(magnitudes), again);
    Found {
        task: "magnitude",
        trials: estimates.len(),
        results,
        warnings: Vec::new(),
        names: Vec::new(),
        data: PartData::default(),
    }
}

/// The ratings of a part beside a reference.
pub(super) fn of_mushra(
    protocol: &Protocol,
    part: &Part,
    own: &Presentations,
    rows: &[&RatingRow],
) -> Found {
    let rating = |row: &&RatingRow| {
        Some(MushraRow {
            participant: row.participant.as_str().to_owned(),
            condition: row.model.as_ref()?.as_str().to_owned(),
            rating: number(part, row)?,
        })
    };
    let ratings: Vec<MushraRow> = rows.iter().filter_map(rating).collect();
    let of = |role: Role| {
        let has = |id: &&ModelId| protocol.model(id).is_some_and(|m| m.role == role);
        own.models.iter().find(has).map(|id| id.as_str().to_owned())
    };
    let roles = MushraRoles {
        reference: of(Role::HiddenReference).unwrap_or_default(),
        mid_anchor: of(Role::MidAnchor),
    };
    let (kept, all) = mushra(&ratings, &roles, &Screening::default());
    let mut results = PartResults::undefined("");
    (results.over.mushra, results.mushra_unscreened) = (Some(kept), all);
    Found {
        task: "mushra",
        trials: ratings.len(),
        results,
        warnings: Vec::new(),
        names: Vec::new(),
        data: PartData::default(),
    }
}

/// The number that was given to the part's own question.
fn number(part: &Part, row: &RatingRow) -> Option<f64> {
    row.answers.get(part.asks.first()?)?.number()
}
