//! Ranking: the order of the realizations of a set.

use super::Order;
use serde::Serialize;
use study_base::text::{ModelId, PartId, QuestionId};

/// Most realizations that are ranked: all of them are felt in each trial, and each rank is one digit.
pub const MOST_RANKED: usize = 9;

/// What each trial of a part presents, one after another, and how it is ranked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranking {
    /// The realizations, or levels of a family, all of which are felt in each trial: 2 to [`MOST_RANKED`].
    pub models: Vec<ModelId>,
    /// How their order in a trial is made; never shuffled over trials or from a file.
    pub order: Order,
    /// Number of trials.
    pub repetitions: u32,
    /// Whether several can have the same rank.
    pub ties: bool,
    /// Number of practice trials, in orders that are drawn.
    pub practice: u32,
}

impl Ranking {
    /// Of the questions of its part those about ranks, by interval.
    pub fn asked<'q>(&self, asks: &'q [QuestionId]) -> &'q [QuestionId] {
        &asks[..self.models.len().min(asks.len())]
    }
}

/// The question about the rank of an interval, from 1: it has the id of the part, those of the others its number
/// as well.
///
/// ```
/// # use study_base::text::PartId;
/// # use study_plan::protocol::ranking::question;
/// let part = PartId::new("order").unwrap();
/// assert_eq!([1, 2].map(|n| question(&part, n).to_string()), ["order", "order-2"]);
/// ```
///
/// # Panics
/// Never: the id of a part is short enough.
pub fn question(part: &PartId, interval: usize) -> QuestionId {
    let id = match interval {
        0 | 1 => part.to_string(),
        n => format!("{part}-{n}"),
    };
    QuestionId::new(id).expect("a part id has at most 20 characters and those of a question id")
}
