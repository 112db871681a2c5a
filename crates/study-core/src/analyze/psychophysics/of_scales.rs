//! Magnitude estimation and MUSHRA of a study.

use super::part_data::{Found, PartData};
use super::scales::{MagnitudeRow, MushraRoles, MushraRow, magnitude, mushra};
use crate::outcome::RatingRow;
use crate::protocol::parts::{Part, Presentations};
use crate::protocol::{Protocol, Role};
use study_base::text::ModelId;
use study_stats::mushra::Screening;

/// The estimates of a part.
pub(super) fn of_magnitudes(part: &Part, rows: &[&RatingRow]) -> Found {
    let estimate = |row: &&RatingRow| {
        Some(MagnitudeRow {
            participant: row.participant.as_str().to_owned(),
            level: row.level?,
            estimate: number(part, row)?,
        })
    };
    let estimates: Vec<MagnitudeRow> = rows.iter().filter_map(estimate).collect();
    Found {
        task: "magnitude",
        trials: estimates.len(),
        values: magnitude(&estimates),
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
    Found {
        task: "mushra",
        trials: ratings.len(),
        values: mushra(&ratings, &roles, &Screening::default()),
        warnings: Vec::new(),
        names: Vec::new(),
        data: PartData::default(),
    }
}

/// The number that was given to the part's own question.
fn number(part: &Part, row: &RatingRow) -> Option<f64> {
    row.answers.get(part.asks.first()?)?.number()
}
