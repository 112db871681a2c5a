//! Standard questionnaires at the end of a session.

use super::keys::words;
use super::kinds::{self, QuestionKind};
use serde::Serialize;
use std::collections::BTreeMap;
use study_base::text::{PartId, QuestionId};

/// One of `[[questionnaires]]`. Its items are questions of the `[[outro]]`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Questionnaire {
    /// Identifier of the questionnaire.
    pub id: PartId,
    /// Which one it is.
    pub kind: Inventory,
}

words! {
    /// A standard questionnaire.
    Inventory {
        /// The System Usability Scale (Brooke 1996): ten sentences, agreed to from 1 to 5; a score from 0 to 100.
        Sus = "sus",
        /// The NASA Task Load Index without weights (Hart & Staveland 1988; Hart 2006): six ratings from 0 to 100.
        NasaTlx = "nasa-tlx",
    }
}

/// What is asked in an item, in English.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Item {
    /// The end of its id.
    pub name: &'static str,
    /// Its text; `{system}` is the word for what is judged.
    pub prompt: &'static str,
    /// Label of the lowest answer.
    pub low: &'static str,
    /// Label of the highest answer.
    pub high: &'static str,
}

const fn agree(name: &'static str, prompt: &'static str) -> Item {
    Item {
        name,
        prompt,
        low: "strongly disagree",
        high: "strongly agree",
    }
}

const fn load(name: &'static str, prompt: &'static str) -> Item {
    Item {
        name,
        prompt,
        low: "very low",
        high: "very high",
    }
}

/// Brooke's items, free to use with acknowledgement of the source.
const SUS: [Item; 10] = [
    agree(
        "1",
        "I think that I would like to use this {system} frequently.",
    ),
    agree("2", "I found the {system} unnecessarily complex."),
    agree("3", "I thought the {system} was easy to use."),
    agree(
        "4",
        "I think that I would need the support of a technical person to be able to use this {system}.",
    ),
    agree(
        "5",
        "I found the various functions in this {system} were well integrated.",
    ),
    agree(
        "6",
        "I thought there was too much inconsistency in this {system}.",
    ),
    agree(
        "7",
        "I would imagine that most people would learn to use this {system} very quickly.",
    ),
    agree("8", "I found the {system} very cumbersome to use."),
    agree("9", "I felt very confident using the {system}."),
    agree(
        "10",
        "I needed to learn a lot of things before I could get going with this {system}.",
    ),
];

/// The subscales of the Task Load Index, a work of the United States government.
const NASA_TLX: [Item; 6] = [
    load("mental", "How mentally demanding was the task?"),
    load("physical", "How physically demanding was the task?"),
    load(
        "temporal",
        "How hurried or rushed was the pace of the task?",
    ),
    Item {
        low: "perfect",
        high: "failure",
        ..load(
            "performance",
            "How successful were you in accomplishing what you were asked to do?",
        )
    },
    load(
        "effort",
        "How hard did you have to work to accomplish your level of performance?",
    ),
    load(
        "frustration",
        "How insecure, discouraged, irritated, stressed, and annoyed were you?",
    ),
];

impl Inventory {
    /// Its items, in their order.
    ///
    /// ```
    /// # use study_plan::protocol::Inventory;
    /// assert_eq!((Inventory::Sus.items().len(), Inventory::NasaTlx.items().len()), (10, 6));
    /// ```
    pub fn items(self) -> &'static [Item] {
        match self {
            Self::Sus => &SUS,
            Self::NasaTlx => &NASA_TLX,
        }
    }

    /// The answers to an item, with labels at both ends of its scale.
    pub fn scale(self, low: &str, high: &str) -> QuestionKind {
        let (low, high) = (low.to_owned(), high.to_owned());
        match self {
            Self::Sus => QuestionKind::Rating(kinds::Rating {
                from: 1,
                to: 5,
                labels: BTreeMap::from([(1, low), (5, high)]),
            }),
            Self::NasaTlx => QuestionKind::Slider(kinds::Slider {
                from: 0.0,
                to: 100.0,
                step: 5.0,
                labels: BTreeMap::from([("0".to_owned(), low), ("100".to_owned(), high)]),
            }),
        }
    }
}

impl Questionnaire {
    /// The question of an item, such as `sus_1`.
    pub fn question(&self, item: &Item) -> QuestionId {
        item_id(&self.id, item)
    }
}

/// The question of an item: the id of the questionnaire and the name of the item.
pub(super) fn item_id(id: &PartId, item: &Item) -> QuestionId {
    let id = QuestionId::new(format!("{id}_{}", item.name));
    id.expect("a part id has at most 20 characters and the name of an item at most 11")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_of_every_questionnaire_has_an_id() {
        for kind in [Inventory::Sus, Inventory::NasaTlx] {
            let id = PartId::new("x".repeat(20)).unwrap();
            let own = Questionnaire { id, kind };
            let ids: Vec<QuestionId> = kind.items().iter().map(|i| own.question(i)).collect();
            assert!((1..ids.len()).all(|i| !ids[..i].contains(&ids[i])));
        }
    }
}
