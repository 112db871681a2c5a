//! `[confirms]`: a study that confirms on other participants what a search found.

use serde::Serialize;
use study_base::text::{ModelId, PartId, ParticipantId};

/// The search whose result a study confirms. Its own participants would judge again what they chose themselves, so
/// that they are refused.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Confirms {
    /// Identifier of the study that searched.
    pub study: String,
    /// Its part of kind `search`.
    pub part: PartId,
    /// SHA-256 of the pairs and answers of the search, as `study explore --out` writes them of those who are included.
    pub pairs_sha256: String,
    /// The point that it found to be best, a realization of that study.
    pub best: ModelId,
    /// Who took part in it.
    pub searchers: Vec<ParticipantId>,
    /// Whether answers of pilots led to the point. Absent from fingerprints if not, as the next.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub pilot: bool,
    /// Whether answers of simulated participants did.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub simulated: bool,
}

impl Confirms {
    /// Whether somebody took part in the search. Ids that differ in case alone are the same person's.
    pub fn was_searcher(&self, participant: &ParticipantId) -> bool {
        let same = |id: &ParticipantId| id == participant || id.collides_with(participant);
        self.searchers.iter().any(same)
    }
}
