//! The fixed columns of the derived tables: names that no question may take.

/// The columns of `ratings.csv` before the questions.
pub const RATINGS_BEFORE: [&str; 20] = [
    "study",
    "participant",
    "session",
    "row",
    "trial",
    "block",
    "position",
    "planned_position",
    "model",
    "role",
    "repetition",
    "previous_model",
    "practice",
    "pilot",
    "simulated",
    "device_kind",
    "device_id",
    "operator",
    "tool_version",
    "protocol_version",
];

/// The columns of `ratings.csv` after the questions; the covariates follow.
pub const RATINGS_AFTER: [&str; 15] = [
    "corrected",
    "declined",
    "remarks",
    "reference_s",
    "exploration_s",
    "response_s",
    "strokes",
    "least_energy_j",
    "switches_per_s",
    "clamp_count",
    "started_at",
    "rated_at",
    "attempt",
    "status",
    "vaf",
];

/// The columns of `participants.csv` before the answers of setup, intake, outro.
pub const PARTICIPANTS: [&str; 13] = [
    "participant",
    "session",
    "state",
    "reason",
    "row",
    "pilot",
    "simulated",
    "erased",
    "consent_version",
    "protocol_version",
    "trials_done",
    "trials_planned",
    "started_at",
];

/// Whether `ratings.csv` has a fixed column of this name, in any case.
pub fn is_ratings_column(name: &str) -> bool {
    RATINGS_BEFORE
        .iter()
        .chain(&RATINGS_AFTER)
        .any(|c| c.eq_ignore_ascii_case(name))
}

/// Whether `participants.csv` has a fixed column of this name, in any case.
pub fn is_participants_column(name: &str) -> bool {
    PARTICIPANTS.iter().any(|c| c.eq_ignore_ascii_case(name))
}
