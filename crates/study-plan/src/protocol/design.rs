//! `[design]`: how many trials a participant has, and in which order.

use super::keys::words;
use serde::Serialize;
use std::collections::BTreeMap;
use study_base::text::ModelId;

/// `[design]`: the trials of a participant and their order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Design {
    /// Planned participants; an analysis with fewer is interim.
    pub participants: u32,
    /// Trials of each realization that is not for practice. With parts, each part has
    /// this and the next four for itself, see [`design_of`](super::Protocol::design_of).
    pub repetitions: u32,
    /// How orders are made.
    pub order: Order,
    /// Largest number of consecutive trials with the same realization.
    pub max_run: Option<u32>,
    /// Least distance between two positions of the same realization.
    pub min_distance: Option<u32>,
    /// Realizations of the practice trials, in this order, before all others.
    pub practice: Vec<ModelId>,
    /// Breaks between trials.
    pub breaks: Option<Breaks>,
    /// Failed attempts after which a trial is closed as failed.
    pub max_attempts: u32,
    /// The order of the parts.
    pub parts_order: PartsOrder,
    /// How the intervals of tracks and pairs are ordered.
    pub order_version: OrderVersion,
}

/// How the intervals of a trial are ordered; `docs/schedule.md` specifies both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub enum OrderVersion {
    /// Every sequence of intervals twice in each block: the last ones can be guessed.
    #[default]
    Balanced,
    /// As balanced as is possible without an answer that can be guessed.
    Unguessable,
}

impl OrderVersion {
    /// Its number in the protocol file.
    pub fn number(self) -> u32 {
        match self {
            Self::Balanced => 1,
            Self::Unguessable => 2,
        }
    }
}

words! {
    /// The order of the parts of a session.
    PartsOrder {
        /// As in the file.
        Fixed = "fixed",
        /// Lines of a Williams design, by row.
        Williams = "williams",
    }
}

/// How the order of trials is made; `docs/schedule.md` specifies each.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// A new random permutation of the realizations in each repetition.
    Blocked,
    /// One random order of all trials.
    Shuffled,
    /// Lines of a Williams design: first-order carry-over balanced.
    Williams,
    /// Lines of a cyclic Latin square: positions balanced.
    LatinSquare,
    /// The order of the file, in each repetition.
    Fixed,
    /// Read from a CSV `row,position,model`, a path relative to the protocol.
    File(String),
}

/// The orders of an `orders.csv`: row → realizations by position.
pub type FileOrders = BTreeMap<u32, Vec<ModelId>>;

/// A break after every so many trials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Breaks {
    /// Trials between two breaks, practice not counted.
    pub every: u32,
    /// Least duration of a break, s.
    pub at_least_s: f64,
}
