//! Which names the columns of questions, covariates and factors cannot have.

use super::{ParticipantColumn, RatingColumn};

/// Whether `ratings.csv` of a study without parts has a fixed column of this name, in any
/// case.
pub fn is_ratings_column(name: &str) -> bool {
    let all = RatingColumn::ALL.iter().map(|c| c.column());
    all.filter(|c| c.is_in(false, false))
        .any(|c| c.reserves(name))
}

/// The same for a study with parts.
pub fn is_parts_column(name: &str) -> bool {
    (RatingColumn::ALL.iter()).any(|c| c.column().reserves(name))
}

/// Whether a header of `ratings.csv` is that of a study with parts. A covariate of a study
/// without may have the name of one of their columns, but not of all, one after the other.
pub fn are_of_parts(header: &[String]) -> bool {
    let all = RatingColumn::ALL.iter().map(|c| c.column());
    let own = all.filter(|c| !c.is_in(false, false) && !c.optional);
    let own: Vec<&str> = own.map(|c| c.name).collect();
    header.windows(own.len()).any(|w| w == own)
}

/// Whether `participants.csv` of a study without parts has a fixed column of this name, in
/// any case.
pub fn is_participants_column(name: &str) -> bool {
    let all = ParticipantColumn::ALL.iter().map(|c| c.column());
    (all.filter(|c| c.is_in(false, false))).any(|c| c.reserves(name))
}

/// The same for a study with parts.
pub fn is_participants_column_of_parts(name: &str) -> bool {
    (ParticipantColumn::ALL.iter()).any(|c| c.column().reserves(name))
}
