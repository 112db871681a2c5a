//! What is presented in the parts whose trials each have one realization, alone or after a reference.

use super::Order;
use serde::Serialize;
use study_base::text::ModelId;

/// Which realizations a part with one rating a trial presents, and in which order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Presentations {
    /// The realizations.
    pub models: Vec<ModelId>,
    /// How the order is made; never from a file.
    pub order: Order,
    /// Trials of each.
    pub repetitions: u32,
    /// Largest number of consecutive trials with the same realization.
    pub max_run: Option<u32>,
    /// Least distance between two positions of the same realization.
    pub min_distance: Option<u32>,
    /// Realizations of the practice trials.
    pub practice: Vec<ModelId>,
}

/// What is given numbers, and beside what.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Magnitude {
    /// Felt first in each trial; `None`: participants choose their own scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard: Option<Standard>,
    /// The levels or realizations.
    #[serde(flatten)]
    pub presentations: Presentations,
}

/// What the numbers of magnitude estimation refer to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standard {
    /// A level of the family, or a realization.
    pub model: ModelId,
    /// The number that it is said to have, the modulus.
    pub modulus: f64,
}

/// Which realizations are rated beside which reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mushra {
    /// Felt before the realization in each trial.
    pub reference: Option<ModelId>,
    /// The realizations, a hidden reference among them.
    #[serde(flatten)]
    pub presentations: Presentations,
}
