//! A planned trial, and the seat that determines a participant's order.
//!
//! Both the schedule, which makes trials, and the outcomes, which record them, use
//! these types.

use super::parts::Interval;
use serde::{Deserialize, Serialize};
use std::fmt;
use study_base::text::{ModelId, PartId};

/// A planned trial. Frozen before the session starts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Trial {
    /// Number within the session, practice included, from 1.
    pub trial: u32,
    /// Block from 1; 0 for practice.
    pub block: u32,
    /// Position among the trials that count, from 1; for practice among the practice
    /// trials.
    pub position: u32,
    /// What is presented.
    #[serde(flatten)]
    pub stimuli: Stimuli,
    /// Repetition number among the trials that count, from 1; 0 for practice.
    pub repetition: u32,
    /// Whether it is practice, which is never analyzed.
    pub practice: bool,
    /// The part to which it belongs; `None` in a study without parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartId>,
}

/// What a planned trial presents, as far as it is known before the session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Stimuli {
    /// A reference, then one realization that is rated.
    Rated {
        /// The reference.
        reference: ModelId,
        /// The realization.
        model: ModelId,
    },
    /// A single realization.
    One {
        /// The realization.
        model: ModelId,
    },
    /// Two realizations, in this order.
    Pair {
        /// The realizations.
        pair: [ModelId; 2],
    },
    /// A trial of a track. Its level follows from the answers before it.
    Track {
        /// The track.
        track: PartId,
        /// What each interval presents.
        intervals: Vec<Interval>,
        /// Whether the comparison is the top of the ladder.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        easy: bool,
    },
    /// A level is set, from the level of its start.
    Adjusted {
        /// The level at which it starts.
        start: ModelId,
        /// What is felt before it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        standard: Option<ModelId>,
    },
    /// A trial of a search. Its two points follow from the answers before it.
    Search {
        /// The space.
        space: PartId,
        /// Whether the point with the higher number comes first.
        swapped: bool,
    },
    /// Several realizations that are ranked, in this order.
    Set {
        /// The realizations.
        set: Vec<ModelId>,
    },
}

impl Stimuli {
    /// One realization, after a reference if there is one.
    pub fn rated(reference: Option<&ModelId>, model: &ModelId) -> Self {
        let model = model.clone();
        match reference.cloned() {
            Some(reference) => Self::Rated { reference, model },
            None => Self::One { model },
        }
    }
}

impl Trial {
    /// The realization of a trial that is about a single, planned one.
    pub fn model(&self) -> Option<&ModelId> {
        match &self.stimuli {
            Stimuli::One { model } | Stimuli::Rated { model, .. } => Some(model),
            Stimuli::Pair { .. }
            | Stimuli::Track { .. }
            | Stimuli::Search { .. }
            | Stimuli::Set { .. }
            | Stimuli::Adjusted { .. } => None,
        }
    }

    /// The track to which it belongs.
    pub fn track(&self) -> Option<&PartId> {
        match &self.stimuli {
            Stimuli::Track { track, .. } => Some(track),
            Stimuli::One { .. }
            | Stimuli::Rated { .. }
            | Stimuli::Pair { .. }
            | Stimuli::Search { .. }
            | Stimuli::Set { .. }
            | Stimuli::Adjusted { .. } => None,
        }
    }

    /// Whether what it presents follows from the answers before it.
    pub fn follows_from_answers(&self) -> bool {
        matches!(self.stimuli, Stimuli::Track { .. } | Stimuli::Search { .. })
    }
}

/// What a participant's order is drawn from: a row, or the number of a pilot or of a
/// simulated participant.
///
/// Only real participants take a row. Pilots and simulated participants have random
/// streams of their own and so never change the order of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Seat {
    /// The participant's place in the ledger, from 1.
    Row(u32),
    /// The pilot's number, from 1.
    Pilot(u32),
    /// The simulated participant's number, from 1.
    Simulated(u32),
}

impl Seat {
    /// The name of the random stream of the order.
    pub fn stream(self) -> &'static str {
        match self {
            Self::Row(_) => "row",
            Self::Pilot(_) => "pilot",
            Self::Simulated(_) => "simulated",
        }
    }

    /// The number, from 1.
    pub fn number(self) -> u32 {
        match self {
            Self::Row(n) | Self::Pilot(n) | Self::Simulated(n) => n,
        }
    }

    /// The row, for a real participant.
    pub fn row(self) -> Option<u32> {
        match self {
            Self::Row(n) => Some(n),
            Self::Pilot(_) | Self::Simulated(_) => None,
        }
    }

    /// Whether the participant is a pilot.
    pub fn is_pilot(self) -> bool {
        matches!(self, Self::Pilot(_))
    }

    /// Whether the participant is simulated.
    pub fn is_simulated(self) -> bool {
        matches!(self, Self::Simulated(_))
    }
}

impl fmt::Display for Seat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.stream(), self.number())
    }
}
