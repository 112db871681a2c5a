//! The maps of a part that searches.

use crate::analyze::exclude::Applied;
use std::collections::BTreeMap;
use study_base::text::{PartId, ParticipantId};
use study_plan::protocol::SpaceRules;

/// What a part that searches found.
#[derive(Debug, Clone, PartialEq)]
pub struct Exploration {
    /// The part.
    pub part: PartId,
    /// Its space. Values below are those of its certified points, in their order.
    pub space: SpaceRules,
    /// The sessions that count, in their order. Two of the same participant are two searches.
    pub searches: Vec<Explored>,
    /// All of them together; `None` with fewer than two.
    pub population: Option<Population>,
    /// Whether pilots are among them.
    pub pilot: bool,
    /// Whether simulated participants are among them.
    pub simulated: bool,
    /// The effect of each preregistered exclusion rule.
    pub exclusions: Vec<Applied>,
}

impl Exploration {
    /// How many participants there are, of whom some may have searched in several sessions.
    pub fn people(&self) -> usize {
        by_participant(&self.searches).len()
    }

    /// Index of the best point: that of all together, or of the only search.
    pub fn best(&self) -> Option<usize> {
        let of_all = self.population.as_ref().map(|all| all.best);
        of_all.or_else(|| self.searches.first().map(|own| own.best))
    }
}

/// The search of one participant in one session.
#[derive(Debug, Clone, PartialEq)]
pub struct Explored {
    /// Participant.
    pub participant: ParticipantId,
    /// Session, from 1.
    pub session: u32,
    /// Whether it is a pilot's.
    pub pilot: bool,
    /// Whether it is a simulated participant's.
    pub simulated: bool,
    /// The pairs in the order in which they were presented, with the corrected answers.
    pub pairs: Vec<ExploredPair>,
    /// Points that were left out because the device failed at them, from 0.
    pub left_out: Vec<usize>,
    /// The posterior mean of the utility of each point, in units of the noise of one impression, minus its mean over the
    /// points: only differences of utilities are known.
    pub mean: Vec<f64>,
    /// The posterior standard deviation of that difference.
    pub sd: Vec<f64>,
    /// Index of the point with the largest mean, of those that were not left out.
    pub best: usize,
}

/// A pair that was presented.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExploredPair {
    /// Trial of the session.
    pub trial: u32,
    /// Its two points, the lower number first.
    pub points: [usize; 2],
    /// The one that was preferred; `None` if that was declined.
    pub preferred: Option<usize>,
}

/// The maps of several searches together. Each participant counts alike, however certain their map is; that of somebody with
/// several sessions is the mean of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Population {
    /// Mean over the participants' maps.
    pub mean: Vec<f64>,
    /// Standard deviation between the participants' maps; between the sessions of the only one.
    pub sd: Vec<f64>,
    /// Index of the point with the largest mean, of those that were not left out in any search.
    pub best: usize,
}

/// The searches of each participant.
pub(super) fn by_participant(searches: &[Explored]) -> BTreeMap<&ParticipantId, Vec<&Explored>> {
    let mut own: BTreeMap<_, Vec<&Explored>> = BTreeMap::new();
    for search in searches {
        own.entry(&search.participant).or_default().push(search);
    }
    own
}
